"""All assembly modes of a linkage at one time: group by group, or by a search from many starting poses."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from symgen.errors import ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.rods.assur import NotInGroups, modes_of_groups
from symgen.runtime.rods.constraints import Constraints

_SEED, _SAME, _CLOSED = 20, 1e-6, 1e-12


def assemblies(
    constraints: Constraints, near: Array, t: float, *, tries: int = 40
) -> tuple[list[Array], str]:
    """Return coordinates of the assembly modes at the time t, the nearest to ``near`` first.

    With them why modes may be missing, as :attr:`AssemblyModes.incomplete`: empty where the linkage consists
    of groups that are solved by signs and roots (:mod:`symgen.runtime.rods.assur`). Otherwise they are those
    of a search from ``near``, its mirror images and ``tries`` random poses of the same seed every time:
    others may exist, though that is unlikely for linkages of few loops. Every pose is a solution to
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
        poses, incomplete = _search(constraints, near, t, tries), f"{problem}: searched from many poses"
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


def _search(constraints: Constraints, near: Array, t: float, tries: int) -> Iterator[Array]:
    """Yield poses that nearly meet the constraints, from many starting poses."""
    from scipy.optimize import least_squares

    length, places = constraints.length(near), constraints.places(near, 0.0)[: constraints.description.drawn]
    centre = np.tile(places.mean(axis=0), constraints.n // places.shape[1])
    axes = _axes((places - places.mean(axis=0)) / length)

    def placed(x: Array) -> Array:
        return np.asarray(centre + length * x)

    for start in _poses((near - centre) / length, axes, tries):
        solved = least_squares(
            lambda x: constraints.residual(placed(x), t) / length,
            start,
            lambda x: constraints.jacobian(placed(x), t),
            method="lm",
            x_scale=1.0,  # scales of their own would depend on the axes
            xtol=1e-12,
            ftol=1e-12,
            max_nfev=100,
        )
        if np.max(np.abs(solved.fun)) < 1e-6:
            yield placed(solved.x)


def _isolated(constraints: Constraints, q: Array, t: float) -> bool:
    values = np.linalg.svd(constraints.jacobian(q, t), compute_uv=False)
    return bool(values[-1] > _SAME * values[0])


def polished(constraints: Constraints, q: Array, t: float, root: Array | None = None) -> Array | None:
    """Return q brought to round-off by Newton's method; None where it does not get there.

    Corrections have the minimum norm, in the metric L L^T with the factor ``root`` L if one is given.
    """
    for _ in range(8):
        residual = constraints.residual(q, t)
        if np.max(np.abs(residual), initial=0.0) <= 4e-16 * max(float(np.max(np.abs(q))), 1e-300):
            break
        slopes = constraints.jacobian(q, t)
        if root is None:
            q = q - np.linalg.lstsq(slopes, residual, rcond=1e-12)[0]
        else:
            weighted = np.linalg.solve(root, slopes.T).T
            q = q - np.linalg.solve(root.T, np.linalg.lstsq(weighted, residual, rcond=1e-12)[0])
    size = max(float(np.max(np.abs(q))), 1e-300)
    return q if np.max(np.abs(constraints.residual(q, t)), initial=0.0) <= _CLOSED * size else None


def _poses(drawn: Array, axes: Array, tries: int) -> list[Array]:
    """Return a pose, from its centre and over its size, its mirror images, and random poses.

    They rotate and mirror with ``axes``, and depend on the order of the points only if two of them are alike.
    """
    arms = drawn.reshape(-1, len(axes)) @ axes.T
    mirrored = [arms * (1 - 2 * unit) for unit in np.eye(len(axes))]
    order = np.lexsort(np.round(arms, 9).T)
    random = np.random.default_rng(_SEED).uniform(-1, 1, (tries, *arms.shape))
    poses = np.array([arms, -arms, *mirrored, *random[:, np.argsort(order)]])
    return list((poses @ axes).reshape(len(poses), -1))


def _axes(arms: Array) -> Array:
    """Return orthonormal axes, row by row, each towards the farthest point from those before it."""
    axes = np.zeros((0, arms.shape[1]))
    while len(axes) < arms.shape[1]:
        out = arms - arms @ axes.T @ axes
        far = out[np.argmax(np.linalg.norm(out, axis=1))]
        if np.linalg.norm(far) < _SAME:  # all points are on a line or plane: it has no sides
            return np.vstack([axes, np.linalg.svd(axes)[2][len(axes) :]])
        axes = np.vstack([axes, far / np.linalg.norm(far)])
    return axes
