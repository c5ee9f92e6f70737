"""What an error costs: the least wall time at which a program comes within it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise


def front(points: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the points (error, time) that no other beats in both, by falling error; errors above zero."""
    best: list[tuple[float, float]] = []
    for error, time in sorted(points):
        if error > 0 and math.isfinite(error) and (not best or time < best[-1][1]):
            best.append((error, time))
    return best[::-1]


def time_at(points: Iterable[tuple[float, float]], error: float) -> float | None:
    """Return the time at which an error is reached, interpolated between logarithms along the front.

    A program whose loosest run is better than asked takes the time of that run; one whose tightest is worse
    does not reach it: None.

    Parameters
    ----------
    points
        Errors and times [s] of a program's runs.
    error
        The error asked for, in the unit of theirs.
    """
    edge = front(points)
    if not edge or edge[-1][0] > error:
        return None
    if edge[0][0] <= error:
        return edge[0][1]
    for (loose, less), (tight, more) in pairwise(edge):
        if tight <= error <= loose:
            part = math.log(loose / error) / math.log(loose / tight)
            return math.exp((1 - part) * math.log(less) + part * math.log(more))
    raise AssertionError("a front has no gaps")
