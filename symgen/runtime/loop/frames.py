"""The frames of a loop's links in space, from the numbers of its table."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cache

import numpy as np

from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.library import shipped_module
from symgen.runtime.loop.kernels import LoopKernels

#: Numbers of a row of the table, and of t, q, u, p, work and out of the kernel of its transform.
_ROW = 5
_SIZES = (0, _ROW, 0, 0, 0, 12)
_NONE = np.zeros(1)


@cache
def _transform() -> int:
    """Return the address of the compiled transform of a row, whose module is checked once."""
    address: int = shipped_module("loop_row").ADDRESSES["transform"]
    return address


def transforms(rows: Array) -> Array:
    """Return the transforms of rows of tables, shape (..., 5), as 4x4 matrices by the kernel ``loop_row``."""
    count = rows.size // _ROW
    entries, out = np.zeros((count, _ROW + 1)), np.empty((count, 12))
    entries[:, :_ROW] = rows.reshape(-1, _ROW)
    nothing = np.zeros((count, 1))
    _core.call_many(_transform(), _SIZES, nothing[:, 0], entries, _ROW, _NONE, nothing, out)
    placed = np.zeros((count, 4, 4))
    placed[:, :3], placed[:, 3, 3] = out.reshape(-1, 3, 4), 1.0
    return placed.reshape(*rows.shape[:-1], 4, 4)


def product(rows: Iterable[Array]) -> Array:
    """Return the transform of rows in a chain as a 4x4 matrix."""
    whole = np.eye(4)
    for placed in transforms(np.array([*rows], dtype=float).reshape(-1, _ROW)):
        whole = whole @ placed
    return whole


def standing(kernels: LoopKernels, times: Array, poses: Array) -> Array:
    """Return positions [over the size of the loop] and axes of all links, shape (poses, numbers).

    Poses, shape (poses, variables), are compared by them: they do not depend on the choice of angles. A link
    between two balls may spin about their line: only that axis of it is included.
    """
    d, n = kernels.description, kernels.description.coordinates
    states, work = np.zeros((len(poses), 2 * n + 1)), np.zeros((len(poses), kernels.work_size + 1))
    states[:, :n] = poses
    tables = kernels.many("rows", times, states, work)["rows"].reshape(len(poses), -1, _ROW)
    placed = transforms(tables[:, :-1])
    whole, features = np.eye(4), []
    for k in range(placed.shape[1]):
        whole = whole @ placed[:, k]
        spins = d.joints[k] == d.joints[k + 1] == "S"
        features += [whole[:, :3, 0], whole[:, :3, 3] / d.size, *([] if spins else [whole[:, :3, 1]])]
    return np.concatenate(features, axis=1)


def ball_angles(kernels: LoopKernels, q: Array) -> list[Array]:
    """Return poses, (..., variables), with every choice of the angles of balls that keeps links in place.

    Z(theta) Y(eta) X(alpha) has two; the frame of a link between two balls may also be rotated by 180 deg
    about i.
    """
    d = kernels.description
    solved = {d.variables[i].name: i for i in d.having("dependent")}
    choices = [q]
    for row, joint in enumerate(d.joints, 1):
        theta, eta, alpha = (solved.get(f"{entry}{row}", -1) for entry in ("theta", "eta", "alpha"))
        if joint != "S" or min(theta, eta) < 0:
            continue
        if alpha >= 0:
            choices += [_flipped(q, theta, eta, alpha) for q in choices]
        after = [solved.get(f"{entry}{row + 1}", -1) for entry in ("theta", "eta", "alpha")]
        if row == len(d.joints) or d.joints[row] != "S" or min(after[:2]) < 0:
            continue
        if alpha < 0 <= after[2]:
            choices += [_spun(_flipped(q, theta, eta, -1), after[0], after[1], after[2]) for q in choices]
        elif alpha >= 0 > after[2]:
            choices += [
                _flipped(_spun(q, after[0], after[1], alpha), after[0], after[1], -1) for q in choices
            ]
    return choices


def _flipped(q: Array, theta: int, eta: int, alpha: int) -> Array:
    """Return q with the other angles of Z(theta) Y(eta) X(alpha); without alpha, 180 deg less about i."""
    other = q.copy()
    other[..., theta], other[..., eta] = q[..., theta] + math.pi, math.pi - q[..., eta]
    if alpha >= 0:
        other[..., alpha] += math.pi
    return other


def _spun(q: Array, theta: int, eta: int, alpha: int) -> Array:
    """Return q with a rotation of 180 deg about i before Z(theta) Y(eta), and another about i by alpha."""
    other = q.copy()
    other[..., theta], other[..., eta] = -q[..., theta], -q[..., eta]
    other[..., alpha] += math.pi
    return other
