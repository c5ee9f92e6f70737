"""Loops from a recursion over rods: each step is a straight-line kernel over one rod or point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from symgen.lowering.expressions import ZERO, OperationCount, references
from symgen.lowering.kernel import Kernel, Store
from symgen.lowering.straight_line import Shared, StraightLine
from symgen.symbolic.system import System

#: The steps performed for every rod in one evaluation of all accelerations.
PER_ROD = ("length", "gather", "inward", "outward")


class LoweredRecursion(Protocol):
    """Steps of a derivation over one rod or point, with their purpose."""

    @property
    def name(self) -> str:
        """Name of the kernels' module."""

    @property
    def title(self) -> str:
        """Title of the model."""

    @property
    def dimension(self) -> int:
        """Number of vector components."""

    @property
    def steps(self) -> tuple[System, ...]:
        """The steps, each a separate system."""

    @property
    def references(self) -> tuple[str, ...]:
        """References of the equations."""


@dataclass(frozen=True, slots=True)
class StepResult:
    """One result of a step, entry by entry; ``added`` if it accumulates."""

    name: str
    size: int
    unit: str
    description: str

    @property
    def added(self) -> bool:
        """Whether the step adds to the stored values."""
        return self.name.startswith("add_")


@dataclass(frozen=True, slots=True)
class RecursionStep:
    """One step: its kernel, and the meaning of its results."""

    kernel: Kernel
    results: tuple[StepResult, ...]

    @property
    def counts(self) -> OperationCount:
        """Operations of one call, including the accumulating additions."""
        added = sum(r.size for r in self.results if r.added)
        return self.kernel.counts + OperationCount(add=added)


@dataclass(frozen=True, slots=True)
class Loops:
    """All lowered steps of a recursion."""

    name: str
    title: str
    dimension: int
    steps: tuple[RecursionStep, ...]
    references: tuple[str, ...]

    def step(self, name: str) -> RecursionStep:
        """Return the step called ``name``."""
        return next(s for s in self.steps if s.kernel.name == name)

    def size(self, step: str, result: str) -> int:
        """Return the number of entries in one result of a step."""
        return next(r.size for r in self.step(step).results if r.name == result)

    @property
    def per_rod(self) -> OperationCount:
        """Operations per rod in one evaluation of all accelerations."""
        return sum((self.step(name).counts for name in PER_ROD), OperationCount())


def lower_recursion(recursion: LoweredRecursion) -> Loops:
    """Lower every step of a recursion to a kernel."""
    steps = tuple(_lower(step) for step in recursion.steps)
    return Loops(recursion.name, recursion.title, recursion.dimension, steps, recursion.references)


def _lower(step: System) -> RecursionStep:
    shared = Shared(step, tuple(m.name for m in step.matrices))
    stores = [
        Store(m.name, i, entries.get(i, ZERO))
        for m, entries in ((m, shared.entries[m.name]) for m in step.matrices)
        for i in range(len(m.matrix))
    ]
    assignments = StraightLine(shared.values).assignments(s.value for s in stores)
    read = references([a.value for a in assignments] + [s.value for s in stores])
    used = {r.partition("[")[0] for r in read if "[" in r}
    inputs = tuple((g.name, len(g.quantities)) for g in step.groups if g.name in used)
    return RecursionStep(
        Kernel(step.name, step.title, inputs, assignments, tuple(stores), ()),
        tuple(StepResult(m.name, m.matrix.rows, m.unit, m.description) for m in step.matrices),
    )
