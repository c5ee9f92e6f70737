"""Precision points of a planar four-bar: one condition for each dyad and pose, or for each pair of angles.

And Roberts's theorem: three four-bars have the same coupler curve.
"""

from __future__ import annotations

import sympy as sp

Point = tuple[sp.Expr, sp.Expr]


def dyad(ground: Point, joint: Point, length: sp.Expr, point: Point, angle: sp.Expr) -> sp.Expr:
    """Return the closure error [m^2] of a link between a ground point and a joint of the coupler.

    ``joint`` is its place on the coupler [m], from the coupler's point and in axes that turn with it;
    ``point`` and ``angle`` are the place of that point [m] and the rotation of the coupler [rad].
    """
    cos, sin = sp.cos(angle), sp.sin(angle)
    x = point[0] + cos * joint[0] - sin * joint[1] - ground[0]
    y = point[1] + sin * joint[0] + cos * joint[1] - ground[1]
    return x**2 + y**2 - length**2


def freudenstein(ratios: tuple[sp.Expr, sp.Expr, sp.Expr], crank: sp.Expr, rocker: sp.Expr) -> sp.Expr:
    """Return the closure error of Freudenstein's equation for the angles of crank and rocker [rad].

    The ratios are d/a, d/c and (a^2 - b^2 + c^2 + d^2)/(2 a c): the thesis on kineto-elastodynamics, Ch. II.
    """
    first, second, third = ratios
    return first * sp.cos(rocker) - second * sp.cos(crank) + third - sp.cos(crank - rocker)


def cognate(o: complex, a: complex, b: complex, c: complex, p: complex) -> tuple[complex, ...]:
    """Return O, A, B, C and P of a four-bar with the same coupler curve that keeps the ground point O.

    Places are complex numbers x + iy, with A and B apart. Its links are sides of the parallelogram O A P A'
    and of triangles similar to the coupler A B P, so that its coupler turns as the link OA does. The third
    four-bar of the curve is that of C, B, A, O and P. Source: the theorem of Roberts and Chebyshev.
    """
    ratio = (p - a) / (b - a)
    joint = o + p - a
    return o, joint, joint + ratio * (a - o), o + ratio * (c - o), p
