"""Matrices, symbols and shared terms on a page: as mathematics if short, as sparsity pattern if large."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import sympy as sp
from markupsafe import Markup

from symgen.report.mathematics.equations import displayed
from symgen.report.mathematics.numbers import value_of
from symgen.report.mathematics.python import in_python
from symgen.symbolic.notation import mathml, mathml_name
from symgen.symbolic.quantity import Quantity
from symgen.symbolic.system import Definition, NamedMatrix, SaddlePoint, System

#: Most characters of a matrix shown as a whole.
_WHOLE = 1100
#: Most characters of an entry.
_ENTRY = 700
#: Most characters of all entries of a list together.
_LIST = 5000
#: Maximum number of entries of a matrix shown as a whole: beyond, zeros would fill the page.
_CELLS = 100
#: Digits of constants on a page.
DIGITS = 6


@dataclass(frozen=True, slots=True)
class MatrixPattern:
    """Nonzero entries (row, column) of a matrix; ``fill`` are those added by elimination."""

    rows: int
    columns: int
    cells: tuple[tuple[int, int], ...]
    fill: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True, slots=True)
class EntryView:
    """One entry: its row and column names, and its mathematics, which is empty if too long."""

    place: str
    math: Markup


@dataclass(frozen=True, slots=True)
class MatrixView:
    """A matrix on a page: ``math`` as a whole, or ``pattern`` with some ``entries``.

    ``latex`` and ``python`` are for the clipboard, and empty for a matrix that is too long.
    """

    name: str
    about: str
    unit: str
    shape: str
    math: Markup
    pattern: MatrixPattern | None
    entries: tuple[EntryView, ...]
    more: int
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    latex: str
    python: str
    source: str


@dataclass(frozen=True, slots=True)
class SymbolView:
    """A symbol with its meaning; ``expression`` if it is defined by one."""

    name: str
    math: Markup
    unit: str
    about: str
    expression: Markup | None = None


def matrix_view(matrix: NamedMatrix) -> MatrixView:
    """Return a matrix as a whole if it is short, else its pattern and first entries."""
    m = matrix.matrix.applyfunc(shown)
    texts = {(i, j): len(str(m[i, j])) for i in range(m.rows) for j in range(m.cols) if m[i, j] != 0}
    whole = m.rows * m.cols <= _CELLS and sum(texts.values()) <= _WHOLE
    entries: list[EntryView] = []
    if not whole:
        room = _LIST
        for place, length in texts.items():
            room -= min(length, _ENTRY)
            if room < 0:
                break
            entries.append(EntryView(_place(matrix, *place), _entry(m[place], length)))
    copied = sum(texts.values()) <= _LIST
    return MatrixView(
        name=matrix.name,
        about=matrix.description,
        unit=matrix.unit,
        shape="" if matrix.in_letters else f"{m.rows} × {m.cols}",
        math=_math(replace(matrix, matrix=m).equation) if whole else Markup(),
        pattern=None if whole or min(m.shape) == 1 else MatrixPattern(m.rows, m.cols, tuple(texts)),
        entries=tuple(entries),
        more=0 if whole else len(texts) - len(entries),
        rows=matrix.rows if m.rows > 1 else (),
        columns=matrix.columns if m.cols > 1 else (),
        latex="\n".join(displayed(matrix)) if copied else "",
        python=in_python(matrix) if copied else "",
        source=matrix.source,
    )


def _entry(expression: sp.Expr, length: int) -> Markup:
    return _math(expression) if length <= _ENTRY else Markup()


def _place(matrix: NamedMatrix, row: int, column: int) -> str:
    names = [matrix.rows[row] if matrix.rows else str(row + 1)]
    if matrix.matrix.cols > 1:
        names.append(matrix.columns[column] if matrix.columns else str(column + 1))
    return ", ".join(names)


def shown(expression: sp.Expr) -> sp.Expr:
    """Return an expression with long constants rounded for the page."""
    long = {
        number: sp.Float(number, DIGITS)
        for number in expression.atoms(sp.Rational)
        if len(str(number.p)) > DIGITS or len(str(number.q)) > DIGITS
    }
    return expression.xreplace(long) if long else expression


def _math(expression: sp.Basic | sp.MatrixBase) -> Markup:
    return Markup(mathml(expression))  # noqa: S704 - names are escaped by the printer


def symbols(systems: Sequence[System]) -> dict[str, tuple[SymbolView, ...]]:
    """Return every argument of the systems once, by group, and the constants with their values.

    A letter of a whole vector or matrix may stand for another one in another system.
    """
    views: dict[str, tuple[SymbolView, ...]] = {}
    known: set[str] = set()
    for system in systems:
        for group in system.groups:
            names = {x: x.name if x.symbol.is_commutative else x.description for x in group.quantities}
            new = [x for x, name in names.items() if name not in known]
            known |= {names[x] for x in new}
            if new:
                head = f"{group.name}: {group.description}"
                views[head] = (*views.get(head, ()), *map(_symbol, new))
        constants = [c for c in system.constants if c.quantity.name not in known]
        known |= {c.quantity.name for c in constants}
        if constants:
            head = "constants of the scene"
            views[head] = (*views.get(head, ()), *map(_constant, constants))
    return views


def _constant(constant: Definition) -> SymbolView:
    view = _symbol(constant.quantity)
    return replace(view, about=f"{view.about} = {value_of(constant)}")


def _symbol(x: Quantity) -> SymbolView:
    return SymbolView(x.name, Markup(mathml_name(x.name)), x.unit, x.description)  # noqa: S704


def shared_terms(systems: Sequence[System], limit: int) -> tuple[tuple[SymbolView, ...], int]:
    """Return the first shared terms named in derivations, without repetition, and the number omitted."""
    every = {d.quantity.name: d for system in systems for d in system.definitions}
    views = tuple(
        replace(_symbol(d.quantity), expression=_entry(shown(d.expression), len(str(d.expression))))
        for d in islice(every.values(), limit)
    )
    return views, len(every) - len(views)


def elimination(system: System, point: SaddlePoint) -> tuple[MatrixPattern, int]:
    """Return the pattern of [M J^T; J 0] in elimination order, and the number of entries of its factor."""
    masses, jacobian = system[point.mass].matrix, system[point.jacobian].matrix
    n, m = masses.rows, jacobian.rows
    near: list[set[int]] = [set() for _ in range(n + m)]
    for i, j in _nonzero(masses):
        near[i].add(j)
    for i, j in _nonzero(jacobian):
        near[n + i].add(j)
        near[j].add(n + i)
    at = {unknown: k for k, unknown in enumerate(point.order)}
    return _eliminated([{at[j] for j in near[unknown]} for unknown in point.order])


def _nonzero(matrix: sp.MatrixBase) -> Iterable[tuple[int, int]]:
    return ((i, j) for i in range(matrix.rows) for j in range(matrix.cols) if matrix[i, j] != 0)


def _eliminated(near: Sequence[set[int]]) -> tuple[MatrixPattern, int]:
    """Eliminate the unknowns in order, updating the later unknowns coupled to each."""
    cells = {(i, j) for i, row in enumerate(near) for j in row} | {(i, i) for i in range(len(near))}
    known = set(cells)
    behind = [sorted(j for j in row if j > i) for i, row in enumerate(near)]
    grown = [set(row) for row in behind]
    for i in range(len(near)):
        for a in grown[i]:
            grown[a] |= {b for b in grown[i] if b > a}
            known |= {(a, b) for b in grown[i]} | {(b, a) for b in grown[i]}
    factor = sum(len(row) for row in grown) + len(near)
    size = len(near)
    return MatrixPattern(size, size, tuple(sorted(cells)), tuple(sorted(known - cells))), factor
