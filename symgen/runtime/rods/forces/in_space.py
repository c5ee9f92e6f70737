"""Forces in a driven linkage in space over its motion: outputs of its equations of motion at the poses."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np

from symgen.errors import ModelError, SimulationError
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.dead_points import dead_points
from symgen.runtime.model.arguments import LinkageForces
from symgen.runtime.result.forces import Forces
from symgen.runtime.result.records import Variable, converters
from symgen.runtime.result.state import State
from symgen.runtime.rods.constraints import Constraints
from symgen.runtime.rods.forces.analysis import sampled, selected, solutions, why
from symgen.runtime.rods.kinematics import driven, follow, with_references
from symgen.runtime.rods.poses import Poses
from symgen.runtime.rods.recorded_motion import over_poses

#: Condition of the constraints beyond which they do not determine forces.
_LOST = 1e9


def analyse(constraints: Constraints, begin: State, redundant: int, request: LinkageForces) -> Forces:
    """Return the outputs that the scene selects over a motion that starts from a state.

    ``redundant`` is how many constraints follow from the others wherever the linkage goes; their forces have
    the least norm.

    Raises
    ------
    ModelError
        For elements and sections, and drives that do not determine the motion.
    SimulationError
        If a requested pose cannot be reached, or does not determine the forces.
    """
    began, d = perf_counter(), constraints.description
    default = LinkageForces()
    if (request.elements, tuple(request.sections)) != (default.elements, tuple(default.sections)):
        raise ModelError(f"section forces are for linkages in the plane, and {d.name} is in space")
    over = request.instants(d.t_end)
    driven(constraints, begin.q, begin.t)
    times = over.times(d.name, constraints.driving)
    followed = follow(constraints, begin.q, begin.t, over, times)
    followed = replace(followed, samples=with_references(constraints, followed, begin))
    if over.spread:
        times = np.sort(followed.samples.times)
    shown = converters(d.units)

    def at(t: float) -> str:
        return f"t = {t:.9g} s"

    poses = sampled(constraints, followed, times, over.at is not None, at, lambda p: p.describe(shown))
    conditions, notes = _conditions(constraints, poses), list[str]()
    lost = conditions > _LOST
    if np.any(lost):
        where = at(float(poses.times[lost][0]))
        notes.append(f"constraints and drives do not determine forces at {where}, a singular pose")
        if over.at is not None or np.all(lost):
            raise SimulationError(notes[0], time=float(poses.times[lost][0]))
        poses, conditions = poses[np.flatnonzero(~lost)], conditions[~lost]
    if redundant:
        names = ", ".join(d.labels[i] for i in d.redundant)
        notes.append(f"redundant constraints ({names}): forces that are not determined have the least norm")
    if d.switches:
        notes.append("loads switch: forces may jump between two poses, and extremes are those of the poses")
    notes += (pose.describe(shown) for pose in followed.poses)
    notes += dead_points(constraints.evaluator, poses.times, poses.q)
    drives = constraints.driving(poses.times)
    units = constraints.units()
    variables = [Variable(name, units[name], f"drive {name}", (), x) for name, x in drives.items()]
    variables += (v for v in selected(constraints, redundant, poses, followed) if v.name not in drives)
    for v in variables:
        finite = np.isfinite(v.values.reshape(len(poses), -1)).all(axis=1)
        if not np.all(finite):
            t = float(poses.times[~finite][0])
            raise SimulationError(f"no finite {v.name} at {at(t)}: {why(constraints, poses, t)}", time=t)
    worst = int(np.argmax(conditions))
    drive = next(iter(drives), "") if over.over == "input" else ""
    fields = over_poses(
        constraints, poses, followed, variables, drive, "multipliers", over.stop, began,
        elements=0,
        condition=float(conditions[worst]),
        worst_at=at(float(poses.times[worst])),
        residual=_disagreement(constraints, redundant, poses),
    )  # fmt: skip
    return Forces(**fields, notes=tuple(notes))


def _conditions(constraints: Constraints, poses: Poses) -> Array:
    """Return the condition number of the constraints at every pose, redundant ones included."""
    conditions = np.ones(len(poses))
    for i, (t, q) in enumerate(zip(poses.times.tolist(), poses.q, strict=True)):
        values = np.linalg.svd(constraints.jacobian(q, t), compute_uv=False)
        with np.errstate(divide="ignore"):
            conditions[i] = values[0] / values[constraints.n - 1]
    return conditions


def _disagreement(constraints: Constraints, redundant: int, poses: Poses) -> float:
    """Return the largest difference of accelerations by forces from those by drives, over the largest one."""
    found = solutions(constraints, redundant, poses)[:, : constraints.n]
    size = float(np.max(np.abs(poses.accelerations), initial=0.0))
    return float(np.max(np.abs(found - poses.accelerations), initial=0.0)) / (size or 1.0)
