"""A driven linkage followed through times in compiled steps, where no singular pose is on the way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symgen.runtime._kinematics import Kinematics
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.rods.constraints import Bonds
from symgen.runtime.rods.following.groups import groups_of
from symgen.runtime.rods.poses import Poses

Array = NDArray[np.float64]

#: Parts of the range at first, and the most of them.
_PARTS, _MOST = 8, 1_000_000
#: Most that a link may turn from one pose to the next [rad]: half of what would hide a revolution.
_TURN = 1.5


@dataclass(frozen=True, slots=True)
class Branch:
    """Poses along a branch, close enough to count revolutions; ``asked`` indexes the requested ones."""

    poses: Poses
    asked: NDArray[np.intp]


def along_branch(bonds: Bonds, q: Array, t: float, low: float, high: float, times: Array) -> Branch | None:
    """Follow a linkage from the pose q at the time t over a range, on one branch.

    Parameters
    ----------
    low, high
        Range of time [s], with t in it.
    times
        Increasing times [s] in the range to pass through.

    Returns
    -------
    Branch or None
        None where the compiled steps come near a pose in which the constraint Jacobian is singular, or find
        none that fits their prediction: there the curve is to be followed by its arc length.
    """
    kinematics = steps_of(bonds, q, t)
    parts = _PARTS
    while parts <= _MOST:
        nodes = np.union1d(np.linspace(low, high, parts + 1), times)
        before, after = nodes[nodes < t][::-1].copy(), nodes[nodes >= t]
        forward = kinematics.follow(t, q, after)
        if len(forward) < len(after):
            return None
        back = kinematics.follow(t, q, before)
        if len(back) < len(before):
            return None
        poses = Poses(nodes, np.concatenate([back[::-1], forward]))
        turned = _turned(bonds, poses)
        if turned <= _TURN:
            return Branch(poses, np.searchsorted(nodes, times))
        parts *= int(np.ceil(min(turned / _TURN, _MOST)) + 1)
    return None


def steps_of(bonds: Bonds, q: Array, t: float, forces: Evaluator | None = None) -> Kinematics:
    """Return the compiled steps of a linkage, by constraints that are independent in a pose q at a time t.

    With the kernels of the analysis ``forces``, they give the multipliers of the constraints too.
    """
    from scipy.linalg import qr

    rows = qr(bonds.jacobian(q, t).T, mode="r", pivoting=True)[1][: bonds.n]
    groups = groups_of(bonds.slopes, rows.tolist(), bonds.n)
    return Kinematics(bonds.kinematics, groups, bonds.length(q), forces)


def _turned(bonds: Bonds, poses: Poses) -> float:
    """Return the largest rotation of a link between consecutive poses [rad]; infinite if it is unknown."""
    if len(bonds.description.axes) != 2 or len(poses) < 2:
        return 0.0
    places, velocities = bonds.moving(poses)
    worst, steps = 0.0, np.diff(poses.times)
    for points in bonds.description.links.values():
        i, j = (bonds.description.points.index(p) for p in points[:2])
        d, v = places[:, j] - places[:, i], velocities[:, j] - velocities[:, i]
        squared = np.sum(d * d, axis=1)
        if not np.all(squared > 0.0):
            return np.inf
        rate = (d[:, 0] * v[:, 1] - d[:, 1] * v[:, 0]) / squared
        by_rate = steps * (rate[1:] + rate[:-1]) / 2
        change = np.diff(np.arctan2(d[:, 1], d[:, 0]))
        other = np.abs((change - by_rate + np.pi) % (2 * np.pi) - np.pi)
        fastest = steps * np.maximum(np.abs(rate[1:]), np.abs(rate[:-1]))
        worst = max(worst, float(np.max(fastest + other, initial=0.0)))
    return worst if np.isfinite(worst) else np.inf
