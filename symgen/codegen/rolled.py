"""Large kernels as loops: statements that repeat from body to body are printed once.

The code of a straight-line kernel grows with the number of bodies, and compilers need more than proportional
time for it. A mechanism of many bodies repeats the same statements: the rows of a constraint, the pivots
and entries of a factor. Where a sequence of statements repeats, as along a row of equal linkages, it becomes
the body of a loop, in which evenly spaced indices are computed and values of one repeat are local. All other
statements are grouped by their expression, which is printed once, as a loop over a table of indices.
Values, pivots and rank checks are those of the straight-line code, to the last bit.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symgen.codegen.printers import Printer
from symgen.codegen.tables import Case, Cases, Place, Repetition, Statement, Tables
from symgen.codegen.target import Target
from symgen.lowering.expressions import ZERO, Node, Reference, Sum
from symgen.lowering.kernel import Kernel, Program, Store

#: Statements of a program, without stores of zeros, above which its kernels become loops, and the least
#: number of statements of such a kernel. Straight-line code is faster, but its compilation takes seconds for
#: every ten thousand statements.
STRAIGHT, LEAST = 15_000, 500
#: Number of operations of a kernel that count as one statement.
PER_STATEMENT = 4
#: Least repeats, and statements in all of them, of a sequence that becomes a loop of its own.
REPEATS, REPEATED = 8, 256
#: Sequences that repeat are looked for where this many statements occur again; number of lengths tried.
_WINDOW, _LENGTHS = 16, 8
#: Number of terms above which a sum becomes a statement per term.
_TERMS = 16
#: The template of such kernels.
ROLLED = "c/rolled.c.j2"
#: Numbers per line of a table.
_PER_LINE = 24


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


def statements_of(program: Program) -> dict[str, int]:
    """Return the number of statements of every kernel, without stores of zeros."""
    return {k.name: len(k.assignments) + sum(s.value != ZERO for s in k.stores) for k in program.kernels}


def large(program: Program, target: Target) -> frozenset[str]:
    """Return the kernels that become loops; kernels in lanes remain straight-line code."""
    if target.language != "c" or target.lanes:
        return frozenset()
    statements = statements_of(program)
    least = LEAST if sum(statements.values()) > STRAIGHT else math.inf

    def size(kernel: Kernel) -> int:
        called = sum(k.counts.flops for k in kernel.first + kernel.then)
        return max(statements[kernel.name], (kernel.counts.flops - called) // PER_STATEMENT)

    return frozenset(k.name for k in program.kernels if k.is_sparse or size(k) > least)


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
    cases = Cases(printer)
    statements: list[Statement] = []
    defined: dict[str, int] = {}
    read: dict[Place, list[int]] = {}

    def state(target: Place, value: Node) -> None:
        case, operands = cases.number(target, value)
        waits = {defined[name] for name, index in operands if index is None}
        if target[1] is None:
            defined[target[0]] = len(statements)
        else:
            waits.update(read.get(target, ()))
        for place in operands:
            if place[0] in ("work", "out"):
                read.setdefault(place, []).append(len(statements))
        statements.append(Statement(case, target, operands, waits))

    def write(target: Place, value: Node) -> None:
        if isinstance(value, Sum) and len(value.terms) > _TERMS:
            # From left to right, as the sum is evaluated.
            total, *others = value.terms
            for term in others[:-1]:
                partial = f"{len(statements)} partial"
                state((partial, None), Sum((total, term)))
                total = Reference(partial)
            value = Sum((total, others[-1]))
        state(target, value)

    for assignment, stores in zip(kernel.assignments, early, strict=True):
        write((assignment.target, None), assignment.value)
        for store in stores:
            write((store.array, store.index), store.value)
    waited = len(statements)
    for store in late:
        write((store.array, store.index), store.value)
    order: Sequence[int] = range(len(statements))
    blocks = _blocks([s.case for s in statements])
    if 2 * sum(b.length * b.repeats for b in blocks) < len(statements):
        order = [*_order(statements[:waited]), *range(waited, len(statements))]
        blocks = _blocks([statements[i].case for i in order])
    tables = Tables(cases, [statements[i] for i in order], blocks)
    constants = [printer.literal(text, printer.precision) for text in cases.constants]
    return Rolled(
        cases=tuple(tables.cases),
        runs=_lines([f"{{{case}, {rows}}}" for case, rows in tables.runs]),
        count=len(tables.runs),
        places=_lines(tables.numbers or [0]),
        constants=_lines(constants or ["0"]),
        values=max(1, tables.values),
        zeros=kernel.out_size if kernel.is_sparse else 0,
    )


def _order(statements: Sequence[Statement]) -> list[int]:
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


def _blocks(cases: Sequence[int]) -> list[Repetition]:
    """Return the sequences of cases that repeat, in order and without overlap."""
    last: dict[tuple[int, ...], int] = {}
    distances: Counter[int] = Counter()
    for i in range(len(cases) - _WINDOW):
        window = tuple(cases[i : i + _WINDOW])
        if window in last:
            distances[i - last[window]] += 1
        last[window] = i
    n, numbers = len(cases), np.array(cases)
    best, length = np.zeros(n, dtype=int), np.zeros(n, dtype=int)
    for distance, _ in sorted(distances.most_common(_LENGTHS)):
        ends = np.append(np.flatnonzero(numbers[:-distance] != numbers[distance:]), n - distance)
        equal = ends[np.searchsorted(ends, np.arange(n - distance))] - np.arange(n - distance)
        repeats = equal // distance + 1
        covered = np.where((repeats >= REPEATS) & (repeats * distance >= REPEATED), repeats * distance, 0)
        better = np.flatnonzero(covered > best[: n - distance])
        best[better], length[better] = covered[better], distance
    blocks, at = [], 0
    starts = np.flatnonzero(best)
    while (i := int(np.searchsorted(starts, at))) < len(starts):
        first = int(starts[i])
        blocks.append(Repetition(first, int(length[first]), int(best[first] // length[first])))
        at = first + int(best[first])
    return blocks


def _lines(numbers: Sequence[int | str]) -> str:
    """Return the lines of a table in C."""
    rows = (numbers[i : i + _PER_LINE] for i in range(0, len(numbers), _PER_LINE))
    return ",\n        ".join(", ".join(map(str, row)) for row in rows)
