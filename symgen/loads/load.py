"""Load kinds: table of the scene, record, and the measures on which a load acts, with energy and force.

A load acts on *measures* of the linkage (:mod:`symgen.loads.measure`): the position of a point, the
distance between two points, an angle. On each it has an energy, a function of the value of the measure, and
a force without potential, a function of value, rate, time and state. Equations of motion, power, joint
forces, momentum rows, the planarity check and the loads of elastic links follow from these.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol

import sympy as sp

from symgen.loads.measure import LoadTerm, Measure, Vector
from symgen.symbolic.names import Letter
from symgen.symbolic.quantity import AXES

if TYPE_CHECKING:
    from symgen.scene.table import Table
    from symgen.scene.units import Dimension

_KIND = "symgen.kind"
#: An effort of a drive that prescribed motions determine, as a loop writes it.
UNKNOWN = "?"


class Placed(Protocol):
    """A point of the scene."""

    @property
    def name(self) -> str: ...
    @property
    def at(self) -> Vector: ...
    @property
    def ground(self) -> bool: ...


class Reading(Protocol):
    """The reader of a scene, as far as loads need it."""

    dimension: int

    @property
    def drawing_is_a_guess(self) -> bool: ...
    def known_point(self, name: str, where: str) -> Placed: ...
    def known_link(self, name: str, where: str) -> None: ...
    def moving_link(self, name: str, where: str) -> None: ...
    def is_spatial_body(self, link: str) -> bool: ...
    def is_elastic(self, link: str) -> bool: ...
    def points_of(self, link: str) -> Sequence[str]: ...
    def drawn(self, link: str) -> Vector: ...
    def with_state(
        self, own: str = "", words: Mapping[str, Dimension] | None = None
    ) -> Mapping[str, tuple[Any, ...]]: ...
    def value(
        self,
        text: str | int | float,
        dim: Dimension,
        where: str,
        names: Mapping[str, tuple[Any, ...]] | None = None,
    ) -> sp.Expr: ...
    def not_negative(self, text: str | int | float, dim: Dimension, where: str) -> sp.Expr: ...
    def vector(
        self,
        texts: list[str | int | float],
        dim: Dimension,
        where: str,
        names: Mapping[str, tuple[Any, ...]] | None = None,
    ) -> Vector: ...


def expression(kind: Literal["scalar", "polar", "axial"]) -> Any:
    """Declare a field that holds expressions of the time and the state, as the scene has them.

    A ``polar`` field holds the components of a vector such as a force, an ``axial`` one those of a vector
    such as a torque, which has one component in the plane. Fields that are not declared hold constants.
    """
    return field(metadata={_KIND: kind})


@dataclass(frozen=True, slots=True)
class JointLaw:
    """A couple [N m] on a link against another one, or the ground (empty), by the force in their joint.

    ``factor`` is the couple over the size of the force [m], a function of ``RATE``.
    """

    link: str
    against: str
    point: str
    factor: sp.Expr


@dataclass(frozen=True, slots=True)
class Load(ABC):
    """A load of a linkage: one entry of its table, with exact values in SI units.

    Attributes
    ----------
    noun, plural
        Name of one load of this kind in messages, and of several in structures.
    schema
        The table of the scene.
    named
        Whether its quantities have names ``NOUN_NUMBER``, which links and parameters cannot have.
    acts
        Whether it acts on anything.
    drawn
        How pages draw a line between two points on which it acts.
    letters
        Letters of the fields that hold constants.
    name
        Name of its quantities.
    """

    noun: ClassVar[str]
    plural: ClassVar[str]
    schema: ClassVar[type[Table]]
    named: ClassVar[bool] = True
    acts: ClassVar[bool] = True
    drawn: ClassVar[Literal["spring", "actuator"]] = "actuator"
    letters: ClassVar[Mapping[str, Letter]] = {}
    keys: ClassVar[Mapping[str, str]] = {}

    name: str

    @classmethod
    @abstractmethod
    def read(cls, read: Reading, table: Any, name: str, where: str) -> Load:
        """Return the load that a table of the scene describes.

        Raises
        ------
        SceneError
            For unknown points and links, wrong units and values that are not physical.
        """

    @abstractmethod
    def terms(self, dimension: int) -> Iterator[LoadTerm]:
        """Yield the measures on which the load acts, with energy and force, in 2 or 3 dimensions."""

    @property
    def of_joint(self) -> JointLaw | None:
        """The law of ``couple`` by the force in a joint; None without one."""
        return None

    @property
    def effort(self) -> sp.Symbol:
        """The effort of a drive that keeps a motion [N or N m], an unknown of the equations of motion."""
        return sp.Symbol(f"{self.name}.effort", real=True)

    @property
    def is_sought(self) -> bool:
        """Whether its effort is an unknown."""
        return any(self.effort in e.free_symbols for e in self.expressions)

    @property
    def turns(self) -> str:
        """The link that an unknown torque turns, in space about an axis; "" for other loads."""
        return ""

    def about(self, axis: Vector) -> Load:
        """Return the load with its unknown torque about an axis in space."""
        raise NotImplementedError

    @property
    def couple(self) -> sp.Symbol:
        """The couple by the force in a joint [N m], an unknown of the equations of motion."""
        return sp.Symbol(f"{self.name}.couple", real=True)

    def off_sections(self) -> Load | None:
        """Return the load without what acts on sections of elastic links; None where nothing is left."""
        return None if any(m.section for m in self.measures(2)) else self

    @classmethod
    def numbered(cls, number: int) -> str:
        """Return the name of the load with this number in its table."""
        return f"{cls.noun.replace(' ', '_')}_{number}"

    def measures(self, dimension: int) -> Iterator[Measure]:
        """Yield the measures on which the load acts."""
        for term in self.terms(dimension):
            yield term.on

    @property
    def expressions(self) -> Vector:
        """Its expressions of the time and the state."""
        return tuple(e for _, value in self._declared() for e in value)

    def with_expressions(self, change: Callable[[sp.Expr], sp.Expr]) -> Load:
        """Return the load with all its expressions of the time and the state changed."""
        return self._with(lambda _, __, value: tuple(map(change, value)))

    def with_written(self, change: Callable[[str, sp.Expr], sp.Expr], axes: Sequence[str]) -> Load:
        """Return the load with all its expressions changed, each with its key in the table of the scene.

        ``axes`` are those of the drawing within which it acts.
        """

        def changed(name: str, kind: str, value: Vector) -> Vector:
            key = self.keys.get(name, name)
            if kind == "polar":
                return tuple(change(f"{key}.{AXES.index(a)}", e) for a, e in zip(axes, value, strict=True))
            if len(value) == 1:  # a couple about the axis across the plane of a drawing in space
                (across,) = (i for i, a in enumerate(AXES) if a not in axes) if len(axes) == 2 else (2,)
                return (change(f"{key}.{across}", change(key, value[0])),)
            return tuple(change(f"{key}.{i}", e) for i, e in enumerate(value))

        return self._with(changed)

    def in_plane(self, across: int, change: Callable[[sp.Expr], sp.Expr]) -> Load:
        """Return a load in space by its components in the plane across an axis, its expressions changed."""

        def components(_: str, kind: str, value: Vector) -> Vector:
            if kind == "polar":
                value = (value[across - 2], value[across - 1])
            elif kind == "axial":
                value = (value[across],)
            return tuple(map(change, value))

        return self._with(components)

    def _declared(self) -> Iterator[tuple[tuple[str, str], Vector]]:
        for f in fields(self):
            if _KIND in f.metadata:
                value = getattr(self, f.name)
                yield (f.name, f.metadata[_KIND]), (value,) if f.metadata[_KIND] == "scalar" else value

    def _with(self, change: Callable[[str, str, Vector], Vector]) -> Load:
        changed: dict[str, Any] = {}
        for (name, kind), value in self._declared():
            new = change(name, kind, value)
            changed[name] = new[0] if kind == "scalar" else new
        return replace(self, **changed)


@dataclass(frozen=True, slots=True)
class StatedOutput(Load):
    """An output by an expression, with the SI unit of its value and its meaning, which acts on nothing."""

    named = acts = False

    word: str
    unit: str
    meaning: str
    value: sp.Expr = expression("scalar")

    def terms(self, dimension: int) -> Iterator[LoadTerm]:
        yield from ()
