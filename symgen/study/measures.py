"""How far one run is from another, and what that is measured over."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Part of the largest in its unit below which a quantity is round-off.
_NOISE = 1e-9


def sizes(largest: Array, units: Sequence[str]) -> Array:
    """Return what errors of quantities are measured over: the largest value of each.

    Of one that is zero but for rounding it is the largest of all in its unit.
    """
    kinds = np.array(units)
    of_kind = np.array([np.max(largest[kinds == unit]) for unit in kinds])
    found: Array = np.where(largest > _NOISE * of_kind, largest, np.where(of_kind > 0, of_kind, 1.0))
    return found


def distance(a: Array, b: Array) -> Array:
    """Return the largest difference at each time: of points (times, points, axes) their distance."""
    gap = np.asarray(a - b)
    amounts = np.linalg.norm(gap, axis=-1) if gap.ndim == 3 else np.abs(gap)
    largest: Array = amounts.max(axis=1)
    return largest
