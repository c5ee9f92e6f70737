"""Matrices that can be shown for one name: the systems of a scene or building block, and its derivation."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import sympy as sp

from symgen.errors import ModelError, check_known, nearest
from symgen.lowering.program import lower_system
from symgen.mechanics.sources import of_assembly
from symgen.methods import further_of, method_of
from symgen.models import BLOCKS, DERIVATIONS
from symgen.models.assembled.system import ASSEMBLED
from symgen.models.record import elastic_record, of_system, record
from symgen.pipeline.citations import (
    COMMANDS,
    PAPERS,
    as_equation,
    citation,
    citing,
    command_of,
    elsewhere,
    narrowed,
    settings,
)
from symgen.pipeline.systems import momentum_of, system_of
from symgen.pipeline.user_system import equations_of, is_user_file
from symgen.scene.loading import SceneText, check_scene, override, read_scene
from symgen.scene.loop.loop import Loop
from symgen.scene.resolve import resolve
from symgen.scene.rods.letters import derived_in_letters
from symgen.scene.rods.linkage import Linkage
from symgen.symbolic.derivative import derivative
from symgen.symbolic.notation import DerivedMatrix
from symgen.symbolic.system import Export, Matrices, NamedMatrix, SaddlePoint, Step, System

#: Name that selects the derivation record instead of a matrix.
RECORD = "derivation"
_MOMENTUM = "momentum_rows"
_SQUARE = "matrix", "rhs"
#: Maximum number of matrices named in an error.
_NAMED = 5


@dataclass(frozen=True, slots=True)
class Chosen:
    """Selected matrices and the System that they belong to."""

    system: System
    matrices: tuple[NamedMatrix, ...]

    @property
    def is_square(self) -> bool:
        """Whether these are the square system of momentum rows."""
        return tuple(m.name for m in self.matrices) == _SQUARE

    def valued(self, values: Mapping[str, sp.Expr], *, constants: bool) -> Chosen:
        """Return the matrices with values [SI] of some symbols, and of all ``constants`` of the scene.

        Raises
        ------
        ModelError
            For a symbol that there is not.
        """
        system = replace(self.system, matrices=self.matrices, exports=(), saddle_point=None, residual="")
        known = {x.name: x.symbol for x in system.symbols()}
        for name in values:
            check_known(name, known, f"{system.name} has no symbol")
        system = _valued(system, values, constants)
        return Chosen(system, system.matrices)

    def by(self, name: str) -> Chosen:
        """Return the partial derivatives with respect to an argument."""
        derived = derivative(self.system, self.matrices, name)
        return Chosen(derived, derived.matrices)


def _valued(system: System, values: Mapping[str, sp.Expr], constants: bool) -> System:
    """Return a system with values of those of the symbols that it has, and of all constants of the scene."""
    known = {x.name: x.symbol for x in system.symbols()}
    there = {known[name]: x for name, x in values.items() if name in known}
    system = system.substituted(there)
    system = system.in_numbers() if constants else system
    for m in system.matrices:
        if m.matrix.has(sp.zoo, sp.nan, sp.oo):
            raise ModelError(f"{m.name} has no finite value where {', '.join(values)} have these values")
    return system


class Subject:
    """Systems derived from a scene, a building block or a user's own file, each on first access.

    Parameters
    ----------
    name
        A scene, a building block, or a Python file that returns a System.
    changes
        Scene values to override.
    """

    def __init__(self, name: str, changes: Mapping[str, Any]) -> None:
        self.name = name
        self.is_block = name in BLOCKS
        self.is_scene = not self.is_block and not is_user_file(name)
        self._changes = changes

    @classmethod
    def of(cls, scene: SceneText | str) -> Subject:
        """Return the subject of a scene that was read, or of a Python file."""
        if isinstance(scene, str):
            return cls(scene, {})
        subject = cls(scene.name, {})
        subject.is_block, subject.is_scene = False, True
        subject.__dict__["text"] = scene
        return subject

    @cached_property
    def text(self) -> SceneText:
        """The scene."""
        return override(read_scene(self.name), self._changes)

    @cached_property
    def resolved(self) -> Linkage | Loop:
        """The resolved scene."""
        return resolve(check_scene(self.text))

    @cached_property
    def system(self) -> System:
        """The system of the model itself."""
        if self.is_block:
            return BLOCKS[self.name]()
        return system_of(self.resolved) if self.is_scene else equations_of(Path(self.name))

    @cached_property
    def further(self) -> dict[str, System]:
        """Further systems, by the prefix of their matrix names (before the dot)."""
        if not self.is_scene:
            return {}
        further: dict[str, System] = derived_in_letters(self.resolved, further_of)
        return further

    @cached_property
    def steps(self) -> System | None:
        """The derivation steps of a building block, if they have matrices of their own."""
        derivation: Callable[[], System] | None = DERIVATIONS.get(self.name)
        return derivation() if derivation else None

    @cached_property
    def record(self) -> tuple[Step, ...]:
        """The derivation record, step by step."""
        if not self.is_assembled:
            return self._before_assembly
        from symgen.pipeline.assembled import assembled_record

        steps = assembled_record(cast("Linkage", self.resolved), self.assembled)
        return (*self._before_assembly, *steps)

    def record_with(self, values: Mapping[str, sp.Expr], *, constants: bool) -> tuple[Step, ...]:
        """Return the record with values [SI] of some symbols, and of all ``constants`` of the scene.

        Raises
        ------
        ModelError
            For a symbol that no step has.
        """
        known = {x.name for step in self.record for x in step.system.symbols()}
        for name in values:
            check_known(name, known, f"the derivation of {self.name} has no symbol")
        systems = {id(step.system): step.system for step in self.record}
        valued = {key: _valued(system, values, constants) for key, system in systems.items()}
        return tuple(replace(step, system=valued[id(step.system)]) for step in self.record)

    @cached_property
    def _before_assembly(self) -> tuple[Step, ...]:
        if self.is_scene and not self._kinematic and method_of(self.resolved).record:
            return record(self.resolved, self.system)
        whole = of_system(self.system)
        if self.steps is None:
            return (whole,)
        is_element = "weak_form" in self.steps
        return (*elastic_record(self.steps), whole) if is_element else (whole, of_system(self.steps))

    @property
    def is_assembled(self) -> bool:
        """Whether this is a scene with elastic links in the plane, whose equations are assembled."""
        return self.is_scene and not self._kinematic and self.resolved.method == "elastic"

    @property
    def constraints(self) -> tuple[str, ...]:
        """Names of the constraints of elastic links in the plane, such as those that keep their length."""
        joints = self.further["elastic_joints"]
        return joints["jacobian"].rows if "jacobian" in joints else ()

    @cached_property
    def assembled(self) -> System:
        """The assembled equations of elastic links."""
        from symgen.pipeline.assembled import assembled_of

        return assembled_of(cast("Linkage", self.resolved))

    @property
    def _kinematic(self) -> bool:
        """Whether this is a scene with kinematic analysis only."""
        return self.is_scene and self.resolved.kinematic

    @property
    def parts(self) -> tuple[tuple[str, System], ...]:
        """All systems by the prefix of their matrix names; derivation steps first."""
        whole = (self.steps, self.system) if self.steps else (self.system,)
        further = tuple((f"{kind}.", system) for kind, system in self.further.items())
        return (*(("", system) for system in whole), *further)

    @property
    def recorded(self) -> tuple[NamedMatrix, ...]:
        """Matrices of the derivation record that are in none of :attr:`parts`, without assembled ones."""
        known = {m.name for prefix, part in self.parts if not prefix for m in part.matrices}
        return tuple(m for step in self._before_assembly for m in step.matrices if m.name not in known)

    def found(self, name: str, *, numbers: bool = False, cuts: Sequence[str] = ()) -> tuple[Chosen, ...]:
        """Return what a name or the number of an equation stands for, by system.

        A number, as in ``(47)``, ``F.1`` or ``Attia (7)``, stands for the matrices that correspond to it, or
        those of their rows that do. All other names are looked up as by :meth:`choose`.

        Raises
        ------
        ModelError
            If there is nothing.
        """
        equation = as_equation(name)
        if not equation or cuts:
            return (self.choose(name, numbers=numbers, cuts=cuts),)
        if not (cited := self._citing(equation)):
            raise ModelError(
                f"no matrix of {self.name} corresponds to the equation {equation}\n  {elsewhere(equation)}"
            )
        return cited

    def choose(self, name: str, *, numbers: bool = False, cuts: Sequence[str] = ()) -> Chosen:
        """Return what a name stands for, with its System: a matrix, a kernel, a shared term, an argument.

        Names of the derivation record and of further systems are known as well, those of further systems
        with and without their prefix. ``momentum_rows`` are all momentum rows, with the joints of ``cuts``
        cut; with ``numbers``, they are returned as the square system that they form.

        Raises
        ------
        ModelError
            If nothing has this name; the message suggests the nearest ones.
        """
        kind, _, rest = name.partition(".")
        if kind == _MOMENTUM and self.is_scene:
            return self._momentum(rest, numbers, cuts)
        if cuts:
            raise ModelError(f"cuts apply to momentum_rows and momentum_rows.NAME of a scene, not to {name}")
        if self.steps and name in self.steps:  # a matrix of a step, rather than a symbol of the block
            return Chosen(self.steps, (self.steps[name],))
        if name in ASSEMBLED and self.is_assembled and name in self.assembled:
            return Chosen(self.assembled, (self.assembled[name],))
        known: list[str] = []
        for prefix, system in self.searched():
            own = name.removeprefix(prefix) if name.startswith(prefix) else name
            matrices = system.named(own)
            if matrices:
                return Chosen(system, matrices)
            known += (prefix + x for x in system.names())
        raise ModelError(
            f"{self.system.name} has nothing called {name!r}. {nearest(name, known)}\n"
            f"  symgen show {self.name} lists its matrices."
        )

    def _citing(self, equation: str) -> tuple[Chosen, ...]:
        """Return the matrices or rows that cite an equation most precisely, by system."""
        ranked = [(*citing(equation, system.matrices), system) for _, system in self.searched()]
        best = max(rank for rank, _, _ in ranked)
        seen: set[str] = set()
        found = []
        for rank, matrices, system in sorted(ranked, key=lambda of: of[2] is not self.steps):
            new = tuple(m for m in matrices if m.name not in seen)
            if new and rank == best:
                seen.update(m.name for m in new)
                found.append(Chosen(system, new))
        return tuple(sorted(found, key=lambda chosen: not chosen.matrices[0].in_letters))

    def searched(self) -> Iterator[tuple[str, System]]:
        """Yield the systems in which names are looked up, each derived when it is reached."""
        yield from self.unassembled()
        if self.is_assembled:
            yield "", self.assembled

    def unassembled(self) -> Iterator[tuple[str, System]]:
        """Yield the systems by their prefix whose derivation needs no kernels: all but the assembled one."""
        yield "", self.system
        yield from ((f"{kind}.", system) for kind, system in self.further.items())
        seen = {id(self.system)}
        if self.steps:
            seen.add(id(self.steps))
            yield "", self.steps
        for step in self._before_assembly:
            if id(step.system) not in seen:
                seen.add(id(step.system))
                yield "", step.system
        if self.system.saddle_point:
            yield "", _solved(self.system, self.system.saddle_point)

    def _momentum(self, row: str, numbers: bool, cuts: Sequence[str]) -> Chosen:
        system = momentum_of(self.resolved, cuts, joined=numbers)
        if row:
            check_known(row, {*system.names()}, f"{self.name} has no momentum row")
            return Chosen(system, system.named(row))
        return Chosen(system, tuple(m for m in system.matrices if (m.name in _SQUARE) == numbers))


def parts(found: Iterable[Chosen], rows: str | None, columns: str | None) -> list[Chosen]:
    """Return rows and columns, as comma-separated names or numbers, of the matrices that have all of them.

    Raises
    ------
    ModelError
        When no matrix has them.
    """
    labels = [[x.strip() for x in text.split(",")] if text else [] for text in (rows, columns)]
    selected, errors = [], []
    for chosen in found:
        matrices = []
        for m in chosen.matrices:
            try:
                matrices.append(narrowed(m, *labels))
            except ModelError as error:
                errors.append(error)
        if matrices:
            selected.append(replace(chosen, matrices=tuple(matrices)))
    if not selected:
        raise errors[0]
    return selected


def citations_of_papers() -> str:
    """Return the content of :data:`symgen.pipeline.citations.STORED`."""
    papers: dict[str, dict[str, list[list[str]]]] = {}
    for paper, models in PAPERS.items():
        known: set[tuple[str, ...]] = set()
        papers[paper] = {}
        for name, options in models:
            every = dict.fromkeys(_citations(Subject(name, settings(options))))
            cited = [c for c in every if c and paper in c[0] and c not in known]
            known.update(cited)
            papers[paper][command_of(name, options)] = [*map(list, cited)]
        papers[paper] |= {command: [[source]] for command, source in COMMANDS.get(paper, ())}
    return json.dumps(papers, indent=1) + "\n"


def _citations(subject: Subject) -> Iterator[tuple[str, ...]]:
    yield from (citation(m) for _, system in subject.unassembled() for m in system.matrices)
    if subject.is_assembled:  # without kernels, which may be those of older equations here
        yield from ((source,) for _, source in of_assembly(subject.constraints) if "(" in source)


def _solved(system: System, point: SaddlePoint) -> System:
    """Return the system with the kernels that factorise and solve [M J^T; J 0], by their matrices."""
    matrices = point.mass, point.jacobian, point.force, point.rhs
    kernels = {k.name for k in lower_system(system).kernels} - {e.kernel for e in system.exports}
    about = "solves the equations of motion"
    return replace(system, exports=tuple(Export(kernel, about, matrices) for kernel in sorted(kernels)))


class Equations(Matrices):
    """Derived matrices of a source by name; every other name of its derivation is derived on request."""

    def __init__(self, subject: Subject) -> None:
        super().__init__((name, DerivedMatrix.of(m)) for name, m in subject.system.by_name().items())
        self._subject = subject

    def cut(self, *joints: str) -> System:
        """Return the momentum rows of a linkage with joints ``LINK.POINT`` cut, and their system A x = b.

        The cuts may leave no loop. Without joints, a loop is cut where a point is reached a second time.
        """
        if not self._subject.is_scene:
            raise ModelError(f"{self._subject.name} is not a scene: it has no joints to cut")
        return momentum_of(self._subject.resolved, joints)

    def _repr_html_(self) -> str:
        return self._subject.system._repr_html_()

    def __missing__(self, name: str) -> Any:
        matrices = [m for chosen in self._subject.found(name) for m in chosen.matrices]
        if len(matrices) != 1:
            names = ", ".join(m.name for m in matrices[:_NAMED])
            raise ModelError(f"{name} stands for {len(matrices)} matrices: {names}, ...: name one of them")
        m = matrices[0]
        return m.equation if m.in_letters else DerivedMatrix.of(m.matrix)
