"""The frames of a loop's links in space, from the numbers of its table."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.loop_kernels import LoopKernels

Array = NDArray[np.float64]


def product(rows: Iterable[Array]) -> Array:
    """Return the transform of rows in a chain, T = Z(theta + eps S) Y(eta) X(alpha + eps a), as 4x4."""
    whole = np.eye(4)
    for theta, shift, eta, alpha, length in rows:
        turned = np.eye(4)
        (c, s), (d, e), (f, g) = ((math.cos(x), math.sin(x)) for x in (theta, eta, alpha))
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[d, 0, e], [0, 1, 0], [-e, 0, d]])
        turned[:3, :3] = turn @ np.array([[1, 0, 0], [0, f, -g], [0, g, f]])
        turned[:3, 3] = np.array([0, 0, shift]) + turn @ np.array([length, 0, 0])
        whole = whole @ turned
    return whole


def standing(kernels: LoopKernels, t: float, q: Array) -> Array:
    """Return where all links stand, however their angles are written: numbers to compare poses by.

    Of a link between two balls, which may spin about their line, only that line is told.
    """
    d = kernels.description
    table = kernels("rows", t, q, np.zeros_like(q))["rows"]
    whole, told = np.eye(4), []
    for k, row in enumerate(table[:-1]):
        whole = whole @ product([row])
        spins = d.joints[k] == d.joints[k + 1] == "S"
        told += [whole[:3, 0], whole[:3, 3] / d.size, *([] if spins else [whole[:3, 1]])]
    return np.concatenate(told)
