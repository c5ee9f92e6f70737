"""Damping of a link, of its motion relative to its own axes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime.beams.data import BeamInfo, Piece, Properties

Array = NDArray[np.float64]


def rayleigh(piece: Piece, properties: Properties) -> Array:
    """Return ``mass_damping`` times the mass plus ``stiffness_damping`` times the stiffness, (n, n)."""
    return properties.mass_damping * piece.mass + properties.stiffness_damping * piece.stiffness


def modal(
    info: BeamInfo, dofs: Sequence[str], fixed: Sequence[int], piece: Piece, properties: Properties
) -> Array:
    """Return the matrix that damps every elastic mode of the link with free ends by one ratio, (n, n).

    That is M Phi diag(2 ratio omega) Phi^T M with modes Phi of unit modal mass; rigid motions are not damped,
    exactly: what round-off mixes of them into the modes is taken out again.

    Raises
    ------
    ModelError
        When the mass matrix is not positive: something of the link has no mass.
    """
    from scipy.linalg import eigh

    n = len(dofs)
    free = [j for j in range(n) if j not in fixed]
    at = np.ix_(free, free)
    mass, stiffness = piece.mass[at], piece.stiffness[at]
    try:
        squares, modes = eigh(stiffness, mass)
    except np.linalg.LinAlgError:
        raise ModelError(
            f"elastic link {info.link!r} cannot have a damping ratio: something of it moves without mass"
        ) from None
    rigid = rigid_motions(info, dofs, piece, properties)[free]
    elastic = modes[:, rigid.shape[1] :]
    momenta = mass @ elastic
    rates = 2 * properties.ratio * np.sqrt(np.maximum(squares[rigid.shape[1] :], 0.0))
    damping = (momenta * rates) @ momenta.T
    # Motion less its rigid part, by momentum.
    others = np.eye(len(free)) - rigid @ np.linalg.solve(rigid.T @ mass @ rigid, rigid.T @ mass)
    found = np.zeros((n, n))
    found[at] = others.T @ damping @ others
    return found


def rigid_motions(info: BeamInfo, dofs: Sequence[str], piece: Piece, properties: Properties) -> Array:
    """Return unit motions along and across the link and a unit rotation about its first point, (n, 3)."""
    found = np.zeros((len(dofs), 3))
    inner = []
    for j, name in enumerate(dofs):
        kind, _, node = name.partition("@")
        if kind == "u":
            found[j, 0] = 1.0
        elif kind == "w":
            found[j, 1:] = 1.0, properties.length * info.node(int(node))
        elif kind == "theta":
            found[j, 2] = 1.0
        elif kind in info.inner_dofs:
            inner.append(j)
    if inner:  # they follow without force
        at = np.ix_(inner, inner)
        found[inner] = -np.linalg.solve(piece.stiffness[at], piece.stiffness[inner] @ found)
    return found
