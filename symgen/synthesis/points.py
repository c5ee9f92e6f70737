"""What tasks of precision points share: their equations, unknowns, and the linkages found."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symgen.errors import SceneError
from symgen.synthesis.search import Conditions, Search

Array = NDArray[np.float64]
Equations = Callable[[Array], tuple[Array, Array]]

#: Links whose lengths or places differ by less, relative to the size of the task, are one link.
ONE_LINK = 1e-6


class Found(NamedTuple):
    """Linkages and their prescribed poses: values of crank and rocker or slider, or poses of the coupler."""

    linkages: list[Any]
    poses: list[Array]
    search: Search


def equations_at(rows: Conditions, full: Array, which: NDArray[np.intp], size: int = 0) -> Equations:
    """Return a condition at the rows of ``full``, where ``which`` is the unknown's number or -1 if known.

    ``size`` is the number of unknowns, that of those at the rows when absent.
    """
    row, column = np.nonzero(which >= 0)
    number = which[row, column]
    size = size or int(number.max()) + 1

    def equations(unknown: Array) -> tuple[Array, Array]:
        full[row, column] = unknown[number]
        residual, single = rows(full)
        slopes = np.zeros((len(full), size))
        slopes[row, number] = single[row, 0, column]
        return residual.ravel(), slopes

    return equations


def numbered(full: Array, free: list[int]) -> NDArray[np.intp]:
    """Return the numbers of unknowns, in the columns ``free`` and the same in all rows; -1 elsewhere."""
    which = np.full(full.shape, -1)
    which[:, free] = np.arange(len(free))
    return which


def same(one: Array, other: Array, size: float) -> bool:
    """Return whether coordinates agree, relative to their size."""
    return bool(np.abs(one - other).max() <= ONE_LINK * max(size, float(np.abs(one).max())))


def distinct(
    linkages: list[Any], poses: list[Array], size: float, unit: float
) -> tuple[list[Any], list[Array]]:
    """Return linkages without repetitions: those of least error, in its unit, and shortest links first."""
    kept: list[tuple[Any, Array]] = []
    order = sorted(
        zip(linkages, poses, strict=True), key=lambda x: (round(x[0].error / unit, 9), *x[0].lengths.values())
    )
    for linkage, own in order:
        if not any(same(linkage.places, other.places, size) for other, _ in kept):
            kept.append((linkage, own))
    return [k for k, _ in kept], [p for _, p in kept]


def enough(conditions: int, unknowns: int, what: str, which: str) -> None:
    """Raise SceneError where nothing is unknown, or conditions do not determine the unknowns."""
    if not unknowns:
        raise SceneError("nothing is left to be found", hint=f"Prescribe fewer of: {which}.")
    if conditions < unknowns:
        raise SceneError(
            f"{conditions} conditions do not determine {unknowns} unknowns",
            hint=f"Give more {what} or prescribe some of: {which}.",
        )
