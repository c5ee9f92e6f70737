"""Precision points of a planar four-bar: one condition for each dyad and pose, or for each pair of angles."""

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
