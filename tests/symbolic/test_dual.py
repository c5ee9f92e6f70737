"""Dual numbers, vectors and matrices, against SymPy's own series and plain geometry."""

from __future__ import annotations

import random

import pytest
import sympy as sp

from symgen.symbolic.dual import Dual, DualMatrix, DualVector, X, Y, Z, identity, operator, skew
from symgen.symbolic.vectors import cross, dot

theta, shift, eta, alpha, a, b, c = sp.symbols("theta S eta alpha a b c", real=True)
eps = sp.Symbol("eps")
RIGID = Z(Dual(theta, shift)) @ Y(Dual(eta)) @ X(Dual(alpha, a))


def zero(entries):
    """Whether expressions vanish, in exact arithmetic at random rational points of every circle and line."""
    matrix, rng = sp.Matrix(entries), random.Random(3)
    for _ in range(2):
        values = {x: sp.Rational(rng.randint(-40, 40), 41) for x in sorted(matrix.free_symbols, key=str)}
        circles = {}
        for x, t in values.items():
            circles |= {sp.cos(x): (1 - t**2) / (1 + t**2), sp.sin(x): 2 * t / (1 + t**2)}
        found = matrix.xreplace(circles).xreplace(values)
        assert not found.atoms(sp.Function), "only cosines and sines of single symbols are known exactly"
        if not found.is_zero_matrix:
            return False
    return True


def vector(name):
    return tuple(sp.symbols(f"{name}_x {name}_y {name}_z", real=True))


def dual_vector(name):
    return DualVector(vector(name), vector(f"{name}d"))


def truncated(expression):
    """An expression in eps with its square taken for zero."""
    series = sp.series(expression, eps, 0, 2).removeO()
    return Dual(series.coeff(eps, 0), series.coeff(eps, 1))


@pytest.mark.parametrize("function", [sp.sin, sp.cos, sp.exp, sp.sqrt, lambda x: x**3 - 2 / x])
def test_function_rule_is_the_series(function):
    found, exact = Dual(a, b).map(function), truncated(function(a + eps * b))
    assert sp.simplify(found.real - exact.real) == 0 and sp.simplify(found.dual - exact.dual) == 0


def test_products_drop_the_square_of_eps():
    found, exact = Dual(a, b) * Dual(c, theta), truncated(sp.expand((a + eps * b) * (c + eps * theta)))
    assert (found.real, found.dual) == (exact.real, exact.dual)
    assert Dual(sp.S(0), b) * Dual(sp.S(0), c) == Dual(sp.S(0))
    assert 2 * Dual(a, b) - b == Dual(2 * a - b, 2 * b)


def test_a_row_is_orthogonal_as_a_dual_matrix():
    for product in (RIGID.T @ RIGID, RIGID @ RIGID.T):
        assert zero(product.real - identity().real) and zero(product.dual)
    assert zero([RIGID.real.det(method="berkowitz") - 1])


def test_a_matrix_with_another_dual_part_is_not_orthogonal():
    wrong = DualMatrix(RIGID.real, RIGID.dual + RIGID.real)
    assert not zero((wrong.T @ wrong).dual)


@pytest.mark.parametrize("turn, axis", [(X, 0), (Y, 1), (Z, 2)])
def test_turns_are_right_handed_and_shift_along_their_axis(turn, axis):
    found = turn(Dual(theta, shift))
    unit = sp.eye(3)[:, axis]
    assert found.real * unit == unit
    assert sp.diff(found.real, theta).subs(theta, 0) == skew(tuple(unit))
    assert zero(sp.Matrix(found.shift) - shift * unit)


def test_transference():
    """Every identity of angles holds for dual angles: here the spherical one, and the sum of turns."""
    one, two = Z(Dual(theta, shift)) @ Z(Dual(eta, a)), Z(Dual(theta + eta, shift + a))
    assert zero(one.real - two.real.expand(trig=True)) and zero(one.dual - two.dual.expand(trig=True))
    angle = Dual(theta, shift)
    square = angle.map(sp.sin) * angle.map(sp.sin) + angle.map(sp.cos) * angle.map(sp.cos)
    assert sp.simplify(square.real) == 1 and sp.simplify(square.dual) == 0
    # The cosine of the dual angle between two lines: angle, and common normal times its sine.
    first = DualVector((sp.S(0), sp.S(0), sp.S(1)), (sp.S(0),) * 3)
    second = X(Dual(alpha, a)).times(first)
    found = first.dot(second)
    assert (found.real, sp.simplify(found.dual + a * sp.sin(alpha))) == (sp.cos(alpha), 0)


def test_a_moved_line_passes_through_the_moved_point():
    shifted = RIGID.shift
    for k in range(3):
        unit = [sp.S(int(i == k)) for i in range(3)]
        line = RIGID.times(DualVector(tuple(unit), (sp.S(0),) * 3))
        assert zero(sp.Matrix(line.dual) - sp.Matrix(cross(shifted, line.real)))


def test_cross_product_and_its_matrix():
    u, v, w = (dual_vector(n) for n in "uvw")
    assert zero(operator(u).times(v).column - u.cross(v).column)
    jacobi = u.cross(v.cross(w)) + v.cross(w.cross(u)) + w.cross(u.cross(v))
    assert jacobi.column.expand().is_zero_matrix
    assert sp.expand((u.dot(u.cross(v))).dual) == 0


def test_a_rigid_motion_keeps_the_reciprocal_product():
    u, v = dual_vector("u"), dual_vector("v")
    before, after = u.dot(v), RIGID.times(u).dot(RIGID.times(v))
    assert zero([after.dual - before.dual])
    assert sp.expand(before.dual - dot(u.real, v.dual) - dot(u.dual, v.real)) == 0


def test_a_dual_factor_turns_a_line_into_a_screw():
    line = dual_vector("u")
    found = line * Dual(a, b)
    assert found.real == tuple(a * x for x in line.real)
    assert zero(sp.Matrix(found.dual) - a * sp.Matrix(line.dual) - b * sp.Matrix(line.real))
    assert (line - line).column == sp.zeros(6, 1)
