"""Axes of an elastic link in the rigid motion, from vectors in fixed axes."""

from __future__ import annotations

from functools import lru_cache

import sympy as sp

from symgen.mechanics.elastic.hamilton import (
    AX,
    AY,
    FIELDS,
    N0,
    OMEGA,
    OMEGA_RATE,
    HamiltonStep,
    derive,
)
from symgen.mechanics.elastic.turning_axes import COSINE, SINE
from symgen.symbolic.names import Names
from symgen.symbolic.quantity import Quantity, quantity

Vector = tuple[sp.Expr, ...]  # two components

#: The first point of a link in fixed axes, and its velocity.
POINT = (
    quantity("X_1", "m", "first point of the link, X of fixed axes"),
    quantity("Y_1", "m", "first point of the link, Y of fixed axes"),
)
POINT_RATES = (
    quantity("X_1_t", "m/s", "rate of X_1"),
    quantity("Y_1_t", "m/s", "rate of Y_1"),
)


def local(vector: Vector, cosine: sp.Expr, sine: sp.Expr) -> Vector:
    """Return the axial and transverse components of a vector in fixed axes."""
    return cosine * vector[0] + sine * vector[1], cosine * vector[1] - sine * vector[0]


def moving_frame(
    names: Names, link: str, along: tuple[Vector, Vector, Vector], felt: Vector, force: Vector
) -> dict[sp.Symbol, sp.Expr]:
    """Return COSINE, SINE and the rigid-motion inputs of a link's equation, by symbol.

    Parameters
    ----------
    names, link
        Collector of intermediates, and the name of the link in their names.
    along
        The vector from the first point to the second [m], and its first and second rate.
    felt
        Acceleration of the first point minus gravity [m/s^2].
    force
        Force on the link at its first point [N]; its axial component is the axial force there.
    """
    (x, y), rate, second = along
    length = names.scalar(f"{link}_reach", sp.sqrt(x**2 + y**2), "m", f"distance of the ends of {link}")
    cosine = names.scalar(f"{link}_cosine", x / length, "1", f"{COSINE.description}, {link}")
    sine = names.scalar(f"{link}_sine", y / length, "1", f"{SINE.description}, {link}")
    (stretching, turning), (_, across) = (local(v, cosine, sine) for v in (rate, second))
    omega_of, omega_rate_of = _rates_of_direction()
    r, r_t, v_n, a_n = _POLAR
    known = {r: length, r_t: stretching, v_n: turning, a_n: across}
    felt_along, felt_across = local(felt, cosine, sine)
    quantities = {COSINE.symbol: cosine, SINE.symbol: sine}

    def name(q: Quantity, value: sp.Expr) -> None:
        quantities[q.symbol] = names.scalar(f"{link}_{q.name}", value, q.unit, f"{q.description}, {link}")

    name(OMEGA, omega_of.xreplace(known))
    name(OMEGA_RATE, omega_rate_of.xreplace(known | quantities))
    # These are of the linkage, whose parameters may be called like the symbols above.
    for q, value in ((AX, felt_along), (AY, felt_across), (N0, -local(force, cosine, sine)[0])):
        name(q, value)
    return quantities


#: Length of a vector, its rate, and the transverse components of its first and second rate.
_POLAR = sp.symbols("r r_t v_n a_n", real=True)


@lru_cache(maxsize=1)
def _rates_of_direction() -> tuple[sp.Expr, sp.Expr]:
    """Return theta' of r (cos theta, sin theta) by ``_POLAR``, and theta'' by these and theta'."""
    t = sp.Symbol("t", real=True)
    r, theta = sp.Function("r", real=True)(t), sp.Function("theta", real=True)(t)
    vector, across = sp.Matrix([sp.cos(theta), sp.sin(theta)]), sp.Matrix([-sp.sin(theta), sp.cos(theta)])
    first, second = (sp.trigsimp(sp.expand((r * vector).diff(t, k).dot(across))) for k in (1, 2))
    length, rate, v_n, a_n = _POLAR
    known = {theta.diff(t, 2): OMEGA_RATE.symbol, theta.diff(t): OMEGA.symbol, r.diff(t): rate, r: length}
    omega = sp.solve(first.subs(known) - v_n, OMEGA.symbol)[0]
    return omega, sp.solve(second.subs(known) - a_n, OMEGA_RATE.symbol)[0]


def from_fixed_axes() -> tuple[HamiltonStep, ...]:
    """Return the steps from the place of a point to its velocity in axes of the link: Eqs. (6.2)-(6.9)."""
    c, s = COSINE.symbol, SINE.symbol
    place = next(step.expressions for step in derive().steps if step.name == "place")
    turned = local(place, c, -s)
    position = tuple(
        sp.Add(q.symbol, *sp.Add.make_args(sp.expand(e))) for q, e in zip(POINT, turned, strict=True)
    )
    rates = {q.symbol: FIELDS[f"{name}_t"].symbol for name, q in FIELDS.items() if name in ("u", "w")}
    rates |= {q.symbol: r.symbol for q, r in zip(POINT, POINT_RATES, strict=True)}
    rates |= {c: -OMEGA.symbol * s, s: OMEGA.symbol * c}
    velocity = tuple(sp.expand(sp.Add(*(e.diff(q) * r for q, r in rates.items()))) for e in position)
    rotated = (sp.expand(e) for e in local(velocity, c, s))
    origin = local(tuple(q.symbol for q in POINT_RATES), c, s)
    simplified = tuple(sp.expand(e.subs(s**2, 1 - c**2)) for e in rotated)
    return (
        HamiltonStep("position", ("X", "Y"), position, "m", "position R in fixed axes", "(6.2), (6.3)"),
        HamiltonStep(
            "velocity_in_fixed_axes", ("X", "Y"), velocity, "m/s", "velocity in fixed axes, the rate of R",
            "(6.4)",
        ),
        HamiltonStep(
            "rotated_velocity", ("x", "y"), simplified, "m/s",
            "this velocity, rotated into axes of the link, simplified by c^2 + s^2 = 1", "(6.5)-(6.7)",
        ),
        HamiltonStep(
            "origin_velocity", ("v_x", "v_y"), origin, "m/s",
            "velocity of the first point in axes of the link, x1' and y1'", "(6.8), (6.9)",
        ),
    )  # fmt: skip
