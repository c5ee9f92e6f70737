"""Motions that constraints allow: J R = 0, with the first and the second rate of R.

The thesis on kineto-elasto-dynamics condenses inextensible links by R, Eqs. (E.40)-(E.47), without its rates.
"""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from symgen.symbolic.names import Names

#: Names of R and its rates, with their units.
BASIS = (("condensation", "1"), ("condensation_rate", "1/s"), ("condensation_second_rate", "1/s^2"))


def allowed_motions(
    rates: Sequence[sp.ImmutableMatrix], pivots: Sequence[tuple[int, int]], names: Names
) -> list[sp.ImmutableMatrix]:
    """Return R, R' and R'' of S = R p, where p are the unknowns without pivot, in their order.

    Parameters
    ----------
    rates
        J, J' and J'' of the constraints J S = 0.
    pivots
        Row and column of J for each dependent unknown, in the order of elimination.
    names
        Collector of the entries of the inverse.
    """
    jacobian, rate, second_rate = rates
    dependent = [j for _, j in pivots]
    free = [j for j in range(jacobian.cols) if j not in dependent]
    rows = [i for i, _ in pivots]
    scale = sp.diag(*(_denominator(jacobian.row(i)) for i in rows))
    jacobian, rate, second_rate = (scale * m.extract(rows, list(range(m.cols))) for m in rates)
    jacobian, rate, second_rate = (m.applyfunc(sp.cancel) for m in (jacobian, rate, second_rate))
    inverse = _inverse(jacobian.extract(list(range(len(rows))), dependent), names)
    basis: list[sp.MatrixBase] = []
    for order, (name, unit) in enumerate(BASIS):
        if order == 0:
            right = jacobian.extract(list(range(jacobian.rows)), free)
        else:
            right = rate * basis[0] if order == 1 else second_rate * basis[0] + 2 * rate * basis[1]
        solved = -inverse * right
        whole = sp.zeros(jacobian.cols, len(free))
        for k, j in enumerate(free):
            whole[j, k] = sp.Integer(order == 0)
        for i, j in enumerate(dependent):
            for k in range(len(free)):
                about = "displacement of a dependent unknown by an independent one"
                whole[j, k] = names.scalar(f"{name}_{j + 1}_{k + 1}", solved[i, k], unit, about)
        basis.append(whole)
    return [sp.ImmutableMatrix(m) for m in basis]


def _denominator(row: sp.MatrixBase) -> sp.Expr:
    """Return the common denominator of a row, such as the length of a link; any factor leaves J R = 0."""
    return sp.lcm_list([sp.fraction(sp.together(e))[1] for e in row])


def _inverse(matrix: sp.MatrixBase, names: Names) -> sp.MatrixBase:
    """Return the inverse, its pivots on the diagonal one after the other; quotients and rows are named."""
    n = matrix.rows
    both = sp.Matrix.hstack(sp.Matrix(matrix), sp.eye(n))
    for k in range(n):
        pivot = both[k, k]
        for j in range(2 * n):
            about = "entry of the inverse of the constraints by the dependent unknowns, in elimination"
            both[k, j] = names.scalar(f"eliminated_{k + 1}_{j + 1}", both[k, j] / pivot, "1", about)
        for i in range(n):
            factor = both[i, k]
            if i != k and factor != 0:
                for j in range(2 * n):
                    both[i, j] -= factor * both[k, j]
    return both[:, n:]
