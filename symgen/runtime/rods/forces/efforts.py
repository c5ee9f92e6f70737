"""Efforts that keep prescribed motions, and where their drives cannot."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.result.records import Variable
from symgen.runtime.rods.constraints import Constraints
from symgen.runtime.rods.poses import Poses


def efforts(constraints: Constraints, poses: Poses) -> Iterator[Variable]:
    """Yield the efforts at poses with the unknowns of their equations."""
    names, unknowns = constraints.evaluator.efforts, poses.unknowns
    if not names or unknowns is None:
        return
    for name, values in zip(names, unknowns.T[-len(names) :], strict=True):
        unit = "N" if name.endswith(".force") else "N*m"
        yield Variable(name, unit, f"effort of {name.rpartition('.')[0]}", (), values)


def dead_points(constraints: Constraints, poses: Poses) -> Iterator[str]:
    """Yield between which poses in a row efforts pass a pole: their drives cannot move the quantities there.

    The determinant of the rates of the drives by those of the prescribed quantities changes its sign there.
    """
    names = constraints.evaluator.efforts
    if not names or len(poses) < 2:
        return
    order = np.argsort(poses.times, kind="stable")
    times, signs = poses.times[order], np.sign(transmissions(constraints, poses[order]))
    for i in np.flatnonzero(signs[:-1] * signs[1:] < 0).tolist():
        drives = ", ".join(name.rpartition(".")[0] for name in names)
        yield (
            f"between t = {times[i]:.9g} s and {times[i + 1]:.9g} s there is a dead point of {drives}: next "
            "to it efforts grow without bounds"
        )


def transmissions(constraints: Constraints, poses: Poses) -> Array:
    """Return the determinant of the rates of the drives by those of the prescribed quantities at poses."""
    evaluator, d = constraints.evaluator, constraints.description
    moved = [i for i, label in enumerate(d.labels) if label.startswith("the motion of ")]
    ones = np.zeros((constraints.m, len(moved)))
    ones[moved, range(len(moved))] = 1.0
    pushes = evaluator.many("effort_forces", poses.times, poses.q, poses.u)
    pushes = pushes.reshape(len(poses), constraints.n, len(evaluator.efforts))
    found = np.empty(len(poses))
    for k, (t, q) in enumerate(zip(poses.times.tolist(), poses.q, strict=True)):
        rates = np.linalg.lstsq(constraints.jacobian(q, t), ones, rcond=None)[0]
        found[k] = np.linalg.det(pushes[k].T @ rates)
    return found
