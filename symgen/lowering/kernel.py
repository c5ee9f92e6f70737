"""A kernel: one straight-line function with its arguments, its results and its exact cost."""

from __future__ import annotations

from dataclasses import dataclass, field

from symgen.lowering.nodes import Node, OperationCount, count

#: The argument arrays of every kernel, in their fixed order.
ARRAYS = ("t", "q", "u", "p", "work", "out")

#: Name of the kernel that is called once a run, before all others: see :mod:`symgen.lowering.binding_times`.
SETUP = "setup"


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

    ``inputs`` gives the size of every argument array that its own program reads; an entry of one is the
    reference ``array[index]``. All loads come before all stores, so ``work`` and ``out`` may be read and
    written by the same kernel. ``first`` and ``then`` are kernels it calls before and after its own
    program, with its own arguments. ``counts`` are its operations by kind, those of the kernels it calls
    included.
    """

    name: str
    description: str
    inputs: tuple[tuple[str, int], ...]
    assignments: tuple[Assignment, ...]
    stores: tuple[Store, ...]
    blocks: tuple[Block, ...]
    first: tuple[Kernel, ...] = ()
    then: tuple[Kernel, ...] = ()
    counts: OperationCount = field(init=False)

    def __post_init__(self) -> None:
        own = count([a.value for a in self.assignments] + [s.value for s in self.stores])
        object.__setattr__(self, "counts", sum((k.counts for k in self.first + self.then), own))

    @property
    def reads(self) -> dict[str, int]:
        """Number of entries that it and the kernels it calls first read of each argument array."""
        sizes = dict(self.inputs)
        for kernel in self.first:
            sizes = {a: max(sizes.get(a, 0), n) for a, n in {**sizes, **kernel.reads}.items()}
        return sizes

    @property
    def out_size(self) -> int:
        """Number of doubles in ``out``."""
        return max((s.index + 1 for s in self.stores if s.array == "out"), default=0)

    @property
    def work_size(self) -> int:
        """Number of doubles in ``work`` that the kernel reads or writes."""
        written = max((s.index + 1 for s in self.stores if s.array == "work"), default=0)
        return max(written, self.reads.get("work", 0), *(k.work_size for k in self.first + self.then), 0)


@dataclass(frozen=True, slots=True)
class Program:
    """All kernels of one model, with the meaning of every argument.

    ``pivots`` is where 'factor' leaves in ``work``, for every unknown, its pivot and the sum of its terms of
    its own sign; 0 when there is no such kernel. ``rank_tolerance`` is what such a pivot keeps at most where
    its multiplier is set to zero.
    """

    name: str
    title: str
    groups: tuple[tuple[str, str, tuple[Slot, ...]], ...]
    kernels: tuple[Kernel, ...]
    pivots: int
    rank_tolerance: str
    references: tuple[str, ...]
    left_out: tuple[str, ...]

    @property
    def setup(self) -> Kernel | None:
        """The kernel that computes what depends on parameters alone, None where there is nothing to."""
        return next((k for k in self.kernels if k.name == SETUP), None)

    @property
    def calls_functions(self) -> bool:
        """Whether calls of sines, cosines and their like are much of what its kernels do."""
        counts = [k.counts for k in self.kernels]
        return 50 * sum(c.call for c in counts) > sum(c.flops for c in counts)

    def kernel(self, name: str) -> Kernel:
        """Return the kernel called ``name``."""
        return next(k for k in self.kernels if k.name == name)
