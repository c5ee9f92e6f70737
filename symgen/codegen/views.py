"""Programs as used by the templates, with every expression as final text."""

from __future__ import annotations

from dataclasses import dataclass

from symgen.codegen.calls import CallView, merged
from symgen.codegen.rolled import Rolled
from symgen.lowering.expressions import GUARDED_INVERSE
from symgen.lowering.kernel import IteratedKernel, Slot
from symgen.precision import Precision


@dataclass(frozen=True, slots=True)
class TextAssignment:
    """An assignment as source text."""

    target: str
    value: str


@dataclass(frozen=True, slots=True)
class BlockView:
    """A part of ``out``, as used by the templates."""

    name: str
    first: int
    last: int
    rows: int
    columns: int
    unit: str
    description: str


@dataclass(frozen=True, slots=True)
class GroupView:
    """An argument array and the meaning of its entries; ``behind`` counts derived entries from 'setup'."""

    name: str
    description: str
    slots: tuple[Slot, ...]
    behind: int = 0
    has_tolerance: bool = False

    @property
    def size(self) -> int:
        """Number of entries."""
        return len(self.slots) + self.behind + self.has_tolerance

    @property
    def derived(self) -> str:
        """Return the index range of the entries from 'setup', without the rank tolerance behind them."""
        return f"{len(self.slots)}..{len(self.slots) + self.behind - 1}"


@dataclass(frozen=True, slots=True)
class KernelView:
    """A kernel as used by the templates, with every expression as final text.

    ``sizes`` are those of all arrays, of which those ``given`` are read. In C, ``early`` has the stores that
    follow each assignment, and ``late`` those behind all of them; of large kernels, ``rolled`` has all
    statements. ``iterated`` is the kernel if it repeats another one.
    """

    name: str
    description: str
    counts: str
    prototype: str
    unused: tuple[str, ...]
    first: tuple[str, ...]
    then: tuple[str, ...]
    assignments: tuple[TextAssignment, ...]
    stores: tuple[TextAssignment, ...]
    early: tuple[tuple[TextAssignment, ...], ...]
    late: tuple[TextAssignment, ...]
    calls: tuple[CallView, ...]
    blocks: tuple[BlockView, ...]
    given: tuple[str, ...]
    sizes: tuple[int, ...]
    work_size: int
    after_setup: bool
    rolled: Rolled | None
    iterated: IteratedKernel | None


@dataclass(frozen=True, slots=True)
class SeriesStatement:
    """An assignment as text, declared where it is to a new name."""

    target: str
    value: str
    declared: str = ""
    loop: bool = False


@dataclass(frozen=True, slots=True)
class LoopOverOrders:
    """A loop over the orders for products of rows side by side."""

    kind: str
    name: str
    first: int
    second: int
    count: int
    loop: bool = True


@dataclass(frozen=True, slots=True)
class OrderView:
    """A kernel for one order as used by the template."""

    name: str
    description: str
    functions: list[str]
    statements: tuple[SeriesStatement | LoopOverOrders, ...]
    out: tuple[SeriesStatement, ...]


@dataclass(frozen=True, slots=True)
class SeriesView:
    """The function of all orders as used by the template.

    ``products`` counts those of the present order, ``products_ahead`` those one order ahead; ``power`` is 1
    if the power of loads is integrated, else 0; ``watched`` counts other quantities. ``solve`` is the view of
    the kernel of the solution if it is repeated in the loop over the orders, else None; without this kernel
    (``inverse``) the solution is a product with the inverse matrix. ``speed`` is that of one freedom,
    with the motion of unit inertia in the place of the multipliers. ``calls`` are functions of the C library.
    """

    name: str
    prototype: str
    rows: int
    coordinates: int
    multipliers: int
    products: int
    products_ahead: int
    power: int
    watched: int
    ahead: OrderView | None
    sides: OrderView
    behind: OrderView | None
    speed: OrderView | None
    along: OrderView | None
    inverse: bool
    solve: KernelView | None
    calls: tuple[CallView, ...]

    @property
    def functions(self) -> list[str]:
        """Return the names of the recurrences that it calls."""
        orders = (self.ahead, self.sides, self.behind, self.speed, self.along)
        return [name for order in orders if order for name in order.functions]


@dataclass(frozen=True, slots=True)
class UnitView:
    """A model as used by the templates."""

    name: str
    title: str
    guard: str
    type: str
    precision: Precision
    lanes: bool
    equations: str
    groups: tuple[GroupView, ...]
    references: tuple[str, ...]
    kernels: tuple[KernelView, ...]
    series: SeriesView | None = None
    first: bool = True

    @property
    def tuned(self) -> GroupView | None:
        """The array completed by 'setup'; None without this kernel."""
        return next((g for g in self.groups if g.behind), None)

    @property
    def addressed(self) -> tuple[str, ...]:
        """The names of all functions with the arguments of kernels."""
        return (*(k.name for k in self.kernels), *([self.series.name] if self.series else []))

    @property
    def calls(self) -> tuple[CallView, ...]:
        """The distinct functions called by the kernels of this file."""
        of_lanes = self.series.calls if self.series and self.lanes else ()
        return merged([*(c for k in self.kernels for c in k.calls), *of_lanes])

    @property
    def lookups(self) -> tuple[CallView, ...]:
        """The functions of tables among them."""
        return tuple(c for c in self.calls if c.lookup)

    @property
    def guarded(self) -> bool:
        """Return whether a kernel of this file calls the guarded reciprocal."""
        return any(c.function == GUARDED_INVERSE for c in self.calls)
