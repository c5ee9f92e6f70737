"""Sign of an expression: a jump in a load, as a function known to derivation and lowering."""

from __future__ import annotations

from typing import Any

import sympy as sp


class Sign(sp.Function):
    """1 above zero, -1 below, 0 at zero; its derivative is zero, also at the jump."""

    nargs = 1
    is_real = True
    is_commutative = True

    @classmethod
    def eval(cls, x: sp.Expr) -> sp.Expr | None:
        """Return the sign of a number, and extract a minus sign from the argument."""
        if x.is_number:
            return sp.sign(x)
        coefficient, rest = x.as_coeff_Mul()
        if coefficient.is_negative:
            return -cls(-x)
        return cls(rest) if coefficient != 1 and coefficient.is_positive else None

    def fdiff(self, argindex: int = 1) -> Any:
        """Return the derivative away from the jump."""
        return sp.Integer(0)


def greatest(a: sp.Expr, b: sp.Expr) -> sp.Expr:
    """Return the greater of two expressions; its factors are exactly 0 and 1."""
    above = Sign(a - b)
    return a * (1 + above) / 2 + b * (1 - above) / 2


def least(a: sp.Expr, b: sp.Expr) -> sp.Expr:
    """Return the lesser of two expressions."""
    return -greatest(-a, -b)
