"""Independent solutions of the test cases: closed forms, and motions in one coordinate."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from symgen.runtime.model.rods import RodModel
from symgen.runtime.result.result import Result
from symgen.runtime.result.state import State
from symgen.scene.loading import load_scene
from symgen.scene.resolve import resolve_linkage
from symgen.scene.rods.linkage import Linkage

Array = NDArray[np.float64]
G = 9.81
_DIGITS = 40


def compound_pendulum(times: Array, angle: float, rate: float, moment: float, inertia: float) -> Array:
    """Return the angle of a pendulum from the horizontal over time (times,) [rad].

    Parameters
    ----------
    times
        Increasing times, starting with the initial time [s].
    angle, rate
        Initial angle and rate [rad, rad/s].
    moment, inertia
        Mass times lever [kg m], and moment of inertia about the axis [kg m^2].
    """
    from scipy.integrate import solve_ivp

    motion = solve_ivp(
        lambda _, y: [y[1], -G * moment * np.cos(y[0]) / inertia],
        (0, times[-1]), [angle, rate], method="DOP853", rtol=1e-13, atol=1e-13, t_eval=times,
    )  # fmt: skip
    angles: Array = motion.y[0]
    return angles


@cache
def spatial_double_pendulum(times: tuple[float, ...]) -> Array:
    """Return the ends of two rods of 1 m and 1 kg that start along the vertical (times, 2, 3) [m].

    Lagrange's equations in the unit vectors d1, d2 of the rods: with T = 2/3 d1'^2 + 1/6 d2'^2 + 1/2 d1'.d2'
    and V = -g.(3/2 d1 + 1/2 d2), each projected onto the plane normal to its rod. The ends start with 2 m/s
    along x, the lower one with an additional 3 m/s along y.
    """
    from scipy.integrate import solve_ivp

    down = np.array([0.0, 0.0, -1.0])
    one, loads = np.eye(3), np.concatenate([1.5 * G * down, 0.5 * G * down])

    def rates(_: float, state: Array) -> Array:
        d, v = state[:6].reshape(2, 3), state[6:].reshape(2, 3)
        across = [one - np.outer(x, x) / (x @ x) for x in d]
        # The axial acceleration of a unit vector is -v^2.
        along = [np.outer(x, x) / (x @ x) for x in d]
        top = np.hstack([across[0] * 4 / 3 + along[0], across[0] / 2])
        low = np.hstack([across[1] / 2, across[1] / 3 + along[1]])
        right = [across[k] @ loads[3 * k : 3 * k + 3] - (v[k] @ v[k]) * d[k] for k in range(2)]
        found = np.linalg.solve(np.vstack([top, low]), np.concatenate(right))
        return np.concatenate([state[6:], found])

    start = np.concatenate([down, down, [2.0, 0.0, 0.0], [0.0, 3.0, 0.0]])
    motion = solve_ivp(rates, (0, times[-1]), start, method="DOP853", rtol=1e-13, atol=1e-14, t_eval=times)
    d = motion.y[:6].T.reshape(-1, 2, 3)
    return np.cumsum(d, axis=1)


def on_circle(angles: Array) -> Array:
    """Return positions on the circle of 1 m about the origin."""
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


@cache
def peaucellier_arm(end: float) -> Callable[[Array], Array]:
    """Return the Peaucellier linkage of the scene ``peaucellier_limit``, released at rest: A, B, C, D [m].

    The coordinate is the angle psi of the arm from EB to EA, which is smooth through the limit. Rods are
    given by centre of mass and moment of inertia about it: no particles, constraints or multipliers.
    Internal unit of length: centimetre.
    """
    import sympy as sp
    from scipy.integrate import solve_ivp

    psi = sp.symbols("psi")
    reach = 4 * sp.cos(psi) + sp.sqrt(32 - 16 * sp.sin(psi) ** 2)
    crank = 2 * sp.asin(reach / 4)
    pin = sp.Matrix([2, 0])
    a = sp.Matrix([2 * sp.cos(crank), 2 * sp.sin(crank)])
    along = (a - pin) / reach
    across = sp.Matrix([-along[1], along[0]])
    b = pin + 4 * (sp.cos(psi) * along - sp.sin(psi) * across)
    d = pin + 4 * (sp.cos(psi) * along + sp.sin(psi) * across)
    points = [x / 100 for x in (0, 0, *a, *b, *(b + d - a), *d, *pin)]
    jet = sp.lambdify(psi, [[sp.diff(x, psi, k) for x in points] for k in range(3)], cse=True)
    rods = ((0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (2, 5), (1, 4))

    def slope(_: float, y: Array) -> list[float]:
        place, change, bend = (np.array(x, dtype=float).reshape(6, 2) for x in jet(y[0]))
        inertia = inertia_change = pull = 0.0
        for p, q in rods:
            rod = place[q] - place[p]
            length = np.hypot(*rod)
            middle, middle_bend = (change[p] + change[q]) / 2, (bend[p] + bend[q]) / 2
            across = np.array([-rod[1], rod[0]]) / length**2
            spin, spin_bend = across @ (change[q] - change[p]), across @ (bend[q] - bend[p])
            inertia += length * (middle @ middle + length**2 / 12 * spin**2)
            inertia_change += 2 * length * (middle @ middle_bend + length**2 / 12 * spin * spin_bend)
            pull += G * length * middle[1]
        return [y[1], -(pull + inertia_change * y[1] ** 2 / 2) / inertia]

    start = float(sp.nsolve(reach - 4 * sp.cos(sp.Rational(4, 10)), 1.0))
    motion = solve_ivp(
        slope, (0, end), [start, 0.0], method="DOP853", rtol=1e-12, atol=1e-13, dense_output=True
    )
    return lambda t: np.array([jet(x)[0][2:10] for x in motion.sol(t)[0]]).reshape(len(t), 4, 2)


def accelerations_error(scene: str, model: RodModel, result: Result) -> float:
    """Return the relative error of initial and final accelerations of a run, against 40 digits."""
    linkage = resolve_linkage(load_scene(scene)).as_written
    last = {p: result.final[p] for p in model.description.free}
    end = model.state(
        {p: found["position"] for p, found in last.items()},
        {p: found["velocity"] for p, found in last.items()},
    )
    return max(_accelerations_error(linkage, model, state) for state in (model.initial_state(), end))


def _accelerations_error(linkage: Linkage, model: RodModel, state: State) -> float:
    found = model.accelerations(state)
    exact = exact_accelerations(linkage, state)
    difference = max(float(abs(found[p][i] - x)) for p, row in exact.items() for i, x in enumerate(row))
    return difference / max(float(abs(x)) for row in exact.values() for x in row)


def exact_accelerations(linkage: Linkage, state: State) -> dict[str, list[Any]]:
    """Return the accelerations of the free points of rods under gravity [m/s^2], to 40 digits.

    Kinetic energy from velocity of the centre and rotation: T = m |v_c|^2/2 + J |v_2 - v_1|^2/(2 l^2),
    with d . d'' = -|d'|^2 for d from end to end; all unknowns in one dense elimination.
    """
    axes = linkage.dimension
    free = [p.name for p in linkage.points if not p.ground]
    with mpmath.workdps(_DIGITS):
        n, m = len(free) * axes, len(linkage.links)
        matrix, right = mpmath.zeros(n + m), mpmath.zeros(n + m, 1)
        gravity = [_exact(g) for g in linkage.gravity]
        for row, k in enumerate(linkage.links, n):
            mass, length, centre, inertia = (_exact(x) for x in (k.mass, k.length, k.centre, k.inertia))
            shares = {k.start: 1 - centre / length, k.end: centre / length}
            turn = {k.start: -1, k.end: 1}
            d, w = (
                [mpmath.mpf(a) - mpmath.mpf(b) for a, b in zip(of[k.end], of[k.start], strict=True)]
                for of in (state.positions, state.velocities)
            )
            right[row] = -mpmath.fdot(w, w)
            for a in set(shares) & set(free):
                for i in range(axes):
                    at = free.index(a) * axes + i
                    right[at] += mass * shares[a] * gravity[i]
                    matrix[at, row] = matrix[row, at] = turn[a] * d[i]
                    for b in set(shares) & set(free):
                        share = mass * shares[a] * shares[b] + inertia * turn[a] * turn[b] / length**2
                        matrix[at, free.index(b) * axes + i] += share
        solved = mpmath.lu_solve(matrix, right)
        return {p: [solved[i * axes + j] for j in range(axes)] for i, p in enumerate(free)}


def _exact(expression: Any) -> Any:
    return mpmath.mpmathify(expression.evalf(_DIGITS + 5))
