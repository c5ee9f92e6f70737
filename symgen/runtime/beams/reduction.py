"""Fewer unknowns for a link: kept length, Guyan's condensation, Craig's and Bampton's modes.

All are constant transforms in the link's own axes, s = basis @ y.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgen.errors import SceneError
from symgen.runtime.arrays import Array
from symgen.runtime.beams.data import Piece
from symgen.runtime.beams.elements import Segment
from symgen.runtime.kernels.elastic_description import BeamInfo


def of_one_length(
    info: BeamInfo, dofs: Sequence[str], parts: Sequence[Segment], stiffness: Array
) -> tuple[tuple[str, ...], Array]:
    """Return the unknowns of a link that keeps its length, and the basis, shape (all, kept).

    Displacements along the link inside it lie on the straight line between those of its ends; that the ends
    differ by nothing is left to the assembly, as the constraint of the link's length. Inner unknowns along
    the link follow from those statically.
    """
    n = info.elements
    along = {dofs.index(f"u@{i + 1}"): info.node(i) for i in range(1, n)}
    inner = [j for part in parts for j in part.dofs[2 * len(info.node_dofs) :] if _is_along(part, j)]
    transverse = [j for j in range(len(dofs)) if j not in along and j not in inner]
    basis = np.zeros((len(dofs), len(transverse)), stiffness.dtype)
    basis[transverse, np.arange(len(transverse))] = 1.0
    first, last = transverse.index(dofs.index("u@1")), transverse.index(dofs.index(f"u@{n + 1}"))
    for j, part_of_length in along.items():
        basis[j, [first, last]] = 1 - part_of_length, part_of_length
    if inner:
        outer = [j for j in range(len(dofs)) if j not in inner]
        basis[inner] = _followers(stiffness, inner, outer) @ basis[outer]
    return tuple(dofs[j] for j in transverse), basis


def _is_along(part: Segment, dof: int) -> bool:
    """Return True if an unknown of an element causes no transverse displacement."""
    return part.shape(part.length / 3)[1, part.dofs.index(dof)] == 0.0


def reduced(
    info: BeamInfo, dofs: Sequence[str], fixed: Sequence[int], piece: Piece
) -> tuple[tuple[str, ...], Array]:
    """Return the unknowns kept by the link's reduction, and the basis, shape (all, kept).

    Kept are the displacements of joints, and the rotation of the first end where it is that of a shaft. All
    others follow statically (R. J. Guyan, AIAA Journal 3, 1965, 380); to that are added the lowest modes
    with the kept ones held (R. R. Craig and M. C. C. Bampton, AIAA Journal 6, 1968, 1313-1319).

    Raises
    ------
    SceneError
        If the link has fewer modes than requested, or no stiffness.
    """
    first, *others = ([f"u@{i + 1}", f"w@{i + 1}"] for i in info.joint_nodes)
    names = [*first, *(["theta@1"] if info.clamped else []), *(name for pair in others for name in pair)]
    names += [name for name in info.rotations if name not in names]
    ends = [dofs.index(name) for name in names]
    inside = [j for j in range(len(dofs)) if j not in ends and j not in fixed]
    modes = info.modes if info.reduction == "craig-bampton" else 0
    if modes > len(inside):
        raise SceneError(
            f"expected at most {len(inside)} modes, those of the link with fixed ends, got {modes}",
            where=f"links.{info.link}.elastic.reduction.modes",
            hint="Give fewer modes, or more elements.",
        )
    basis = np.zeros((len(dofs), len(ends) + modes), piece.stiffness.dtype)
    basis[ends, np.arange(len(ends))] = 1.0
    if inside:
        try:
            basis[inside, : len(ends)] = _followers(piece.stiffness, inside, ends)
            if modes:
                basis[inside, len(ends) :] = held_modes(piece, inside, modes)[1]
        except np.linalg.LinAlgError:
            raise SceneError(
                "the link cannot be reduced: with fixed ends, a part of it moves without stiffness or mass",
                where=f"links.{info.link}.elastic.reduction",
            ) from None
    return (*names, *(f"mode@{k + 1}" for k in range(modes))), basis


def held_modes(piece: Piece, inside: Sequence[int], count: int) -> tuple[Array, Array]:
    """Return squares of the lowest angular frequencies (count,) and their modes (inside, count).

    All other unknowns are held. Modes have unit modal mass, and their largest component is positive.
    """
    from scipy.linalg import eigh

    at = np.ix_(inside, inside)
    squares, shapes = eigh(piece.stiffness[at], piece.mass[at], subset_by_index=(0, count - 1))
    largest = shapes[np.argmax(np.abs(shapes), axis=0), np.arange(count)]
    return squares, shapes * np.sign(largest)


def _followers(stiffness: Array, inside: Sequence[int], outside: Sequence[int]) -> Array:
    """Return the unknowns inside by those outside, where no force acts inside."""
    return np.asarray(-np.linalg.solve(stiffness[np.ix_(inside, inside)], stiffness[np.ix_(inside, outside)]))
