"""Pareto front of error and wall time: the least time in which a program reaches an error."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise


def front(points: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the Pareto-optimal points (error, time) by decreasing error; errors must be positive."""
    best: list[tuple[float, float]] = []
    for error, time in sorted(points):
        if error > 0 and math.isfinite(error) and (not best or time < best[-1][1]):
            best.append((error, time))
    return best[::-1]


def time_at(points: Iterable[tuple[float, float]], error: float) -> float | None:
    """Return the time in which an error is reached, by log-log interpolation along the front.

    If the loosest run of a program is more accurate than required, its time is returned; if the tightest run
    does not reach the error, None.

    Parameters
    ----------
    points
        Errors and times [s] of a program's runs.
    error
        The required error, in the same unit.
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
