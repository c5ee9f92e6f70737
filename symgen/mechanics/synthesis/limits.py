"""Limit positions and transmission angles of crank-rockers, in the plane and on a sphere, and slider-cranks.

Source: the thesis on kineto-elastodynamics, Chapter III, with its errata. In the limit positions of the
rocker, crank and coupler are in line: extended, a triangle of the sides a + b, c and d, and folded, one of
b - a, c and d. In the other two triangles the crank lies on the fixed link: d - a, and d + a. The thesis
writes sines, cosines and a quotient by cos(theta1) that vanishes; here each triangle is closed by its two
components, and no length or angle is divided by. In those of a slider-crank the offset of the guide takes
the place of rocker and fixed link. On a sphere (Chapter I names the extension, and does not derive it) the
same four triangles are spherical, with arcs as sides, and the cosine rule of each angle closes them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

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
    ("time_ratio", "1", "rotation of the crank from extended to folded limit position, over that back"),
)  # fmt: skip

#: The quantities of a spherical four-bar: those of a planar one, with arcs as lengths.
SPHERICAL_QUANTITIES = (
    ("crank", "rad", "arc of the crank, a"),
    ("coupler", "rad", "arc of the coupler, b"),
    ("rocker", "rad", "arc of the rocker, c"),
    ("fixed_link", "rad", "arc of the fixed link, d"),
    *QUANTITIES[4:],
)
#: The quantities of a slider-crank, whose guide is at its offset to the left of the slider's direction.
SLIDER_QUANTITIES = (
    ("crank", "m", "length of the crank, r"),
    ("coupler", "m", "length of the coupler, l"),
    ("offset", "m", "distance of the guide from the ground point, e"),
    ("stroke", "m", "distance of the limit positions of the slider"),
    ("slider_extended", "m", "position of the slider along the guide, extended limit position"),
    ("slider_folded", "m", "position of the slider along the guide, folded limit position"),
    ("crank_extended", "rad", "angle from the guide to the coupler, extended limit position"),
    ("crank_folded", "rad", "angle from the guide to the coupler, folded limit position"),
    ("transmission_least", "rad", "angle between coupler and the normal of the guide, crank away from it"),
    ("transmission_greatest", "rad", "the same with the crank towards the guide, beyond 90 deg if r > e"),
    ("time_ratio", "1", "rotation of the crank from extended to folded limit position, over that back"),
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


def cosine_opposite(side: sp.Symbol, b: sp.Symbol, c: sp.Symbol, on_sphere: bool = False) -> sp.Expr:
    """Return the cosine of the angle opposite to a side of a triangle, from the cosine rule."""
    cosine = sp.Symbol("cosine", real=True)
    rule = (_spherical_rule if on_sphere else _cosine_rule)(side, b, c, sp.acos(cosine))
    return -rule.subs(cosine, 0) / rule.diff(cosine)


def _spherical_rule(side: sp.Expr, b: sp.Expr, c: sp.Expr, angle: sp.Expr) -> sp.Expr:
    """Return the error of the spherical cosine rule for the side opposite to the angle between b and c."""
    return sp.cos(b) * sp.cos(c) + sp.sin(b) * sp.sin(c) * sp.cos(angle) - sp.cos(side)


def _spherical_triangle(
    side: sp.Expr, c: sp.Expr, d: sp.Expr, angles: tuple[sp.Expr, ...]
) -> Iterator[sp.Expr]:
    """Yield the closure of the spherical triangle with the angles at M, Q and B: each by its cosine rule."""
    at_m, at_q, at_b = angles
    yield _spherical_rule(c, side, d, at_m)
    yield _spherical_rule(side, c, d, at_q)
    yield _spherical_rule(d, side, c, at_b)


def _time_ratio(x: dict[str, sp.Symbol]) -> sp.Expr:
    """Return the error [rad] of the ratio of the crank's rotations between the limit positions."""
    more = x["crank_folded"] - x["crank_extended"]
    return (sp.pi + more) - x["time_ratio"] * (sp.pi - more)


def conditions(x: dict[str, sp.Symbol]) -> list[sp.Expr]:
    """Return the ten closure errors of a crank-rocker's quantities."""
    return _crank_rocker(x, _triangle, _cosine_rule)


def spherical_conditions(x: dict[str, sp.Symbol]) -> list[sp.Expr]:
    """Return the ten closure errors of the quantities of a spherical crank-rocker."""
    return _crank_rocker(x, _spherical_triangle, _spherical_rule)


def _crank_rocker(
    x: dict[str, sp.Symbol],
    triangle: Callable[..., Iterator[sp.Expr]],
    cosine_rule: Callable[..., sp.Expr],
) -> list[sp.Expr]:
    a, b, c, d = (x[name] for name in ("crank", "coupler", "rocker", "fixed_link"))
    extended, folded = (
        tuple(x[f"{part}_{pose}"] for part in ("crank", "rocker", "transmission"))
        for pose in ("extended", "folded")
    )
    return [
        *triangle(a + b, c, d, extended),
        *triangle(b - a, c, d, folded),
        x["rocker_extended"] - x["rocker_folded"] - x["swing"],
        cosine_rule(d - a, b, c, x["transmission_least"]),
        cosine_rule(d + a, b, c, x["transmission_greatest"]),
        _time_ratio(x),
    ]


def slider_conditions(x: dict[str, sp.Symbol]) -> list[sp.Expr]:
    """Return the eight closure errors of a slider-crank's quantities."""
    r, l, e = (x[name] for name in ("crank", "coupler", "offset"))
    limits = [(l + r, "extended"), (l - r, "folded")]
    along = [side * sp.cos(x[f"crank_{pose}"]) - x[f"slider_{pose}"] for side, pose in limits]
    across = [side * sp.sin(x[f"crank_{pose}"]) - e for side, pose in limits]
    return [
        *along,
        *across,
        x["slider_extended"] - x["slider_folded"] - x["stroke"],
        l * sp.cos(x["transmission_least"]) - (e + r),
        l * sp.cos(x["transmission_greatest"]) - (e - r),
        _time_ratio(x),
    ]


def necessary(x: dict[str, sp.Symbol]) -> list[sp.Rel]:
    """Return relations, linear but for the time ratio, between the quantities of every crank-rocker.

    Grashof's condition with the crank as the shortest link, the sums of the angles of triangles, and the
    order of the angle at B, which grows with the distance AC: from d - a to d + a.
    """
    return _of_crank_rocker(x, lambda angles: [sp.Eq(sp.Add(*angles), sp.pi)])


def spherical_necessary(x: dict[str, sp.Symbol]) -> list[sp.Rel]:
    """Return relations, linear but for the time ratio, of every spherical crank-rocker.

    Those of :func:`necessary`, but for the sums of angles: spherical triangles have an excess, and two angles
    exceed the third by less than 180 deg. The crank's arc is also less than the supplement of any other, and
    the sum of all arcs is less than a circle: the triangles of crank and fixed link close with the opposite
    axes, too.
    """
    a, *others = (x[name] for name in ("crank", "coupler", "rocker", "fixed_link"))
    return [
        *_of_crank_rocker(x, _excess),
        *(a + other < sp.pi for other in others),
        sp.Add(a, *others) < 2 * sp.pi,
    ]


def _excess(angles: list[sp.Symbol]) -> list[sp.Rel]:
    total = sp.Add(*angles)
    return [total > sp.pi, *(total < sp.pi + 2 * angle for angle in angles)]


def _of_crank_rocker(
    x: dict[str, sp.Symbol], of_angles: Callable[[list[sp.Symbol]], list[sp.Rel]]
) -> list[sp.Rel]:
    a, b, c, d = (x[name] for name in ("crank", "coupler", "rocker", "fixed_link"))
    least, greatest = x["transmission_least"], x["transmission_greatest"]
    relations = [a > 0, a + b < c + d, a + c < b + d, a + d < b + c, a < b, a < c, a < d, least > 0]
    for pose in ("extended", "folded"):
        angles = [x[f"{part}_{pose}"] for part in ("crank", "rocker", "transmission")]
        relations += [*of_angles(angles), angles[0] > 0, angles[1] > 0]
        relations += [least < angles[2], angles[2] < greatest]
    swing = sp.Eq(x["rocker_extended"] - x["rocker_folded"], x["swing"])
    return [*relations, greatest < sp.pi, swing, x["swing"] > 0, sp.Eq(_time_ratio(x), 0)]


def slider_necessary(x: dict[str, sp.Symbol]) -> list[sp.Rel]:
    """Return relations, linear but for the time ratio, of every slider-crank whose crank turns."""
    r, l, e, stroke = (x[name] for name in ("crank", "coupler", "offset", "stroke"))
    least, greatest, ratio = x["transmission_least"], x["transmission_greatest"], x["time_ratio"]
    return [
        r > 0, e >= 0, r + e < l, stroke >= 2 * r, stroke < 2 * l,
        sp.Eq(x["slider_extended"] - x["slider_folded"], stroke),
        x["slider_folded"] > 0, x["slider_extended"] <= l + r, x["slider_folded"] <= l - r,
        x["crank_extended"] >= 0, x["crank_extended"] <= x["crank_folded"], x["crank_folded"] < sp.pi / 2,
        least > 0, least < greatest, least < sp.pi / 2, least + greatest <= sp.pi, ratio >= 1, ratio < 3,
        sp.Eq(_time_ratio(x), 0),
    ]  # fmt: skip
