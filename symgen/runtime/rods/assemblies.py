"""All assembly modes of a linkage at one time: group by group, or by a search from many starting poses."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from symgen.errors import ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.newton import corrected
from symgen.runtime.rods.assembly.assur import modes_of_groups
from symgen.runtime.rods.assembly.quadratics import NotInGroups
from symgen.runtime.rods.constraints import Constraints
from symgen.runtime.rods.search import NEARLY, search

#: Distance between two poses that count as one, over the size of the linkage.
_SAME = 1e-6
#: Least singular value of an isolated pose, over the largest.
_ISOLATED = 1e-6
#: Largest error of constraints of a closed pose, over the size.
_CLOSED = 1e-12


def assemblies(
    constraints: Constraints, near: Array, t: float, *, tries: int = 40
) -> tuple[list[Array], str]:
    """Return coordinates of the assembly modes at the time t, the nearest to ``near`` first.

    With them why modes may be missing, as :attr:`AssemblyModes.incomplete`: empty where the linkage consists
    of groups that are solved by signs and roots (:mod:`symgen.runtime.rods.assembly.assur`). Otherwise they
    are those of a search from ``near``, its mirror images and ``tries`` random poses of the same seed every
    time: others may exist, though that is unlikely for linkages of few loops. Every pose is a solution to
    round-off. Poses in which the drives do not determine the motion are omitted. There must be at least as
    many constraints, drives among them, as coordinates.

    Raises
    ------
    ModelError
        When the drives have no finite values at that time.
    """
    if not np.all(np.isfinite(constraints.residual(near, t))):
        raise ModelError(f"the drives have no finite values at t = {t:g} s")
    length, incomplete = constraints.length(near), ""
    poses: Iterable[Array]
    try:
        poses = modes_of_groups(constraints, near, t)
    except NotInGroups as problem:
        poses = (q for q, missed in search(constraints, near, t, tries) if missed < NEARLY)
        incomplete = f"{problem}: searched from many poses"
    unique: list[Array] = []
    for pose in poses:
        q = polished(constraints, pose, t)
        if q is None:
            incomplete = incomplete or "a pose that was found could not be refined"
            continue
        if constraints.turned_over(q, t):
            continue
        if not _isolated(constraints, q, t):
            incomplete = incomplete or "poses at dead centres are omitted"
        elif all(np.max(np.abs(q - other)) > _SAME * length for other in unique):
            unique.append(q)
    unique.sort(key=lambda q: (round(float(np.linalg.norm(q - near) / length), 6), q.tolist()))
    return unique, incomplete


def _isolated(constraints: Constraints, q: Array, t: float) -> bool:
    values = np.linalg.svd(constraints.jacobian(q, t), compute_uv=False)
    return bool(values[-1] > _ISOLATED * values[0])


def polished(constraints: Constraints, q: Array, t: float, root: Array | None = None) -> Array | None:
    """Return q brought to round-off by Newton's method; None where it does not get there.

    Corrections have the minimum norm, in the metric L L^T with the factor ``root`` L if one is given.
    """

    def change(q: Array, left: Array) -> Array:
        slopes = constraints.jacobian(q, t)
        if root is None:
            return np.asarray(-np.linalg.lstsq(slopes, left, rcond=1e-12)[0])
        weighted = np.linalg.solve(root, slopes.T).T
        return np.asarray(-np.linalg.solve(root.T, np.linalg.lstsq(weighted, left, rcond=1e-12)[0]))

    def size(q: Array) -> float:
        return max(float(np.max(np.abs(q))), 1e-300)

    return corrected(q, change, size, 8, residual=lambda q: constraints.residual(q, t), tolerated=_CLOSED)
