"""Constraints as quadratic polynomials of the coordinates."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.arrays import Array

#: Coordinates in units of the linkage's size, from a pose; complex if a group does not close.
Poses = NDArray[Any]

#: Largest number of coordinates for which groups are solved.
_LARGEST = 120
#: Derivatives below this part of the largest count as zero.
NONE = 1e-13
#: Largest difference of constraints from their quadratic form, over the size of the linkage.
_POLYNOMIAL = 1e-10
_CURVED = "constraints are not quadratic in the coordinates"


class QuadraticRows(Protocol):
    """Conditions Phi(q, t) = 0 in metres: m rows, n coordinates."""

    m: int
    n: int

    def residual(self, q: Array, t: float) -> Array:
        """Return Phi [m], shape (m,)."""

    def jacobian(self, q: Array, t: float) -> Array:
        """Return dPhi/dq [1], shape (m, n)."""

    def length(self, q: Array) -> float:
        """Return the size of the linkage [m]."""


class NotInGroups(Exception):
    """The constraints are not quadratic, or not of groups that are solved here; the text tells which."""


@dataclass(frozen=True, slots=True)
class Quadratics:
    """Constraints c + g x + x H x / 2 = 0."""

    constant: Array
    slope: Array
    curvature: Array

    def values(self, rows: Sequence[int], x: Poses) -> Poses:
        """Return the constraints of some rows at poses (..., n): (..., rows)."""
        bent = np.einsum("...i,rij,...j->...r", x, self.curvature[rows], x)
        return self.constant[rows] + x @ self.slope[rows].T + bent / 2

    def slopes(self, rows: Sequence[int], columns: Sequence[int], x: Poses) -> Poses:
        """Return the derivatives of rows by columns at poses (..., n): (..., rows, columns)."""
        return self.slope[np.ix_(rows, columns)] + np.einsum(
            "rci,...i->...rc", self.curvature[np.ix_(rows, columns)], x
        )

    def having(self, rows: Iterable[int], columns: Iterable[int]) -> dict[int, set[int]]:
        """Return the columns on which each row depends."""
        there = (self.slope != 0) | (self.curvature != 0).any(axis=2)
        return {r: {c for c in columns if there[r, c]} for r in rows}

    def along(self, axes: Array) -> Quadratics:
        """Return the constraints by y of x = y axes, the axes being orthonormal."""
        return Quadratics(self.constant, *_cleared(self.slope @ axes.T, axes @ self.curvature @ axes.T))


def quadratics(constraints: QuadraticRows, near: Array, t: float) -> tuple[Quadratics, float]:
    """Return constraints by coordinates from the given pose, both over the size, and the size."""
    if constraints.m != constraints.n:
        raise NotInGroups("constraints are redundant")
    if constraints.n > _LARGEST:
        raise NotInGroups(f"there are {constraints.n} coordinates, more than {_LARGEST}")
    n, size, slope = constraints.n, constraints.length(near), constraints.jacobian(near, t)
    moved = [constraints.jacobian(near + size * unit, t) for unit in np.eye(n)]
    curvature = np.array(moved).transpose(1, 2, 0) - slope[:, :, None]
    if not (np.isfinite(slope).all() and np.isfinite(curvature).all()):
        raise NotInGroups(_CURVED)
    of = Quadratics(constraints.residual(near, t) / size, *_cleared(slope, curvature))
    x = np.random.default_rng(0).uniform(-1, 1, n)
    every = list(range(constraints.m))
    away = of.values(every, x) - constraints.residual(near + size * x, t) / size
    bent = of.slopes(every, every, x) - constraints.jacobian(near + size * x, t)
    if not (np.abs(away).max() < _POLYNOMIAL and np.abs(bent).max() < _POLYNOMIAL):
        raise NotInGroups(_CURVED)
    return of, size


def _cleared(slope: Array, curvature: Array) -> tuple[Array, Array]:
    """Return derivatives of constraints, those that rounding leaves as zeros."""
    least = NONE * np.maximum(np.abs(slope).max(axis=1), np.abs(curvature).max(axis=(1, 2)))
    return (
        np.where(np.abs(slope) < least[:, None], 0.0, slope),
        np.where(np.abs(curvature) < least[:, None, None], 0.0, curvature),
    )
