"""Independent solutions of the test cases: closed forms, and motions in minimal coordinates."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from symgen.scene.loading import load_scene
from symgen.scene.resolve import resolve_linkage

if TYPE_CHECKING:
    import sympy as sp

Array = NDArray[np.float64]
G = 9.81


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
        solution = np.linalg.solve(np.vstack([top, low]), np.concatenate(right))
        return np.concatenate([state[6:], solution])

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

    The coordinate is the angle psi of the arm from EB to EA, which is smooth through the limit. Internal unit
    of length: centimetre.
    """
    import sympy as sp

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
    rods = ((0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (2, 5), (1, 4))
    start = float(sp.nsolve(reach - 4 * sp.cos(sp.Rational(4, 10)), 1.0))
    motion = _in_one_coordinate(psi, points, rods, (start, 0.0), end)
    return lambda times: motion(times)[:, 1:5]


@cache
def four_bar(end: float) -> Callable[[Array], Array]:
    """Return the four-bar linkage of the scene ``far_origin``: A and B relative to O [m].

    The coordinate is the angle phi of the crank; B is the intersection of two circles, to the left of AC.
    """
    import sympy as sp

    phi = sp.symbols("phi")
    a, c = sp.Matrix([sp.cos(phi), sp.sin(phi)]), sp.Matrix([2, 0])
    square = (c - a).dot(c - a)
    part = (square + sp.Rational(18, 10) ** 2 - sp.Rational(14, 10) ** 2) / (2 * square)
    height = sp.sqrt(sp.Rational(18, 10) ** 2 / square - part**2)
    b = a + part * (c - a) + height * sp.Matrix([a[1] - c[1], c[0] - a[0]])
    points = [sp.Integer(0), sp.Integer(0), *a, *b, *c]
    motion = _in_one_coordinate(phi, points, ((0, 1), (1, 2), (2, 3)), (1.1, 2.5), end)
    return lambda times: motion(times)[:, 1:3]


def _in_one_coordinate(
    psi: sp.Symbol,
    coordinates: Sequence[sp.Expr],
    rods: Sequence[tuple[int, int]],
    start: tuple[float, float],
    end: float,
) -> Callable[[Array], Array]:
    """Return the points of a planar linkage of rods of 1 kg/m under gravity over time (times, points, 2) [m].

    Rods are given by centre of mass and moment of inertia about it: no particles, constraints or multipliers.

    Parameters
    ----------
    psi, coordinates
        The coordinate of the motion, and x, y of every point as functions of it [m].
    rods
        Numbers of the points at the ends of every rod.
    start, end
        Initial value and rate of the coordinate, and the final time [s].
    """
    import sympy as sp
    from scipy.integrate import solve_ivp

    # Functions of numbers, which are several times as fast there as those of arrays.
    jet = sp.lambdify(psi, [[sp.diff(x, psi, k) for x in coordinates] for k in range(3)], "math", cse=True)

    def slope(_: float, y: Array) -> list[float]:
        place, change, bend = (np.array(x, dtype=float).reshape(-1, 2) for x in jet(y[0]))
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

    motion = solve_ivp(slope, (0, end), start, method="DOP853", rtol=1e-12, atol=1e-13, dense_output=True)
    return lambda times: np.array([jet(x)[0] for x in motion.sol(times)[0]]).reshape(len(times), -1, 2)


@cache
def hanging_chain(scene: str, times: tuple[float, ...]) -> Array:
    """Return the joints of a planar chain of uniform rods, released at rest (times, rods, 2) [m].

    The first point of the scene is the support. By Gauss's principle, the angular accelerations minimise
    the sum of m |a - g|^2, with half the mass of a rod at each of the two points (1 -+ 1/sqrt(3))/2 of its
    length, which is exact for a uniform rod. Householder reflections with the heaviest rows first keep the
    digits of light rods next to heavy ones (Cox and Higham 1998).
    """
    from scipy.integrate import solve_ivp
    from scipy.linalg import qr, solve_triangular

    linkage = resolve_linkage(load_scene(scene)).as_written
    places = [p.at for p in linkage.points]
    x, y = np.array([[float(v - u) for u, v in zip(*ends, strict=True)] for ends in pairwise(places)]).T
    lengths, angles = np.hypot(x, y), np.arctan2(y, x)
    n = len(lengths)
    # Row 2k+i: the fractions of all rods up to point i of rod k.
    share = np.repeat(np.tril(np.ones((n, n)), -1), 2, axis=0)
    share[np.arange(2 * n), np.arange(2 * n) // 2] = np.tile([0.5 - 3**-0.5 / 2, 0.5 + 3**-0.5 / 2], n)
    weights = np.tile(np.sqrt([float(k.mass) / 2 for k in linkage.links for _ in range(2)]), 2)
    order = np.argsort(-weights, kind="stable")

    def rates(_: float, state: Array) -> Array:
        cosine, sine, rate = np.cos(state[:n]), np.sin(state[:n]), state[n:]
        rows = np.concatenate([-share * sine, share * cosine]) * weights[:, None]
        inward = lengths * rate**2
        right = np.concatenate([share @ (inward * cosine), share @ (inward * sine) - G]) * weights
        q, r, columns = qr(rows[order], mode="economic", pivoting=True)
        rates_of_state = np.empty(n)
        rates_of_state[columns] = solve_triangular(r, q.T @ right[order])
        return np.concatenate([rate, rates_of_state / lengths])

    start = np.concatenate([angles, np.zeros(n)])
    motion = solve_ivp(rates, (0, times[-1]), start, method="DOP853", rtol=1e-13, atol=1e-13, t_eval=times)
    angle = motion.y[:n].T
    ends = np.stack([lengths * np.cos(angle), lengths * np.sin(angle)], axis=2)
    return np.array(places[0], dtype=float) + np.cumsum(ends, axis=1)
