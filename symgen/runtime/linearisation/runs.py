"""Exact derivatives along a run: the tangent of its steps, or their transpose.

A run is cut at the times at which outputs are requested. Its states between steps are kept. Compiled code
evaluates the stages of each step again with the slopes of the equations of motion, and carries derivatives of
the state by all directions forward, or those of one output back to the start and the parameters, whichever
costs less.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError, SimulationError
from symgen.runtime import _core
from symgen.runtime._variations import LinkageVariations, Variations
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.failures import problem
from symgen.runtime.integrate.options import Options, recorded_at
from symgen.runtime.integrate.redundancy import slack
from symgen.runtime.integrate.simulate import effects_of
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.linearisation.record import Sensitivity, sensitivity_of
from symgen.runtime.linearisation.sensitivity import Jump, jumps_between, moved_pose, total_slopes
from symgen.runtime.linearisation.state_space import Tangents, check_unique
from symgen.runtime.result.state import State

#: Steps at most of a run with derivatives, whose states are all kept.
MOST_STEPS = 1_000_000
#: Steps whose states are noted in one call.
_CHUNK = 4096
#: Directions at which the transposed steps of one output cost as much as the tangents of all.
_DIRECTIONS = 6


@dataclass(frozen=True, slots=True)
class StoredTrajectory:
    """The states between the steps of a run.

    Attributes
    ----------
    t, y
        Times [s] (steps + 1,) and states (steps + 1, 2n).
    references
        References of angles in loads and branches of loads that jump, steps + 1 rows.
    ends
        Number of steps till each requested time.
    switches
        Number of switching points; the last columns of ``references`` are their branches.
    event
        The event at which the run ends, by its place in the description.
    """

    t: Array
    y: Array
    references: Array
    ends: tuple[int, ...]
    switches: int = 0
    event: int | None = None


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
            "  Choose dop853, dopri5, rk4, radau5, newmark or generalized-alpha."
        )
    recorded_at(times, start.t, chosen.t_end)
    t: list[Array] = [np.array([start.t])]
    y: list[Array] = []
    references: list[Array] = []
    now, state, ends, step = start.t, np.concatenate([start.q, start.u]), [], chosen.step
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
        while status == _core.MORE:
            room = min(_CHUNK, chosen.max_steps - sum(map(len, t)) + 1)
            if room <= 0:
                break
            rows = np.zeros(room), np.zeros((room, len(state))), np.zeros((room, held.stop - held.start))
            status, count = stepper.advance_noting(*rows)
            for of, row in zip((t, y, references), rows, strict=True):
                of.append(row[:count])
        if status == _core.ENDED:
            return StoredTrajectory(
                np.array([stepper.t]), np.zeros(0), np.zeros(0), (), event=stepper.ended_by
            )
        if status != _core.DONE:
            raise SimulationError(cause(stepper, replace(chosen, t_end=end), status), time=stepper.t)
        now, state = end, stepper.state
        step = step if not chosen.rtol and not chosen.atol else 0.0
        ends.append(sum(map(len, t)) - 1)
    return StoredTrajectory(np.concatenate(t), np.concatenate(y), np.concatenate(references), tuple(ends))


def at_run(
    path: StoredTrajectory,
    tangents: Callable[[State, Array], Tangents],
    evaluator: Evaluator,
    kernels: Evaluator,
    outputs: Sequence[str],
    by: Sequence[str],
    coordinates: Sequence[str],
    chosen: Options,
) -> Sensitivity:
    """Return the derivatives of outputs, and of the integrals that ``kernels`` have, at the ends of the path.

    Parameters
    ----------
    path
        The run.
    tangents
        Returns the linearised motion at a state, for references of angles in loads.
    evaluator
        The kernels of the equations of motion.
    kernels
        Those of the analysis ``variation``; its outputs are the integrands.
    outputs
        Names of outputs.
    by
        Tunable parameters, and coordinates and their rates, whose values at the start are meant.
    coordinates
        Independent coordinates, which keep their values at the start with other parameters.
    chosen
        The options of the run.

    Raises
    ------
    ModelError
        As :func:`symgen.runtime.linearisation.sensitivity.at_pose`; for a repeated integral.
    SimulationError
        When a derivative is not finite.
    """
    start = tangents(state_of(path, 0), path.references[0])
    start.check_closed()
    each = dict.fromkeys(by)
    parameters = [name for name in each if name in start.parameters]
    initial = [*coordinates, *(f"{name}'" for name in coordinates)]
    chosen_initial = [name for name in each if name not in parameters]
    columns = [initial.index(name) for name in chosen_initial]
    names = (*parameters, *chosen_initial)
    of_pose, of_coordinates = moved_pose(start, parameters, coordinates), start.independent(coordinates)
    first = np.vstack([np.hstack([p, c[:, columns]]) for p, c in zip(of_pose, of_coordinates, strict=True)])
    ends = [tangents(state_of(path, i), path.references[i]) for i in path.ends]
    shown = [x for name in outputs for x in ends[0].slopes.scalars(name)]
    for end in ends:
        check_unique(end, shown)
    slopes = [total_slopes(end, shown, parameters, len(names)) for end in ends]
    if path.event is not None:  # the last row is at its time, which changes, too
        slopes = [(np.pad(x, ((0, 1), (0, 0))), np.pad(y, ((0, 1), (0, 0)))) for x, y in slopes[:-1]]
        slopes.append(total_slopes(ends[-1], shown, parameters, len(names), f"event.{path.event}"))
    integrands = [b.about for b in kernels.info("integrands").blocks] if kernels.has("integrands") else []
    repeated = next((name for name in integrands if integrands.count(name) > 1), None)
    if repeated:
        raise ModelError(f"the integral of {repeated} is given twice\n  Name each integrand once.")
    units = {b.about: b.unit for b in kernels.info("integrands").blocks} if integrands else {}
    equations = evaluator.equations(start.redundant, work_of_loads=False)

    states = 0 if chosen.method.kind == "explicit" else 2 * start.n
    if states and integrands:
        raise ModelError(f"expected an explicit method for integrals, got {chosen.method.name}")
    jumps = jumps_between(
        path.references[:, path.references.shape[1] - path.switches :],
        lambda i, k: tangents(state_of(path, i), path.references[k]),
        (parameters, len(names)),
    )
    causes = [f"loads that jump: {start.description.switches[0]}"] if jumps else []
    if path.event is not None:
        causes.append(f"an event that ends the run: {start.description.events[path.event].name}")
    if integrands and causes:
        raise ModelError(f"derivatives of integrals are not available for {causes[0]}")

    def along(columns: int) -> Variations:
        entries = _places(kernels, integrands, parameters[:columns], start)
        return LinkageVariations(equations, chosen.method, kernels, entries, columns + states)

    if not states and fewer((len(shown) + len(integrands)) * len(ends), len(names)):
        slopes_at_times = carried_back(path, along(len(names)), slopes, len(integrands), first, jumps)
        _, integrals = carried_forward(path, along(0), first[:, :0], len(integrands))
    else:
        moved, integrals = carried_forward(path, along(len(names)), first, len(integrands), jumps)
        ended = zip(slopes, moved, strict=True)
        slopes_at_times = [
            np.vstack([by_state @ x + direct, summed]) for (by_state, direct), (x, summed) in ended
        ]
    order = [names.index(name) for name in by]
    of_outputs = [[end.slopes.values[name] for name in shown] for end in ends]
    if path.event is not None:
        shown.append("time")
        of_outputs = [[*values, end.state.t] for values, end in zip(of_outputs, ends, strict=True)]
    of_integrals = {f"integral of {name}": f"{units[name]}*s" for name in integrands}
    return sensitivity_of(
        start.description,
        {name: ends[0].slopes.units.get(name, "s") for name in shown} | of_integrals,
        by,
        np.hstack([np.reshape(of_outputs, (len(ends), len(shown))), integrals]),
        np.array(slopes_at_times)[..., order],
        path.t[[*path.ends]],
        {name: start.slopes.units[name] for name in chosen_initial},
    )


def state_of(path: StoredTrajectory, i: int) -> State:
    """Return a state of the path."""
    q, u = np.split(path.y[i], 2)
    return State(float(path.t[i]), q, u, {}, {})


def _places(
    kernels: Evaluator, integrands: Sequence[str], parameters: Sequence[str], start: Tangents
) -> list[NDArray[np.int_]]:
    """Return row, column and place of the slopes of residual, Phi, dPhi/dt and integrands."""
    d, n = kernels.description, start.n
    state = [*d.of_coordinates(), *d.of_coordinates("v")]
    unknowns = [*d.of_coordinates("a"), *(f"{c}_lambda" for c in d.constraints)]
    columns = {name: i for i, name in enumerate([*state, *unknowns, *parameters])}
    rows = {"residual": unknowns, "constraints": unknowns[n:], "rates": unknowns[n:], "outputs": integrands}
    entries: dict[str, list[tuple[int, int, int]]] = {name: [] for name in rows}
    for kernel in ("stage", "closing", "integrand_slopes"):
        for block in kernels.info(kernel).blocks if kernels.has(kernel) else ():
            labels = {label: i for i, label in enumerate(rows[block.name])}
            for k, label in enumerate(block.rows):
                row, column = label.split()
                if column in columns:  # other parameters may not be requested
                    entries[block.name].append((labels[row], columns[column], block.offset + k))
    return [np.array(each, dtype=np.int_).reshape(-1, 3) for each in entries.values()]


def _slices(path: StoredTrajectory, first: int, last: int) -> tuple[Array, Array, Array]:
    return path.t[first : last + 1], path.y[first : last + 1], path.references[first : last + 1]


def _check(status: int, t: Array, count: int) -> None:
    if status != _core.DONE:
        at = float(t[min(count, len(t) - 1)])
        cause = (
            "the constraints lose rank"
            if status == _core.SINGULAR
            else "a number that is not finite appeared"
        )
        raise SimulationError(f"no derivatives of the run from t = {at:.9g} s on: {cause}", time=at)


def fewer(outputs: int, directions: int) -> bool:
    """Return whether transposed steps, one after the other for each output, cost less than all tangents."""
    return outputs * _DIRECTIONS < directions


def carried_forward(
    path: StoredTrajectory, along: Variations, first: Array, integrals: int = 0, jumps: Sequence[Jump] = ()
) -> tuple[list[tuple[Array, Array]], Array]:
    """Return derivatives of state and integrals by all directions, and the integrals, at all ends."""
    count = first.shape[1]
    moved, summed = np.zeros((len(first), along.columns)), np.zeros((integrals, along.columns))
    moved[:, :count] = first
    begin, tangents, sums = 0, [], []

    def go(begin: int, end: int) -> None:
        part = _slices(path, begin, end)
        status, count = along.forward(*part, moved, summed)
        _check(status, part[0], count)

    for end in path.ends if count or integrals else ():
        for jump in jumps:
            if begin < jump.step <= end:
                go(begin, jump.step)
                begin = jump.step
                moved[:, :count] += np.outer(jump.change, jump.by_state @ moved[:, :count] + jump.direct)
        go(begin, end)
        tangents.append((moved[:, :count].copy(), summed[:, :count].copy()))
        sums.append(along.sums)
        begin = end
    return tangents, np.reshape(sums, (len(path.ends), integrals))


def carried_back(
    path: StoredTrajectory,
    along: Variations,
    slopes: Sequence[tuple[Array, Array]],
    integrals: int,
    first: Array,
    jumps: Sequence[Jump] = (),
) -> list[Array]:
    """Return derivatives of outputs and integrals at all ends from transposed steps, each output by itself.

    ``slopes`` are those of outputs at each end by the state, and by the directions at a held state.
    """
    gradients = []
    for end, (by_state, direct) in zip(path.ends, slopes, strict=True):
        passed = [jump for jump in jumps if jump.step <= end]
        rows = []
        for seeds in _seeds(by_state, direct, integrals):
            (seed, weights, gradient), last = seeds, end
            for jump in (*reversed(passed), None):
                part = _slices(path, jump.step if jump else 0, last)
                status, count = along.backward(*part, seed, weights, gradient)
                _check(status, part[0][::-1], count)
                if jump:
                    weight, last = seed @ jump.change, jump.step
                    seed[:] += weight * jump.by_state
                    gradient[:] += weight * jump.direct
            rows.append(gradient + seed @ first)
        gradients.append(np.array(rows))
    return gradients


def _seeds(by_state: Array, direct: Array, integrals: int) -> Iterator[tuple[Array, Array, Array]]:
    """Yield seed of the last state, weights of the integrals, and the gradient at a held state."""
    for row, gradient in zip(by_state, direct, strict=True):
        yield row.copy(), np.zeros(integrals), gradient.copy()
    for weights in np.eye(integrals):
        yield np.zeros(by_state.shape[1]), weights, np.zeros(direct.shape[1])
