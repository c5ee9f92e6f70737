"""Numeric values of derived matrices for given values of their arguments."""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from symgen.errors import ModelError
from symgen.symbolic.constants import rounded
from symgen.symbolic.system import NamedMatrix, System

#: Working digits and retained digits.
_WORKING, _PRINTED = 40, 12
#: Maximum number of symbols named in an error.
_NAMED = 8


def in_numbers(system: System, matrix: NamedMatrix, values: Mapping[str, float], label: str) -> str:
    """Return a matrix as numbers, one row per line; ``label`` names the state.

    Raises
    ------
    ModelError
        If the matrix contains an argument without a value in ``values``.
    """
    numbers = evaluated(system, matrix, values)
    rows = matrix.rows or tuple(str(i) for i in range(numbers.rows))
    width = max(map(len, rows))
    lines = [
        f"{row:>{width}}  " + "  ".join(f"{float(x): .10e}" for x in numbers[i, :])
        for i, row in enumerate(rows)
    ]
    columns = [f"columns: {', '.join(matrix.columns)}"] if matrix.columns else []
    return "\n".join([f"{matrix.name} {label} [{matrix.unit}]", *columns, *lines])


def evaluated(system: System, matrix: NamedMatrix, values: Mapping[str, float]) -> sp.ImmutableMatrix:
    """Return a matrix evaluated at the given argument values [SI], through the shared terms.

    Raises
    ------
    ModelError
        If the matrix contains an argument without a value in ``values``.
    """
    known = {
        x.symbol: sp.Rational(values[x.name])
        for group in system.groups
        for x in group.quantities
        if x.name in values
    }
    for definition in system.definitions:
        known[definition.quantity.symbol] = _number(definition.expression.xreplace(known), _WORKING)
    numbers = matrix.matrix.applyfunc(lambda e: _number(e.xreplace(known), _PRINTED))
    missing = sorted(s.name for s in numbers.free_symbols)
    if missing:
        more = ", ..." if len(missing) > _NAMED else ""
        raise ModelError(
            f"{matrix.name} contains symbols without values: {', '.join(missing[:_NAMED])}{more}\n"
            "  Give each with --with NAME=NUMBER, in SI units."
        )
    return numbers


def _number(expression: sp.Expr, digits: int) -> sp.Expr:
    """Return the value of an expression, or the expression itself if an argument has no value."""
    return rounded(expression, digits) if expression.is_number else expression
