"""A driven loop followed by arc length, past the turning points of its input."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from symgen.errors import SimulationError
from symgen.runtime.arrays import Array
from symgen.runtime.closure.start import Closed
from symgen.runtime.loop.kernels import LoopKernels
from symgen.runtime.rods.following.continuation import Curve, CurvePoint

#: Most steps along the curve of poses.
_MOST_STEPS = 100_000
#: Largest defect of closure of a pose of the curve, over the size.
_EXACT = 1e-11


class LoopConstraints:
    """Closure as constraints in metres: angles and rotations times the size of the loop.

    The unknowns are the dependent variables, angles times the size, so that a curve has one unit.
    """

    def __init__(self, kernels: LoopKernels, q: Array) -> None:
        d = kernels.description
        self.kernels, self.whole, self.solved = kernels, q.copy(), d.having("dependent")
        self.scale = d.size / kernels.scale
        self.size = d.size

    def pose(self, x: Array, t: float) -> Array:
        """Return all variables [rad, m] at the unknowns x [m] and the time t [s]."""
        q = self.whole.copy()
        q[self.solved] = x / self.scale[self.solved]
        q[self.kernels.inputs] = self.kernels.prescribed(t)[:, 0]
        return q

    def unknowns(self, q: Array) -> Array:
        """Return the unknowns [m] of a pose."""
        return (q * self.scale)[self.solved]

    def residual(self, x: Array, t: float) -> Array:
        """Return the small rotation, times the size, and the displacement by which the loop is open [m]."""
        e = self._position(x, t)["closure_defect"]
        turn = 0.5 * np.array([e[2, 1] - e[1, 2], e[0, 2] - e[2, 0], e[1, 0] - e[0, 1]])
        return np.concatenate([self.size * turn, e[:, 3]])

    def jacobian(self, x: Array, t: float) -> Array:
        """Return its derivative by the unknowns [1], shape (6, unknowns)."""
        return self._screws(x, t)[:, self.solved] / self.scale[self.solved]

    def drift(self, x: Array, t: float) -> Array:
        """Return its rate at fixed unknowns [m/s]."""
        inputs = self.kernels.inputs
        return self._screws(x, t)[:, inputs] @ self.kernels.prescribed(t)[:, 1]

    def _screws(self, x: Array, t: float) -> Array:
        screws = self._position(x, t)["closure_jacobian"].copy()
        screws[:3] *= self.size
        return screws

    def _position(self, x: Array, t: float) -> dict[str, Array]:
        q = self.pose(x, t)
        return self.kernels("position", t, q, np.zeros_like(q))


def walk(kernels: LoopKernels, begin: Closed, stop: float, samples: int) -> tuple[Array, Array, list[float]]:
    """Follow the closed loop by arc length till its input leaves the range or the curve closes.

    Parameters
    ----------
    begin
        The pose at the beginning of the range.
    stop
        The time at which the range ends [s].
    samples
        How many poses to return, at equal distances along the curve.

    Returns
    -------
    tuple
        Times, poses (samples, variables), and the times of the input's turning points.

    Raises
    ------
    SimulationError
        When the curve cannot be followed from its beginning.
    """
    constraints = LoopConstraints(kernels, begin.q)
    curve = Curve(constraints, constraints.size, abs(stop - begin.t))
    if (
        np.max(np.abs(constraints.residual(constraints.unknowns(begin.q), begin.t)))
        > _EXACT * constraints.size
    ):
        raise SimulationError(
            f"the loop closes within its assembly tolerance only at {kernels.value_at(begin.t)}, and turning "
            "points of the input are followed where a loop closes exactly\n  Evaluate it without through.",
            time=begin.t,
        )
    onward = np.append(np.zeros(len(constraints.solved)), np.sign(stop - begin.t))
    start = curve.point(curve.join(constraints.unknowns(begin.q), begin.t), onward)
    ends = min(begin.t, stop), max(begin.t, stop)
    path = curve.walk(start, ends, True, _MOST_STEPS)
    low, high = (e / curve.duration for e in ends)
    outside = next((i for i, p in enumerate(path) if i and not low <= p.x[-1] <= high), len(path))
    path = path[: outside + 1]  # no turning point beyond the range is passed
    if len(path) < 2:
        raise SimulationError(
            f"the loop cannot be followed from {kernels.value_at(begin.t)}: the position is singular",
            time=begin.t,
        )
    turning = [
        float(b.x[-1] * curve.duration)
        for a, b, c in zip(path, path[1:], path[2:], strict=False)
        if (b.x[-1] - a.x[-1]) * (c.x[-1] - b.x[-1]) < 0.0
    ]
    points = _resampled(curve, _inside(curve, path, low, high), samples)
    split = [curve.split(p.x) for p in points]
    return (
        np.array([t for _, t in split]),
        np.array([constraints.pose(x, t) for x, t in split]),
        turning,
    )


def _inside(
    curve: Curve[LoopConstraints], path: list[CurvePoint], low: float, high: float
) -> list[CurvePoint]:
    """Return the path; a last point beyond the range is replaced by the end of the range."""
    last = path[-1]
    if low <= last.x[-1] <= high:
        return path
    duration = curve.duration
    end = curve.at_time(path[-2], last, duration * (high if last.x[-1] > high else low))
    return [*path[:-1], *([end] if end is not None else [])]


def _resampled(curve: Curve[LoopConstraints], path: list[CurvePoint], samples: int) -> list[CurvePoint]:
    """Return points at equal distances along the path."""
    along = np.concatenate([[0.0], np.cumsum([np.linalg.norm(b.x - a.x) for a, b in pairwise(path)])])
    points = []
    for s in np.linspace(0.0, along[-1], samples):
        i = min(max(int(np.searchsorted(along, s)), 1), len(path) - 1)
        part = float((s - along[i - 1]) / (along[i] - along[i - 1]))
        point = path[i - 1] if part <= 0.0 else path[i] if part >= 1.0 else None
        point = point or curve.between(path[i - 1], path[i], part)
        if point is not None:
            points.append(point)
    return points
