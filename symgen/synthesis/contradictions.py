"""Prescribed quantities that no linkage has, shown by linear relations that exclude each other."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import sympy as sp
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Least margin by which strict relations hold together: rounding of the given values.
_MARGIN = 1e-9
_SIGNS = {
    sp.StrictLessThan: "<",
    sp.LessThan: "<=",
    sp.StrictGreaterThan: ">",
    sp.GreaterThan: ">=",
    sp.Eq: "=",
}


class _Row(NamedTuple):
    """The relation coefficients @ x + constant > 0, >= 0 or = 0, and its text."""

    coefficients: Array
    constant: float
    sign: str
    text: str


def contradiction(
    quantities: tuple[tuple[str, str, str], ...],
    necessary: Callable[[dict[str, sp.Symbol]], list[sp.Rel]],
    prescribed: dict[str, tuple[float, float]],
) -> str:
    """Return relations that exclude each other in the given ranges; empty where a linear program meets all.

    None of those returned can be omitted.
    """
    x = {name: sp.Symbol(name, real=True) for name, _, _ in quantities}
    rows = [*_rows(x, necessary(x), prescribed)]
    bounds = [prescribed.get(name, (None, None)) for name in x]
    if _hold(rows, bounds):
        return ""
    for row in [*rows]:
        fewer = [other for other in rows if other is not row]
        if not _hold(fewer, bounds):
            rows = fewer
    return "; ".join(row.text for row in rows)


def _rows(
    x: dict[str, sp.Symbol], relations: list[sp.Rel], prescribed: dict[str, tuple[float, float]]
) -> Iterator[_Row]:
    """Yield the relations that are linear at a given time ratio."""
    ratio = {x[name]: low for name, (low, high) in prescribed.items() if name == "time_ratio" and low == high}
    nowhere = dict.fromkeys(x.values(), 0)
    for relation in relations:
        sign = _SIGNS[type(relation)]
        more = relation.rhs - relation.lhs if "<" in sign else relation.lhs - relation.rhs
        slopes = [more.subs(ratio).diff(symbol) for symbol in x.values()]
        if all(slope.is_number for slope in slopes):
            constant = float(more.subs(ratio).subs(nowhere))
            text = f"{relation.lhs} {sign} {relation.rhs}"
            yield _Row(np.array([float(slope) for slope in slopes]), constant, sign.replace("<", ">"), text)


def _hold(rows: list[_Row], bounds: list[tuple[Any, Any]]) -> bool:
    """Return whether relations hold together, the strict ones by a margin."""
    from scipy.optimize import linprog

    if not rows:
        return True
    strict = np.array([row.sign == ">" for row in rows])
    equal = np.array([row.sign == "=" for row in rows])
    matrix = np.array([row.coefficients for row in rows])
    constants = np.array([row.constant for row in rows])
    least = np.column_stack([-matrix, strict.astype(float)])
    solution = linprog(
        [*np.zeros(matrix.shape[1]), -1.0],
        A_ub=least[~equal], b_ub=constants[~equal],
        A_eq=-least[equal] if equal.any() else None, b_eq=-constants[equal] if equal.any() else None,
        bounds=[*bounds, (None, 1.0)],
    )  # fmt: skip
    return bool(solution.status != 2 and (solution.x is None or solution.x[-1] > _MARGIN))
