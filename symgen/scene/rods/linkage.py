"""Resolved scene of points and links, with exact values in SI units."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeVar

import sympy as sp

from symgen.errors import SceneError
from symgen.loads import LOADS
from symgen.loads.load import Load, StatedOutput
from symgen.loads.measure import Measure
from symgen.scene.elastic.links import Crank, ElasticLink, JointInSpace, ModalDamping, Station
from symgen.scene.limit import Limit
from symgen.scene.rods.rotations import Driver, GearPair, Hinge, PrescribedMotion
from symgen.scene.rods.run_parameters import FirstOrder, Parameter, Switch, Winding, Written, defaults
from symgen.scene.units import Shown
from symgen.symbolic.constants import rounded
from symgen.symbolic.quantity import AXES, quantity

TIME = quantity("t", "s", "time")
_DIGITS = 30

Vector = tuple[sp.Expr, ...]
_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class PlacedPoint:
    """A point as drawn [m], of the ground at ``motion``; ``hidden``: added by symgen."""

    name: str
    at: Vector
    ground: bool
    motion: Vector
    hidden: bool = False


@dataclass(frozen=True, slots=True)
class CarriedPoint:
    """A further point of a body: at start + along*d + across*(d turned left), d from its start to its end.

    ``joined``: it has coordinates of its own, since an elastic link is joined to another component there.
    """

    name: str
    along: sp.Expr
    across: sp.Expr
    joined: bool = False


@dataclass(frozen=True, slots=True)
class RigidLink:
    """A rod, or a planar body on two of its points.

    Attributes
    ----------
    start, end
        The points that carry it.
    length
        Their distance [m]; may depend on the time t when the link is massless.
    mass, centre, offset, inertia
        Mass [kg], centre of mass along the line from the start and to the left of it [m], moment of inertia
        about it [kg m^2].
    as_drawn
        Whether the length is the drawn distance.
    carried
        Further points of the body.
    """

    name: str
    start: str
    end: str
    length: sp.Expr
    mass: sp.Expr
    centre: sp.Expr
    offset: sp.Expr
    inertia: sp.Expr
    as_drawn: bool
    carried: tuple[CarriedPoint, ...]

    @property
    def base(self) -> tuple[str, ...]:
        """The points that carry it."""
        return self.start, self.end

    def along(self, point: str) -> sp.Expr:
        """Return the place of one of its points along its line, as a fraction of the length."""
        ends = {self.start: sp.S.Zero, self.end: sp.Integer(1)}
        return ends[point] if point in ends else next(c.along for c in self.carried if c.name == point)


@dataclass(frozen=True, slots=True)
class WeightedPoint:
    """A point of a body in space: the sum of the base points, each times its weight; the weights add to 1."""

    name: str
    weights: Vector
    joined: bool = False


@dataclass(frozen=True, slots=True)
class Bar:
    """A fixed distance [m] between two base points of a body."""

    start: str
    end: str
    length: sp.Expr


@dataclass(frozen=True, slots=True)
class SpatialBody:
    """A rigid body in space on four of its points.

    Attributes
    ----------
    base
        The four points, not in one plane, that carry it.
    bars
        The distances between them that nothing else keeps.
    mass, centre
        Mass [kg], and the weights of the base points that give its centre.
    masses
        The constant matrix of the kinetic energy by the velocities of the base points [kg], row by row.
    inverse
        Inverse of the matrix of products e_j.e_k of e_k = r_k - r_0 [1/m^2]: for the angular velocity.
    carried
        Its further points.
    """

    name: str
    base: tuple[str, ...]
    bars: tuple[Bar, ...]
    mass: sp.Expr
    centre: Vector
    masses: tuple[Vector, ...]
    inverse: tuple[Vector, ...]
    carried: tuple[WeightedPoint, ...]


@dataclass(frozen=True, slots=True)
class PlacedMass:
    """A mass [kg] at a point; its moment of inertia [kg m^2] rotates with the link, which includes it."""

    point: str
    mass: sp.Expr
    inertia: sp.Expr = sp.S.Zero
    link: str = ""


@dataclass(frozen=True, slots=True)
class Guide:
    """Points that stay on the line of the link ``along``."""

    name: str
    points: tuple[str, ...]
    along: str


@dataclass(frozen=True, slots=True)
class WeldedAngle:
    """The angle between two links that are welded at a point: that of the drawing.

    Attributes
    ----------
    name, label, point
        Name and label of its constraint, and the point.
    link, other
        The links; ``other`` is empty for the direction of a link that is clamped to the ground.
    cosine, sine
        Of the angle from ``other``, or from the axis x, to ``link``.
    """

    name: str
    label: str
    point: str
    link: str
    other: str
    cosine: sp.Expr
    sine: sp.Expr


@dataclass(frozen=True, slots=True)
class Event:
    """Where ``gap``, of the time t and the state, passes zero: rising (1), falling (-1) or either way (0).

    ``unit`` is the unit of the gap; ``about`` names the quantity and its threshold.
    """

    name: str
    gap: sp.Expr
    unit: str
    direction: int
    ends_run: bool
    about: str


@dataclass(frozen=True, slots=True)
class StartConditions:
    """Directions [rad], rates [rad/s] of links, velocities [m/s] of points; or the equilibrium from there."""

    angles: tuple[tuple[str, sp.Expr], ...]
    rates: tuple[tuple[str, Vector], ...]
    velocities: tuple[tuple[str, Vector], ...]
    equilibrium: bool = False


@dataclass(frozen=True, slots=True)
class Plane:
    """The plane across a coordinate axis in which a linkage stays that is written in space.

    ``across`` is the number of that axis, ``level`` the coordinate on it [m], ``whole`` the linkage in space.
    """

    across: int
    level: sp.Expr
    whole: Linkage

    def __str__(self) -> str:
        """Return its equation."""
        return f"{AXES[self.across]} = {float(self.level):g} m" if self.level else f"{AXES[self.across]} = 0"

    def within(self, vector: Sequence[_T]) -> tuple[_T, _T]:
        """Return the components in the plane, in the order in which a left turn is positive."""
        return vector[self.across - 2], vector[self.across - 1]

    def lifted(self, vector: Vector, across: sp.Expr) -> Vector:
        """Return the vector in space with these components in the plane and this one across it."""
        components = {self.across: across, (self.across - 2) % 3: vector[0], (self.across - 1) % 3: vector[1]}
        return tuple(components[i] for i in range(3))


@dataclass(frozen=True)
class Linkage:
    """A linkage, resolved: exact expressions over the tunable parameters and time, in SI units.

    ``plane`` is the plane of a linkage written in space; all components then refer to it. ``leaves_plane``
    names the component by which a linkage in space leaves every coordinate plane; ``kinematic`` restricts it
    to the motion prescribed by the drives. ``remarks`` are for the notes of results, ``written`` has its
    values as the scene writes them.
    """

    name: str
    file: str
    title: str
    units: Shown
    dimension: int
    parameters: tuple[Parameter, ...]
    points: tuple[PlacedPoint, ...]
    links: tuple[RigidLink, ...]
    bodies: tuple[SpatialBody, ...]
    gravity: Vector
    masses: tuple[PlacedMass, ...]
    loads: tuple[Load, ...]
    guides: tuple[Guide, ...]
    drivers: tuple[Driver, ...]
    hinges: tuple[Hinge, ...]
    start: StartConditions
    t_end: sp.Expr
    assembly_tolerance: sp.Expr
    outputs: tuple[str, ...] | None
    elastic: tuple[ElasticLink, ...] = ()
    crank: Crank | None = None
    modal_damping: ModalDamping | None = None
    stations: tuple[Station, ...] = ()
    welded_angles: tuple[WeldedAngle, ...] = ()
    joints: tuple[JointInSpace, ...] = ()
    events: tuple[Event, ...] = ()
    states: tuple[FirstOrder, ...] = ()
    gears: tuple[GearPair, ...] = ()
    motions: tuple[PrescribedMotion, ...] = ()
    windings: tuple[Winding, ...] = ()
    switches: tuple[Switch, ...] = ()
    plane: Plane | None = None
    leaves_plane: str = ""
    kinematic: bool = False
    remarks: tuple[str, ...] = ()
    limits: tuple[Limit, ...] = ()
    written: Written = field(default_factory=Written, compare=False, repr=False)

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes of its coordinates."""
        return self.plane.within(AXES) if self.plane else tuple(AXES[: self.dimension])

    @property
    def shown_axes(self) -> tuple[str, ...]:
        """Names of the axes that it is written in, and that results have."""
        return tuple(AXES) if self.plane else self.axes

    @property
    def as_written(self) -> Linkage:
        """The linkage with all the axes it is written in."""
        return self.plane.whole if self.plane else self

    @cached_property
    def defaults(self) -> Mapping[sp.Symbol, sp.Expr]:
        """Value of every parameter in the scene."""
        return defaults(self.parameters)

    @cached_property
    def constants(self) -> Mapping[sp.Symbol, sp.Expr]:
        """Value of every letter, over the tunable parameters."""
        return {p.quantity.symbol: p.default for p in self.parameters if p.fixed}

    @cached_property
    def _points(self) -> Mapping[str, PlacedPoint]:
        return {p.name: p for p in self.points}

    @cached_property
    def _links(self) -> Mapping[str, RigidLink]:
        return {k.name: k for k in self.links}

    @property
    def moves(self) -> bool:
        """Whether ground, drives or a motor move it in the rigid motion of its elastic links."""
        prescribed = [c for p in self.points if p.ground for c in p.motion]
        prescribed += [*(d.angle for d in self.drivers), *(m.value for m in self.motions)]
        driven = self.crank is not None and self.crank.mode == "motor"
        return driven or any(TIME.symbol in e.free_symbols for e in prescribed)

    def number(self, expression: sp.Expr) -> float:
        """Return the value of an expression at the scene's own parameters and t = 0."""
        return number(expression, self.defaults)

    def point(self, name: str) -> PlacedPoint:
        """Return the point called ``name``."""
        return self._points[name]

    def link(self, name: str) -> RigidLink:
        """Return the link called ``name``."""
        return self._links[name]

    def measure(self, load: str) -> Measure | None:
        """Return where the load with this name acts first; None where no load is called so."""
        named = (k for k in self.loads if k.named and k.name == load)
        return next((m for k in named for m in k.measures(len(self.axes))), None)

    def turned_by(self, owner: str) -> tuple[str, str]:
        """Return the link whose angle loads call ``owner.angle``, and the one it is taken from (or "")."""
        measure = self.measure(owner)
        link, against = (name for _, name in measure.links) if measure else (owner, "")
        return link, against

    @property
    def method(self) -> str:
        """The method: with elastic links under forces ``elastic`` or ``spatial``, else ``rods``."""
        kind = "elastic" if self.dimension == 2 else "spatial"
        return kind if self.elastic and not self.kinematic else "rods"

    @property
    def scene_outputs(self) -> tuple[str, ...]:
        """Names of the recorded outputs that the scene states by expressions."""
        names = (load.word for load in self.loads if isinstance(load, StatedOutput))
        return tuple(name for name in names if self.outputs is None or name in self.outputs)

    @property
    def placed_loads(self) -> Iterator[tuple[str, int, Load]]:
        """Every load after its table in the scene and its number there, in the order of ``LOADS``."""
        for table, kind in LOADS.items():
            of_kind = (load for load in self.loads if type(load) is kind)
            yield from ((table, i, load) for i, load in enumerate(of_kind))

    def body(self, name: str) -> SpatialBody | None:
        """Return the body in space called ``name``, if it is one."""
        return next((k for k in self.bodies if k.name == name), None)


def state_symbol(name: str) -> sp.Symbol:
    """Return the symbol ``owner.word`` of a quantity of the state in a load."""
    return sp.Symbol(name, real=True)


def state_of(expression: sp.Expr) -> list[sp.Symbol]:
    """Return the symbols in an expression that stand for quantities of the state, in order."""
    return sorted((s for s in expression.free_symbols if "." in s.name), key=lambda s: str(s.name))


def number(expression: sp.Expr, values: Mapping[sp.Symbol, sp.Expr]) -> float:
    """Return the value of an expression at these parameters and t = 0.

    Raises
    ------
    SceneError
        When it has no finite real value there.
    """
    value = expression.xreplace({**values, TIME.symbol: sp.Integer(0)})
    try:
        result = float(rounded(value, _DIGITS))
    except (OverflowError, TypeError):
        result = math.nan
    if not math.isfinite(result):
        raise SceneError("expected a finite real value with the parameters of the scene and t = 0")
    return result
