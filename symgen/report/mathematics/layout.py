"""Matrices and expressions as text within the width of a terminal or a page."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from unicodedata import combining

import sympy as sp
from sympy.printing.pretty.stringpict import prettyForm

from symgen.symbolic.notation import pretty, pretty_entries, text, text_name
from symgen.symbolic.system import NamedMatrix

#: Width of lines where the output is not a terminal.
WIDTH = 100
#: Character columns between the columns of a matrix.
_GAP = 2
#: Character columns of both brackets together.
_BRACKETS = 2
#: Most character columns of the names of rows beside a matrix.
_LABEL = 24
#: Places of an expression at which its line may be broken if there is no blank.
_BREAKS = re.compile(r"(?<=[⋅,(/])|(?<=[^*]\*)(?!\*)")


def columns(line: str) -> int:
    """Return the number of columns that a line takes on a terminal."""
    return sum(not combining(c) for c in line)


def heading(m: NamedMatrix, width: int = WIDTH) -> list[str]:
    """Return name, description, unit and source of a matrix as lines."""
    return wrapped(f"{m.name}: {m.description} [{m.unit}]{f'; {m.source}' if m.source else ''}", width)


def in_lines(m: NamedMatrix, width: int = WIDTH) -> Iterator[str]:
    """Yield a matrix as lines: whole, in blocks of columns, or as a list of its entries.

    Names of rows stand beside them, those of columns follow; or both stand with each entry.
    """
    matrix = m.matrix
    if 0 in matrix.shape:
        yield f"  {matrix.rows} x {matrix.cols}"
        return
    if matrix.shape == (1, 1):
        whole = pretty(m.equation).splitlines()
        yield from whole if _fits(whole, width) else wrapped(text(m.equation), width)
        return
    if m.left is not None and not m.lefts:
        yield from (*wrapped(f"{text(m.left)} =", width), "")
    forms = pretty_entries(matrix)
    labels = tuple(f"{text(x)} =" for x in m.lefts) or (m.rows if matrix.rows > 1 else ())
    beside = max(map(columns, labels), default=0)
    if beside > _LABEL:
        beside = 0
    margin = beside + _GAP if beside else 0
    blocks = [*_blocks(forms, width - margin)]
    if not blocks:
        yield from _entries(m, width)
        return
    for first, last in blocks:
        if len(blocks) > 1:
            names = m.columns[first:last] if m.columns else [str(j + 1) for j in range(first, last)]
            yield from wrapped(f"columns: {', '.join(names)}", width)
        at = dict(zip(_baselines(forms, first, last), labels, strict=False)) if beside else {}
        for i, line in enumerate(pretty(matrix[:, first:last]).splitlines()):
            label = at.get(i, "")
            yield f"{label}{' ' * (margin - columns(label))}{line}"
    if labels and not beside:
        yield from wrapped(f"rows: {', '.join(labels)}", width)
    if len(m.columns) > 1 and len(blocks) == 1:
        yield from wrapped(f"columns: {', '.join(m.columns)}", width)


def _baselines(forms: Sequence[Sequence[prettyForm]], first: int, last: int) -> Iterator[int]:
    """Yield the line of each row in a block of columns."""
    start = 0
    for row in forms:
        above = max(form.baseline for form in row[first:last])
        yield start + above
        start += above + max(form.height() - form.baseline for form in row[first:last]) + 1


def _blocks(forms: Sequence[Sequence[prettyForm]], width: int) -> Iterator[tuple[int, int]]:
    """Yield first and last column, exclusive, of blocks within a width; nothing if a column is wider."""
    widths = [max(form.width() for form in column) for column in zip(*forms, strict=True)]
    if max(widths) + _BRACKETS > width:
        return
    starts, used = [0], _BRACKETS - _GAP
    for j, own in enumerate(widths):
        if used + _GAP + own > width:
            starts.append(j)
            used = _BRACKETS - _GAP
        used += _GAP + own
    yield from pairwise([*starts, len(widths)])


def _entries(m: NamedMatrix, width: int) -> Iterator[str]:
    """Yield the entries of a matrix, but for zeros, with the names of row and column.

    Of a symmetric matrix, those on and above the diagonal are yielded.
    """
    for i in range(m.matrix.rows):
        for j in range(i if m.symmetric else 0, m.matrix.cols):
            if m.matrix[i, j] != 0:
                place = [m.rows[i] if m.rows else str(i + 1)]
                if m.matrix.cols > 1:
                    place.append(m.columns[j] if m.columns else str(j + 1))
                label = f"{text(m.lefts[i])} =" if m.lefts else f"{', '.join(place)}:"
                yield from wrapped(f"  {label} {text(m.matrix[i, j])}", width, "      ")
    if m.symmetric:
        yield "  entries below the diagonal: as above it (symmetric)"
    if any(x == 0 for x in m.matrix):
        yield "  all other entries: 0"


def defined(symbol: sp.Symbol, expression: sp.Expr, width: int = WIDTH) -> list[str]:
    """Return the definition of a shared term as lines."""
    return wrapped(f"  {text_name(symbol.name)} = {text(expression)}", width, "      ")


def wrapped(line: str, width: int = WIDTH, indent: str = "    ", *, inside: bool = True) -> list[str]:
    """Return a line as lines within a width, broken at blanks, or else ``inside`` products and arguments.

    Lines after the first begin with ``indent``.
    """
    if columns(line) <= width:
        return [line]
    lead = line[: len(line) - len(line.lstrip(" "))]
    lines, current = [], lead
    for word in line.split():
        blank = " " if current.strip() else ""
        if columns(current + blank + word) <= width:
            current += blank + word
            continue
        if current.strip():
            lines.append(current)
            current = indent
        for part in _BREAKS.split(word) if inside and columns(indent + word) > width else [word]:
            if current.strip() and columns(current + part) > width:
                lines.append(current)
                current = indent
            current += part
    return [*lines, current]


def _fits(lines: Sequence[str], width: int) -> bool:
    return all(columns(line) <= width for line in lines)
