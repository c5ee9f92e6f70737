"""Conditions of synthesis as building blocks: residuals and their derivatives by every quantity."""

from __future__ import annotations

import sympy as sp

from symgen.mechanics.synthesis import limits, points
from symgen.symbolic.quantity import Quantity, quantity
from symgen.symbolic.system import Export, Group, NamedMatrix, System


def synthesis_limits_system() -> System:
    """Return the conditions on limit positions and transmission angles of a crank-rocker."""
    quantities = tuple(quantity(*row) for row in limits.QUANTITIES)
    residual = limits.conditions({x.name: x.symbol for x in quantities})
    units = "m, m, rad, m, m, rad, rad, m^2, m^2"
    reference = "The thesis on kineto-elastodynamics, Chapter III"
    return _conditions(
        "synthesis_limits", "Limit positions of a crank-rocker", quantities, residual, units, reference
    )


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


def _conditions(
    name: str,
    title: str,
    quantities: tuple[Quantity, ...],
    residual: list[sp.Expr],
    units: str,
    reference: str = "",
) -> System:
    column = sp.ImmutableMatrix(residual)
    slopes = sp.ImmutableMatrix(sp.Matrix(residual).jacobian([x.symbol for x in quantities]))
    matrices = (
        NamedMatrix("residual", column, units, "expressions that vanish"),
        NamedMatrix("slopes", slopes, units, "their derivatives, by the unit of the quantity",
                    columns=tuple(x.name for x in quantities)),
    )  # fmt: skip
    return System(
        name=name,
        title=title,
        groups=(Group("q", "prescribed and unknown quantities", quantities),),
        matrices=matrices,
        exports=(Export("conditions", "residual and its derivatives", ("residual", "slopes")),),
        references=(reference,) if reference else (),
    )
