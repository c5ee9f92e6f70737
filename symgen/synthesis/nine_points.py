"""All four-bars through nine points, by a homotopy from the solutions of a problem with complex points.

Four-bars through nine points have 1442 classes of solutions (Wampler, Morgan and Sommese, 1992), complex ones
included. A class is a linkage with its two cognates, in both orders of crank and rocker. The file
``nine_points.npz`` holds one solution of each for complex points, found by ``benchmarks/nine_points.py``;
here they are followed while these points move to prescribed ones.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from symgen.mechanics.synthesis.points import cognate, without_rotation

Array = NDArray[np.float64]
#: Vectors in isotropic coordinates: ground point and joint of crank and rocker, each x + iy and x - iy.
Complex = NDArray[np.complexfloating[Any, Any]]

#: First step of a path of length one.
_STEP = 0.05
#: Least step, in doubles and in the widest type.
_LEAST = (1e-9, 1e-13)
#: Largest first correction of a step, over the size of the solution.
_PREDICTED = 1e-4
#: Largest last correction of a step, over the size of the solution.
_CORRECTED = 1e-8
#: Steps of one size before it is doubled.
_STEADY = 3
#: Difference of a vector from a real one, or of one class from another, relative to its size.
_SAME = 1e-6


def real_linkages(places: Array) -> tuple[list[Array], int]:
    """Return the real four-bars through nine points, one of three cognates, and the number of lost ones.

    A row has the five quantities of crank and rocker and the coupler's rotations at the last eight points.
    With a solution its complex conjugate is one, which stands for it where its own path is lost. Others are
    lost where paths end at infinity or in a singular solution, as they do for special points only.
    """
    known = start()
    moves = (places - places[0])[1:] @ np.array([1, 1j])
    points = np.column_stack([moves, moves.conj()])
    ends, lost = follow(known[0], known[1], points)
    ends = ends[~lost]
    both = np.concatenate([ends, ends.conj()[:, [1, 0, 3, 2, 5, 4, 7, 6]]])
    ends = both[classes(both)]
    linkages = []
    for members in cognates(ends):
        size = np.maximum(1.0, np.abs(members).max(axis=1, keepdims=True))
        is_real = (np.abs(members[:, 1::2] - members[:, ::2].conj()) < _SAME * size).all(axis=1)
        if is_real.any():
            linkages.append(_as_dyads(members[is_real][0], points, places[0]))
    return linkages, len(known[0]) - len(ends)


def _as_dyads(x: Complex, points: Complex, origin: Array) -> Array:
    g, w, c, v = x[::2]
    _, turned, common = _functions()(*x[:, None], *points.T)[:3]
    joints = [[z.real, z.imag] for z in (w, v)]
    grounds = [np.array([z.real, z.imag]) + origin for z in (g, c)]
    lengths = [abs(w - g), abs(v - c)]
    dyads = [[*grounds[i], *joints[i], lengths[i]] for i in (0, 1)]
    return np.concatenate([*dyads, np.angle(turned * common.conj())])


@cache
def start() -> tuple[Complex, Complex]:
    """Return the solutions (1442, 8) of a problem with complex points, and these (8, 2)."""
    with (files("symgen.synthesis") / "nine_points.npz").open("rb") as file, np.load(file) as stored:
        return stored["solutions"], stored["points"]


def follow(solutions: Complex, start: Complex, end: Complex) -> tuple[Complex, NDArray[np.bool_]]:
    """Return solutions (n, 8) after their points (8, 2) have moved from start to end; and which are lost.

    Each step is one of Runge and Kutta's method of fourth order, corrected three times by Newton's method.
    Paths that doubles lose, as of points on a short arc, whose equations are ill-conditioned, are followed on
    from there in the widest type.
    """
    x, progress, lost = _follow(solutions, start, end, np.zeros(len(solutions)), _LEAST[0])
    if lost.any():
        y, first, last = (z.astype(np.clongdouble) for z in (x[lost], start, end))
        x[lost], _, lost[lost] = _follow(y, first, last, progress[lost].astype(np.longdouble), _LEAST[1])
    return x, lost


def _follow(
    solutions: Complex, start: Complex, end: Complex, progress: Array, least: float
) -> tuple[Complex, Array, NDArray[np.bool_]]:
    """Return solutions, their progress and which are lost, from some progress on, in their own type."""
    x, count, progress = solutions.copy(), len(solutions), progress.copy()
    step, steady = np.minimum(_STEP, 1 - progress), np.zeros(count, dtype=int)
    lost = np.zeros(count, dtype=bool)
    move = end - start

    def rate(x: Complex, t: Array) -> Complex:
        _, slopes, by_point = equations(x, start + t[:, None, None] * move)
        return _solved(slopes, -(by_point * move).sum(axis=2))

    active = np.arange(count)
    with np.errstate(all="ignore"):
        while active.size:
            y, t, h = x[active], progress[active], np.minimum(step[active], 1.0 - progress[active])
            half = h[:, None] / 2
            k1 = rate(y, t)
            k2 = rate(y + half * k1, t + h / 2)
            k3 = rate(y + half * k2, t + h / 2)
            k4 = rate(y + 2 * half * k3, t + h)
            y, t = y + half / 3 * (k1 + 2 * k2 + 2 * k3 + k4), t + h
            sizes = []
            for _ in range(3):
                residual, slopes, _ = equations(y, start + t[:, None, None] * move)
                change = _solved(slopes, residual)
                y = y - change
                sizes.append(np.abs(change).max(axis=1) / np.maximum(np.abs(y).max(axis=1), 1.0))
            good = (sizes[0] < _PREDICTED) & (sizes[2] < _CORRECTED)
            on, back = active[good], active[~good]
            x[on], progress[on] = y[good], t[good]
            steady[on] += 1
            step[on] *= np.where(steady[on] % _STEADY == 0, 2.0, 1.0)
            step[back], steady[back] = h[~good] / 2, 0
            lost[back] = step[back] < least
            active = active[(progress[active] < 1.0) & ~lost[active]]
    return x, progress, lost


def cognates(x: Complex) -> Complex:
    """Return the solutions (n, 3, 8) of a linkage and its two cognates."""
    linkages = [x]
    for order in ([0, 1, 2, 3], [2, 3, 0, 1]):
        g, w, c, v = (x[:, 2 * i : 2 * i + 2] for i in (order[0], order[1], order[2], order[3]))
        parts: tuple[Any, ...] = (g, w, v, c, np.zeros_like(g))
        ground, joint, end, other, _ = cognate(*parts)
        linkages.append(np.concatenate([ground, joint, other, end], axis=1))
    return np.stack(linkages, axis=1)


def classes(x: Complex) -> NDArray[np.intp]:
    """Return the first of each class among solutions (n, 8), by symmetric sums of the ground points."""
    members = cognates(x)
    one, two, three = members[:, 0, 0], members[:, 0, 4], members[:, 1, 4]
    key = np.column_stack([one + two + three, one * two + two * three + three * one])
    size = np.maximum(1.0, np.abs(key).max(axis=1))
    order = np.argsort(key[:, 0].real)
    first = np.ones(len(x), dtype=bool)
    for i, number in enumerate(order):
        for other in order[i + 1 :]:
            if key[other, 0].real - key[number, 0].real > _SAME * size[number]:
                break
            if np.abs(key[other] - key[number]).max() <= _SAME * size[number]:
                first[max(number, other)] = False
    return np.flatnonzero(first)


def _solved(slopes: Complex, right: Complex) -> Complex:
    """Return the solutions of linear systems with scaled rows; nan for a singular system."""
    scale = np.abs(slopes).max(axis=2)
    matrix, right = slopes / scale[:, :, None], right / scale
    if matrix.dtype == np.clongdouble:
        return _eliminated(matrix, right)
    try:
        return np.linalg.solve(matrix, right[:, :, None])[:, :, 0]
    except np.linalg.LinAlgError:
        if len(slopes) == 1:
            return np.full(right.shape, np.nan + 0j)
        half = len(slopes) // 2
        parts = (slice(half), slice(half, None))
        return np.concatenate([_solved(matrix[part], right[part]) for part in parts])


def _eliminated(matrix: Complex, right: Complex) -> Complex:
    """Return the solutions by Gauss's elimination with partial pivoting, in types that LAPACK has not."""
    every, n = np.arange(len(matrix)), matrix.shape[1]
    rows = np.concatenate([matrix, right[:, :, None]], axis=2)
    for k in range(n):
        pivot = k + np.abs(rows[:, k:, k]).argmax(axis=1)
        rows[every, pivot], rows[:, k] = rows[:, k].copy(), rows[every, pivot]
        factor = rows[:, k + 1 :, k] / rows[:, k, k, None]
        rows[:, k + 1 :] -= factor[:, :, None] * rows[:, k, None]
    x = rows[:, :, n]
    for k in range(n - 1, -1, -1):
        x[:, k] = (x[:, k] - (rows[:, k, k + 1 : n] * x[:, k + 1 :]).sum(axis=1)) / rows[:, k, k]
    return x


def equations(x: Complex, points: Complex) -> tuple[Complex, Complex, Complex]:
    """Return residuals (n, 8) and their slopes by the unknowns (n, 8, 8) and by each point (n, 8, 2)."""
    residual, _, _, *slopes = _functions()(*x.T[:, :, None], points[:, :, 0], points[:, :, 1])
    every = np.stack([np.broadcast_to(s, residual.shape) for s in slopes], axis=2)
    return residual, every[:, :, :8], every[:, :, 8:]


@cache
def _functions() -> Callable[..., tuple[Complex, ...]]:
    """Return condition, numerator and denominator of the rotation, and the condition's derivatives."""
    g, h, w, v, c, d, u, s, p, q = symbols = sp.symbols("g h w v c d u s p q")
    condition, turned, common = without_rotation((((g, h), (w, v)), ((c, d), (u, s))), (p, q))
    every = [condition, turned, common, *(condition.diff(x) for x in symbols)]
    return sp.lambdify(symbols, every, "numpy", cse=True)
