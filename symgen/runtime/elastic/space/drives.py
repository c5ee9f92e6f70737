"""Torques of the drives of rigid links in space to which elastic links are joined."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgen.runtime.elastic.large.collocation import MotionState, stacked
from symgen.runtime.elastic.space.linkage import AXES, LinkageInSpace
from symgen.runtime.result.records import Variable


def drives(of: LinkageInSpace, moments: Sequence[MotionState]) -> list[Variable]:
    """Return torque and power of each drive.

    A torque is the sum of that on the link alone and of the virtual work, per angle, of the joints with axes
    fixed in the link.
    """
    info, points, rigid = of.rigid.description.elastic, of.rigid.description.coordinates, len(of.rows)
    if info is None or not info.driven:
        return []
    t, q, v, _, multipliers = stacked(moments)
    work = np.zeros((len(t), points + len(of.rigid.description.constraints)), multipliers.dtype)
    work[:, [points + row for row in of.rows]] = multipliers[:, :rigid] / of.sizes
    state = t, q[:, :points], v[:, :points]
    torques = of.of_joints("drives", *state, work)["drive_torques"].reshape(len(t), -1)
    driven, (places, rates) = of.of_joints("driven", *state), of.prescribed_with_tangents(t)
    slopes = of.directed(np.hstack([q, places]), np.hstack([v, rates]))[..., 2:]
    slopes = slopes * multipliers[:, rigid + 3 * len(of.pins) :, None]
    forces = np.zeros((len(t), of.unknowns + places.shape[1]), slopes.dtype)
    np.add.at(forces.T, of.vectors, np.moveaxis(slopes, 0, -1))
    on_axes = forces[:, -AXES * len(info.driven) :].reshape(len(t), -1, AXES)
    torques = torques + np.sum(on_axes * driven["driven_slopes"].reshape(on_axes.shape), axis=2)
    powers = torques * driven["drive_speeds"].reshape(len(t), -1)
    variables = []
    for name, torque, power in zip(info.driven, torques.T, powers.T, strict=True):
        variables.append(
            Variable(f"{name}.torque", "N*m", f"torque of the drive on {name} about its axis", (), torque)
        )
        variables.append(Variable(f"{name}.power", "W", f"power of the drive on {name}", (), power))
    return variables
