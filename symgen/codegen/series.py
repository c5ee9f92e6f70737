"""The kernel of power series as C: its loops over the orders, and the statements between them."""

from __future__ import annotations

from symgen.codegen.calls import calls
from symgen.codegen.printers import Printer
from symgen.codegen.views import LoopOverOrders, OrderView, SeriesStatement
from symgen.lowering.coefficients import LOOPS
from symgen.lowering.expressions import Call, Node
from symgen.lowering.kernel import Assignment, SeriesKernel


def order_view(kernel: SeriesKernel, c_type: str, prints: Printer) -> OrderView:
    """Return a kernel for one order as text."""

    def statement(a: Assignment) -> SeriesStatement | LoopOverOrders:
        if isinstance(a.value, Call) and a.value.function in LOOPS:
            first, second, count = (int(prints(x)) for x in a.value.arguments)
            return LoopOverOrders(a.value.function, a.target, first, second, count)
        declared = "" if "[" in a.target else f"const {c_type} "
        return SeriesStatement(a.target, prints(a.value), declared)

    values: list[Node] = [*(a.value for a in kernel.assignments), *(s.value for s in kernel.stores)]
    return OrderView(
        kernel.name,
        kernel.description,
        list(calls(values)),
        tuple(map(statement, kernel.assignments)),
        tuple(SeriesStatement(f"out[{s.index}]", prints(s.value)) for s in kernel.stores),
    )
