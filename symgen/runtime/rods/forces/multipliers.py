"""Forces in a driven linkage by the multipliers of its constraints, in compiled steps."""

from __future__ import annotations

import numpy as np

from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.rods.constraints import Constraints
from symgen.runtime.rods.following.branch import steps_of
from symgen.runtime.rods.forces.assembly import Assembly, ForceSolution, solve
from symgen.runtime.rods.poses import Poses


def by_multipliers(
    constraints: Constraints, loads: Evaluator, poses: Poses, assembly: Assembly
) -> ForceSolution | None:
    """Return the forces at all poses by J^T lambda = f - M a, whose J the kinematics factorises.

    The equations of the elements are set up at one pose, that nearest to a loss of rank: they tell the
    condition there. The residual is the larger of theirs there and that of the multipliers over all poses.

    Returns
    -------
    Solution or None
        None where the multipliers do not determine all forces: near a pose in which J is singular, with
        redundant constraints, and for links whose joint forces need more than multipliers; and where loads
        depend on forces.
    """
    if (
        poses.unknowns is not None
        or constraints.m != constraints.n
        or not loads.has("joint_forces")
        or not len(poses)
    ):
        return None
    multipliers, quality = np.empty((len(poses), constraints.m)), np.empty((len(poses), 2))
    for kernels, rows in poses.wound(loads):
        there = poses[rows]
        steps = steps_of(constraints, there.q[0], float(there.times[0]), kernels)
        solved, errors = steps.multipliers(there.times, np.ascontiguousarray(there.states))
        if len(solved) < len(rows):
            return None
        multipliers[rows], quality[rows] = solved, errors
    motion = np.hstack([poses.accelerations, multipliers])
    forces = poses.many(loads, "joint_forces", motion)
    order = {label: i for i, label in enumerate(loads.info("joint_forces").blocks[0].rows)}
    x = forces[:, [order[label] for u in assembly.unknowns for label in u.labels]]
    worst = int(np.argmin(quality[:, 0]))
    nearest = Assembly(constraints, loads, poses[np.array([worst])], assembly.elements)
    solution = solve(nearest)
    size = float(np.max(np.abs(x / nearest.scales), initial=0.0)) or 1.0
    return ForceSolution(
        x,
        np.full(len(poses), assembly.size),
        np.zeros((len(poses), assembly.size)),
        worst,
        solution.condition,
        max(nearest.residual(x[worst : worst + 1]), float(np.max(quality[:, 1])) / size),
    )
