"""The order of convergence that errors show, from the range of steps in which they show one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: How far the order may differ from one pair of steps to the next for both to be in the asymptotic range, and
#: from the theoretical order for the two to agree.
_STEADY, AGREES = 0.15, 0.2
#: An error counts where it is this many times what the reference or round-off leaves open, and where it is
#: no more than this part of the motion.
_ABOVE, _BELOW = 20.0, 1e-2
#: Points that a fit needs.
_FEWEST = 3


@dataclass(frozen=True, slots=True)
class Order:
    """The order that a method showed beside the one that theory gives it.

    ``observed`` is None where no range of steps shows one. ``steps`` are the steps of the points fitted, of
    them the first and the last count as the range.
    """

    method: str
    precision: str
    theoretical: int
    observed: float | None
    steps: tuple[int, ...]

    @property
    def agrees(self) -> bool | None:
        """Whether it is the theoretical one within 0.2; None where none was observed."""
        return None if self.observed is None else abs(self.observed - self.theoretical) <= AGREES


def observed_order(
    steps: Sequence[int], errors: Sequence[float], floor: float, size: float
) -> tuple[float | None, tuple[int, ...]]:
    """Return the order that errors fall with, and the numbers of steps that show it.

    The asymptotic range is looked for from the most steps downwards: the first numbers, three or more, from
    which to which the order stays the same, whatever it is.

    Parameters
    ----------
    steps
        Numbers of steps, rising.
    errors
        Error at each of them.
    floor
        What the reference and round-off leave open: errors near it say nothing.
    size
        Size of the motion: errors near it say nothing either.
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
    """Return by how much the order changes between neighbours; zero for fewer than three points."""
    if len(n) < _FEWEST:
        return 0.0
    return float(np.ptp(np.diff(np.log(e)) / np.diff(np.log(n))))


def _stagnation(e: Array) -> float:
    """Return the error at which more steps gain nothing; zero where they gained to the last."""
    finite = e[np.isfinite(e)]
    if len(finite) < 2 or finite[-1] < finite[:-1].min():
        return 0.0
    return float(finite.min())
