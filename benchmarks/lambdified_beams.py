"""The elastic four-bar with prescribed crank motion by SymPy, ``lambdify`` and SciPy, for comparison.

The matrices from the derivation of the element are assembled for the 10 unknowns of the linkage in the exact
form, with numeric parameters. The rigid motion and its axial forces are in closed form (two circles, Newton
and Euler) in the same function, so one call evaluates everything at a time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from symgen.elements import ELEMENTS
from symgen.elements.element import LENGTH
from symgen.mechanics.elastic.beam_matrices import BeamMatrices, ElementSection, beam_matrices

Array = NDArray[np.float64]
Vector = tuple[sp.Expr, sp.Expr]
Pairs = list[tuple[sp.Symbol, sp.Expr]]

TIME = sp.Symbol("t")
#: Index of the unknown for each dof u, w, theta, kappa of both nodes; None if it is fixed.
UNKNOWNS = 10
PLACES: dict[str, tuple[int | None, ...]] = {
    "crank": (None, None, None, 4, 0, 1, 5, None),
    "coupler": (0, 1, 6, None, 2, 3, 7, None),
    "output": (2, 3, 8, None, None, None, 9, None),
}


@dataclass(frozen=True)
class Link:
    """A link in rigid motion: direction, rates, acceleration of its first point, and axial force there."""

    name: str
    length: float
    e: Vector
    rate: sp.Expr
    acceleration: sp.Expr
    origin: Vector
    pull: sp.Expr


def plus(*parts: tuple[Any, Vector]) -> Vector:
    """Return a linear combination of vectors."""
    x, y = (sp.Add(*(f * v[i] for f, v in parts)) for i in range(2))
    return x, y


def left(v: Vector) -> Vector:
    """Return a vector rotated by 90 degrees counterclockwise."""
    return -v[1], v[0]


def dot(v: Vector, w: Vector) -> sp.Expr:
    """Return the scalar product."""
    return v[0] * w[0] + v[1] * w[1]


def cross(v: Vector, w: Vector) -> sp.Expr:
    """Return the out-of-plane component of the vector product."""
    return v[0] * w[1] - v[1] * w[0]


def rigid_links(bar: Any) -> tuple[list[Link], Pairs]:
    """Return the links in the rigid motion of the linkage with the parameters of ``bar``, over time.

    Their quantities are symbols; the second value defines these in order.
    """
    named: Pairs = []

    def name(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(name(v) for v in value)
        if sp.sympify(value).is_Number:
            return value
        named.append((sp.Symbol(f"r{len(named)}"), value))
        return named[-1][0]

    a, b, c, m, speed = (sp.Float(x) for x in (bar.a, bar.b, bar.c, bar.m, bar.speed))
    heavy, Q = sp.Float(bar.bearing), (sp.Float(bar.d), sp.Integer(0))
    e1 = name((sp.cos(speed * TIME), sp.sin(speed * TIME)))
    A = plus((a, e1))
    gap = name(plus((1, Q), (-1, A)))
    reach = name(dot(gap, gap))
    along = name((b**2 - c**2 + reach) / 2)
    e2 = name(plus((along / reach / b, gap), (sp.sqrt(b**2 * reach - along**2) / reach / b, left(gap))))
    B = plus((1, A), (b, e2))
    e3 = name(plus((1 / c, B), (-1 / c, Q)))
    turn = name(cross(e2, e3))
    w2, w3 = name((-a * speed * cross(e1, e3) / (b * turn), -a * speed * cross(e1, e2) / (c * turn)))
    inward = name(plus((a * speed**2, e1), (b * w2**2, e2), (-c * w3**2, e3)))
    al2, al3 = name((dot(inward, e3) / (b * turn), dot(inward, e2) / (c * turn)))
    aA, aB = name((plus((-(speed**2), A)), plus((-(w3**2) * c, e3), (al3 * c, left(e3)))))
    # moments of the coupler about A and of the output link about Q give the force of B on the coupler
    first = m * (b / 2 * cross(e2, aA) + b**2 / 3 * al2)
    second = -m * c**2 / 3 * al3 - heavy * cross(e3, aB)
    on_coupler_b = name(plus((-second / turn, e2), (first / turn, e3)))
    centre = plus((1, aA), (b / 2 * al2, left(e2)), (-b / 2 * w2**2, e2))
    on_coupler_a = name(plus((m * b, centre), (-1, on_coupler_b)))
    on_output = plus((-1, on_coupler_b), (-heavy, aB))
    on_crank = plus((m * a / 2, aA), (1, on_coupler_a), (heavy, aA))
    back = plus((-1, e3))
    none = sp.Integer(0)
    links = [
        Link("crank", bar.a, e1, speed, none, (none, none), name(-dot(on_crank, e1))),
        Link("coupler", bar.b, e2, w2, al2, aA, name(-dot(on_coupler_a, e2))),
        Link("output", bar.c, back, w3, al3, aB, name(-dot(on_output, back))),
    ]
    return links, named


def assembled(bar: Any) -> tuple[list[sp.Matrix], Pairs]:
    """Return M, C, K and Q of the whole linkage, and the definitions of their symbols."""
    section = ElementSection(
        (sp.Float(bar.m),), (sp.Integer(0),), (sp.Float(bar.EA),), (sp.Float(bar.EI),), (sp.Integer(0),)
    )
    matrices = beam_matrices(ELEMENTS["beam8"], section)
    M, C, K, Q = (sp.zeros(UNKNOWNS, n) for n in (UNKNOWNS, UNKNOWNS, UNKNOWNS, 1))
    links, named = rigid_links(bar)
    for link in links:
        places = PLACES[link.name]
        kept = [i for i, p in enumerate(places) if p is not None]
        for total, part in zip((M, C, K, Q), of_link(link, matrices), strict=True):
            for i in kept:
                for j in kept if part.cols > 1 else (0,):
                    total[places[i], places[j] if part.cols > 1 else 0] += part[i, j]
    for x, link in ((0, links[1]), (2, links[2])):
        for i in range(2):
            M[x + i, x + i] += bar.bearing
            Q[x + i] -= bar.bearing * link.origin[i]
    return [M, C, K, Q], named


def of_link(link: Link, found: BeamMatrices) -> tuple[sp.Matrix, ...]:
    """Return M, C, K and Q of a link in fixed axes, in the exact form."""
    known = {LENGTH.symbol: sp.Float(link.length)}

    def number(matrix: sp.ImmutableMatrix) -> sp.Matrix:
        return sp.Matrix(matrix).xreplace(known).evalf(17)

    rate, turn = link.rate, link.acceleration
    ax, ay = dot(link.origin, link.e), dot(link.origin, left(link.e))
    mass, gyro, stiffness = (number(x) for x in (found.mass, found.gyroscopic, found.stiffness))
    geometric = [number(x) for x in found.geometric]
    T, J = sp.eye(8), sp.zeros(8, 8)
    for i in (0, 4):
        T[i : i + 2, i : i + 2] = sp.Matrix([[link.e[0], -link.e[1]], [link.e[1], link.e[0]]])
        J[i, i + 1], J[i + 1, i] = -1, 1
    local = stiffness - rate**2 * mass - turn * gyro
    local += link.pull * geometric[0] + ax * geometric[1] - rate**2 * geometric[2]
    local += turn * mass * J.T + rate**2 * (mass * J.T * J.T - 2 * gyro * J.T)
    load = -ax * number(found.load_x) - ay * number(found.load_y)
    load += rate**2 * number(found.load_out) - turn * number(found.load_turn)
    damping = rate * (2 * mass * J.T - 2 * gyro)
    return T * mass * T.T, T * damping * T.T, T * local * T.T, T * load


class Lambdified:
    """The equations of motion as one lambdified function of time, integrated by SciPy's DOP853."""

    def __init__(self, bar: Any, functions: str) -> None:
        self.bar = bar
        matrices, named = assembled(bar)
        entries = [entry for matrix in matrices for entry in matrix]

        def shared(expressions: Any) -> tuple[Pairs, Any]:
            # the same search as with cse=True, but keeping the names of the rigid motion, which is faster
            own, short = sp.cse(expressions, list=False)
            return [*named, *own], short

        self.function: Callable[[float], list[float]] = sp.lambdify(
            TIME, entries, modules=functions, cse=shared
        )
        self.evaluations = 0

    def matrices(self, t: float) -> tuple[Array, Array, Array, Array]:
        """Return M, C, K and Q at a time."""
        found = np.array(self.function(t), dtype=float)
        n = UNKNOWNS * UNKNOWNS
        M, C, K = found[: 3 * n].reshape(3, UNKNOWNS, UNKNOWNS)
        return M, C, K, found[3 * n :]

    def rate(self, t: float, y: Array) -> Array:
        """Return y' of y = (S, S')."""
        M, C, K, Q = self.matrices(t)
        v = y[UNKNOWNS:]
        return np.concatenate([v, np.linalg.solve(M, Q - C @ v - K @ y[:UNKNOWNS])])

    def turn(self, tolerance: float, samples: int, scale: Array) -> Array:
        """Return S at equally spaced times of one revolution from rest, (samples, 10).

        ``scale`` is the scale of each of (S, S') for the absolute tolerances.
        """
        from scipy.integrate import solve_ivp

        times = np.linspace(0.0, self.bar.period, samples)
        found = solve_ivp(
            self.rate,
            (0.0, self.bar.period),
            np.zeros(2 * UNKNOWNS),
            method="DOP853",
            t_eval=times,
            rtol=tolerance,
            atol=tolerance * scale,
        )
        if not found.success:
            raise ArithmeticError(found.message)
        self.evaluations = int(found.nfev)
        return np.asarray(found.y[:UNKNOWNS].T)
