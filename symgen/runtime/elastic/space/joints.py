"""Joints of elastic links in space that restrict rotations: welds, revolute and universal joints."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from symgen.errors import ModelError
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.elastic.space.directions import DIRECTORS, DirectionRow

#: Size of a direction, of length one, that counts as zero.
_NONE = 1e-8


@dataclass(frozen=True, slots=True)
class FixedVectors:
    """Vectors fixed in a part: their places (vectors, 3), and values at the start (vectors, 3).

    ``between``: the vectors are places of points, and directions are differences of them. Values may have
    tangents, and then those of directions and factors follow.
    """

    places: Indices
    vectors: Array
    between: bool = False

    @property
    def span(self) -> Array:
        """Directions that the vectors give, (directions, 3), orthonormal up to tangents."""
        of = self.vectors - self.vectors[:1] if self.between else self.vectors
        left, sizes, _ = np.linalg.svd(of.real)
        rank = int(np.sum(sizes > _NONE * sizes[0]))
        return (left[:, :rank] / sizes[:rank]).T @ of

    def factors(self, direction: Array) -> Array | None:
        """Return the factors with which the vectors sum to a direction; None if there are none."""
        # Those of points have the sum zero.
        of = np.vstack([self.vectors.T, np.full(len(self.vectors), float(self.between))])
        right = np.append(direction, 0.0)
        inverse = np.linalg.pinv(of.real)
        factors: Array = inverse @ right
        factors = factors + inverse @ (right - of @ factors)  # with the tangents of the vectors
        return factors if np.linalg.norm(of @ factors - right) < _NONE else None


def rows_of(
    kind: str, about: str, axis: Array, first: FixedVectors, second: FixedVectors
) -> Iterator[DirectionRow]:
    """Yield the constraints between the directors of a link and another part, which hold at the start.

    Parameters
    ----------
    kind
        ``weld``, ``revolute``, or ``universal`` with the axis on the second part, and its other axis
        transverse to the first link.
    about
        The joint, for messages.
    axis
        Direction at the start, (3,); without effect for a weld.

    Raises
    ------
    ModelError
        Where the second part has no such direction, or the axis of a universal joint is along the link.
    """
    vectors = first.vectors
    span = second.span
    if kind == "weld" and len(span) == 1:
        # A rod has no rotation about its line.
        products = [(n, span[0]) for n in _normals(span[0])]
    elif kind == "weld":
        one, two = span[:2]
        two = two - (one @ two) * one
        three = np.cross(one, two)
        products = [(three, one), (three, two), (one, two)]
    else:
        axis = axis / length_of(axis)
        if kind == "universal":
            across = np.cross(axis, vectors[0])
            if np.linalg.norm(across) < _NONE:
                raise ModelError(f"{about}: expected an axis across the link, got one along it")
            products = [(across / length_of(across), axis)]
        else:
            products = [(n, axis) for n in _normals(axis)]
            if second.factors(axis) is None:
                products = [(axis, n) for n, _ in products]
    for a, b in products:
        factors = second.factors(b)
        if factors is None:
            raise ModelError(f"{about}: the axis has no direction fixed in the other link\n  {_REMEDY}")
        missing = 4 - len(factors)
        places = np.concatenate([first.places, second.places, second.places[:1].repeat(missing, axis=0)])
        yield DirectionRow(places, np.concatenate([vectors @ a, factors, np.zeros(missing)]))


def _normals(axis: Array) -> Array:
    """Return two directions across a unit vector, (2, 3), with its tangents."""
    normals = np.linalg.svd(axis.real[None])[2][1:]
    return normals - np.outer(normals @ axis, axis)


def length_of(vectors: Array) -> Array:
    """Return the lengths of vectors (..., 3), with their tangents."""
    return np.sqrt(np.sum(vectors**2, axis=-1))


def check_independent(name: str, jacobian: Array, labels: Sequence[str]) -> None:
    """Raise ModelError where constraints with these labels repeat or contradict others at the start."""
    nonzero = np.flatnonzero(np.any(jacobian, axis=1))
    rows = jacobian[nonzero] / np.linalg.norm(jacobian[nonzero], axis=1)[:, None]
    left, sizes, _ = np.linalg.svd(rows)
    rank = int(np.sum(sizes > _NONE * sizes[0]))
    repeated = nonzero[np.any(np.abs(left[:, rank:]) > _NONE, axis=1)]
    if len(repeated):
        names = dict.fromkeys(labels[k] for k in repeated.tolist() if labels[k] != DIRECTORS)
        raise ModelError(
            f"{name}: expected independent joints, got some that repeat or contradict others: "
            f"{', '.join(names)}\n  Leave one out, or choose a kind that restricts less."
        )


_REMEDY = "Join it to an elastic link, the ground, or a body with a third point."
