"""Distances between runs, and the scales of error measures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Relative threshold of round-off, compared with the largest quantity of the same unit.
_NOISE = 1e-9


def sizes(largest: Array, units: Sequence[str]) -> Array:
    """Return the scale of each quantity for errors: its largest value.

    For quantities that are zero up to round-off, it is the largest value of all quantities of the unit.
    """
    kinds = np.array(units)
    of_kind = np.array([np.max(largest[kinds == unit]) for unit in kinds])
    return np.where(largest > _NOISE * of_kind, largest, np.where(of_kind > 0, of_kind, 1.0))


def distance(a: Array, b: Array) -> Array:
    """Return the largest difference at each time; for points (times, points, axes) their distance."""
    gap = np.asarray(a - b)
    amounts = np.linalg.norm(gap, axis=-1) if gap.ndim == 3 else np.abs(gap)
    return amounts.max(axis=1)
