"""Damping of a link, of its motion relative to its own axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from symgen.errors import SceneError
from symgen.runtime.arrays import Array
from symgen.runtime.beams.data import Piece, Properties
from symgen.runtime.beams.pieces import whole
from symgen.runtime.kernels.elastic_description import BeamInfo

#: The most modes of a link or a structure that each have a damping ratio by forces of their own.
_MODAL = 24
#: Number of rigid motions of a link in the plane.
_RIGID = 3


def rayleigh(piece: Piece, properties: Properties) -> Array:
    """Return ``mass_damping`` times the mass plus ``stiffness_damping`` times the stiffness, (n, n)."""
    return properties.mass_damping * piece.mass + properties.stiffness_damping * piece.stiffness


def stiffened(pieces: Sequence[Piece], factor: float) -> tuple[Piece, ...]:
    """Return pieces with damping of so many seconds times their stiffness added."""
    return tuple(replace(piece, damping=piece.damping + factor * piece.stiffness) for piece in pieces)


def modal_forces(elastic: Array, speeds: Array, ratios: float | Array) -> Array:
    """Return forces f of modes whose damping matrix f f^T gives them damping ratios, (n, modes).

    A mode phi of unit modal mass and angular frequency w has f = sqrt(2 ratio / w^3) K phi. Its damping
    phi^T f f^T phi is 2 ratio w, and f^T phi of all other modes is zero. Motions that
    strain nothing are not damped.

    Parameters
    ----------
    elastic
        Elastic forces K phi of the modes, (n, modes).
    speeds, ratios
        Angular frequencies [rad/s], (modes,), and damping ratios.
    """
    return elastic * np.sqrt(2 * ratios / speeds**3)


def shared(ratio: float, speeds: Array) -> tuple[Array, float]:
    """Return damping ratios by modal forces, and the factor [s] of stiffness-proportional damping.

    Modes up to number ``_OWN`` have the ratio. If there are more modes, stiffness-proportional damping gives
    mode ``_OWN`` the ratio, and higher modes ratios in proportion to their frequencies; modal forces add the
    difference for lower modes.

    Parameters
    ----------
    speeds
        Angular frequencies by rising size [rad/s].
    """
    if len(speeds) <= _MODAL:
        return np.full(len(speeds), ratio), 0.0
    last = float(speeds[_MODAL - 1])
    return ratio * (1 - speeds[: _MODAL - 1] / last), 2 * ratio / last


def modal(
    info: BeamInfo, fixed: Sequence[int], pieces: tuple[Piece, ...], n: int, ratio: float
) -> tuple[tuple[Piece, ...], Array]:
    """Return pieces that damp every elastic mode of the link with free ends by one ratio.

    The modes of a link of few elements are damped in one piece, for they couple all of its unknowns. For one
    of many, the second result are the forces of :func:`modal_forces`, (modes, unknowns of all pieces), that
    are not in the pieces.

    Parameters
    ----------
    fixed
        Unknowns that are zero, of the n of the link.

    Raises
    ------
    SceneError
        When the mass matrix is not positive: something of the link has no mass.
    """
    from scipy.linalg import eigh

    piece = whole(pieces, n)
    free = [j for j in range(n) if j not in fixed]
    at = np.ix_(free, free)
    try:
        squares, shapes = eigh(piece.stiffness[at], piece.mass[at])
    except np.linalg.LinAlgError:
        raise SceneError(
            "the link cannot have a damping ratio: a part of it moves without mass",
            where=f"links.{info.link}.elastic.damping.ratio",
        ) from None
    speeds = np.sqrt(squares[_RIGID:])
    ratios, factor = shared(ratio, speeds)
    speeds, shapes = speeds[: len(ratios)], shapes[:, _RIGID : _RIGID + len(ratios)]
    if not factor:
        forces = modal_forces(piece.stiffness[at] @ shapes, speeds, ratios)
        damping = piece.damping.copy()
        damping[at] += forces @ forces.T
        return (replace(piece, damping=damping),), np.zeros((0, n))
    moved = np.zeros((n, len(ratios)))
    moved[free] = shapes
    elastic = np.vstack([part.stiffness @ moved[list(part.at)] for part in pieces])
    return stiffened(pieces, factor), modal_forces(elastic, speeds, ratios).T
