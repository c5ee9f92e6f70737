"""Derived matrices as numbers, at values of their arguments."""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from symgen.errors import ModelError
from symgen.symbolic.system import NamedMatrix, System

#: Digits that are computed with, and that are kept.
_WORKING, _KEPT = 17, 12
#: Symbols named in an error.
_NAMED = 8


def in_numbers(system: System, matrix: NamedMatrix, values: Mapping[str, float], label: str) -> str:
    """Return a matrix as numbers, a row a line; ``label`` says at what state.

    Raises
    ------
    ModelError
        When it holds an argument that ``values`` do not give.
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
    """Return a matrix with every argument at its value [SI], through the shared terms.

    Raises
    ------
    ModelError
        When it holds an argument that ``values`` do not give.
    """
    known = {
        x.symbol: sp.Float(values[x.name], _WORKING)
        for group in system.groups
        for x in group.quantities
        if x.name in values
    }
    for definition in system.definitions:
        known[definition.quantity.symbol] = definition.expression.xreplace(known).evalf(_WORKING)
    numbers = matrix.matrix.xreplace(known).evalf(_KEPT)
    missing = sorted(s.name for s in numbers.free_symbols)
    if missing:
        more = ", ..." if len(missing) > _NAMED else ""
        raise ModelError(
            f"{matrix.name} holds unknowns: {', '.join(missing[:_NAMED])}{more}\n"
            "  Give each with --with NAME=NUMBER, in SI units."
        )
    return numbers
