"""Matrices that can be shown for one name: the systems of a scene or building block, and its derivation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from symgen.errors import DerivationError
from symgen.methods import further_of, method_of
from symgen.models import BLOCKS, DERIVATIONS
from symgen.models.record import elastic_record, of_system, record
from symgen.pipeline.systems import system_of
from symgen.pipeline.user_system import is_user_file, load
from symgen.scene.loading import SceneText, check_scene, override, read_scene
from symgen.scene.loop.loop import Loop
from symgen.scene.resolve import resolve
from symgen.scene.rods.linkage import Linkage
from symgen.symbolic.derivative import derivative
from symgen.symbolic.system import NamedMatrix, Step, System

#: Name that selects the derivation record instead of a matrix.
RECORD = "derivation"
_MOMENTUM = "momentum_rows"


@dataclass(frozen=True, slots=True)
class Chosen:
    """Selected matrices and the System that they belong to."""

    system: System
    matrices: tuple[NamedMatrix, ...]

    def part(self, rows: str | None, columns: str | None) -> Chosen:
        """Return selected rows and columns, given as comma-separated names or numbers."""
        labels = [[x.strip() for x in text.split(",")] if text else [] for text in (rows, columns)]
        return replace(self, matrices=tuple(m.part(*labels) for m in self.matrices))

    def by(self, name: str) -> Chosen:
        """Return the partial derivatives with respect to an argument."""
        derived = derivative(self.system, self.matrices, name)
        return Chosen(derived, derived.matrices)


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
        return system_of(self.resolved) if self.is_scene else load(Path(self.name)).system

    @cached_property
    def further(self) -> dict[str, System]:
        """Further systems, by the prefix of their matrix names (before the dot)."""
        return further_of(self.resolved) if self.is_scene else {}

    @cached_property
    def steps(self) -> System | None:
        """The derivation steps of a building block, if they have matrices of their own."""
        derivation: Callable[[], System] | None = DERIVATIONS.get(self.name)
        return derivation() if derivation else None

    @cached_property
    def record(self) -> tuple[Step, ...]:
        """The derivation record, step by step."""
        if self.is_scene and not self._kinematic:
            return record(self.resolved, self.system)
        whole = of_system(self.system)
        return (*elastic_record(), whole) if self.steps else (whole,)

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

    def choose(self, name: str, *, numbers: bool = False) -> Chosen:
        """Return a matrix by name with its System, or one or all of the momentum rows.

        With ``numbers``, all momentum rows are returned as the square system that they form.

        Raises
        ------
        ModelError
            If no matrix has this name; the message suggests the nearest one.
        """
        kind, _, rest = name.partition(".")
        if kind == _MOMENTUM and self.is_scene:
            return self._momentum(rest, numbers)
        if self.steps and name in self.steps:
            return Chosen(self.steps, (self.steps[name],))
        if rest and kind in self.further:
            return Chosen(self.further[kind], (self.further[kind][rest],))
        return Chosen(self.system, (self.system[name],))

    def _momentum(self, row: str, numbers: bool) -> Chosen:
        method = method_of(self.resolved)
        if not method.momentum:
            raise DerivationError(f"{self.name} has no momentum rows: these are of points and links")
        if self._kinematic:
            raise DerivationError(
                f"{self.name} is a kinematic analysis, which has no momentum rows\n"
                "  Give --set analysis.kind=dynamics."
            )
        system = method.load("momentum")(self.resolved)
        if row:
            return Chosen(system, (system[row],))
        square = ("matrix", "rhs")
        return Chosen(system, tuple(m for m in system.matrices if (m.name in square) == numbers))
