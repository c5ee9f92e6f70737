"""The frames of a loop's links in space, from the numbers of its table."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import cache

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.kernels.library import shipped_module
from symgen.runtime.loop.kernels import LoopKernels


@cache
def _transform() -> Callable[..., Array]:
    """Return the compiled transform of a row, whose module is checked once."""
    return shipped_module("loop_row").transform


def product(rows: Iterable[Array]) -> Array:
    """Return the transform of rows in a chain as a 4x4 matrix, each by the kernel ``loop_row``."""
    transform, whole = _transform(), np.eye(4)
    for row in rows:
        placed = np.eye(4)
        placed[:3] = transform(q=np.array(row, dtype=float)).reshape(3, 4)
        whole = whole @ placed
    return whole


def standing(kernels: LoopKernels, t: float, q: Array) -> Array:
    """Return positions [over the size of the loop] and axes of all links, to compare poses by.

    They do not depend on the choice of angles. A link between two balls may spin about their line: only that
    axis of it is included.
    """
    d = kernels.description
    table = kernels("rows", t, q, np.zeros_like(q))["rows"]
    whole, features = np.eye(4), []
    for k, row in enumerate(table[:-1]):
        whole = whole @ product([row])
        spins = d.joints[k] == d.joints[k + 1] == "S"
        features += [whole[:3, 0], whole[:3, 3] / d.size, *([] if spins else [whole[:3, 1]])]
    return np.concatenate(features)


def ball_angles(kernels: LoopKernels, q: Array) -> list[Array]:
    """Return a pose with every choice of the angles of its balls that leaves all links in place.

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
    other[theta], other[eta] = q[theta] + math.pi, math.pi - q[eta]
    if alpha >= 0:
        other[alpha] += math.pi
    return other


def _spun(q: Array, theta: int, eta: int, alpha: int) -> Array:
    """Return q with a rotation of 180 deg about i before Z(theta) Y(eta), and another about i by alpha."""
    other = q.copy()
    other[theta], other[eta] = -q[theta], -q[eta]
    other[alpha] += math.pi
    return other
