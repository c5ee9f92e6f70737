"""Products of vectors of expressions."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp


def dot(a: Sequence[sp.Expr], b: Sequence[sp.Expr]) -> sp.Expr:
    """Return the scalar product."""
    zero = sp.S.Zero
    return sp.Add(*(sp.Mul(x, y) for x, y in zip(a, b, strict=True) if x is not zero and y is not zero))


def cross(a: Sequence[sp.Expr], b: Sequence[sp.Expr]) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Return the cross product of two vectors in space."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def cross_in_plane(a: Sequence[sp.Expr], b: Sequence[sp.Expr]) -> sp.Expr:
    """Return the product a_x b_y - a_y b_x of two vectors in the plane."""
    return a[0] * b[1] - a[1] * b[0]
