"""Exact derivatives along a run of a loop: the tangent of its steps, or their transpose.

The states between steps are kept. Compiled code evaluates their stages again, with the gradients of the
accelerations of closure and of the balance of efforts: see ``loop_variations.c``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from symgen.errors import ModelError
from symgen.runtime._variations import LoopVariations
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.options import Options
from symgen.runtime.kernels.batch import lanes_of
from symgen.runtime.kernels.description import LoopDescription
from symgen.runtime.kernels.library import Library
from symgen.runtime.linearisation.record import Sensitivity, sensitivity_of
from symgen.runtime.linearisation.runs import (
    StoredTrajectory,
    carried_back,
    carried_forward,
    fewer,
    followed,
    state_of,
)
from symgen.runtime.loop.derivatives.free import FreePose
from symgen.runtime.loop.kernels import LoopKernels
from symgen.runtime.result.state import State


def follow(loop: LoopKernels, rank: int, start: State, chosen: Options, times: Array) -> StoredTrajectory:
    """Carry out a run that steps exactly to the times requested, and keep its states.

    Raises
    ------
    ModelError
        As :func:`symgen.runtime.linearisation.runs.followed`; for implicit methods, and loads that jump;
        where the run takes other angles of ball joints.
    SimulationError
        As for :meth:`Model.simulate`.
    """
    from symgen.runtime.loop.motion import problem

    d = loop.description
    if d.switches:
        raise ModelError(f"derivatives of runs are not available for loads that jump: {d.switches[0]}")
    if chosen.method.kind != "explicit":
        raise ModelError(
            f"expected an explicit method for derivatives of runs of loops, got {chosen.method.name}\n"
            "  Choose dop853, dopri5 or rk4."
        )
    equations = loop.equations(d.having("dependent", "free"), rank, work_of_loads=False)
    turns = slice(len(d.tunable), len(d.tunable) + len(d.balls))
    path = followed(equations, turns, (), start, chosen, times, lambda *at: problem(loop, *at))
    if path.references.any():
        step = int(np.argmax(path.references.any(axis=1)))
        raise ModelError(
            f"derivatives of the run are not available from t = {path.t[step]:.9g} s on: the angles of a "
            "ball joint come near to a pole\n  Turn the axes of the rows next to the ball (theta, alpha) so "
            "that it lies elsewhere."
        )
    return path


def at_run(
    path: StoredTrajectory,
    pose: Callable[[State], FreePose],
    loop: LoopKernels,
    along: Callable[[Sequence[int]], LoopVariations] | None,
    by: Sequence[str],
) -> Sensitivity:
    """Return the derivatives of outputs at the ends of the path.

    Parameters
    ----------
    path
        The run.
    pose
        Returns the tangents of the loop at a state.
    along
        Returns the tangents of steps by directions: numbers of parameters, -1 of none. Without it the path is
        its first state alone.
    by
        Tunable parameters, and free variables and their rates, whose values at the start are meant.

    Raises
    ------
    ModelError
        As :class:`FreePose`; for a parameter that opens redundant closure equations.
    SimulationError
        When a derivative is not finite.
    """
    d = loop.description
    names = [p.name for p in d.parameters]
    begin = pose(state_of(path, 0))
    initial = {d.variables[i].name + mark: (k, i) for k, mark in enumerate(("", "'")) for i in begin.free}
    first = np.array([begin.started(*initial[x]) if x in initial else begin.by_parameter(x) for x in by]).T
    first = first[: 2 * d.coordinates]
    parameters = list(dict.fromkeys(name for name in by if name not in initial))
    seeds = np.array([[float(name == x) for x in by] for name in parameters]).reshape(
        len(parameters), len(by)
    )
    ends = [begin] if along is None else [pose(state_of(path, i)) for i in path.ends]
    if along is None:
        slopes_at_times = [begin.by_state(first, parameters, seeds)]
    else:
        steps = along([-1 if name in initial else names.index(name) for name in by])
        if fewer(len(begin.outputs) * len(ends), len(by)):
            slopes = [_by_state(end, parameters, seeds) for end in ends]
            slopes_at_times = carried_back(path, steps, slopes, 0, first)
        else:
            moved, _ = carried_forward(path, steps, first)
            slopes_at_times = [
                end.by_state(x, parameters, seeds) for end, (x, _) in zip(ends, moved, strict=True)
            ]
    values = [end.values for end in ends]
    units = {name: d.variables[i].unit + ("/s" if k else "") for name, (k, i) in initial.items()}
    if along is None:
        return sensitivity_of(d, begin.outputs, by, values[0], slopes_at_times[0], float(path.t[0]), units)
    times = path.t[[*path.ends]]
    return sensitivity_of(d, begin.outputs, by, np.array(values), np.array(slopes_at_times), times, units)


def steps_of(
    loop: LoopKernels, kernels: tuple[LoopDescription, Library], rank: int, chosen: Options
) -> Callable[[Sequence[int]], LoopVariations]:
    """Return the function of directions that gives the tangents of steps.

    Parameters
    ----------
    kernels
        Those of the analysis ``loop_variation``, which take vectors where they are compiled.
    rank
        Of the screws of dependent variables.
    """
    d = loop.description
    equations = loop.equations(d.having("dependent", "free"), rank, work_of_loads=False)
    description, library = kernels
    width = lanes_of(library, description.name)[0] if library.backend == "c" else 1
    return lambda directions: LoopVariations(
        equations, chosen.method, description, library, width, directions
    )


def _by_state(end: FreePose, parameters: Sequence[str], seeds: Array) -> tuple[Array, Array]:
    """Return the slopes of outputs by the state (outputs, 2n), and by the directions at a held state."""
    states = 2 * len(end.q)
    by_state = end.by_state(np.eye(states), parameters, np.zeros((len(parameters), states)))
    return by_state, end.by_state(np.zeros((states, seeds.shape[1])), parameters, seeds)
