"""A kernel: one straight-line function with its arguments, its results and its exact cost."""

from __future__ import annotations

from dataclasses import dataclass

from symgen.lowering.nodes import Node, OperationCount, count

#: The argument arrays of every kernel, in their fixed order.
ARRAYS = ("t", "q", "u", "p", "work", "out")


@dataclass(frozen=True, slots=True)
class Slot:
    """What one entry of an argument array means."""

    name: str
    unit: str
    description: str


@dataclass(frozen=True, slots=True)
class Assignment:
    """A named intermediate value."""

    target: str
    value: Node


@dataclass(frozen=True, slots=True)
class Store:
    """A result: the array and the place it is written to."""

    array: str
    index: int
    value: Node


@dataclass(frozen=True, slots=True)
class Block:
    """A named part of ``out`` (or ``work``): where it starts and what shape it has."""

    name: str
    offset: int
    shape: tuple[int, int]
    unit: str
    description: str
    rows: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Kernel:
    """A straight-line program: loads, assignments, stores.

    ``inputs`` gives for every array it reads the names that its program uses, in order. All loads come
    before all stores, so ``work`` and ``out`` may be read and written by the same kernel.
    """

    name: str
    description: str
    inputs: tuple[tuple[str, tuple[str, ...]], ...]
    assignments: tuple[Assignment, ...]
    stores: tuple[Store, ...]
    blocks: tuple[Block, ...]

    @property
    def counts(self) -> OperationCount:
        """Operations by kind."""
        return count([a.value for a in self.assignments] + [s.value for s in self.stores])

    @property
    def out_size(self) -> int:
        """Number of doubles in ``out``."""
        return max((s.index + 1 for s in self.stores if s.array == "out"), default=0)

    @property
    def work_size(self) -> int:
        """Number of doubles in ``work`` that the kernel reads or writes."""
        written = max((s.index + 1 for s in self.stores if s.array == "work"), default=0)
        return max(written, len(dict(self.inputs).get("work", ())))


@dataclass(frozen=True, slots=True)
class Program:
    """All kernels of one model, with the meaning of every argument."""

    name: str
    title: str
    groups: tuple[tuple[str, str, tuple[Slot, ...]], ...]
    kernels: tuple[Kernel, ...]
    references: tuple[str, ...]

    def kernel(self, name: str) -> Kernel:
        """Return the kernel called ``name``."""
        return next(k for k in self.kernels if k.name == name)
