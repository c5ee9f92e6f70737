"""Angles written in degrees or turns, as exact multiples of pi."""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache

import sympy as sp

from symgen.scene.expressions import rational
from symgen.scene.units import parse_quantity

#: Largest denominator of a multiple of pi: far more than anybody writes, far less than the digits of pi give.
_FINEST = 10**20


@lru_cache(maxsize=1)
def _pi() -> Fraction:
    """Return pi as the units have it: 64 digits, which every angle in degrees holds as a factor."""
    return parse_quantity("180 deg")[0]


def with_pi(expression: sp.Expr) -> sp.Expr:
    """Return an expression with the numbers that were written in degrees or turns as multiples of pi.

    The cosine of a right angle is zero then, and its factors are omitted.
    """
    found = {}
    for number in expression.atoms(sp.Rational):
        share = Fraction(int(number.p), int(number.q)) / _pi()
        if share and share.denominator < _FINEST:
            found[number] = rational(share) * sp.pi
    return expression.xreplace(found)
