"""Axes of an elastic link in the rigid motion, from vectors in fixed axes."""

from __future__ import annotations

from functools import lru_cache

import sympy as sp

from symgen.mechanics.elastic.hamilton import AX, AY, N0, OMEGA, OMEGA_RATE
from symgen.mechanics.elastic.turning_axes import COSINE, SINE
from symgen.symbolic.names import Names
from symgen.symbolic.quantity import Quantity

Vector = tuple[sp.Expr, ...]  # two components


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
