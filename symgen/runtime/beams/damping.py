"""Damping of a link, of its motion relative to its own axes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from symgen.errors import SceneError
from symgen.runtime.beams.data import BeamInfo, Piece, Properties

Array = NDArray[np.float64]

#: Number of rigid motions of a link in the plane.
_RIGID = 3


def rayleigh(piece: Piece, properties: Properties) -> Array:
    """Return ``mass_damping`` times the mass plus ``stiffness_damping`` times the stiffness, (n, n)."""
    return properties.mass_damping * piece.mass + properties.stiffness_damping * piece.stiffness


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
    found: Array = elastic * np.sqrt(2 * ratios / speeds**3)
    return found


def modal(info: BeamInfo, fixed: Sequence[int], piece: Piece, ratio: float) -> Array:
    """Return the matrix that damps every elastic mode of the link with free ends by one ratio, (n, n).

    Raises
    ------
    SceneError
        When the mass matrix is not positive: something of the link has no mass.
    """
    from scipy.linalg import eigh

    n = len(piece.mass)
    free = [j for j in range(n) if j not in fixed]
    at = np.ix_(free, free)
    try:
        squares, modes = eigh(piece.stiffness[at], piece.mass[at])
    except np.linalg.LinAlgError:
        raise SceneError(
            "the link cannot have a damping ratio: something of it moves without mass",
            where=f"links.{info.link}.elastic.damping.ratio",
        ) from None
    strained = slice(_RIGID, None)
    forces = modal_forces(piece.stiffness[at] @ modes[:, strained], np.sqrt(squares[strained]), ratio)
    found = np.zeros((n, n))
    found[at] = forces @ forces.T
    return found
