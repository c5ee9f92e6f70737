"""A driven linkage followed in time by compiled steps, in ranges without singular poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symgen.runtime._kinematics import Kinematics
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.kernels.description import Description
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.rods.constraints import Constraints
from symgen.runtime.rods.following.groups import groups_of
from symgen.runtime.rods.poses import Poses

#: Parts into which the range is divided at first.
_PARTS = 8
#: Most parts of the range.
_MOST_PARTS = 1_000_000
#: Most that a link may turn from one pose to the next [rad]: half of what would hide a revolution.
TURN = 1.5


@dataclass(frozen=True, slots=True)
class Branch:
    """Poses along a branch, close enough to count revolutions; ``asked`` indexes the requested ones."""

    poses: Poses
    requested: Indices


def along_branch(
    constraints: Constraints, q: Array, t: float, low: float, high: float, times: Array
) -> Branch | None:
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
    kinematics = steps_of(constraints, q, t)
    parts = _PARTS
    while parts <= _MOST_PARTS:
        nodes = nodes_of(t, low, high, times, parts)
        before, after = nodes[nodes < t][::-1].copy(), nodes[nodes >= t]
        forward = kinematics.follow(t, q, after)
        if len(forward) < len(after):
            return None
        back = kinematics.follow(t, q, before)
        if len(back) < len(before):
            return None
        poses = Poses(nodes, np.concatenate([back[::-1], forward]))
        most = float(turned(constraints.description, nodes, *constraints.moving(poses)))
        if most <= TURN:
            return Branch(poses, np.searchsorted(nodes, times))
        parts *= int(np.ceil(min(most / TURN, _MOST_PARTS)) + 1)
    return None


def nodes_of(t: float, low: float, high: float, times: Array, parts: int = _PARTS) -> Array:
    """Return the times of poses along a branch: the start t, those requested, and parts of the range."""
    return np.union1d(np.linspace(low, high, parts + 1), np.append(times, t))


def steps_of(constraints: Constraints, q: Array, t: float, forces: Evaluator | None = None) -> Kinematics:
    """Return the compiled steps of a linkage, by constraints that are independent in a pose q at a time t.

    With the kernels of the analysis ``forces``, they give the multipliers of the constraints too.
    """
    from scipy.linalg import qr

    rows = qr(constraints.jacobian(q, t).T, mode="r", pivoting=True)[1][: constraints.n]
    groups = groups_of(constraints.slopes, sorted(rows.tolist()), constraints.n)
    return Kinematics(constraints.kinematics, groups, constraints.length(q), forces)


def turned(d: Description, times: Array, places: Array, velocities: Array) -> Array:
    """Return the largest rotation of a link between consecutive poses [rad]; infinite if it is unknown.

    Positions and velocities of points have the shape (..., poses, points, axes).
    """
    worst, steps = np.zeros(places.shape[:-3]), np.diff(times)
    if len(d.axes) != 2 or len(times) < 2:
        return worst
    for points in d.links.values():
        i, j = (d.points.index(p) for p in points[:2])
        (x, y), (v, w) = (np.moveaxis(a[..., j, :] - a[..., i, :], -1, 0) for a in (places, velocities))
        squared = x * x + y * y
        with np.errstate(divide="ignore", invalid="ignore"):
            rate = (x * w - y * v) / squared
        by_rate = steps * (rate[..., 1:] + rate[..., :-1]) / 2
        other = np.abs((np.diff(np.arctan2(y, x)) - by_rate + np.pi) % (2 * np.pi) - np.pi)
        fastest = steps * np.maximum(np.abs(rate[..., 1:]), np.abs(rate[..., :-1]))
        most = np.max(fastest + other, axis=-1)
        worst = np.maximum(worst, np.where(np.isfinite(most), most, np.inf))
    return worst
