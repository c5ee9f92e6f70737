"""Constraints on directions: orthonormal directors of nodes, and joints that restrict rotations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.beams.elements import kernels
from symgen.runtime.kernels.evaluate import at_rows

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_BLOCK = "direction"
#: Numbers that its kernels write.
_WRITTEN = {"row": 23, "curvature": 21 * 21}
#: What the constraints of directors are called.
DIRECTORS = "the directors of a node"
#: Products of the directors of a node that are constraints, and their factors.
_PAIRS = ((0, 0, 0.5), (1, 1, 0.5), (2, 2, 0.5), (0, 1, 1.0), (0, 2, 1.0), (1, 2, 1.0))


@dataclass(frozen=True, slots=True)
class Row:
    """One constraint: places of its seven vectors, (7, 3), their factors (7,), its value, and its joint."""

    places: Indices
    factors: Array
    value: float = 0.0
    label: str = DIRECTORS


def orthonormal(directors: Indices) -> list[Row]:
    """Return the rows of the directors of nodes, whose places are (nodes, 3, 3)."""
    units = np.eye(4)
    return [
        Row(np.concatenate([of, of, of[:1]]), np.append(units[i, :3], factor * units[j]), factor * (i == j))
        for of in directors
        for i, j, factor in _PAIRS
    ]


class Directions:
    """Constraints on directions, over the unknowns and the prescribed numbers behind them.

    Parameters
    ----------
    rows
        The constraints, one or more.
    unknowns
        Number of unknowns: places of vectors from there on are those of prescribed numbers.

    Attributes
    ----------
    bound
        Row and unknown of every slope that may not be zero, (2, slopes).
    pairs
        Unknowns of the entries of the slopes of forces, (2, entries).
    labels
        The joint of each row.
    """

    def __init__(self, rows: Sequence[Row], unknowns: int) -> None:
        self.labels = [row.label for row in rows]
        self._places = np.array([row.places.ravel() for row in rows])
        self._given = np.array([[*row.factors, row.value] for row in rows])
        free = self._places < unknowns
        self._kept = free & (np.repeat(self._given[:, :7], 3, axis=1) != 0.0)
        self.bound = np.stack([np.nonzero(self._kept)[0], self._places[self._kept]])
        none = np.zeros((1, int(np.max(self._places)) + 1))
        curved = self._call("curvature", none, none).reshape(len(rows), 21, 21)
        curved[~(free[:, :, None] & free[:, None])] = 0.0
        self._owners, *at = np.nonzero(curved)
        self.pairs = np.stack([self._places[self._owners, k] for k in at])
        self._curved = curved[self._owners, at[0], at[1]]

    def __len__(self) -> int:
        return len(self._places)

    def _call(self, kernel: str, q: Array, v: Array) -> Array:
        """Return the output of a kernel for every row, (times, rows, numbers), of places and rates."""
        given = np.broadcast_to(self._given, (len(q), *self._given.shape))
        states = np.concatenate([q[:, self._places], v[:, self._places], given], axis=2).reshape(-1, 50)
        found = at_rows(kernels(_BLOCK).ADDRESSES[kernel], states, 21, np.zeros(1), _WRITTEN[kernel])
        return found.reshape(len(q), len(self), -1)

    def errors(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return errors of the constraints and their rates, (times, rows), at places and rates."""
        found = self._call("row", q, v)
        return found[:, :, 0], found[:, :, 1]

    def jacobian(self, q: Array) -> Array:
        """Return the slopes at ``bound``, (times, slopes)."""
        found: Array = self._call("row", q, np.zeros_like(q))[:, :, 2:][:, self._kept]
        return found

    def add_forces(self, residual: Array, q: Array, multipliers: Array) -> None:
        """Add J^T lambda to a residual (times, unknowns)."""
        row, column = self.bound
        forces = self.jacobian(q) * multipliers[:, row]
        for k, force in enumerate(forces):
            residual[k] += np.bincount(column, force, residual.shape[1])

    def stiffness(self, multipliers: Array) -> Array:
        """Return the slopes of J^T lambda at ``pairs``, (entries,)."""
        return self._curved * multipliers[self._owners]
