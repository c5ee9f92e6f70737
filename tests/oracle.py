"""The truth for kernels: the original SymPy matrices, evaluated with mpmath at 30 digits or more."""

from __future__ import annotations

import mpmath
import numpy as np
import sympy as sp

from symgen.symbolic.system import System

DIGITS = 30


class Oracle:
    """Evaluates the matrices of a system at given argument arrays, shared subexpressions as derived."""

    def __init__(self, system: System, digits: int = DIGITS) -> None:
        self.system, self.digits = system, digits
        self.symbols = [x.symbol for g in system.groups for x in g.quantities]
        self._functions: dict[str, object] = {}

    def matrix(self, name: str, values: dict[str, np.ndarray]) -> mpmath.matrix:
        """Return a matrix at the arrays of each group, exact in the given doubles."""
        if name not in self._functions:
            matrix = sp.Matrix(self.system[name].matrix)
            shared = self._used(matrix)
            self._functions[name] = sp.lambdify(
                self.symbols, matrix, modules="mpmath", cse=lambda e: (shared, e)
            )
        with mpmath.workdps(self.digits):
            arguments = [mpmath.mpf(float(x)) for g in self.system.groups for x in values[g.name]]
            return mpmath.matrix(self._functions[name](*arguments))

    def _used(self, matrix: sp.Matrix) -> list[tuple[sp.Symbol, sp.Expr]]:
        """The definitions that a matrix needs, as the derivation gave them."""
        needed, found = set(matrix.free_symbols), []
        for definition in reversed(self.system.definitions):
            if definition.quantity.symbol in needed:
                needed |= definition.expression.free_symbols
                found.append((definition.quantity.symbol, definition.expression))
        return found[::-1]

    def solve(self, values: dict[str, np.ndarray], rhs: mpmath.matrix | None = None) -> mpmath.matrix:
        """Solve [M J^T; J 0] x = rhs; by default with the system's own right-hand side."""
        point = self.system.saddle_point
        with mpmath.workdps(self.digits):
            mass, jacobian = (self.matrix(n, values) for n in (point.mass, point.jacobian))
            n, m = mass.rows, jacobian.rows
            whole = mpmath.zeros(n + m)
            for i in range(n):
                for j in range(n):
                    whole[i, j] = mass[i, j]
                for j in range(m):
                    whole[i, n + j] = whole[n + j, i] = jacobian[j, i]
            if rhs is None:
                force, gamma = (self.matrix(k, values) for k in (point.force, point.rhs))
                rhs = mpmath.matrix([*force, *gamma])
            return mpmath.lu_solve(whole, rhs)


def relative_error(found: np.ndarray, exact: mpmath.matrix) -> float:
    """Return the largest error over the largest entry (over one when all are zero)."""
    with mpmath.workdps(DIGITS):
        exact_entries = list(exact)
        size = max((abs(x) for x in exact_entries), default=mpmath.mpf(0)) or mpmath.mpf(1)
        return float(
            max(
                (abs(mpmath.mpf(float(f)) - x) / size for f, x in zip(found, exact_entries, strict=True)),
                default=0,
            )
        )
