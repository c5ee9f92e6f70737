"""Forces in a driven linkage by the multipliers of its constraints, in compiled steps."""

from __future__ import annotations

import numpy as np

from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.rods.constraints import Constraints
from symgen.runtime.rods.following.branch import steps_of
from symgen.runtime.rods.forces.assembly import Assembly, Solution, solve
from symgen.runtime.rods.poses import Poses


def by_multipliers(
    constraints: Constraints, loads: Evaluator, poses: Poses, assembly: Assembly
) -> Solution | None:
    """Return the forces at all poses by J^T lambda = f - M a, whose J the kinematics factorises.

    The equations of the elements are set up at one pose, that nearest to a loss of rank: they tell the
    condition there. The residual is the larger of theirs there and that of the multipliers over all poses.

    Returns
    -------
    Solution or None
        None where the multipliers do not determine all forces: near a pose in which J is singular, with
        redundant constraints, and for links whose joint forces need more than multipliers.
    """
    if constraints.m != constraints.n or not loads.has("joint_forces") or not len(poses):
        return None
    steps = steps_of(constraints, poses.q[0], float(poses.times[0]), loads)
    multipliers, quality = steps.multipliers(poses.times, np.ascontiguousarray(poses.states))
    if len(multipliers) < len(poses):
        return None
    motion = np.hstack([poses.accelerations, multipliers])
    forces = loads.many("joint_forces", poses.times, poses.q, poses.u, motion)
    order = {label: i for i, label in enumerate(loads.info("joint_forces").blocks[0].rows)}
    x = forces[:, [order[label] for u in assembly.unknowns for label in u.labels]]
    worst = int(np.argmin(quality[:, 0]))
    there = Assembly(constraints, loads, poses[np.array([worst])], assembly.elements)
    solution = solve(there)
    size = float(np.max(np.abs(x / there.scales), initial=0.0)) or 1.0
    return Solution(
        x,
        np.full(len(poses), assembly.size),
        np.zeros((len(poses), assembly.size)),
        worst,
        solution.condition,
        max(there.residual(x[worst : worst + 1]), float(np.max(quality[:, 1])) / size),
    )
