"""Exact derivatives along a run: the tangent of its steps, or their transpose.

A run is cut at the times at which outputs are requested. Its states between steps are kept. Compiled code
evaluates the stages of each step again with the slopes of the equations of motion, and carries derivatives of
the state by all directions forward, or those of one output back to the start and the parameters, whichever
costs less.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from symgen.errors import ModelError, SimulationError
from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.failures import problem
from symgen.runtime.integrate.options import Options, recorded_at
from symgen.runtime.integrate.redundancy import slack
from symgen.runtime.integrate.simulate import effects_of
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.linearisation.jumps import jumps_between, total_slopes
from symgen.runtime.linearisation.record import Sensitivity, sensitivity_of
from symgen.runtime.linearisation.sensitivity import closing_motion, moved_pose, moved_rest
from symgen.runtime.linearisation.steps import (
    StepTangents,
    StoredTrajectory,
    carried_back,
    carried_forward,
    fewer,
)
from symgen.runtime.linearisation.tangents import Tangents
from symgen.runtime.result.state import State

#: Most steps of a run with derivatives, which stores the states of all steps.
MOST_STEPS = 1_000_000
#: Steps whose states are noted in one call.
_CHUNK = 4096
#: Relative change of derivatives by halved steps, over the tolerance of the run, and its largest value.
_CHANGE, _LARGEST_CHANGE = 1e4, 1e-2
#: Relative change of derivatives, over that of the states, which halved steps do not reduce: 2 to 3 where a
#: chaotic motion amplifies both.
_BEYOND_STATES = 10.0
#: Rates of constraints by parameters [m/s], over their scale, that count as zero.
_MOVING = 1e-9


def follow(
    evaluator: Evaluator,
    tangent: Evaluator | None,
    redundant: int,
    start: State,
    chosen: Options,
    times: Array,
) -> StoredTrajectory:
    """Carry out a run that steps exactly to the times requested, and keep its states.

    ``tangent`` are the kernels of the analysis of that name, for implicit methods.

    Raises
    ------
    ModelError
        For times that do not increase from the start to the end; for RATTLE.
    SimulationError
        As for :meth:`Model.simulate`.
    """
    d = evaluator.description
    allowed = slack(evaluator, start.q) if redundant else np.inf

    def until(times: Array, chosen: Options, ends: int) -> StoredTrajectory:
        equations = evaluator.equations(redundant, allowed, work_of_loads=False, tangent=tangent)
        events = [(e.direction, kind & ends) for e, kind in zip(d.events, effects_of(d.events), strict=True)]

        def cause(stepper: _core.Run, chosen: Options, status: int) -> str:
            return problem(status, stepper, equations, evaluator, chosen)

        return followed(equations, d.of_held, events, start, chosen, times, cause)

    path = until(times, chosen, _core.ENDS_RUN | _core.REVOLVES)
    if path.event is not None:  # again, with a last step that ends there
        t = float(path.t[-1])
        again = until(np.array([*times[times < t], t]), replace(chosen, t_end=t), _core.REVOLVES)
        path = replace(again, event=path.event)
    return replace(path, switches=len(d.switches))


def followed(
    equations: _core.Integrable,
    held: slice,
    events: Sequence[tuple[int, int]],
    start: State,
    chosen: Options,
    times: Array,
    cause: Callable[[_core.Run, Options, int], str],
) -> StoredTrajectory:
    """Carry out a run that steps exactly to the times requested, and keep its states.

    Where an event ends the run, the path has this event and its time alone.

    Parameters
    ----------
    equations
        Without the work of loads.
    held
        Which parameters are the references that a run sets.
    events
        Direction and kind of each event.
    cause
        Returns the message for a run that fails.

    Raises
    ------
    ModelError
        For RATTLE, and times that do not increase from the start to the end.
    SimulationError
        As for :meth:`Model.simulate`.
    """
    if chosen.method.kind == "rattle":
        raise ModelError(
            f"derivatives of runs are not available for {chosen.method.name}\n"
            "  Choose dop853, taylor, dopri5, rk4, radau5, newmark or generalized-alpha."
        )
    recorded_at(times, start.t, chosen.t_end)
    t: list[Array] = [np.array([start.t])]
    y: list[Array] = []
    references: list[Array] = []
    now, state, ends, step = start.t, np.concatenate([start.q, start.u]), [], chosen.step
    passages: list[float] = []
    for end in times.tolist():
        stepper = _core.Run(
            equations, chosen.method, now, state, end, chosen.rtol, chosen.atol, step, np.zeros(0),
            max_step=chosen.max_step,
            directions=[direction for direction, _ in events],
            terminal=[kind for _, kind in events],
        )  # fmt: skip
        status = stepper.begin()
        if not y:
            y.append(stepper.state[None, :])
            references.append(equations.parameters[None, held])
        else:  # at a switching point the run goes on with other branches
            next(rows for rows in reversed(references) if len(rows))[-1] = equations.parameters[held]
        while status == _core.MORE:
            room = min(_CHUNK, chosen.max_steps - sum(map(len, t)) + 1)
            if room <= 0:
                break
            rows = np.zeros(room), np.zeros((room, len(state))), np.zeros((room, held.stop - held.start))
            status, count = stepper.advance_noting(*rows)
            for of, row in zip((t, y, references), rows, strict=True):
                of.append(row[:count])
        if status == _core.ENDED:
            if stepper.events[-1][2] is None:
                raise ModelError(
                    f"the event that ends the run at t = {stepper.t:.9g} s touches zero: this time has no "
                    "derivatives\n  End the run at a time (t_end), or by another event."
                )
            return StoredTrajectory(
                np.array([stepper.t]), np.zeros(0), np.zeros(0), (), event=stepper.ended_by
            )
        if status != _core.DONE:
            raise SimulationError(cause(stepper, replace(chosen, t_end=end), status), time=stepper.t)
        now, state = end, stepper.state
        passages += [t for t, _, _ in stepper.passages]
        step = step if not chosen.rtol and not chosen.atol else 0.0
        ends.append(sum(map(len, t)) - 1)
    rows = np.concatenate(t), np.concatenate(y), np.concatenate(references)
    return StoredTrajectory(*rows, tuple(ends), passages=tuple(passages))


def of_run(
    chosen: Options,
    path: Callable[[Options], StoredTrajectory],
    derivatives: Callable[[StoredTrajectory], Sensitivity],
) -> Sensitivity:
    """Return the derivatives along the path of a run with options; next to losses of rank with a note.

    There rounding errors of a pose grow by 1/s, of accelerations by 1/s^3 and of their slopes by 1/s^4, with
    the sine s of the least angle between constraints at a stage. The note has what other steps change,
    or that the digits are unknown, where the run fails with other steps.
    """
    along = path(chosen)
    found = derivatives(along)
    if not along.passages:
        return found
    others = replace(chosen, rtol=4 * chosen.rtol, atol=4 * chosen.atol, step=chosen.step / 2)
    note = (
        f"the constraints lose rank at t = {along.passages[0]:.9g} s, next to which derivatives lose digits: "
    )
    try:
        changes = np.abs(derivatives(path(others)).derivatives - found.derivatives)
    except SimulationError as error:
        cause = str(error).splitlines()[0]
        note += f"how many is unknown, as they are not found with steps of another length ({cause})"
        return replace(found, notes=(*found.notes, note))
    sizes = np.max(np.abs(found.derivatives), axis=0)
    parts = np.divide(np.max(changes, axis=0), sizes, out=np.zeros_like(sizes), where=sizes > 0)
    i, j = np.unravel_index(np.argmax(parts), parts.shape)
    note += (
        f"with other steps, that of {found.outputs[i]} by {found.parameters[j]} differs by {parts[i, j]:.1g} "
        "of its largest value"
    )
    return replace(found, notes=(*found.notes, note))


def halved(
    path: StoredTrajectory,
    again: Callable[[Options], StoredTrajectory],
    tangents: Callable[[State, Array], Tangents],
    steps: StepTangents,
    coordinates: Sequence[str],
    chosen: Options,
) -> StoredTrajectory:
    """Return the path of a run by implicit steps whose longest are halved till they resolve motions about it.

    Where a motion is at rest or uniform, steps of the method's own choice grow as long as the run. They
    resolve motions about it if the derivatives by the start values of the coordinates, and of their rates,
    hardly change with steps of half the length. They do not settle beyond the states, which a chaotic motion
    leaves undetermined within the tolerance. ``again`` carries out the run with other options.
    """
    if not (steps.states and chosen.rtol and coordinates):
        return path
    by = [*coordinates, *(f"{name}'" for name in coordinates)]
    first = np.vstack(moved_pose(tangents(state_of(path, 0), path.references[0]), by, coordinates))
    along, limit = steps.along(by), min(_CHANGE * chosen.rtol, _LARGEST_CHANGE)
    least = chosen.atol / chosen.rtol

    def at_ends(of: StoredTrajectory) -> tuple[Array, Array]:
        moved = [x for x, _ in carried_forward(of, along, first)[0]]
        parts = (len(of.ends), 2, -1)  # coordinates and rates
        return np.reshape(moved, parts), np.reshape(of.y[list(of.ends)], parts)

    derivatives, states = at_ends(path)
    change, moved = np.inf, 0.0
    while change > max(limit, _BEYOND_STATES * moved):
        path = again(replace(chosen, max_step=float(np.max(np.diff(path.t))) / 2))
        before, states_before = derivatives, states
        derivatives, states = at_ends(path)
        change, moved = (
            _relative_change(before, derivatives, 0.0),
            _relative_change(states_before, states, least),
        )
    return path


def _relative_change(before: Array, after: Array, least: float) -> float:
    """Return the largest relative change of vectors along the last axis; ``least`` adds to their norms."""
    norms = np.linalg.norm(after, axis=-1) + least
    return float(np.max(np.linalg.norm(after - before, axis=-1) / norms))


def at_run(
    path: StoredTrajectory,
    tangents: Callable[[State, Array], Tangents],
    steps: StepTangents,
    outputs: Sequence[str],
    by: Sequence[str],
    coordinates: Sequence[str],
    rest: Tangents | None = None,
) -> Sensitivity:
    """Return the derivatives of outputs, and of the integrals of ``steps``, at the ends of the path.

    Parameters
    ----------
    path
        The run.
    tangents
        Returns the linearised motion at a state, for references of angles in loads.
    steps
        Gives the tangents of its steps.
    outputs
        Names of outputs.
    by
        Tunable parameters, and coordinates and their rates, whose values at the start are meant.
    coordinates
        Independent coordinates, which keep their values at the start with other parameters.
    rest
        The equilibrium in which the run starts, which moves with the parameters, if it does.

    Raises
    ------
    ModelError
        As :func:`symgen.runtime.linearisation.sensitivity.at_pose`.
    SimulationError
        When a derivative is not finite.
    """
    start = tangents(state_of(path, 0), path.references[0])
    start.check_closed()
    names = tuple(dict.fromkeys(by))
    first = _moved_start(start, names, coordinates, rest)
    ends = [tangents(state_of(path, i), path.references[i]) for i in path.ends]
    shown = [x for name in outputs for x in ends[0].slopes.scalars(name)]
    for end in ends:
        end.check_unique(shown)
        if end.redundant and set(names).intersection(end.parameters):
            closing_motion(end, names)
    slopes = [total_slopes(end, shown, names) for end in ends]
    if path.event is not None:  # the last row is at its time, which changes, too
        slopes = [(np.pad(x, ((0, 1), (0, 0))), np.pad(y, ((0, 1), (0, 0)))) for x, y in slopes[:-1]]
        slopes.append(total_slopes(ends[-1], shown, names, f"event.{path.event}"))
    jumps = jumps_between(
        path.t, path.references, path.switches, lambda i, row: tangents(state_of(path, i), row), names
    )
    causes = [f"loads that jump: {start.description.switches[0]}"] if jumps else []
    if path.event is not None:
        causes.append(f"an event that ends the run: {start.description.events[path.event].name}")
    integrals = {f"integral of {name}": f"{unit}*s" for name, unit in steps.integrands.items()}
    if integrals and causes:
        raise ModelError(f"derivatives of integrals are not available for {causes[0]}")
    if not steps.states and fewer((len(shown) + len(integrals)) * len(ends), len(names)):
        slopes_at_times = carried_back(path, steps.along(names), slopes, len(integrals), first, jumps)
        sums = carried_forward(path, steps.along(()), first[:, :0], len(integrals))[1]
    else:
        moved, sums = carried_forward(path, steps.along(names), first, len(integrals), jumps)
        ended = zip(slopes, moved, strict=True)
        slopes_at_times = [
            np.vstack([by_state @ x + direct, summed]) for (by_state, direct), (x, summed) in ended
        ]
    of_outputs = [[end.slopes.values[name] for name in shown] for end in ends]
    if path.event is not None:
        shown.append("time")
        of_outputs = [[*values, end.state.t] for values, end in zip(of_outputs, ends, strict=True)]
    return sensitivity_of(
        start.description,
        {name: ends[0].slopes.units.get(name, "s") for name in shown} | integrals,
        by,
        np.hstack([np.reshape(of_outputs, (len(ends), len(shown))), sums]),
        np.array(slopes_at_times)[..., [names.index(name) for name in by]],
        path.t[[*path.ends]],
        start.slopes.units,
    )


def _moved_start(
    start: Tangents, by: Sequence[str], coordinates: Sequence[str], rest: Tangents | None
) -> Array:
    """Return the differentials of coordinates and rates at the start of a run, (2 n, directions).

    Coordinates and rates that do not vary are held, unless the run starts in the equilibrium ``rest``:
    then it moves with the parameters.

    Raises
    ------
    ModelError
        As :func:`moved_pose` and :func:`moved_rest`; for a parameter that sets a drive in motion there.
    """
    if rest is None:
        return np.vstack(moved_pose(start, by, coordinates))
    moved = np.zeros((2 * start.n, len(by)))
    of_parameters = np.array([name in start.parameters for name in by], dtype=bool)
    names = [name for name in by if name in start.parameters]
    moved[:, of_parameters] = np.vstack(moved_rest(rest, names)[:2])
    slopes = start.slopes.rates
    opened = slopes[:, start.by_q] @ moved[: start.n, of_parameters] + start.direct(slopes, names)
    for i in map(int, np.flatnonzero(np.any(np.abs(opened) > _MOVING * start.scale[:, None], axis=0))):
        raise ModelError(
            f"a change of {names[i]} sets a drive in motion at the start, which is then no equilibrium\n"
            "  Take derivatives by other parameters."
        )
    if others := [name for name in by if name not in start.parameters]:
        moved[:, ~of_parameters] = np.vstack(moved_pose(start, others, coordinates))
    return moved


def state_of(path: StoredTrajectory, i: int) -> State:
    """Return a state of the path."""
    q, u = np.split(path.y[i], 2)
    return State(float(path.t[i]), q, u, {}, {})
