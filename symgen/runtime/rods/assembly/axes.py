"""Axes of coordinates in an order in which quadratic constraints determine them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.rods.assembly.quadratics import Quadratics

#: Part of a row that counts as outside of known axes.
_ACROSS = 1e-9


def determined(of: Quadratics) -> Array | None:
    """Return orthonormal axes by which constraints are groups of one point or a point on a circle, if any."""
    none = np.zeros((0, len(of.slope)))
    spans = [_span(np.vstack([g, bent]), none) for g, bent in zip(of.slope, of.curvature, strict=True)]
    return _determined(spans, list(range(len(spans))), none, on_circle=False)


def _span(rows: Array, known: Array) -> Array:
    """Return orthonormal axes of the span of rows across the known axes."""
    _, sizes, axes = np.linalg.svd(rows - rows @ known.T @ known, full_matrices=False)
    return axes[sizes > _ACROSS * np.linalg.norm(rows)]


def _determined(spans: list[Array], left: list[int], known: Array, *, on_circle: bool) -> Array | None:
    """Return the known axes and all others in an order in which rows determine them, None without one.

    A row determines one, two rows of one point two of them; else a point is on the circle of a row, and the
    row that has no other axes is the one that it must meet.
    """
    while left:
        rests = {r: _span(spans[r], known) for r in left}
        least = min(left, key=lambda r: len(rests[r]))
        solved = [least]
        if len(rests[least]) > 1:
            points = [r for r in left if len(rests[r]) == 2]
            solved = _pair(points, rests)
            if not solved:
                ways = (
                    _determined(
                        spans, [s for s in left if s != r], np.vstack([known, rests[r]]), on_circle=True
                    )
                    for r in ([] if on_circle else points)
                )
                return next((axes for axes in ways if axes is not None), None)
        elif not len(rests[least]):
            if not on_circle:
                return None
            on_circle = False
        known = np.vstack([known, rests[solved[0]]])
        left = [r for r in left if r not in solved]
    return known


def _pair(rows: list[int], spans: Mapping[int, Array]) -> list[int]:
    """Return two rows of the same two axes, if there are any."""
    planes = np.array([spans[r] for r in rows])
    for k, plane in enumerate(planes):
        across = np.abs(planes - planes @ plane.T @ plane).max(axis=(1, 2))
        same = [r for r, gap in zip(rows[k:], across[k:], strict=True) if gap < _ACROSS]
        if len(same) > 1:
            return same[:2]
    return []
