"""Large kernels as loops: statements of one shape run over a table of the places that they read and write.

The code of a straight-line kernel grows with the number of bodies, and compilers need more than proportional
time for it. A mechanism of many bodies repeats the same few expressions: the rows of a constraint, the pivots
and entries of a factor. Here every distinct expression is printed once, as a loop over a table of indices.
The order of elimination and the pattern of the factors are in the tables; values, pivots and rank checks are
those of the straight-line code, to the last bit.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from symgen.codegen.printers import Printer
from symgen.codegen.target import Target
from symgen.lowering.kernel import Kernel, Program, Store
from symgen.lowering.nodes import (
    ZERO,
    Call,
    Constant,
    Negative,
    Node,
    Product,
    Quotient,
    Reference,
    Sum,
)

#: Statements of a program, without stores of zeros, above which its kernels become loops, and the least
#: number of statements of such a kernel. Straight-line code is faster, but its compilation takes seconds for
#: every ten thousand statements.
STRAIGHT, LEAST = 15_000, 500
#: The template of such kernels.
ROLLED = "c/rolled.c.j2"
#: Constants that are printed in the loops; all others are in a table.
_PRINTED = frozenset({"0", "1", "2"})
#: Array of intermediate values, and of constants.
_VALUES, _CONSTANTS = "v", "c"
#: Numbers per line of a table.
_PER_LINE = 24


@dataclass(frozen=True, slots=True)
class Case:
    """A statement over the places ``x[0]``, ``x[1]``, ... of a table with ``width`` columns."""

    target: str
    value: str
    width: int


@dataclass(frozen=True, slots=True)
class Rolled:
    """A kernel as loops: ``runs`` has pairs of a case and its number of rows, ``places`` the rows in order.

    ``values`` counts intermediate values; the first ``zeros`` entries of ``out`` are set to zero before all
    else.
    """

    cases: tuple[Case, ...]
    runs: str
    count: int
    places: str
    constants: str
    values: int
    zeros: int


@dataclass(slots=True)
class _Statement:
    """``operands`` are (array, index), or (name, None) of an intermediate value."""

    case: int
    target: tuple[str, int | None]
    operands: list[tuple[str, int | None]]
    waits: set[int]


class _Cases:
    """The distinct statements, numbered by first appearance."""

    def __init__(self, printer: Printer) -> None:
        self._print = printer
        self._numbers: dict[tuple[str, str], int] = {}
        self._known: dict[str, tuple[str, int | None]] = {}
        self.constants: dict[str, int] = {}
        self.found: list[Case] = []

    def place(self, name: str) -> tuple[str, int | None]:
        """Return the array and the index of a reference; an intermediate value has no index yet."""
        known = self._known.get(name)
        if known is None:
            array, bracket, index = name.partition("[")
            known = self._known[name] = (array, int(index[:-1])) if bracket else (name, None)
        return known

    def number(self, target: tuple[str, int | None], value: Node) -> tuple[int, list[tuple[str, int | None]]]:
        """Return the case of a statement, and its operands in the order of its table."""
        operands: list[tuple[str, int | None]] = []
        key = target[0] if target[1] is not None else _VALUES, self._shape(value, operands)
        case = self._numbers.get(key)
        if case is None:
            case = self._numbers[key] = len(self.found)
            general, width = _general(value, 1)
            self.found.append(Case(f"{key[0]}[x[0]]", self._print(general), width))
        return case, operands

    def _shape(self, node: Node, operands: list[tuple[str, int | None]]) -> str:
        match node:
            case Reference(name):
                place = self.place(name)
                operands.append(place)
                return _VALUES if place[1] is None else place[0]
            case Constant(text):
                if text in _PRINTED:
                    return text
                operands.append((_CONSTANTS, self.constants.setdefault(text, len(self.constants))))
                return _CONSTANTS
            case Sum(terms):
                return f"({'+'.join([self._shape(n, operands) for n in terms])})"
            case Product(factors):
                return f"({'*'.join([self._shape(n, operands) for n in factors])})"
            case Quotient(numerator, denominator):
                return f"({self._shape(numerator, operands)}/{self._shape(denominator, operands)})"
            case Negative(value):
                return f"(-{self._shape(value, operands)})"
            case Call(function, arguments):
                return f"{function}({','.join([self._shape(n, operands) for n in arguments])})"
        raise TypeError(f"not a node: {node!r}")


def _general(node: Node, at: int) -> tuple[Node, int]:
    """Return a node that reads its operands through ``x``, from ``x[at]`` on, and the next free column."""

    def all_of(nodes: Iterable[Node]) -> tuple[Node, ...]:
        nonlocal at
        made = []
        for n in nodes:
            general, at = _general(n, at)
            made.append(general)
        return tuple(made)

    match node:
        case Reference(name):
            array, bracket, _ = name.partition("[")
            return Reference(f"{array if bracket else _VALUES}[x[{at}]]"), at + 1
        case Constant(text):
            return (node, at) if text in _PRINTED else (Reference(f"{_CONSTANTS}[x[{at}]]"), at + 1)
        case Sum(terms):
            return Sum(all_of(terms)), at
        case Product(factors):
            return Product(all_of(factors)), at
        case Quotient(numerator, denominator):
            return Quotient(*all_of((numerator, denominator))), at
        case Negative(value):
            return Negative(*all_of((value,))), at
        case Call(function, arguments):
            return Call(function, all_of(arguments)), at
    raise TypeError(f"not a node: {node!r}")


def large(program: Program, target: Target) -> frozenset[str]:
    """Return the kernels that become loops over tables; kernels in lanes remain straight-line code."""
    if target.language != "c" or target.lanes:
        return frozenset()
    statements = {
        k.name: len(k.assignments) + sum(s.value != ZERO for s in k.stores) for k in program.kernels
    }
    least = LEAST if sum(statements.values()) > STRAIGHT else math.inf
    return frozenset(k.name for k in program.kernels if k.is_sparse or statements[k.name] > least)


def rolled(
    kernel: Kernel, early: Sequence[Sequence[Store]], late: Sequence[Store], printer: Printer
) -> Rolled:
    """Return a kernel as loops.

    Parameters
    ----------
    kernel
        The kernel.
    early, late
        Its stores: those that may follow each assignment, and those behind all of them, in order.
    printer
        The printer of the target.
    """
    cases = _Cases(printer)
    statements: list[_Statement] = []
    made: dict[str, int] = {}
    read: dict[tuple[str, int | None], list[int]] = {}

    def state(target: tuple[str, int | None], value: Node) -> None:
        case, operands = cases.number(target, value)
        waits = {made[name] for name, index in operands if index is None}
        if target[1] is not None:
            waits.update(read.get(target, ()))
        for place in operands:
            if place[0] in ("work", "out"):
                read.setdefault(place, []).append(len(statements))
        statements.append(_Statement(case, target, operands, waits))

    for assignment, own in zip(kernel.assignments, early, strict=True):
        made[assignment.target] = len(statements)
        state((assignment.target, None), assignment.value)
        for store in own:
            state((store.array, store.index), store.value)
    last = _order(statements)
    waited = len(statements)
    for store in late:
        state((store.array, store.index), store.value)
    order = [*last, *range(waited, len(statements))]
    zeros = kernel.out_size if kernel.is_sparse else 0
    return _tables(statements, order, cases, zeros, printer)


def _order(statements: Sequence[_Statement]) -> list[int]:
    """Return an order of dependency in which as many statements of one case as possible are consecutive."""
    waits = [len(s.waits) for s in statements]
    after: list[list[int]] = [[] for _ in statements]
    for i, s in enumerate(statements):
        for j in s.waits:
            after[j].append(i)
    ready: dict[int, list[int]] = {}
    for i, s in enumerate(statements):
        if not waits[i]:
            ready.setdefault(s.case, []).append(i)
    order: list[int] = []
    while ready:
        case = max(ready, key=lambda c: (len(ready[c]), -c))
        run = sorted(ready.pop(case))
        order.extend(run)
        for i in run:
            for j in after[i]:
                waits[j] -= 1
                if not waits[j]:
                    ready.setdefault(statements[j].case, []).append(j)
    return order


def _tables(
    statements: Sequence[_Statement], order: Sequence[int], cases: _Cases, zeros: int, printer: Printer
) -> Rolled:
    """Return the tables of statements in order; places of values are used again after their last use."""
    last: dict[str, int] = {}
    for at, i in enumerate(order):
        for name, index in statements[i].operands:
            if index is None:
                last[name] = at
    free: list[int] = []
    places: dict[str, int] = {}
    values = 0
    numbers: list[int] = []
    runs: list[list[int]] = []
    for at, i in enumerate(order):
        s = statements[i]
        row = [places[name] if index is None else index for name, index in s.operands]
        for name in {name for name, index in s.operands if index is None}:
            if last[name] == at:
                free.append(places.pop(name))
        name, index = s.target
        if index is None:
            if free:
                index = free.pop()
            else:
                index, values = values, values + 1
            if name in last:
                places[name] = index
            else:
                free.append(index)
        numbers += [index, *row]
        if runs and runs[-1][0] == s.case:
            runs[-1][1] += 1
        else:
            runs.append([s.case, 1])
    constants = [printer.literal(text, printer.precision) for text in cases.constants]
    return Rolled(
        cases=tuple(cases.found),
        runs=_lines([f"{{{case}, {rows}}}" for case, rows in runs]),
        count=len(runs),
        places=_lines(numbers),
        constants=_lines(constants or ["0"]),
        values=max(1, values),
        zeros=zeros,
    )


def _lines(numbers: Sequence[int | str]) -> str:
    """Return the lines of a table in C."""
    rows = (numbers[i : i + _PER_LINE] for i in range(0, len(numbers), _PER_LINE))
    return ",\n        ".join(", ".join(map(str, row)) for row in rows)
