"""Matrices, symbols and shared terms as a page shows them: mathematics where short, structure where large."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import sympy as sp
from markupsafe import Markup

from symgen.symbolic.notation import mathml, mathml_name
from symgen.symbolic.quantity import Quantity
from symgen.symbolic.system import NamedMatrix, SaddlePoint, System

#: Letters of an expression, as text, up to which a matrix is written as one, an entry is written at all, and
#: all entries of a list together.
_WHOLE, _ENTRY, _LIST = 1100, 700, 5000
#: Entries of a matrix written out as one: beyond, zeros fill the page.
_CELLS = 100
#: Digits of the constants that a page shows.
DIGITS = 6


@dataclass(frozen=True, slots=True)
class Pattern:
    """Which entries of a matrix are not zero, (row, column) each; ``fill`` are those that elimination adds.

    ``split`` is where the second block of rows and columns begins, 0 where there is none.
    """

    rows: int
    columns: int
    cells: tuple[tuple[int, int], ...]
    fill: tuple[tuple[int, int], ...] = ()
    split: int = 0


@dataclass(frozen=True, slots=True)
class EntryView:
    """One entry: what its row and column are called, and its mathematics; empty where it is too long."""

    place: str
    math: Markup


@dataclass(frozen=True, slots=True)
class MatrixView:
    """A matrix as a page shows it: ``math`` as a whole, or ``pattern`` with some ``entries``."""

    name: str
    about: str
    unit: str
    shape: str
    math: Markup
    pattern: Pattern | None
    entries: tuple[EntryView, ...]
    more: int
    rows: tuple[str, ...]
    columns: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class SymbolView:
    """A symbol with its meaning; ``expression`` where it stands for one."""

    name: str
    math: Markup
    unit: str
    about: str
    expression: Markup | None = None


def matrix_view(matrix: NamedMatrix) -> MatrixView:
    """Return a matrix whole where it is short, else its structure and its first entries."""
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
    alone = m.shape == (1, 1)
    return MatrixView(
        name=matrix.name,
        about=matrix.description,
        unit=matrix.unit,
        shape=f"{m.rows} × {m.cols}",
        math=_math(m[0, 0] if alone else m) if whole else Markup(),
        pattern=None if whole or min(m.shape) == 1 else Pattern(m.rows, m.cols, tuple(texts)),
        entries=tuple(entries),
        more=0 if whole else len(texts) - len(entries),
        rows=matrix.rows if m.rows > 1 else (),
        columns=matrix.columns if m.cols > 1 else (),
    )


def _entry(expression: sp.Expr, length: int) -> Markup:
    return _math(expression) if length <= _ENTRY else Markup()


def _place(matrix: NamedMatrix, row: int, column: int) -> str:
    names = [matrix.rows[row] if matrix.rows else str(row + 1)]
    if matrix.matrix.cols > 1:
        names.append(matrix.columns[column] if matrix.columns else str(column + 1))
    return ", ".join(names)


def shown(expression: sp.Expr) -> sp.Expr:
    """Return an expression with long constants rounded to the digits that a page shows."""
    long = {
        number: sp.Float(number, DIGITS)
        for number in expression.atoms(sp.Rational)
        if len(str(number.p)) > DIGITS or len(str(number.q)) > DIGITS
    }
    return expression.xreplace(long) if long else expression


def _math(expression: sp.Basic | sp.MatrixBase) -> Markup:
    return Markup(mathml(expression))  # noqa: S704 - names are escaped by the printer


def symbols(systems: Sequence[System]) -> dict[str, tuple[SymbolView, ...]]:
    """Return every argument of some systems once, by the group it stands in."""
    found: dict[str, tuple[SymbolView, ...]] = {}
    known: set[str] = set()
    for system in systems:
        for group in system.groups:
            new = [x for x in group.quantities if x.name not in known]
            known |= {x.name for x in new}
            if new:
                head = f"{group.name}: {group.description}"
                found[head] = (*found.get(head, ()), *map(_symbol, new))
    return found


def _symbol(x: Quantity) -> SymbolView:
    return SymbolView(x.name, Markup(mathml_name(x.name)), x.unit, x.description)  # noqa: S704


def shared_terms(systems: Sequence[System], limit: int) -> tuple[tuple[SymbolView, ...], int]:
    """Return the first shared terms that derivations name, each once, and how many more there are."""
    every = {d.quantity.name: d for system in systems for d in system.definitions}
    views = tuple(
        replace(_symbol(d.quantity), expression=_entry(shown(d.expression), len(str(d.expression))))
        for d in islice(every.values(), limit)
    )
    return views, len(every) - len(views)


def elimination(system: System, point: SaddlePoint) -> tuple[Pattern, int]:
    """Return the structure of [M J^T; J 0] in the order of its elimination, and the entries of its factor."""
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


def _eliminated(near: Sequence[set[int]]) -> tuple[Pattern, int]:
    """Eliminate unknown by unknown, each from those behind it that it stands with."""
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
    return Pattern(size, size, tuple(sorted(cells)), tuple(sorted(known - cells))), factor
