"""Numeric values of derived matrices for given values of their arguments."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
import sympy as sp

from symgen.errors import ModelError
from symgen.report.mathematics.layout import WIDTH, wrapped
from symgen.symbolic.constants import rounded
from symgen.symbolic.notation import readable
from symgen.symbolic.system import Definition, NamedMatrix, System

#: Working digits.
_WORKING = 40
#: Printed digits.
_PRINTED = 12
#: Whole numbers below this are shown with all their digits.
_WHOLE = 1e10
#: Columns that a number takes with the gap before it.
_NUMBER = 19
#: Singular values below this part of the largest are those of redundant constraints.
_RANK = 1e-12
#: Most constants of one kind and value that a list names one by one.
_ALIKE = 3
#: Numbers in the names of such constants.
_DIGITS_OF_NAMES = re.compile(r"\d+")
#: Maximum number of symbols named in an error.
_NAMED = 8


def value_of(constant: Definition) -> str:
    """Return the value of a constant as text: a decimal number, multiples of pi as such, or an expression."""
    value = constant.expression
    if value.is_number and not (constant.quantity.unit == "rad" and value.has(sp.pi)):
        return f"{float(value):.12g}"
    return str(readable(value))


def alike_in_one(constants: Sequence[Definition]) -> list[tuple[str, str, str, str]]:
    """Return name, unit, value and meaning of constants; many numbered ones of one value are one row."""
    groups: dict[tuple[str, ...], list[Definition]] = {}
    for c in constants:
        x = c.quantity
        bare = (_DIGITS_OF_NAMES.sub("#", text) for text in (x.name, x.description))
        groups.setdefault((*bare, x.unit, value_of(c)), []).append(c)
    rows = []
    for (*_, unit, value), group in groups.items():
        first, last = group[0].quantity, group[-1].quantity
        if len(group) > _ALIKE:
            rows.append((f"{first.name}, ..., {last.name}", unit, value, f"{first.description}, ..."))
        else:
            rows += [(c.quantity.name, unit, value, c.quantity.description) for c in group]
    return rows


def in_numbers(
    system: System, matrix: NamedMatrix, values: Mapping[str, float | sp.Expr], label: str, width: int = WIDTH
) -> str:
    """Return a matrix as numbers, one row per line, in blocks of columns; ``label`` names the state.

    Raises
    ------
    ModelError
        If the matrix contains an argument without a value in ``values``.
    """
    numbers = evaluated(system, matrix, values)
    rows = matrix.rows or tuple(str(i + 1) for i in range(numbers.rows))
    names = matrix.columns or tuple(str(j + 1) for j in range(numbers.cols))
    first = max(map(len, rows), default=0)
    count = max(1, (width - first) // _NUMBER)
    lines = wrapped(f"{matrix.name} {label} [{matrix.unit}]", width)
    for k in range(0, numbers.cols, count):
        if matrix.columns or numbers.cols > count:
            lines += wrapped(f"columns: {', '.join(names[k : k + count])}", width)
        for i, row in enumerate(rows):
            line = f"{row:>{first}}  " + "  ".join(f"{float(x): .10e}" for x in numbers[i, k : k + count])
            lines.append(line)
    return "\n".join(lines)


def solution(system: System, values: Mapping[str, float | sp.Expr], label: str) -> str:
    """Return the solution of the square system A x = b of momentum rows, one unknown per line with its unit.

    With redundant constraints it is the one with the least sum of squares.
    """
    a, b = (np.array(evaluated(system, system[m], values).tolist(), dtype=float) for m in ("matrix", "rhs"))
    scale = np.max(np.abs(a), axis=1, keepdims=True)
    x = np.linalg.lstsq(a / scale, b / scale, rcond=_RANK)[0][:, 0]
    unknowns = system.group("x").quantities
    width = max(len(unknown.name) for unknown in unknowns)
    lines = [f"{u.name:>{width}}  {v: .10g} {u.unit}" for u, v in zip(unknowns, x, strict=True)]
    return "\n".join([f"solution x {label}", *lines])


def table_of_numbers(
    title: str, rows: Sequence[str], columns: Sequence[str], values: Sequence[Sequence[float]]
) -> str:
    """Return numbers with the names of their rows and columns, in blocks of columns within ``WIDTH``.

    Without ``columns`` the values are one column.
    """
    width, cell = max(map(len, rows), default=0), max(17, *(len(c) + 1 for c in columns), 0)
    count = max(1, (WIDTH - width) // cell)
    lines = wrapped(title)
    for first in range(0, max(1, len(columns)), count):
        heads = columns[first : first + count]
        lines += ["", " " * width + "".join(f"{c:>{cell}}" for c in heads)] if heads else []
        lines += [
            f"{row:>{width}}" + "".join(f"{x:{cell}{_form(x)}}" for x in entries[first : first + count])
            for row, entries in zip(rows, values, strict=True)
        ]
    return "\n".join(lines)


def _form(x: float) -> str:
    """Return the format of a number in a table: whole numbers have no digits behind the point."""
    return ".0f" if float(x).is_integer() and abs(x) < _WHOLE else ".9e"


def evaluated(
    system: System, matrix: NamedMatrix, values: Mapping[str, float | sp.Expr]
) -> sp.ImmutableMatrix:
    """Return a matrix evaluated at the given argument values [SI], through the shared terms.

    Raises
    ------
    ModelError
        If the matrix contains an argument without a value in ``values``, or is not finite and real.
    """
    numbers = substituted(system, matrix, values)
    missing = sorted(s.name for s in numbers.free_symbols)
    if missing:
        more = ", ..." if len(missing) > _NAMED else ""
        raise ModelError(
            f"{matrix.name} contains symbols without values: {', '.join(missing[:_NAMED])}{more}\n"
            "  Give each with --with NAME=VALUE, in SI units; 'symgen inverse-dynamics' computes the joint "
            "forces of a driven scene."
        )
    for (i, j), x in numbers.todok().items():
        if not (isinstance(x, sp.Number) and x.is_finite):
            place = f"row {matrix.rows[i] if matrix.rows else i + 1}"
            place += f", column {matrix.columns[j] if matrix.columns else j + 1}" if numbers.cols > 1 else ""
            raise ModelError(
                f"{matrix.name} has no finite real value in {place}: a denominator is zero, or a root is that"
                " of a negative number.\n  Give symbols other values with --with NAME=VALUE, in SI units."
            )
    return numbers


def substituted(
    system: System, matrix: NamedMatrix, values: Mapping[str, float | sp.Expr]
) -> sp.ImmutableMatrix:
    """Return a matrix at the given argument values [SI], where entries may lack one or not be finite."""
    exact = {name: x if isinstance(x, sp.Expr) else sp.Rational(x) for name, x in values.items()}
    known = {x.symbol: exact[x.name] for x in system.symbols() if x.name in exact}
    for definition in (*system.constants, *system.definitions):
        if definition.quantity.symbol not in known:
            known[definition.quantity.symbol] = _number(definition.expression.xreplace(known), _WORKING)
    return sp.ImmutableMatrix(matrix.matrix.applyfunc(lambda e: _number(e.xreplace(known), _PRINTED)))


def _number(expression: sp.Expr, digits: int) -> sp.Expr:
    """Return the value of an expression, or the expression itself if an argument has no value."""
    return rounded(expression, digits) if expression.is_number else expression
