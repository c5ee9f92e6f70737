"""Time per pose of driven linkages, for positions, velocities and accelerations, with the error.

symgen's ``model.kinematics`` is timed whole, with everything that it records, and its compiled steps alone.
The other ways are symgen's own curve by arc length, which follows linkages near singular poses, and
pylinkage, whose functions are compiled by Numba (left out where it is not installed). Errors are those of
point B in the last pose, against two circles; those of other linkages are residuals of their constraints.
Rounds are interleaved.
"""

from __future__ import annotations

import sys
from functools import partial
from typing import Any
from unittest.mock import patch

import numpy as np
from harness import Case, Measurement, Required, Timing, arguments, measure, report_repeats
from linkages import LINKAGES, meeting
from numpy.typing import NDArray

import symgen
from symgen.runtime._kinematics import KinematicLanes
from symgen.runtime.kernels.batch import lanes_of
from symgen.runtime.rods import kinematics
from symgen.runtime.rods.following.branch import steps_of
from symgen.runtime.rods.following.groups import groups_of
from symgen.runtime.rods.poses import Poses

Array = NDArray[np.float64]

#: Lengths of ``crank_rocker`` [m].
CRANK, COUPLER, ROCKER, BASE = 0.1, 0.35, 0.3, 0.4
POSES, SLOW_POSES, ROUNDS = 3601, 361, 20
FASTER, LARGEST_ERROR = 30.0, 1e-13
COMPILED, WHOLE, CURVE, PEER = "compiled steps", "model.kinematics", "by arc length", "pylinkage, Numba"
FORCES = "model.inverse_dynamics"
LANES, LANES_FORCES = "in lanes", "in lanes, with all joint forces"
#: Blocks of runs in lanes, runs of a block, poses of a revolution, and the least poses per second of a core.
BLOCKS, RUNS, OF_A_RUN, IN_LANES, IN_LANES_WITH_FORCES = 3, 16, 361, 8e6, 3e6
#: Most that a pose may take, one after the other: of crank_rocker, and of any of the linkages [s].
ONE_POSE, DEAREST = 0.3e-6, 3e-6


def main() -> int:
    """Measure, print, and return the exit code."""
    options = arguments(__doc__, slack=True)
    return report_repeats(partial(measured, options.slack), options)


def measured(slack: float) -> Measurement:
    """Measure once."""
    model = symgen.build("crank_rocker")
    times = np.linspace(0.0, 1.0, POSES)
    steps, start = steps_of(model.constraints(), model.initial_state().q, 0.0), model.initial_state().q

    def by_arc_length() -> Any:
        with patch.object(kinematics, "along_branch", lambda *given: None):
            return model.kinematics(0.0, 1.0, samples=SLOW_POSES)

    cases = {
        COMPILED: Case(lambda: steps.follow(0.0, start, times), POSES),
        WHOLE: Case(lambda: model.kinematics(0.0, 1.0, samples=POSES), POSES),
        CURVE: Case(by_arc_length, SLOW_POSES),
    }
    places = {
        COMPILED: steps.follow(0.0, start, times)[-1, 0, 2:],
        WHOLE: model.kinematics(0.0, 1.0, samples=POSES)["B.position"].values[-1],
        CURVE: by_arc_length()["B.position"].values[-1],
    }
    cases[FORCES] = Case(lambda: model.inverse_dynamics(samples=POSES, sections=()), POSES)
    places[FORCES] = np.array(model.inverse_dynamics(samples=POSES, sections=()).final["B"]["position"])
    missed = {}
    for how, with_forces in ((LANES, False), (LANES_FORCES, True)):
        cases[how], places[how] = _in_lanes(model, with_forces)
    for name, scene in LINKAGES.items():
        cases[name], missed[name] = _steps(symgen.build(scene()))
    peer = _pylinkage()
    if peer is not None:
        cases[PEER] = Case(lambda: peer.step_fast_with_kinematics(POSES - 1), POSES - 1)
        places[PEER] = peer.step_fast_with_kinematics(POSES - 1)[0][-1, -1]
    timings: dict[str, Timing] = measure(cases, ROUNDS)
    closed = meeting(np.array([CRANK, 0.0]), np.array([BASE, 0.0]), COUPLER, ROCKER)
    errors = {how: float(np.linalg.norm(place - closed)) for how, place in places.items()} | missed
    rows = [
        {
            "route": how,
            "best [us]": t.best * 1e6,
            "median [us]": t.median * 1e6,
            "over the compiled steps": t.best / timings[COMPILED].best,
            "error [m]": errors[how],
        }
        for how, t in timings.items()
    ]
    ratio = timings[CURVE].best / timings[WHOLE].best
    required = [
        Required("model.kinematics: poses for one by arc length", ratio, FASTER, True, timed=True),
        Required("model.kinematics: error [m]", errors[WHOLE], LARGEST_ERROR, False),
        *(
            Required(f"{how}: one pose [us]", timings[how].best * 1e6, most * 1e6 * slack, False, timed=True)
            for how, most in {COMPILED: ONE_POSE, **dict.fromkeys(LINKAGES, DEAREST)}.items()
        ),
        *(
            Required(
                f"{how}: poses per second and core", 1 / timings[how].best, least / slack, True, timed=True
            )
            for how, least in ((LANES, IN_LANES), (LANES_FORCES, IN_LANES_WITH_FORCES))
        ),
        Required("in lanes: error [m]", max(errors[LANES], errors[LANES_FORCES]), LARGEST_ERROR, False),
        Required("residual of the linkages [m]", max(missed.values()), LARGEST_ERROR, False),
    ]
    if PEER in timings:
        line = "pylinkage: poses of symgen for one"
        required.append(Required(line, timings[PEER].best / timings[COMPILED].best, 1.0, True, timed=True))
    notes = [] if peer is not None else ["pylinkage is not installed (pip install pylinkage numba)."]
    return Measurement("A pose of crank_rocker with velocities and accelerations", rows, required, notes)


def _steps(model: symgen.Model) -> tuple[Case, float]:
    """Return the compiled steps of a linkage over a second, and their largest residual [m]."""
    times, start = np.linspace(0.0, 1.0, POSES), model.initial_state().q
    constraints = model.constraints()
    steps = steps_of(constraints, start, 0.0)
    states = steps.follow(0.0, start, times)
    if len(states) < POSES:
        raise RuntimeError(f"{model.name} is followed to t = {times[len(states)]:g} s only")
    return Case(lambda: steps.follow(0.0, start, times), POSES), float(
        constraints.errors(Poses(times, states))[0]
    )


def _in_lanes(model: symgen.Model, with_forces: bool) -> tuple[Case, Array]:
    """Return the steps in lanes over a revolution, and where the last run has B in the end."""
    constraints, start = model.constraints(), model.initial_state().q
    motion, forces = (model.in_lanes(kind) for kind in ("kinematics", "forces"))
    groups = groups_of(constraints.slopes, range(constraints.n), constraints.n)
    lanes = KinematicLanes(
        motion, lanes_of(motion[1], motion[0].name)[0], groups, forces if with_forces else None
    )
    given = (
        np.tile(model.evaluator.parameter_values, (RUNS, 1)),
        np.tile(start, (RUNS, 1)),
        np.full(RUNS, constraints.length(start)),
    )
    times = np.linspace(0.0, 1.0, OF_A_RUN)
    places = lanes.follow(0.0, *given, times)[0][-1, -1, 0, 2:]

    def blocks() -> None:
        for _ in range(BLOCKS):
            lanes.follow(0.0, *given, times)

    return Case(blocks, BLOCKS * RUNS * OF_A_RUN), places


def _pylinkage() -> Any:
    """Return the same linkage of pylinkage, its crank at 1 rev/s; None without the package."""
    try:
        from pylinkage import Crank, Ground, Linkage, RRRDyad
    except ImportError:
        return None
    o, c = Ground(0.0, 0.0, name="O"), Ground(BASE, 0.0, name="C")
    a = Crank(anchor=o, radius=CRANK, angular_velocity=2 * np.pi / (POSES - 1), name="A")
    b = RRRDyad(anchor1=a.output, anchor2=c, distance1=COUPLER, distance2=ROCKER, name="B")
    linkage = Linkage([o, c, a, b])
    linkage.set_input_velocity(a, 2 * np.pi)
    return linkage


if __name__ == "__main__":
    sys.exit(main())
