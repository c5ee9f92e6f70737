"""Functions that kernels call."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import groupby

import sympy as sp

from symgen.codegen.printers import C_FUNCTIONS, LANE_FUNCTIONS, Printer, printer
from symgen.codegen.target import Target
from symgen.lowering.expressions import Call, Lookup, Node, children, constant, references
from symgen.lowering.kernel import Kernel
from symgen.precision import Precision

#: Functions of the C library with two arguments.
_OF_TWO = ("atan2", "pow", "fmax")


@dataclass(frozen=True, slots=True)
class LookupView:
    """The numbers of a function of the pieces of a table, as text; ``period`` is empty without one."""

    finds: bool
    numbers: tuple[str, ...]
    period: str
    step: str
    bounded: bool


@dataclass(frozen=True, slots=True)
class CallView:
    """A function that kernels call: name in the expression tree, name for scalars, number of arguments.

    ``shared`` is true where it has one argument, which never depends on a state. ``lookup`` is that of a
    table.
    """

    function: str
    of_one: str
    arguments: int
    shared: bool
    lookup: LookupView | None = None


def calls(nodes: Iterable[Node]) -> dict[str, Call]:
    """Return a call of each function in expressions."""
    functions: dict[str, Call] = {}
    waiting = list(nodes)
    while waiting:
        node = waiting.pop()
        waiting.extend(children(node))
        if isinstance(node, Call):
            functions[node.function] = node
    return functions


def calls_of(kernel: Kernel, target: Target) -> tuple[CallView, ...]:
    """Return the functions that a kernel calls, by name."""
    values = [a.value for a in kernel.assignments] + [s.value for s in kernel.stores]
    functions = calls(values if kernel.counts.call else ())
    counts = {name: len(call.arguments) for name, call in functions.items()}
    one = Printer(C_FUNCTIONS, target.precision)
    changing = _of_states(kernel, values) if 1 in counts.values() else ()
    return tuple(
        CallView(
            name,
            name if isinstance(call, Lookup) else one.name(name),
            counts[name],
            counts[name] == 1 and name not in changing,
            _lookup(call, target) if isinstance(call, Lookup) else None,
        )
        for name, call in sorted(functions.items())
    )


def _lookup(call: Lookup, target: Target) -> LookupView:
    column = call.column
    prints = replace(printer(target), lanes=False)  # vectors take the function of scalars lane by lane

    def text(number: Fraction) -> str:
        return prints(constant(sp.Rational(number)))

    period, step = (text(x) if x else "" for x in (column.period, column.step))
    return LookupView(column.finds, tuple(map(text, column.numbers)), period, step, column.bounded)


def calls_of_series(kernels: Iterable[Kernel], precision: Precision) -> tuple[CallView, ...]:
    """Return the functions of the C library that kernels of power series call, by name."""
    one, names = Printer(C_FUNCTIONS, precision), set[str]()
    for kernel in kernels:
        names |= calls([*(a.value for a in kernel.assignments), *(s.value for s in kernel.stores)]).keys()
    library = {name.removeprefix("series_") for name in names} & LANE_FUNCTIONS.keys()
    return tuple(CallView(f, one.name(f), 2 if f in _OF_TWO else 1, False) for f in sorted(library))


def _of_states(kernel: Kernel, values: Sequence[Node]) -> set[str]:
    """Return the functions with an argument that depends on the state."""
    states: set[str] = set()

    def changes(nodes: Iterable[Node]) -> bool:
        return any(
            name in states or name.partition("[")[0] in ("q", "u", "work") for name in references(nodes)
        )

    for a in kernel.assignments:
        if changes([a.value]):
            states.add(a.target)
    functions, waiting = set(), list(values)
    while waiting:
        node = waiting.pop()
        waiting.extend(children(node))
        if isinstance(node, Call) and changes(node.arguments):
            functions.add(node.function)
    return functions


def merged(views: Iterable[CallView]) -> tuple[CallView, ...]:
    """Return the distinct functions of several kernels, by name."""
    every = groupby(sorted(views, key=lambda c: c.function), key=lambda c: c.function)
    same = (list(group) for _, group in every)
    return tuple(replace(group[0], shared=all(c.shared for c in group)) for group in same)
