"""Precision points of four-bars and slider-cranks: a condition per dyad and pose, or per pair of values.

And Roberts's theorem: three planar four-bars have the same coupler curve.
"""

from __future__ import annotations

import sympy as sp

Point = tuple[sp.Expr, sp.Expr]


def dyad(ground: Point, joint: Point, length: sp.Expr, point: Point, angle: sp.Expr) -> sp.Expr:
    """Return the closure error [m^2] of a link between a ground point and a joint of the coupler.

    ``joint`` is its place on the coupler [m], from the coupler's point and in axes that turn with it;
    ``point`` and ``angle`` are the place of that point [m] and the rotation of the coupler [rad].
    """
    x, y = _place(joint, point, angle)
    return (x - ground[0]) ** 2 + (y - ground[1]) ** 2 - length**2


def _place(joint: Point, point: Point, angle: sp.Expr) -> Point:
    cos, sin = sp.cos(angle), sp.sin(angle)
    return point[0] + cos * joint[0] - sin * joint[1], point[1] + sin * joint[0] + cos * joint[1]


def slide(angle: sp.Expr, offset: sp.Expr, joint: Point, point: Point, turned: sp.Expr) -> sp.Expr:
    """Return the distance [m] of a slider on the coupler from its guide.

    The guide is a line at the offset [m] to the left of the origin, in the direction of its angle [rad].
    ``joint`` is the place of the slider on the coupler [m], as in :func:`dyad`.
    """
    x, y = _place(joint, point, turned)
    return sp.cos(angle) * y - sp.sin(angle) * x - offset


def axis(azimuth: sp.Expr, elevation: sp.Expr) -> sp.Matrix:
    """Return the unit vector of an axis: its azimuth about z, its elevation above the plane of x and y."""
    level = sp.cos(elevation)
    return sp.Matrix([level * sp.cos(azimuth), level * sp.sin(azimuth), sp.sin(elevation)])


def spherical_dyad(ground: sp.Matrix, joint: sp.Matrix, arc: sp.Expr, rotation: sp.Matrix) -> sp.Expr:
    """Return the error of the cosine of a link's arc between an axis of the ground and one of the coupler."""
    return ground.dot(rotation * joint) - sp.cos(arc)


def without_rotation(
    dyads: tuple[tuple[Point, Point], tuple[Point, Point]], point: Point
) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Return the condition [m^8] on two dyads and a point, and numerator and denominator of exp(i angle).

    A vector is a pair of isotropic coordinates x + iy and x - iy, in place of which any two complex numbers
    may stand. ``dyads`` are the vectors from the first precision point to the ground point and to the joint
    in the first pose, ``point`` is that to another precision point. The closure errors of the dyads, less
    those in the first pose, are linear in exp(i angle) and exp(-i angle), whose product is one: Cramer's rule
    eliminates both. Source: Wampler, Morgan and Sommese, Complete solution of the nine-point path synthesis
    problem for four-bar linkages, Journal of Mechanical Design 114 (1992).
    """
    (p, q), rows = point, []
    for (g, h), (w, v) in dyads:
        rows.append((w * (q - h), v * (p - g), p * q - p * h - g * q + w * h + g * v))
    (a, b, c), (d, e, f) = rows
    turned, back, common = b * f - e * c, d * c - a * f, a * e - d * b
    return turned * back - common**2, turned, common


def freudenstein(ratios: tuple[sp.Expr, sp.Expr, sp.Expr], crank: sp.Expr, rocker: sp.Expr) -> sp.Expr:
    """Return the closure error of Freudenstein's equation for the angles of crank and rocker [rad].

    The ratios are d/a, d/c and (a^2 - b^2 + c^2 + d^2)/(2 a c): the thesis on kineto-elastodynamics, Ch. II.
    """
    first, second, third = ratios
    return first * sp.cos(rocker) - second * sp.cos(crank) + third - sp.cos(crank - rocker)


def slider_function(
    crank: sp.Expr, coupler: sp.Expr, offset: sp.Expr, angle: sp.Expr, slider: sp.Expr
) -> sp.Expr:
    """Return the closure error [m^2] of a slider-crank at an angle of crank and a position of slider."""
    along, across = slider - crank * sp.cos(angle), offset - crank * sp.sin(angle)
    return along**2 + across**2 - coupler**2


def spherical_function(ratios: tuple[sp.Expr, ...], crank: sp.Expr, rocker: sp.Expr) -> sp.Expr:
    """Return the closure error of a spherical four-bar for the angles of crank and rocker [rad].

    Both are counted from the arc of the fixed link, that of the rocker from its continuation. With the arcs
    a, b, c, d of crank, coupler, rocker and fixed link, the ratios are cos d, sin d/tan c, sin d/tan a and
    (cos a cos c cos d - cos b)/(sin a sin c): the spherical form of Freudenstein's equation. The axes at the
    coupler's ends are at the arcs a and c from those of the ground, and their scalar product is cos b.
    """
    a, c, d, t, u = sp.symbols("a c d t u", real=True)
    at_crank = sp.rot_axis3(-crank) * sp.Matrix([sp.sin(a), 0, t * sp.sin(a)])
    at_rocker = sp.rot_axis2(-d) * sp.rot_axis3(-rocker) * sp.Matrix([sp.sin(c), 0, u * sp.sin(c)])
    product = sp.expand(at_crank.dot(at_rocker) / (sp.sin(a) * sp.sin(c)))
    first, second, third, last = ratios
    turning = (product - t * u * sp.cos(d)).subs({t: third / sp.sin(d), u: second / sp.sin(d)})
    return turning.subs(sp.cos(d), first) + last


def cognate(o: complex, a: complex, b: complex, c: complex, p: complex) -> tuple[complex, ...]:
    """Return O, A, B, C and P of a four-bar with the same coupler curve that keeps the ground point O.

    Places are complex numbers x + iy, with A and B apart. Its links are sides of the parallelogram O A P A'
    and of triangles similar to the coupler A B P, so that its coupler turns as the link OA does. The third
    four-bar of the curve is that of C, B, A, O and P. Source: the theorem of Roberts and Chebyshev.
    """
    ratio = (p - a) / (b - a)
    joint = o + p - a
    return o, joint, joint + ratio * (a - o), o + ratio * (c - o), p
