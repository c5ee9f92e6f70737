"""Reference values of kernels: the SymPy matrices of a system, evaluated by mpmath with 40 digits."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import mpmath
import numpy as np
import sympy as sp

from symgen.errors import DerivationError
from symgen.symbolic.switch import PieceFunction, PiecewisePolynomial, Sign, as_fraction
from symgen.symbolic.system import System

DIGITS = 40
#: Steps of iterative refinement, each of which gains the digits that the condition leaves of double
#: precision, and number of additional digits of its residuals.
_STEPS, _GUARD = 60, 20


class Exact:
    """Evaluates the matrices of a system at given arrays, shared subexpressions as derived.

    The lowering takes no part: no pruning, no elimination, no rounding of constants.
    """

    def __init__(self, system: System) -> None:
        self.system = system

    def matrix(self, name: str, values: Mapping[str, Any]) -> mpmath.matrix:
        """Return a matrix at the arrays of each group, exact in the given numbers."""
        return self.matrices((name,), values)[0]

    def matrices(self, names: Sequence[str], values: Mapping[str, Any]) -> list[mpmath.matrix]:
        """Return several matrices; their shared subexpressions are evaluated once."""
        matrices = [self.system[name].matrix for name in names]
        with mpmath.workdps(DIGITS):
            known: dict[sp.Basic, Any] = {
                x.symbol: number(value)
                for g in self.system.groups
                for x, value in zip(g.quantities, values[g.name], strict=True)
            }
            for constant in self.system.constants:
                known[constant.quantity.symbol] = _value(constant.expression, known)
            for symbol, expression in self._used(matrices):
                known[symbol] = _value(expression, known)
            results = [mpmath.zeros(*m.shape) for m in matrices]
            for result, m in zip(results, matrices, strict=True):
                for place, entry in m.todok().items():
                    result[place] = _value(entry, known)
            return results

    def _used(self, matrices: Iterable[sp.MatrixBase]) -> list[tuple[sp.Symbol, sp.Expr]]:
        """Return the definitions that matrices need, in their derived form."""
        needed = set[sp.Basic]().union(*(m.free_symbols for m in matrices))
        used = []
        for definition in reversed(self.system.definitions):
            if definition.quantity.symbol in needed:
                needed |= definition.expression.free_symbols
                used.append((definition.quantity.symbol, definition.expression))
        return used[::-1]

    def whole(self, values: Mapping[str, Any]) -> tuple[mpmath.matrix, mpmath.matrix]:
        """Return [M J^T; J 0] and the right-hand side [f; gamma] of the equations of motion."""
        point = self.system.saddle_point
        if point is None:
            raise DerivationError(f"{self.system.name} has no equations of motion to solve")
        mass, jacobian, force, gamma = self.matrices(
            (point.mass, point.jacobian, point.force, point.rhs), values
        )
        n, m = mass.rows, jacobian.rows
        whole = mpmath.zeros(n + m)
        for i in range(n):
            for j in range(n):
                whole[i, j] = mass[i, j]
            for j in range(m):
                whole[i, n + j] = whole[n + j, i] = jacobian[j, i]
        return whole, mpmath.matrix([*force, *gamma])

    def solve(
        self, values: Mapping[str, Any], rhs: mpmath.matrix | None = None, *, redundant: Sequence[int] = ()
    ) -> mpmath.matrix:
        """Solve [M J^T; J 0] x = rhs, by default the system's own; ``redundant`` multipliers are zero."""
        whole, right = self.whole(values)
        coordinates = whole.rows - self.system[self.system.saddle_point.jacobian].matrix.rows  # type: ignore[union-attr]
        left_out = {coordinates + i for i in redundant}
        return solve(whole, right if rhs is None else rhs, left_out)


#: Functions whose names in mpmath differ.
_FUNCTIONS: dict[type, Any] = {
    sp.Abs: abs, Sign: mpmath.sign, sp.Min: min, sp.Max: max, sp.Gt: operator.gt, sp.Ge: operator.ge,
    sp.Lt: operator.lt, sp.Le: operator.le, sp.And: lambda *parts: all(parts),
}  # fmt: skip


def _value(expression: sp.Basic, known: dict[sp.Basic, Any]) -> Any:
    """Return the value of an expression of known symbols, and add those of its parts to ``known``."""
    if expression in known:
        return known[expression]
    parts = expression.args
    if expression.is_Rational:
        value = mpmath.mpf(expression.p) / expression.q
    elif isinstance(expression, sp.Symbol):
        raise DerivationError(f"{expression} has no value")
    elif not parts:
        value = (
            bool(expression) if expression.is_Boolean else mpmath.mpf(str(sp.N(expression, DIGITS + _GUARD)))
        )
    elif isinstance(expression, sp.Piecewise):
        value = next(_value(e, known) for e, condition in parts if _value(condition, known))
    else:
        of_parts = [_value(part, known) for part in parts]
        if isinstance(expression, PiecewisePolynomial):
            value = _value(expression.in_terms, known)
        elif isinstance(expression, PieceFunction):
            found = expression.column(*map(as_fraction, of_parts))
            value = mpmath.mpf(found.numerator) / found.denominator
        elif expression.is_Add:
            value = mpmath.fsum(of_parts)
        elif expression.is_Mul:
            value = mpmath.fprod(of_parts)
        elif expression.is_Pow:
            value = mpmath.power(*of_parts)
        else:
            function = _FUNCTIONS.get(expression.func) or getattr(mpmath, expression.func.__name__)
            value = function(*of_parts)
    known[expression] = value
    return value


def solve(matrix: mpmath.matrix, rhs: mpmath.matrix, left_out: Iterable[int] = ()) -> mpmath.matrix:
    """Solve a square system to 40 digits; the unknowns ``left_out`` are zero and their rows ignored.

    A factorisation in double precision is refined with residuals at 40 digits. If that does not converge,
    the whole solution is computed at 40 digits, which is slow for many unknowns.
    """
    with mpmath.workdps(DIGITS + _GUARD):
        rows = [i for i in range(matrix.rows) if i not in set(left_out)]
        part_solution = _refined(matrix, rhs, rows)
        if part_solution is None:
            part = mpmath.matrix([[matrix[i, j] for j in rows] for i in rows])
            part_solution = list(mpmath.lu_solve(part, mpmath.matrix([rhs[i] for i in rows])))
        solution = mpmath.zeros(matrix.rows, 1)
        for i, x in zip(rows, part_solution, strict=True):
            solution[i] = x
        return solution


def _refined(matrix: mpmath.matrix, rhs: mpmath.matrix, used: list[int]) -> list[mpmath.mpf] | None:
    rows = [[(k, matrix[i, j]) for k, j in enumerate(used) if matrix[i, j]] for i in used]
    rounded = np.array([[float(matrix[i, j]) for j in used] for i in used])
    # Rows and columns of very different units are equilibrated by powers of two.
    scale = np.ones(len(used))
    for _ in range(4):
        size = np.max(np.abs(rounded * np.outer(scale, scale)), axis=1)
        if not np.all(np.isfinite(size)) or np.any(size == 0):
            return None
        scale *= 2.0 ** -np.round(np.log2(size) / 2)
    try:
        inverse = np.linalg.inv(rounded * np.outer(scale, scale)) * np.outer(scale, scale)
    except np.linalg.LinAlgError:
        return None
    x = [mpmath.mpf(0)] * len(used)
    small, last = mpmath.mpf(10) ** -DIGITS, mpmath.inf
    for _ in range(_STEPS):
        left = [rhs[i] - mpmath.fdot((a, x[k]) for k, a in row) for i, row in zip(used, rows, strict=True)]
        size = max((abs(e) for e in left), default=mpmath.mpf(0))
        if not size:
            return x
        _, power = mpmath.frexp(size)
        step = inverse @ np.array([float(mpmath.ldexp(e, -power)) for e in left])
        if not np.all(np.isfinite(step)):
            return None
        moved = [mpmath.ldexp(mpmath.mpf(float(s)), power) for s in step]
        x = [a + b for a, b in zip(x, moved, strict=True)]
        change, size = (max(abs(a) / s for a, s in zip(y, scale, strict=True)) for y in (moved, x))
        if change <= small * size:
            return x
        if change > last:
            return None
        last = change
    return None


def number(value: Any) -> mpmath.mpf:
    """Return the exact value of a floating-point number of any precision."""
    if isinstance(value, mpmath.mpf):
        return value
    head = float(value)
    rest = value - head if isinstance(value, np.longdouble) and np.isfinite(value) else 0.0
    return mpmath.fadd(head, float(rest), exact=True) if rest else mpmath.mpf(head)
