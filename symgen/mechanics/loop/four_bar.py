"""Motion of a planar four-bar in closed form: angles from half-angles, rates and accelerations from its loop.

Source: the thesis on kineto-elastodynamics, Chapter IV, Eqs. (4.17)-(4.51). The ground point of the crank is
the origin, that of the output link lies at the distance d on the x-axis, and all angles are counted from
there: the crank a and the coupler b lead from one ground point to the joint B, the output link c leads there
from the other. Runs do not use these equations: half-angles have a pole at 180 degrees.
"""

from __future__ import annotations

from typing import NamedTuple

import sympy as sp

from symgen.mechanics.rods.particles import ZERO, Vector
from symgen.mechanics.synthesis.points import freudenstein
from symgen.symbolic.calculus import Calculus


class Lengths(NamedTuple):
    """Lengths [m] of crank, coupler and output link, and distance of the ground points."""

    a: sp.Expr
    b: sp.Expr
    c: sp.Expr
    d: sp.Expr


class Angles(NamedTuple):
    """Angles [rad] of crank, coupler and output link, or their rates."""

    crank: sp.Expr
    coupler: sp.Expr
    output: sp.Expr


def ground(lengths: Lengths) -> tuple[Vector, Vector]:
    """Return the ground points [m] of crank and output link."""
    return (ZERO, ZERO), (lengths.d, ZERO)


def place(start: Vector, length: sp.Expr, angle: sp.Expr) -> Vector:
    """Return the end [m] of a link, Eqs. (4.42)-(4.45)."""
    return start[0] + length * sp.cos(angle), start[1] + length * sp.sin(angle)


def middle(start: Vector, end: Vector) -> Vector:
    """Return the middle [m] of a link, Eqs. (4.46)-(4.51)."""
    return tuple((x + y) / 2 for x, y in zip(start, end, strict=True))


def closure(lengths: Lengths, angles: Angles) -> Vector:
    """Return the end of the coupler less that of the output link [m]: zero on the closed loop."""
    start, end = ground(lengths)
    of_coupler = place(place(start, lengths.a, angles.crank), lengths.b, angles.coupler)
    of_output = place(end, lengths.c, angles.output)
    return tuple(x - y for x, y in zip(of_coupler, of_output, strict=True))


def output_ratios(lengths: Lengths, angles: Angles) -> tuple[sp.Expr, ...]:
    """Return K1, K2 and K3 of Freudenstein's equation of crank and output link, Eqs. (4.18)-(4.20)."""
    rest = closure(lengths._replace(b=ZERO), angles)
    return _ratios(rest, lengths.b, angles.crank, angles.output)


def coupler_ratios(lengths: Lengths, angles: Angles) -> tuple[sp.Expr, ...]:
    """Return K1, -K4 and K5 of that equation of crank and coupler, Eqs. (4.18), (4.21), (4.22)."""
    rest = closure(lengths._replace(c=ZERO), angles)
    return _ratios(rest, lengths.c, angles.crank, angles.coupler)


def _ratios(rest: Vector, length: sp.Expr, crank: sp.Expr, other: sp.Expr) -> tuple[sp.Expr, ...]:
    """Return the coefficients of Freudenstein's equation: the closure without a link has its length."""
    squared = sp.expand(sp.Add(*(x**2 for x in rest)) - length**2)
    first, second = sp.cos(crank), sp.cos(other)
    scale = -squared.coeff(first * second)
    upright = squared.subs({crank: sp.pi / 2, other: sp.pi / 2})  # the third ratio less one
    return (
        squared.coeff(first, 0).coeff(second) / scale,
        -squared.coeff(second, 0).coeff(first) / scale,
        sp.expand(upright + scale) / scale,
    )


def half_angle_coefficients(ratios: tuple[sp.Expr, ...], crank: sp.Expr) -> tuple[sp.Expr, ...]:
    """Return the coefficients of that equation as a quadratic of tan(angle/2), Eqs. (4.23)-(4.27)."""
    angle, tangent = sp.symbols("angle tangent", real=True)
    equation = sp.expand_trig(freudenstein((ratios[0], ratios[1], ratios[2]), crank, angle))
    over = 1 + tangent**2
    equation = equation.subs({sp.cos(angle): (1 - tangent**2) / over, sp.sin(angle): 2 * tangent / over})
    return tuple(sp.Poly(sp.cancel(equation * over), tangent).all_coeffs())


def angle_of(coefficients: tuple[sp.Expr, ...], branch: sp.Expr) -> sp.Expr:
    """Return the angle [rad], Eqs. (4.28), (4.29): twice the arctangent of a root; -1 or 1 selects it."""
    p, q, r = coefficients
    return 2 * sp.atan((-q + branch * sp.sqrt(q**2 - 4 * p * r)) / (2 * p))


def rates(lengths: Lengths, angles: Angles, calculus: Calculus) -> tuple[sp.Expr, ...]:
    """Return the rates of coupler and output link [rad/s], Eqs. (4.30), (4.31): the closure has no rate."""
    loop = sp.Matrix(closure(lengths, angles))
    slopes = loop.jacobian(angles)
    crank = calculus.rate(angles.crank)
    left, right = slopes[:, 1:], -slopes[:, 0] * crank
    return _solved(left, right)


def acceleration_terms(
    lengths: Lengths, angles: Angles, crank: sp.Expr, calculus: Calculus
) -> tuple[sp.Expr, ...]:
    """Return H1 to H6, Eqs. (4.34)-(4.39), of the closure's second rate at an acceleration of the crank.

    The rows of this rate are -H6 x + H3 y = H1 and H5 x - H2 y = -H4, of the accelerations x and y.
    """
    loop = closure(lengths, angles)
    slopes = sp.Matrix(loop).jacobian(angles)
    given = [accelerated(x, (angles.crank,), (crank,), calculus) for x in loop]
    return -given[0], -slopes[1, 2], slopes[0, 2], given[1], slopes[1, 1], -slopes[0, 1]


def accelerations(terms: tuple[sp.Expr, ...]) -> tuple[sp.Expr, ...]:
    """Return the accelerations of coupler and output link [rad/s^2], Eqs. (4.32), (4.33), from H1 to H6."""
    h1, h2, h3, h4, h5, h6 = terms
    return _solved(sp.Matrix([[-h6, h3], [h5, -h2]]), sp.Matrix([h1, -h4]))


def accelerated(
    x: sp.Expr, angles: tuple[sp.Expr, ...], second: tuple[sp.Expr, ...], calculus: Calculus
) -> sp.Expr:
    """Return the second rate of an expression at the accelerations of some angles, Eqs. (4.40), (4.41)."""
    turned = (x.diff(angle) * rate for angle, rate in zip(angles, second, strict=True))
    return sp.Add(calculus.rate(calculus.rate(x)), *turned)


def _solved(left: sp.Matrix, right: sp.Matrix) -> tuple[sp.Expr, ...]:
    """Return the solution of two linear equations by Cramer's rule."""

    def determinant(column: int | None = None) -> sp.Expr:
        matrix = left.copy()
        if column is not None:
            matrix[:, column] = right
        return sp.trigsimp(sp.factor(matrix.det()))

    return tuple(sp.cancel(determinant(k) / determinant()) for k in (0, 1))
