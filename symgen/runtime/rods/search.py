"""Poses that meet conditions, searched from many others; the search rotates and mirrors with the drawing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.rods.assembly.quadratics import QuadraticRows

#: Part of the size by which poses that are refined may miss a condition, or points a line or plane.
NEARLY = 1e-6
#: Seed of the random poses.
_SEED = 20
#: Most steps from each pose.
_STEPS = 100
#: First damping, over the sum of squares of the slopes per coordinate.
_DAMPING = 1e-3


class PointConditions(QuadraticRows, Protocol):
    """Conditions on points."""

    def drawn_places(self, q: Array) -> Array:
        """Return the positions of the points of the scene [m], (points, axes)."""


def search(conditions: PointConditions, near: Array, t: float, tries: int) -> Iterator[tuple[Array, float]]:
    """Yield coordinates of least errors, from ``near``, its mirror images and random poses.

    With them the largest error, over the size.
    """
    size, places = conditions.length(near), conditions.drawn_places(near)
    centre = np.tile(places.mean(axis=0), conditions.n // places.shape[1])
    axes = _axes((places - places.mean(axis=0)) / size)
    for start in _poses((near - centre) / size, axes, tries):
        q = _least_squares(conditions, centre + size * start, size, t)
        yield q, float(np.max(np.abs(conditions.residual(q, t)))) / size


def _least_squares(conditions: QuadraticRows, q: Array, size: float, t: float) -> Array:
    """Return coordinates of least errors, by steps with a damping that is alike in all directions."""
    missed, damping, factor = conditions.residual(q, t) / size, 0.0, 2.0
    for _ in range(_STEPS):
        slopes = conditions.jacobian(q, t)
        damping = damping or _DAMPING * float(np.sum(slopes**2)) / conditions.n
        rows = np.vstack([slopes, damping**0.5 * np.eye(conditions.n)])
        step = np.linalg.lstsq(rows, np.append(-missed, np.zeros(conditions.n)), rcond=None)[0]
        there = conditions.residual(q + size * step, t) / size
        expected = step @ (damping * step - missed @ slopes)
        gain = (missed @ missed - there @ there) / expected if expected > 0 else -1.0
        if gain > 0:
            q, missed, factor = q + size * step, there, 2.0
            damping *= max(1 / 3, 1 - (2 * gain - 1) ** 3)
        else:
            damping, factor = damping * factor, 2 * factor
        if not np.linalg.norm(step) > 1e-12 or not np.max(np.abs(missed)) > 1e-14:
            break
    return q


def _poses(drawn: Array, axes: Array, tries: int) -> list[Array]:
    """Return a pose, from its centre and over its size, its mirror images, and random poses.

    They rotate and mirror with ``axes``, and depend on the order of the points only if two of them are alike.
    """
    arms = drawn.reshape(-1, len(axes)) @ axes.T
    mirrored = [arms * (1 - 2 * unit) for unit in np.eye(len(axes))]
    order = np.lexsort(np.round(arms, 9).T)
    random = np.random.default_rng(_SEED).uniform(-1, 1, (tries, *arms.shape))
    poses = np.array([arms, -arms, *mirrored, *random[:, np.argsort(order)]])
    return list((poses @ axes).reshape(len(poses), -1))


def _axes(arms: Array) -> Array:
    """Return orthonormal axes, row by row, each towards the farthest point from those before it."""
    axes = np.zeros((0, arms.shape[1]))
    while len(axes) < arms.shape[1]:
        out = arms - arms @ axes.T @ axes
        far = out[np.argmax(np.linalg.norm(out, axis=1))]
        if np.linalg.norm(far) < NEARLY:  # all points are on a line or plane: it has no sides
            return np.vstack([axes, np.linalg.svd(axes)[2][len(axes) :]])
        axes = np.vstack([axes, far / np.linalg.norm(far)])
    return axes
