"""Limit positions and transmission angles of a crank-rocker.

Source: the thesis on kineto-elastodynamics, Chapter III, with its errata. In the limit positions of the
rocker, crank and coupler are in line: extended, a triangle of the sides a + b, c and d, and folded, one of
b - a, c and d. In the other two triangles the crank lies on the fixed link: d - a, and d + a. The thesis
writes sines, cosines and a quotient by cos(theta1) that vanishes; here each triangle is closed by its two
components, and no length or angle is divided by.
"""

from __future__ import annotations

from collections.abc import Iterator

import sympy as sp

#: The prescribed and the unknown quantities: name, unit, meaning.
QUANTITIES = (
    ("crank", "m", "length of the crank, a"),
    ("coupler", "m", "length of the coupler, b"),
    ("rocker", "m", "length of the rocker, c"),
    ("fixed_link", "m", "distance of the ground points, d"),
    ("swing", "rad", "angle between the limit positions of the rocker"),
    ("crank_extended", "rad", "theta1: angle from the fixed link to the coupler, extended limit position"),
    ("rocker_extended", "rad", "phi2: angle between rocker and fixed link, extended limit position"),
    ("transmission_extended", "rad", "mu2: angle between coupler and rocker, extended limit position"),
    ("crank_folded", "rad", "theta3: angle from the fixed link to the coupler, folded limit position"),
    ("rocker_folded", "rad", "phi4: angle between rocker and fixed link, folded limit position"),
    ("transmission_folded", "rad", "mu4: angle between coupler and rocker, folded limit position"),
    ("transmission_least", "rad", "mu1: angle between coupler and rocker with the crank on the fixed link"),
    ("transmission_greatest", "rad", "angle between coupler and rocker with the crank opposite to it"),
)  # fmt: skip


def _triangle(side: sp.Expr, c: sp.Expr, d: sp.Expr, angles: tuple[sp.Expr, ...]) -> Iterator[sp.Expr]:
    """Yield the closure of the triangle with the interior angles at M, Q and B: two lengths and their sum."""
    at_m, at_q, at_b = angles
    yield side * sp.cos(at_m) + c * sp.cos(at_q) - d
    yield side * sp.sin(at_m) - c * sp.sin(at_q)
    yield at_m + at_q + at_b - sp.pi


def _cosine_rule(side: sp.Expr, b: sp.Expr, c: sp.Expr, angle: sp.Expr) -> sp.Expr:
    """Return the error of the cosine rule [m^2] for the side opposite to the angle between b and c."""
    return b**2 + c**2 - 2 * b * c * sp.cos(angle) - side**2


def cosine_opposite(side: sp.Symbol, b: sp.Symbol, c: sp.Symbol) -> sp.Expr:
    """Return the cosine of the angle opposite to a side of a triangle, from the cosine rule."""
    cosine = sp.Symbol("cosine", real=True)
    rule = _cosine_rule(side, b, c, sp.acos(cosine))
    return -rule.subs(cosine, 0) / rule.diff(cosine)


def conditions(x: dict[str, sp.Symbol]) -> list[sp.Expr]:
    """Return the nine closure errors of the thirteen quantities, which are zero for a crank-rocker."""
    a, b, c, d = (x[name] for name in ("crank", "coupler", "rocker", "fixed_link"))
    extended, folded = (
        tuple(x[f"{part}_{pose}"] for part in ("crank", "rocker", "transmission"))
        for pose in ("extended", "folded")
    )
    return [
        *_triangle(a + b, c, d, extended),
        *_triangle(b - a, c, d, folded),
        x["rocker_extended"] - x["rocker_folded"] - x["swing"],
        _cosine_rule(d - a, b, c, x["transmission_least"]),
        _cosine_rule(d + a, b, c, x["transmission_greatest"]),
    ]
