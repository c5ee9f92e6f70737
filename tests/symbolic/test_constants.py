"""Numbers rounded within proven bounds, against mpmath; zero where they vanish only analytically."""

from __future__ import annotations

import random

import mpmath
import pytest
import sympy as sp

from symgen.symbolic.constants import rounded, vanishes

A, B = sp.Rational(7, 10), sp.Rational(2, 5)
ZEROS = {
    "circle": sp.sin(A) ** 2 + sp.cos(A) ** 2 - 1,
    "double angle": sp.sin(2 * A) - 2 * sp.sin(A) * sp.cos(A),
    "sum of angles": sp.cos(A + B) - sp.cos(A) * sp.cos(B) + sp.sin(A) * sp.sin(B),
    "roots": sp.sqrt(2) * sp.sqrt(3 + sp.sqrt(5)) - sp.sqrt(5) - 1,
    "root of a zero": sp.sqrt(sp.sin(A) ** 2 + sp.cos(A) ** 2 - 1),
    "nearly one": sp.acos(sp.sin(A) ** 2 + sp.cos(A) ** 2),
    "tangent": sp.tan(A) - sp.sin(A) / sp.cos(A),
    "arc": sp.atan2(sp.sin(A), sp.cos(A)) - A,
    "hyperbola": sp.cosh(A) ** 2 - sp.sinh(A) ** 2 - 1,
    "logarithm": sp.log(sp.exp(A) + 1) - sp.log(sp.exp(A) + 1 + sp.cosh(A) ** 2 - sp.sinh(A) ** 2 - 1),
    "sign": sp.Abs(sp.sin(2 * A) - 2 * sp.sin(A) * sp.cos(A)),
}


@pytest.mark.parametrize("name", ZEROS)
def test_what_vanishes_is_zero(name):
    assert rounded(ZEROS[name], 40) == 0
    assert rounded(ZEROS[name], 40).is_Integer
    assert vanishes(ZEROS[name])


def test_what_does_not_vanish_keeps_its_digits():
    small = sp.Rational(1, 10**120)
    assert not vanishes(ZEROS["circle"] + small)
    assert abs(rounded(ZEROS["circle"] + small, 40) / small - 1) < 1e-38
    near = rounded(sp.sqrt(10**60 + 1) - 10**30, 40)
    assert abs(near * (sp.sqrt(10**60 + 1) + 10**30).evalf(60) - 1) < 1e-38


def test_branch_cuts_are_met_exactly():
    zero = ZEROS["double angle"]
    assert rounded(sp.atan2(zero, -1), 40) == sp.pi.evalf(40) == rounded(sp.atan2(-zero, -1), 40)
    assert rounded(sp.sign(zero), 40) == 0
    assert rounded(sp.asin(1 + ZEROS["circle"]) - sp.pi / 2, 40) == 0
    # SymPy writes atan2 of numbers as a logarithm of a complex number.
    for y, x in ((sp.sin(A), -sp.cos(A)), (-sp.sin(A), -sp.cos(B)), (sp.sqrt(2), -3 * sp.sin(A))):
        for angle, factor in ((sp.atan2(y, x), 1), (sp.Rational(-3, 7) * sp.atan2(y, x), -3 / 7)):
            known = mpmath.atan2(*(float(c) for c in (y, x))) * factor
            assert float(rounded(angle, 40)) == pytest.approx(float(known), rel=1e-14)


@pytest.mark.parametrize(
    "expression",
    [1 / ZEROS["circle"], sp.log(ZEROS["circle"]), sp.sqrt(ZEROS["circle"] - 1), sp.nan, sp.zoo],
)
def test_what_is_not_finite_or_not_real_is_nan(expression):
    assert rounded(expression, 40) is sp.nan


def test_other_functions_go_to_sympy():
    assert rounded(sp.gamma(sp.Rational(1, 3)), 30) == sp.gamma(sp.Rational(1, 3)).evalf(30)


def _drawn(draw: random.Random, depth: int) -> sp.Expr:
    if depth == 0:
        return sp.Rational(draw.randint(-30, 30), draw.randint(1, 20))
    kind = draw.random()
    x = _drawn(draw, depth - 1)
    if kind < 0.3:
        return x + _drawn(draw, depth - 1)
    if kind < 0.5:
        return x * _drawn(draw, depth - 1)
    if kind < 0.6:
        return sp.atan2(x, _drawn(draw, depth - 1) + sp.Rational(1, 7))
    inside = x / (1 + sp.Abs(x))
    return draw.choice(
        [
            sp.sin(x), sp.cos(x), sp.tan(x), sp.atan(x), sp.sinh(inside), sp.cosh(inside), sp.tanh(x), sp.exp(inside),
            sp.asin(inside), sp.acos(inside), sp.log(1 + x**2), sp.sqrt(1 + x**2), (1 + x**2) ** sp.Rational(-2, 3),
        ]
    )  # fmt: skip


def test_random_numbers_against_mpmath():
    draw, count = random.Random(1), 0
    while count < 60:
        expression = _drawn(draw, 4)
        if expression.is_Rational or expression.has(sp.nan, sp.zoo, sp.oo):
            continue
        with mpmath.workdps(150):
            known = mpmath.mpmathify(sp.lambdify([], expression, "mpmath")())
            if abs(known) < mpmath.mpf(10) ** -60:
                continue
            found = mpmath.mpf(rounded(expression, 40)._mpf_)
            assert abs(found - known) <= mpmath.mpf(10) ** -39 * abs(known), expression
        count += 1
