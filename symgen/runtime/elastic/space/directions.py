"""Constraints on directions: orthonormal directors of nodes, and joints that restrict rotations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symgen.runtime._constrained import Rows
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.beams.elements import kernels
from symgen.runtime.kernels.evaluate import at_rows

_BLOCK = "direction"
#: Name of the constraints of directors.
DIRECTORS = "the directors of a node"
#: Products of the directors of a node that are constraints, and their factors.
_PAIRS = ((0, 0, 0.5), (1, 1, 0.5), (2, 2, 0.5), (0, 1, 1.0), (0, 2, 1.0), (1, 2, 1.0))


@dataclass(frozen=True, slots=True)
class DirectionRow:
    """One constraint: places of its seven vectors, (7, 3), their factors (7,), its value, and its joint.

    Factors may have tangents.
    """

    places: Indices
    factors: Array
    value: float = 0.0
    label: str = DIRECTORS


def orthonormal(directors: Indices) -> list[DirectionRow]:
    """Return the rows of the directors of nodes, whose places are (nodes, 3, 3)."""
    units = np.eye(4)
    return [
        DirectionRow(
            np.concatenate([of, of, of[:1]]), np.append(units[i, :3], factor * units[j]), factor * (i == j)
        )
        for of in directors
        for i, j, factor in _PAIRS
    ]


def directions(rows: Sequence[DirectionRow], unknowns: int, first: int) -> Rows:
    """Return constraints on directions, one or more, as the part of a system.

    Places of vectors from ``unknowns`` on are those of prescribed numbers; ``first`` is the number of the
    first row among the constraints.
    """
    places = np.array([row.places.ravel() for row in rows])
    factors = np.array([[*row.factors.real, row.value] for row in rows])
    states = np.concatenate([np.zeros((len(rows), 42)), factors], axis=1)
    of = kernels(_BLOCK).ADDRESSES
    curved = at_rows(of["curvature"], states, 21, np.zeros(1), 21 * 21).reshape(-1, 21, 21)
    free = places < unknowns
    curved[~(free[:, :, None] & free[:, None])] = 0.0
    # Vectors without a factor have no slopes: one that is constant stands for them.
    used = np.repeat(factors[:, :7], 3, axis=1) != 0.0
    slopes, none = np.where(used, places, unknowns), np.zeros((len(rows), 0))
    inner = np.flatnonzero(curved)
    return Rows(of["row"], places, slopes, first, factors, none, none, inner, curved.ravel()[inner])
