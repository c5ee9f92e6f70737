"""What may be shown under one name: the Systems of a scene or a building block, and its derivation record."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from symgen.errors import DerivationError
from symgen.models import BLOCKS, DERIVATIONS
from symgen.models.record import Step, elastic_record, record
from symgen.own import is_own, load
from symgen.pipeline import system_of
from symgen.scene.linkage import Linkage
from symgen.scene.loading import SceneText, check_scene, override, read_scene
from symgen.scene.loop import Loop
from symgen.scene.resolve import resolve
from symgen.symbolic.derivative import derivative
from symgen.symbolic.system import NamedMatrix, System

#: What shows the derivation step by step, in place of a matrix.
RECORD = "derivation"
_MOMENTUM = "momentum_rows"


@dataclass(frozen=True, slots=True)
class Chosen:
    """Matrices to be shown, and the System that they belong to."""

    system: System
    matrices: tuple[NamedMatrix, ...]

    def part(self, rows: str | None, columns: str | None) -> Chosen:
        """Return some rows and columns, by names or numbers with commas between them."""
        wanted = [[x.strip() for x in text.split(",")] if text else [] for text in (rows, columns)]
        return replace(self, matrices=tuple(m.part(*wanted) for m in self.matrices))

    def by(self, name: str) -> Chosen:
        """Return the derivatives by an argument."""
        made = derivative(self.system, self.matrices, name)
        return Chosen(made, made.matrices)


class Subject:
    """Everything derived of a scene, a building block or a user's own file, each when it is first asked for.

    Parameters
    ----------
    name
        A scene, a building block, or a Python file that returns a System.
    changes
        Values to replace in the scene.
    """

    def __init__(self, name: str, changes: Mapping[str, Any]) -> None:
        self.name = name
        self.is_block = name in BLOCKS
        self.is_scene = not self.is_block and not is_own(name)
        self._changes = changes

    @cached_property
    def text(self) -> SceneText:
        """The scene."""
        return override(read_scene(self.name), self._changes)

    @cached_property
    def resolved(self) -> Linkage | Loop:
        """What the scene resolves to."""
        return resolve(check_scene(self.text))

    @cached_property
    def own(self) -> System:
        """What the model is made of."""
        if self.is_block:
            return BLOCKS[self.name]()
        return system_of(self.resolved) if self.is_scene else load(Path(self.name)).system

    @cached_property
    def further(self) -> dict[str, System]:
        """What is derived besides, by what comes before the dot in the names of its matrices."""
        from symgen.models.analyses import elastic_systems

        if not self.is_scene or not isinstance(self.resolved, Linkage):
            return {}
        return elastic_systems(self.resolved)

    @cached_property
    def steps(self) -> System | None:
        """The steps by which a building block is derived, where they are matrices of their own."""
        made: Callable[[], System] | None = DERIVATIONS.get(self.name)
        return made() if made else None

    @cached_property
    def record(self) -> tuple[Step, ...]:
        """The derivation step by step."""
        if self.is_scene and not self._kinematic:
            return record(self.resolved, self.own)
        source = "; ".join(self.own.references)
        whole = Step(
            self.own.title,
            "What it is made of.",
            source,
            self.own,
            tuple(m.name for m in self.own.matrices),
        )
        return (*elastic_record(), whole) if self.steps else (whole,)

    @property
    def _kinematic(self) -> bool:
        """Whether it is a scene that asks for no dynamics."""
        return self.is_scene and isinstance(self.resolved, Linkage) and self.resolved.kinematic

    @property
    def parts(self) -> tuple[tuple[str, System], ...]:
        """All Systems, by what their matrices' names begin with; steps of the derivation first."""
        whole = (self.steps, self.own) if self.steps else (self.own,)
        further = tuple((f"{kind}.", system) for kind, system in self.further.items())
        return (*(("", system) for system in whole), *further)

    def choose(self, name: str, *, numbers: bool = False) -> Chosen:
        """Return a matrix by its name, of its System; of momentum rows all, or one.

        All momentum rows as ``numbers`` are the square system that they make.

        Raises
        ------
        DerivationError
            When there is none of this name, which tells the nearest.
        """
        kind, _, rest = name.partition(".")
        if kind == _MOMENTUM and self.is_scene:
            return self._momentum(rest, numbers)
        if self.steps and name in self.steps:
            return Chosen(self.steps, (self.steps[name],))
        if rest and kind in self.further:
            return Chosen(self.further[kind], (self.further[kind][rest],))
        return Chosen(self.own, (self.own[name],))

    def _momentum(self, row: str, numbers: bool) -> Chosen:
        from symgen.models.momentum import momentum_system

        if not isinstance(self.resolved, Linkage):
            raise DerivationError(f"{self.name} is a loop of joints: momentum rows are of points and links")
        if self._kinematic:
            raise DerivationError(
                f"{self.name} asks for kinematics, so that it has no momentum rows\n"
                "  Give --set analysis.kind=dynamics."
            )
        system = momentum_system(self.resolved)
        if row:
            return Chosen(system, (system[row],))
        square = ("matrix", "rhs")
        return Chosen(system, tuple(m for m in system.matrices if (m.name in square) == numbers))
