"""The kernel of power series as C: its loops over the orders, and the statements between them."""

from __future__ import annotations

from dataclasses import dataclass

from symgen.codegen.printers import Printer
from symgen.lowering.expressions import Call, Node, calls
from symgen.lowering.kernel import Assignment, SeriesKernel
from symgen.lowering.recurrences import BACK, LOOPS, ROW


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
    first: str
    second: str
    count: str
    loop: bool = True


@dataclass(frozen=True, slots=True)
class SeriesView:
    """The kernel as used by the template."""

    name: str
    description: str
    prototype: str
    rows: int
    functions: list[str]
    early: tuple[SeriesStatement, ...]
    back: tuple[SeriesStatement, ...]
    statements: tuple[SeriesStatement | LoopOverOrders, ...]
    out: tuple[SeriesStatement, ...]


def series_view(kernel: SeriesKernel, prototype: str, c_type: str, prints: Printer) -> SeriesView:
    """Return the kernel as text."""

    def statement(a: Assignment) -> SeriesStatement | LoopOverOrders:
        if isinstance(a.value, Call) and a.value.function in LOOPS:
            first, second, count = map(prints, a.value.arguments)
            return LoopOverOrders(a.value.function, a.target, first, second, count)
        declared = "" if "[" in a.target else f"const {c_type} "
        return SeriesStatement(a.target, prints(a.value), declared)

    def of(array: str) -> tuple[SeriesStatement, ...]:
        return tuple(
            SeriesStatement(a.target, prints(a.value))
            for a in kernel.assignments
            if a.target.startswith(f"{array}[")
        )

    values: list[Node] = [*(a.value for a in kernel.assignments), *(s.value for s in kernel.stores)]
    return SeriesView(
        kernel.name,
        kernel.description,
        prototype,
        kernel.rows,
        list(calls(values)),
        of(ROW),
        of(BACK),
        tuple(statement(a) for a in kernel.assignments if not a.target.startswith((f"{ROW}[", f"{BACK}["))),
        tuple(SeriesStatement(f"out[{s.index}]", prints(s.value)) for s in kernel.stores),
    )
