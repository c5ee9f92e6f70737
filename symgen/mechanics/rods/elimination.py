"""Elimination orders of [M J^T; J 0] with little fill-in, and their operation counts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from heapq import heapify, heappop, heappush

#: Cost of a variable pivot, in additions and multiplications: later operations wait for its division.
#: Measured on chains of one to ten rods: eliminating all coordinates first is slower from eight rods on.
_PIVOT = 45
#: Additions and multiplications of a solution per entry of the factor below its diagonal.
_SOLUTION = 4


def cost(order: Iterable[int], varies: Mapping[tuple[int, int], bool], enough: float = math.inf) -> int:
    """Return the cost of one factorisation and one solution, in additions and multiplications.

    Constant entries are computed when the code is generated, and only their use counts.

    Parameters
    ----------
    order
        The elimination order of all unknowns.
    varies
        For every nonzero entry, either triangle or both, whether it changes from state to state.
    enough
        A cost at which to stop counting.
    """
    rows: dict[int, dict[int, bool]] = {k: {} for k in order}
    for (i, j), changes in varies.items():
        rows[i][j] = rows[j][i] = changes
    total = 0
    for k in list(rows):
        if total > enough:
            break
        row = rows.pop(k)
        pivot = row.pop(k, False)
        total += _PIVOT * pivot
        later = sorted(row)
        for n, i in enumerate(later):
            changes = row[i] or pivot
            total += _SOLUTION + changes
            for j in later[: n + 1]:
                product = changes or row[j]
                total += 2 * product
                rows[i][j] = rows[j][i] = rows[i].get(j, False) or product
            del rows[i][k]
    return total


def minimum_degree(entries: Iterable[tuple[int, int]], coordinates: int, count: int) -> tuple[int, ...]:
    """Return the order in which each next unknown has the fewest neighbours among those left.

    A multiplier follows every coordinate of its row. The leading blocks are then those of a positive definite
    mass matrix and of whole rows of J: no pivot vanishes unless J loses rank. Among unknowns with equally
    many neighbours, multipliers come first, then the lowest number.

    Parameters
    ----------
    entries
        Rows and columns of the nonzero entries, either triangle or both.
    coordinates
        Number of coordinates, which are numbered first; multipliers follow.
    count
        Number of all unknowns.
    """
    near: dict[int, set[int]] = {k: {k} for k in range(count)}
    for i, j in entries:
        near[i].add(j)
        near[j].add(i)
    missing = {k: {i for i in near[k] if i < coordinates} for k in range(coordinates, count)}
    rows = {k: [i for i in near[k] if i in missing] for k in range(coordinates)}

    def rank(k: int) -> tuple[int, bool, int]:
        return len(near[k]), k < coordinates, k

    waiting = [rank(k) for k in near if not missing.get(k)]
    heapify(waiting)
    order: list[int] = []
    while near:
        entry = heappop(waiting)
        k = entry[-1]
        if k not in near or entry != rank(k):
            continue  # taken, or its neighbours have changed since: it is in the heap again
        order.append(k)
        around = near.pop(k) - {k}
        for row in rows.get(k, ()):
            missing[row].discard(k)
        for i in around:
            near[i] |= around
            near[i].discard(k)
        for i in (*around, *rows.get(k, ())):
            if not missing.get(i):
                heappush(waiting, rank(i))
    return tuple(order)
