"""Conditions of synthesis as building blocks: residuals and their derivatives by every quantity."""

from __future__ import annotations

import sympy as sp

from symgen.mechanics.sources import LIMITS, NONE
from symgen.mechanics.synthesis import limits, points
from symgen.symbolic.quantity import Quantity, quantity
from symgen.symbolic.system import Export, Group, NamedMatrix, System

#: Conditions on a crank-rocker, each with the printed equations that it corresponds to or is part of.
LIMITS_ROWS = (
    "extended_along F4 F6 G6",
    "extended_across F3 G5",
    "extended_angles F2 G2",
    "folded_along F4",
    "folded_across G4 G5 G7",
    "folded_angles G3",
    "swing F1 G1",
    "least F5",
    "greatest",
    "time_ratio",
)

_CHAPTER = "The thesis on kineto-elastodynamics, Chapter III"


def synthesis_limits_system() -> System:
    """Return the conditions on limit positions and transmission angles of a crank-rocker."""
    quantities = tuple(quantity(*row) for row in limits.QUANTITIES)
    residual = limits.conditions({x.name: x.symbol for x in quantities})
    units = "m, m, rad, m, m, rad, rad, m^2, m^2, rad"
    title = "Limit positions of a crank-rocker"
    return _conditions(
        "synthesis_limits", title, quantities, residual, units, rows=LIMITS_ROWS, reference=_CHAPTER
    )


def synthesis_limits_derived() -> System:
    """Return what follows from several conditions on a crank-rocker, for inspection."""
    quantities = tuple(quantity(*row) for row in limits.QUANTITIES)
    x = {q.name: q.symbol for q in quantities}
    names = [row.partition(" ")[0] for row in LIMITS_ROWS]
    rows = dict(zip(names, limits.conditions(x), strict=True))
    quotients = (rows[f"{pose}_across"] / sp.sin(x[f"crank_{pose}"]) for pose in ("extended", "folded"))
    length = sp.ImmutableMatrix([sp.expand(sp.Add(*quotients) / 2)])
    about = "half the sum of the rows extended_across and folded_across of residual, each over its sine"
    return System(
        "synthesis_limits_derived",
        "The coupler of a crank-rocker by both limit positions",
        (Group("q", "prescribed and unknown quantities", quantities),),
        (NamedMatrix("coupler_by_limits", length, "m", about, ("G5",)),),
        (),
        references=(_CHAPTER,),
        sources=LIMITS,
    )


def synthesis_spherical_limits_system() -> System:
    """Return the conditions on limit positions and transmission angles of a spherical crank-rocker."""
    quantities = tuple(quantity(*row) for row in limits.SPHERICAL_QUANTITIES)
    residual = limits.spherical_conditions({x.name: x.symbol for x in quantities})
    units = "1, 1, 1, 1, 1, 1, rad, 1, 1, rad"
    title = "Limit positions of a spherical crank-rocker"
    return _conditions("synthesis_spherical_limits", title, quantities, residual, units)


def synthesis_slider_limits_system() -> System:
    """Return the conditions on limit positions and transmission angles of a slider-crank."""
    quantities = tuple(quantity(*row) for row in limits.SLIDER_QUANTITIES)
    residual = limits.slider_conditions({x.name: x.symbol for x in quantities})
    units = "m, m, m, m, m, m, m, rad"
    title = "Limit positions of a slider-crank"
    return _conditions("synthesis_slider_limits", title, quantities, residual, units)


def synthesis_dyad_system() -> System:
    """Return the condition on one dyad of a four-bar in one pose of its coupler."""
    quantities = (
        quantity("ground_x", "m", "x of the ground point"),
        quantity("ground_y", "m", "y of the ground point"),
        quantity("joint_x", "m", "place of the joint along the coupler's axis"),
        quantity("joint_y", "m", "place of the joint to the left of the coupler's axis"),
        quantity("length", "m", "length of the link between them"),
        quantity("point_x", "m", "x of the coupler's point"),
        quantity("point_y", "m", "y of the coupler's point"),
        quantity("angle", "rad", "rotation of the coupler"),
    )
    gx, gy, jx, jy, length, px, py, angle = (x.symbol for x in quantities)
    residual = [points.dyad((gx, gy), (jx, jy), length, (px, py), angle)]
    return _conditions("synthesis_dyad", "A dyad in one pose of the coupler", quantities, residual, "m^2")


def synthesis_slide_system() -> System:
    """Return the condition on a slider of the coupler in one pose."""
    quantities = (
        quantity("guide_angle", "rad", "direction of the guide"),
        quantity("guide_offset", "m", "distance of the guide from the origin, to the left of its direction"),
        quantity("slider_x", "m", "place of the slider along the coupler's axis"),
        quantity("slider_y", "m", "place of the slider to the left of the coupler's axis"),
        quantity("point_x", "m", "x of the coupler's point"),
        quantity("point_y", "m", "y of the coupler's point"),
        quantity("angle", "rad", "rotation of the coupler"),
    )
    direction, offset, jx, jy, px, py, angle = (x.symbol for x in quantities)
    residual = [points.slide(direction, offset, (jx, jy), (px, py), angle)]
    return _conditions("synthesis_slide", "A slider in one pose of the coupler", quantities, residual, "m")


def synthesis_spherical_dyad_system() -> System:
    """Return the condition on one dyad of a spherical four-bar in one pose of its coupler."""
    quantities = (
        quantity("ground_azimuth", "rad", "angle of the ground's axis about z, from x"),
        quantity("ground_elevation", "rad", "angle of the ground's axis from the plane of x and y"),
        quantity("joint_azimuth", "rad", "angle of the coupler's axis about z, in its first pose"),
        quantity("joint_elevation", "rad", "angle of the coupler's axis from the plane of x and y"),
        quantity("arc", "rad", "arc of the link between them"),
        *(
            quantity(f"rotation_{i}{j}", "1", "entry of the coupler's rotation matrix")
            for i in "xyz"
            for j in "xyz"
        ),
    )
    a, b, c, d, arc, *entries = (x.symbol for x in quantities)
    rotation = sp.Matrix(3, 3, entries)
    residual = [points.spherical_dyad(points.axis(a, b), points.axis(c, d), arc, rotation)]
    title = "A spherical dyad in one pose of the coupler"
    return _conditions("synthesis_spherical_dyad", title, quantities, residual, "1")


def synthesis_function_system() -> System:
    """Return Freudenstein's equation for one pair of angles, counted from unknown starts."""
    quantities = (
        quantity("d_over_a", "1", "fixed link over crank"),
        quantity("d_over_c", "1", "fixed link over rocker"),
        quantity("third", "1", "(a^2 - b^2 + c^2 + d^2)/(2 a c)"),
        quantity("crank_start", "rad", "angle of the crank where its input is zero"),
        quantity("rocker_start", "rad", "angle of the rocker where its output is zero"),
        quantity("input", "rad", "rotation of the crank"),
        quantity("output", "rad", "rotation of the rocker"),
    )
    *ratios, crank, rocker, x, y = (x.symbol for x in quantities)
    residual = [points.freudenstein((ratios[0], ratios[1], ratios[2]), crank + x, rocker + y)]
    return _conditions(
        "synthesis_function", "Crank and rocker at one precision point", quantities, residual, "1"
    )


def synthesis_slider_function_system() -> System:
    """Return the closure of a slider-crank for one pair of values, counted from unknown starts."""
    quantities = (
        quantity("crank", "m", "length of the crank"),
        quantity("coupler", "m", "length of the coupler"),
        quantity("offset", "m", "distance of the guide from the crank's ground point, to the left"),
        quantity("crank_start", "rad", "angle of the crank where its input is zero"),
        quantity("slider_start", "m", "position of the slider where its output is zero"),
        quantity("input", "rad", "rotation of the crank"),
        quantity("output", "m", "way of the slider"),
    )
    crank, coupler, offset, angle, slider, x, y = (x.symbol for x in quantities)
    residual = [points.slider_function(crank, coupler, offset, angle + x, slider + y)]
    title = "Crank and slider at one precision point"
    return _conditions("synthesis_slider_function", title, quantities, residual, "m^2")


def synthesis_spherical_function_system() -> System:
    """Return the spherical form of Freudenstein's equation for one pair of angles, from unknown starts."""
    quantities = (
        quantity("cos_d", "1", "cosine of the arc of the fixed link"),
        quantity("sin_d_over_tan_c", "1", "sine of that arc over the tangent of the rocker's"),
        quantity("sin_d_over_tan_a", "1", "sine of that arc over the tangent of the crank's"),
        quantity("last", "1", "(cos a cos c cos d - cos b)/(sin a sin c)"),
        quantity("crank_start", "rad", "angle of the crank where its input is zero"),
        quantity("rocker_start", "rad", "angle of the rocker where its output is zero"),
        quantity("input", "rad", "rotation of the crank"),
        quantity("output", "rad", "rotation of the rocker"),
    )
    *ratios, crank, rocker, x, y = (x.symbol for x in quantities)
    residual = [points.spherical_function(tuple(ratios), crank + x, rocker + y)]
    title = "Crank and rocker on a sphere at one precision point"
    return _conditions("synthesis_spherical_function", title, quantities, residual, "1")


def _conditions(
    name: str,
    title: str,
    quantities: tuple[Quantity, ...],
    residual: list[sp.Expr],
    units: str,
    rows: tuple[str, ...] = (),
    reference: str = "",
) -> System:
    column = sp.ImmutableMatrix(residual)
    slopes = sp.ImmutableMatrix(sp.Matrix(residual).jacobian([x.symbol for x in quantities]))
    matrices = (
        NamedMatrix("residual", column, units, "expressions that vanish", rows),
        NamedMatrix("slopes", slopes, units, "their derivatives, by the unit of the quantity", rows,
                    columns=tuple(x.name for x in quantities)),
    )  # fmt: skip
    return System(
        name=name,
        title=title,
        groups=(Group("q", "prescribed and unknown quantities", quantities),),
        matrices=matrices,
        exports=(Export("conditions", "residual and its derivatives", ("residual", "slopes")),),
        references=(reference,) if reference else (),
        sources=LIMITS if reference else NONE,
    )
