"""Moments of inertia as a scene writes them: xx, yy, zz, and xy, xz, yz where they are not zero."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import sympy as sp

from symgen.errors import SceneError
from symgen.scene import units
from symgen.scene.reading import Values

#: A principal extent squared below this share of the largest is that of a flat body, or of rounded values.
FLAT = 1e-9


def inertia_matrix(read: Values, moments: Sequence[str | int | float], where: str) -> sp.Matrix:
    """Return the inertia matrix [kg m^2]: symmetric, three or six moments given."""
    if len(moments) not in (3, 6):
        raise SceneError(f"expected three or six moments of inertia, got {len(moments)}", where=where)
    read_ = [read.value(m, units.INERTIA, f"{where}.{i}") for i, m in enumerate(moments)]
    xx, yy, zz, xy, xz, yz = (*read_, *[sp.Integer(0)] * (6 - len(read_)))
    return sp.Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def spread(matrix: sp.Matrix) -> sp.Matrix:
    """Return the second moments of the mass, trace(I)/2 - I: positive semidefinite for any real body."""
    xx, yy, zz = (matrix[i, i] for i in range(3))
    halves = ((yy + zz - xx) / 2, (xx + zz - yy) / 2, (xx + yy - zz) / 2)
    return sp.Matrix(3, 3, lambda i, j: halves[i] if i == j else -matrix[i, j])


def check_real(read: Values, matrix: sp.Matrix, where: str) -> tuple[float, float]:
    """Check that a real body can have this inertia matrix; return its least and its largest spread."""
    import numpy as np

    moments = spread(matrix)
    extents = np.linalg.eigvalsh([[read.number(moments[i, j]) for j in range(3)] for i in range(3)])
    if extents[0] < -FLAT * abs(extents[2]):
        raise SceneError(
            "no real body has these moments of inertia: the largest exceeds the sum of the others",
            where=where,
        )
    _limit(read, moments, f"{where}, of a real body")
    return float(extents[0]), float(extents[2])


def _limit(read: Values, moments: sp.Matrix, where: str) -> None:
    """Check the principal minors of second moments also at other values of the tunable parameters."""
    size = sp.Rational(str(FLAT)) * moments.trace()
    for count in (1, 2, 3):
        for rows in combinations(range(3), count):
            minor = moments.extract(rows, rows)
            if count == 1 or not minor.is_diagonal():
                read.limit(minor.det() + size**count, units.INERTIA, where, strict=False)
