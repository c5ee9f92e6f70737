"""Rigid motions of an elastic link over its unknowns."""

from __future__ import annotations

import numpy as np


def rigid_motions(info, dofs, piece, properties):
    """Return unit motions along and across the link and a unit rotation about its first point, (n, 3)."""
    found = np.zeros((len(dofs), 3))
    inner = []
    for j, name in enumerate(dofs):
        kind, _, node = name.partition("@")
        if kind == "u":
            found[j, 0] = 1.0
        elif kind == "w":
            found[j, 1:] = 1.0, properties.length * info.node(int(node) - 1)
        elif kind == "theta":
            found[j, 2] = 1.0
        elif kind in info.inner_dofs:
            inner.append(j)
    if inner:  # they follow without force
        at = np.ix_(inner, inner)
        found[inner] = -np.linalg.solve(piece.stiffness[at], piece.stiffness[inner] @ found)
    return found
