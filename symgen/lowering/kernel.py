"""Kernels: straight-line functions with their arguments, results and operation counts."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from symgen.lowering.expressions import ZERO, Node, OperationCount, count

#: The argument arrays of every kernel, in order.
ARRAYS = ("t", "q", "u", "p", "work", "out")

#: The rank tolerance, until the number of entries before it in the parameters' array is known.
RANK_TOLERANCE = "p[rank_tolerance]"
#: Name of the kernel called once per run, before all others: see :mod:`symgen.lowering.binding_times`.
SETUP = "setup"


@dataclass(frozen=True, slots=True)
class Slot:
    """Meaning of one entry of an argument array."""

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
    """A result with the array and index where it is stored."""

    array: str
    index: int
    value: Node


@dataclass(frozen=True, slots=True)
class Block:
    """A named part of ``out`` (or ``work``) with its offset and shape."""

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

    ``inputs`` gives the size of every argument array that the kernel itself reads; the reference to an entry
    is ``array[index]``. All loads precede all stores, so the same kernel may read and write ``work`` and
    ``out``. ``first`` and ``then`` are kernels called before and after it with the same arguments.
    Entries of ``out`` within ``blocks`` that no store writes are zero.
    ``counts`` are the operations by kind, including those of the called kernels.
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
        operations = count([a.value for a in self.assignments] + [s.value for s in self.stores])
        object.__setattr__(self, "counts", sum((k.counts for k in self.first + self.then), operations))

    @property
    def reads(self) -> dict[str, int]:
        """Number of entries of each argument array read by the kernel and those it calls first."""
        sizes = dict(self.inputs)
        for kernel in self.first:
            sizes = {a: max(sizes.get(a, 0), n) for a, n in {**sizes, **kernel.reads}.items()}
        return sizes

    @property
    def out_size(self) -> int:
        """Number of doubles in ``out``."""
        written = max((s.index + 1 for s in self.stores if s.array == "out"), default=0)
        return max(written, *(b.offset + b.shape[0] * b.shape[1] for b in self.blocks), 0)

    @property
    def is_sparse(self) -> bool:
        """Whether entries of ``out`` are zero without a store."""
        return sum(s.array == "out" for s in self.stores) < self.out_size

    @property
    def with_zeros(self) -> Kernel:
        """The kernel with a store for every entry of ``out``."""
        if not self.is_sparse:
            return self
        written = {s.index for s in self.stores if s.array == "out"}
        zeros = (Store("out", i, ZERO) for i in range(self.out_size) if i not in written)
        return replace(self, stores=(*self.stores, *zeros))

    @property
    def work_size(self) -> int:
        """Number of doubles in ``work`` that the kernel reads or writes."""
        written = max((s.index + 1 for s in self.stores if s.array == "work"), default=0)
        return max(written, self.reads.get("work", 0), *(k.work_size for k in self.first + self.then), 0)


@dataclass(frozen=True, slots=True)
class SeriesKernel(Kernel):
    """A kernel of power series in time for one order.

    There are ``rows`` coefficients of each order: those of the ``coordinates``, of the multipliers, of the
    first and then of the second factors of ``products``, the same of products one order ``ahead``, of other
    operands, some that are not used, of the work of loads without potential, and last of the ``watched``
    quantities. Those of the numbers ``lacking`` have functions without a recurrence; their coefficients are
    zero. Of one freedom, the motion of unit inertia is in the place of the multipliers.
    """

    rows: int = 0
    coordinates: int = 0
    products: int = 0
    ahead: int = 0
    watched: int = 0
    lacking: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class IteratedKernel(Kernel):
    """A kernel without statements that repeats another one, ``step``, for sizes f = |F + B f| of forces.

    Its ``numbers`` are in ``work`` from ``place`` on, which ``step`` gets as ``out``: ``count`` sizes; then
    ``part``, by which B is multiplied, and of the last step ``change`` and ``size``, sums over all sizes, and
    ``determinant``, of its matrix; ``bound``, the square of a norm of B; ``missed``, not a number where
    nothing was found, else zero.

    B rises from nothing to itself, in one step if it may. A solution continues one for less of B if it is
    the only one, or if it is near that one and the determinant keeps its sign.
    """

    step: str = ""
    place: int = 0
    count: int = 0
    numbers: int = 0

    def at(self, name: str) -> int:
        """Return the place of a number behind the sizes."""
        return self.count + ("part", "change", "size", "determinant", "bound", "missed", "end").index(name)


@dataclass(frozen=True, slots=True)
class Program:
    """All kernels of one model, with the meaning of every argument.

    ``pivots`` is the offset in ``work`` where 'factor' stores, for every unknown, its pivot and the sum of
    the terms with the pivot's sign; 0 without that kernel. A multiplier is set to zero if the ratio of the
    two does not exceed ``rank_tolerance``, unless the caller overrides it: kernels read the tolerance from
    ``p[tolerance_place]``, after all other entries; -1 if no kernel reads it. ``series`` are the kernels of
    :mod:`symgen.lowering.recurrences`, for compiled runs only.
    """

    name: str
    title: str
    groups: tuple[tuple[str, str, tuple[Slot, ...]], ...]
    kernels: tuple[Kernel, ...]
    pivots: int
    rank_tolerance: str
    references: tuple[str, ...]
    left_out: tuple[str, ...]
    tolerance_place: int = field(default=-1, repr=False)  # kernels that read it tell the place
    series: tuple[SeriesKernel, ...] = ()

    @property
    def setup(self) -> Kernel | None:
        """The kernel that evaluates terms of parameters only; None if there are no such terms."""
        return next((k for k in self.kernels if k.name == SETUP), None)

    @property
    def calls_functions(self) -> bool:
        """Whether calls of mathematical functions make up much of the cost of its kernels."""
        counts = [k.counts for k in self.kernels]
        return 50 * sum(c.call for c in counts) > sum(c.flops for c in counts)

    def kernel(self, name: str) -> Kernel:
        """Return the kernel called ``name``."""
        return next(k for k in self.kernels if k.name == name)
