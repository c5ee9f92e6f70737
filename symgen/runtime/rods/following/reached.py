"""The state of a linkage at a time of its motion, with the revolutions of angles in loads."""

from __future__ import annotations

import numpy as np

from symgen.errors import SimulationError
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.options import Options
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.linearisation.runs import follow as run
from symgen.runtime.model.instants import Instants
from symgen.runtime.result.records import converters
from symgen.runtime.result.state import State
from symgen.runtime.rods.constraints import Constraints
from symgen.runtime.rods.kinematics import driven, follow, order_of, with_references

#: Coordinates, velocities, and references of angles in loads.
_Reached = tuple[Array, Array, Array | None]


def by_drives(constraints: Constraints, begin: State, t: float) -> _Reached:
    """Return where drives lead a linkage from a state to another time [s]; raise as ``kinematics`` does."""
    driven(constraints, begin.q, begin.t)
    instants, times = Instants(min(t, begin.t), max(t, begin.t), 2, [t]), np.array([t])
    followed = follow(constraints, begin.q, begin.t, instants, times)
    order = order_of(followed, times, converters(constraints.description.units))
    pose = with_references(constraints, followed, begin)[order]
    return pose.q[0], pose.u[0], begin.references if pose.references is None else pose.references[0]


def by_run(evaluator: Evaluator, redundant: int, begin: State, times: Array, chosen: Options) -> _Reached:
    """Return where a run leads from a state to the last of some times [s].

    Raises
    ------
    SimulationError
        As for :meth:`Model.simulate`, and when an event ends the run before.
    """
    path, d = run(evaluator, None, redundant, begin, chosen, times), evaluator.description
    if path.event is not None:
        raise SimulationError(
            f"{d.name}: the event {d.events[path.event].name!r} ends the run at t = {path.t[-1]:.9g} s, "
            f"before t = {times[-1]:g} s",
            time=float(path.t[-1]),
        )
    q, u = np.split(path.y[-1], 2)
    return q, u, path.references[-1, : d.windings]
