"""Following a driven loop past poles of the angles of ball joints, next to which the angles turn too fast.

A path that misses such a pole by little turns its angles by half a revolution in a tiny part of the input.
Z(theta) Y(eta) X(alpha) is the same rotation with (theta + pi, pi - eta, alpha + pi): the links move
smoothly, and angles that go straight on describe the same closure on the far side.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from symgen.runtime import _core, _loop
from symgen.runtime.arrays import Array
from symgen.runtime.loop.ball_poles import ball_pole
from symgen.runtime.loop.frames import standing
from symgen.runtime.loop.kernels import LoopKernels

Rows = tuple[Array, ...]

#: Distances [rad, or sizes of the loop] of the input by which a pole is stepped over: the first to succeed.
_OVER = (0.02, 0.01, 0.005, 0.0025)
#: Places before the pole, in such distances, and the weights of extrapolation to the first one behind it.
_BEFORE = np.array([-5.0, -4.0, -3.0, -2.0, -1.0])
_ONWARD = np.array([5.0, -24.0, 45.0, -40.0, 15.0])
#: Largest error of extrapolated places of links.
_LINKS = 1e-4
#: Defect of closure that rounding leaves.
_CLOSED = 1e-11
#: Poles that are stepped over at most.
_MOST = 10_000
#: Steps to poses on either side of a time; weights of interpolation halfway, of all and of all but the last.
_STEPS = np.array([-4, -3, -2, -1, 1, 2, 3, 4])
FINE = np.array([-1, 8, -28, 56, 56, -28, 8, -1]) / 70.0
COARSE = np.array([0, 1, -6, 15, 15, -6, 1, 0]) / 20.0
#: First step to a time next to a pole, over the whole.
_FIRST_STEP = 1.0 / 64.0
#: Most steps to such a time.
_TRIES = 300
#: Largest change of an angle in a step [rad].
_TURN = 0.3


@dataclass(frozen=True, slots=True)
class FollowedSamples:
    """Samples of a followed loop: times, states, outputs and diagnosis, row by row."""

    times: Array
    states: Array
    out: Array
    diagnosis: Array


def follow_over(
    kernels: LoopKernels,
    equations: _loop.LoopEquations,
    t: float,
    q: Array,
    targets: Array,
    longest: float,
    *rows: Array,
) -> tuple[int, int, float]:
    """Follow the loop as ``equations.follow`` does, stepping over poles of the angles of ball joints.

    Times so near a pole that the angles cannot be followed there get a closed pose and the status
    RATES_UNDETERMINED.
    """
    begin, reached = (t, q[:-1].copy()), 0
    for _ in range(_MOST):
        rest = tuple(a[reached:] for a in rows)
        status, count, at = equations.follow(begin[0], q, targets[reached:], longest, *rest)
        reached += count
        if status == _core.DONE or status in (_core.NOT_FINITE, _loop.INCONSISTENT):
            return status, reached, at
        far = _beyond(kernels, equations, begin, (at, q[:-1]), float(targets[reached]))
        if far is None:
            return status, reached, at
        way = np.sign(far[0] - at)
        inside = int(np.count_nonzero((far[0] - targets[reached:]) * way > 0.0))
        part = slice(reached, reached + inside)
        between = tuple(a[part] for a in rows)
        if inside and not _inside(kernels, equations, begin, (at, q[:-1]), far, targets[part], between):
            return status, reached, at
        reached += inside
        begin = far
        q[:-1] = far[1]
        if reached == len(targets):
            return _core.DONE, reached, float(targets[-1])
    return status, reached, at


def _beyond(
    kernels: LoopKernels,
    equations: _loop.LoopEquations,
    begin: tuple[float, Array],
    stopped: tuple[float, Array],
    target: float,
) -> tuple[float, Array] | None:
    """Return a closed pose behind the pole at which following stopped; None without such a pole."""
    t, q = stopped
    rate = kernels.lead_at(t)[1]
    if rate == 0.0 or not ball_pole(kernels, t, q):
        return None
    way = 1.0 if target > t else -1.0
    n = len(q)
    for distance in _OVER:
        step = way * distance * kernels.lead_scale / abs(rate)
        times = t + step * _BEFORE
        before = follow_about(kernels, equations.follow, begin, times)
        if before is None or np.any(before[2][:, _loop.STATUS] == _loop.RATES_UNDETERMINED):
            continue
        poses = before[0][:, :n]
        far = t + step, np.append(_ONWARD @ poses, 0.0)
        if equations.close(*far) != _core.DONE:
            continue
        rows = far[1][:-1]
        links = standing(kernels, times, poses)
        if np.max(np.abs(_ONWARD @ links - standing(kernels, np.array(far[:1]), rows[None]))) < _LINKS:
            return far[0], rows
    return None


def follow_about(
    kernels: LoopKernels, follow: Callable[..., Any], begin: tuple[float, Array], times: Array
) -> Rows | None:
    """Return states, outputs and diagnosis at times, followed from a pose before and behind it.

    Times rise or fall; ``follow`` has the arguments of ``equations.follow``. None where that fails.
    """
    all_rows = kernels.empty(len(times))
    order = np.argsort(np.abs(times - begin[0]), kind="stable")
    for part in (order[times[order] >= begin[0]], order[times[order] < begin[0]]):
        if not len(part):
            continue
        rows, targets = kernels.empty(len(part)), times[part]
        longest = max(float(np.max(np.abs(targets - begin[0]))), 1e-12)
        status, *_ = follow(begin[0], np.append(begin[1], 0.0), targets, longest, *rows)
        if status != _core.DONE:
            return None
        for whole, part_rows in zip(all_rows, rows, strict=True):
            whole[part] = part_rows
    return all_rows


def around(
    kernels: LoopKernels, equations: _loop.LoopEquations, start: tuple[float, Array], t: float, apart: float
) -> FollowedSamples | None:
    """Return poses on both sides of a time; None where the input rests or they cannot be reached.

    They are ``apart`` [rad, or sizes of the loop] of the input.
    """
    rate = kernels.lead_at(t)[1]
    if rate == 0.0:
        return None
    times = t + _STEPS * apart * kernels.lead_scale / abs(rate)
    rows = follow_about(kernels, partial(follow_over, kernels, equations), start, times)
    if rows is None or np.any(rows[2][:, _loop.STATUS] != _core.DONE):
        return None
    return FollowedSamples(times, *rows)


def _inside(
    kernels: LoopKernels,
    equations: _loop.LoopEquations,
    begin: tuple[float, Array],
    near: tuple[float, Array],
    far: tuple[float, Array],
    targets: Array,
    rows: Rows,
) -> bool:
    """Give poses at times between the place where following stopped and the far side of the pole."""
    back, q = kernels.empty(len(targets)), np.append(far[1], 0.0)
    longest = max(abs(far[0] - near[0]), 1e-12)
    _, count, at = equations.follow(far[0], q, targets[::-1].copy(), longest, *back)
    left = len(targets) - count
    for whole, row in zip(rows, back, strict=True):
        whole[left:] = row[:count][::-1]
    sides = [near, (at, q[:-1]), far, begin]
    for i in range(left):
        t = float(targets[i])
        sides.sort(key=lambda side: abs(side[0] - t))
        closed = (_closed_at(equations, side, t) for side in sides)
        pose = next((x for x in closed if x is not None), None)
        if pose is None:
            return False
        _write(kernels, equations, t, pose, tuple(a[i] for a in rows))
    return True


def _closed_at(equations: _loop.LoopEquations, start: tuple[float, Array], target: float) -> Array | None:
    """Return the closed pose next to a pole, reached by closing alone: rates have no bound there."""
    at, q = start[0], np.append(start[1], 0.0)
    step, rate = (target - at) * _FIRST_STEP, np.zeros_like(q)
    for _ in range(_TRIES):
        if at == target:
            break
        new = at + step if abs(target - at) > 1.0001 * abs(step) else target
        pose = q + (new - at) * rate
        if equations.close(new, pose) == _core.DONE and np.max(np.abs(pose - q)) < _TURN and new != at:
            at, q, rate, step = new, pose, (pose - q) / (new - at), 1.5 * (new - at)
        else:
            step /= 2.0
    return q[:-1] if equations.closed_screws(target, q)[1] < _CLOSED else None


def _write(
    kernels: LoopKernels, equations: _loop.LoopEquations, t: float, pose: Array, row: tuple[Array, ...]
) -> None:
    """Write a closed pose next to a pole and its outputs, status RATES_UNDETERMINED."""
    n = len(pose)
    defect = equations.closed_screws(t, np.append(pose, 0.0))[1]
    state, out, diagnosis = row
    state[:] = 0.0
    state[:n] = pose
    diagnosis[:] = 0.0
    diagnosis[_loop.CLOSURE], diagnosis[_loop.STATUS] = defect, _loop.RATES_UNDETERMINED
    if kernels.has("outputs"):
        y, work = np.append(state[: 2 * n], 0.0)[None], np.zeros((1, kernels.work_size + 1))
        out[:] = kernels.rows("outputs", np.array([t]), y, work)[0]
