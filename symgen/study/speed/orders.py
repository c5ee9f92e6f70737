"""Observed order of convergence, from the asymptotic range of step counts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Largest change of the order between consecutive pairs of step counts in the asymptotic range.
_STEADY = 0.15
#: Largest deviation of an order that agrees with theory.
AGREES = 0.2
#: Least valid error, over the uncertainty of the reference or round-off.
_ABOVE = 20.0
#: Largest valid error, over the motion.
_BELOW = 1e-2
#: Minimum number of points of a fit.
_FEWEST = 3


@dataclass(frozen=True, slots=True)
class Order:
    """Observed and theoretical order of a method.

    ``observed`` is None if there is no asymptotic range. ``steps`` are the step counts of the fitted points,
    whose first and last value give the range.
    """

    method: str
    precision: str
    theoretical: int
    observed: float | None
    steps: tuple[int, ...]

    @property
    def agrees(self) -> bool | None:
        """Whether the observed order is within 0.2 of the theoretical one; None if none was observed."""
        return None if self.observed is None else abs(self.observed - self.theoretical) <= AGREES


def observed_order(
    steps: Sequence[int], errors: Sequence[float], floor: float, size: float
) -> tuple[float | None, tuple[int, ...]]:
    """Return the observed order of convergence and the step counts that show it.

    The asymptotic range is sought from the largest step counts downwards: the first three or more counts over
    which the order is constant.

    Parameters
    ----------
    steps
        Increasing numbers of steps.
    errors
        Error for each number of steps.
    floor
        Uncertainty of the reference and round-off: errors near it are disregarded.
    size
        Size of the motion: errors near it are disregarded.
    """
    n, e = np.array(steps, dtype=float), np.array(errors, dtype=float)
    floor = max(floor, _stagnation(e))
    usable = np.isfinite(e) & (e > _ABOVE * floor) & (e < _BELOW * size)
    for last in range(len(n), _FEWEST - 1, -1):
        first = last
        while first and usable[first - 1] and _spread(n[first - 1 : last], e[first - 1 : last]) <= _STEADY:
            first -= 1
        if last - first >= _FEWEST:
            fit = np.polyfit(np.log(n[first:last]), np.log(e[first:last]), 1)
            return -float(fit[0]), tuple(int(x) for x in n[first:last])
    return None, ()


def _spread(n: Array, e: Array) -> float:
    """Return the variation of the order between neighbours; zero for fewer than three points."""
    if len(n) < _FEWEST:
        return 0.0
    return float(np.ptp(np.diff(np.log(e)) / np.diff(np.log(n))))


def _stagnation(e: Array) -> float:
    """Return the error below which more steps bring no improvement; zero if there is no such level."""
    finite = e[np.isfinite(e)]
    if len(finite) < 2 or finite[-1] < finite[:-1].min():
        return 0.0
    return float(finite.min())
