"""The motion of a loop under forces: the compiled step loop over its joint variables."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symgen.errors import SimulationError
from symgen.runtime import _core, _loop
from symgen.runtime.arrays import Array
from symgen.runtime.closure.mobility import scaled_screws
from symgen.runtime.closure.redundancy import note, ranges_of
from symgen.runtime.closure.start import Closed
from symgen.runtime.integrate.checkpoint import CheckpointOptions, RunCheckpoints, mark_of
from symgen.runtime.integrate.failures import of_sliding, unfinished, with_cause
from symgen.runtime.integrate.options import Options
from symgen.runtime.integrate.pace import OUT_OF_TIME, Progress, out_of_time
from symgen.runtime.integrate.simulate import check_end, drive, sample_times, stepper_of
from symgen.runtime.integrate.stepper import Stepper
from symgen.runtime.kernels.typed import build_settings, library_of_runs
from symgen.runtime.loop.ball_poles import ball_pole, in_other_angles
from symgen.runtime.loop.kernels import LoopKernels, in_words
from symgen.runtime.loop.near_singular import CLOSED, REPORTED
from symgen.runtime.loop.samples import LoopSamples
from symgen.runtime.result.recording import (
    counts_of,
    drift_of,
    losses_of_rank,
    of_switches,
    options_of,
)
from symgen.runtime.result.records import LocatedEvent, of_model, over_time
from symgen.runtime.result.result import Result
from symgen.runtime.result.state import State
from symgen.runtime.result.turn import variables

_AXES = ("x", "y", "z")
#: Times named in a note.
_SHOWN = 6


def run(
    kernels: LoopKernels,
    begin: Closed,
    rates: Array,
    chosen: Options,
    progress: Progress | None,
    keeping: CheckpointOptions | None = None,
    t_eval: ArrayLike | None = None,
) -> Result:
    """Integrate from a closed pose and return the result, at times ``t_eval`` where these are given.

    Of the ``rates`` those of free variables matter: the others follow.

    Raises
    ------
    SimulationError
        If the run cannot continue, naming time, row and cause; the error carries the recorded samples.
    ResultError
        When a checkpoint cannot be written, or is of another run.
    """
    check_end(begin.t, chosen)
    d = kernels.description
    equations = kernels.stepping([*d.having("dependent"), *d.having("free")], begin.rank)
    kernels_in_use, q = kernels, begin.q
    if ball_pole(kernels, begin.t, begin.q):
        kernels_in_use, q = in_other_angles(kernels, equations, begin.q)
    y0 = np.concatenate([q, rates_at(kernels_in_use, replace(begin, q=q), rates), [0.0]])
    times = sample_times(begin.t, chosen, t_eval)
    stepper = stepper_of(equations, chosen, begin.t, y0, times)
    checkpoints = None
    if keeping is not None:
        library = library_of_runs(kernels.library, kernels.typed)
        more = () if t_eval is None else (times.tolist(),)
        mark = mark_of(kernels, library, equations, chosen, begin.t, y0, *more)
        checkpoints = RunCheckpoints(stepper, mark, keeping)
    status, wall = drive(stepper, begin.t, chosen, progress, checkpoints)
    result = _recorded(kernels, equations, stepper, chosen, wall)
    if status == _core.DONE:
        return result
    cause = problem(kernels, stepper, chosen, status)
    raise SimulationError(cause, time=stepper.t, partial=result if stepper.recorded else None)


def rates_at_start(kernels: LoopKernels, begin: Closed) -> Array:
    """Return the rates at the start: those given, and the dependent ones that go with them."""
    return rates_at(kernels, begin, np.array([v.start_rate for v in kernels.description.variables]))


def rates_at(kernels: LoopKernels, begin: Closed, prescribed: Array) -> Array:
    """Return all rates at a closed pose from those of the free variables."""
    d = kernels.description
    u = prescribed.copy()
    u[kernels.inputs] = kernels.prescribed(begin.t)[:, 1]
    scale = kernels.scale
    solved, independent = d.having("dependent"), d.having("input", "free")
    screws = scaled_screws(kernels, begin.t, begin.q)
    required = screws[:, independent] @ (u / scale)[independent]
    u[solved] = -np.linalg.lstsq(screws[:, solved], required, rcond=None)[0] * scale[solved]
    return u


def _recorded(
    kernels: LoopKernels,
    equations: _loop.LoopEquations,
    stepper: _core.Run,
    chosen: Options,
    wall: float,
) -> Result:
    d = kernels.description
    n, times = d.coordinates, stepper.sampled
    rows = np.column_stack([stepper.result, np.zeros(len(times))])
    samples = LoopSamples(kernels, equations.rank, times, rows, stepper.references, stepper.turns)
    recorded = tuple(variables(d, samples.outputs()))
    q, u = np.split(stepper.state[: 2 * n], 2)
    if len(times) and times[-1] == stepper.t:  # in the angles of the record, which passages of poles change
        last = {x.name: float(x.values[-1]) for x in recorded if not x.components}
        q = np.array([last.get(v.name, x) for v, x in zip(d.variables, q, strict=True)])
        u = np.array([last.get(f"{v.name}.rate", x) for v, x in zip(d.variables, u, strict=True)])
    ranges = ranges_of(recorded, samples.undetermined())
    parameters = dict(zip((p.name for p in d.parameters), kernels.parameter_values.tolist(), strict=True))
    return Result(
        **of_model(
            d,
            parameters,
            **options_of(chosen),
            **build_settings(kernels.library, kernels.typed),
        ),
        axes=_AXES,
        coordinate=over_time(times),
        variables=recorded,
        drift=drift_of(stepper),
        final={
            v.name: {"value": x, "rate": s, "unit": v.unit}
            for v, x, s in zip(d.variables, q.tolist(), u.tolist(), strict=True)
        },
        statistics={
            **counts_of(stepper, equations),
            "undetermined": ranges,
            "wall_s": wall,
        },
        notes=(
            *_of_passages(stepper, samples),
            *samples.notes(),
            *note(kernels, ranges, len(times)),
            *of_switches(d.switches, stepper.switchings),
        ),
    )


def _of_passages(stepper: _core.Run, samples: LoopSamples) -> Iterator[str]:
    """Say where the run passed change points, and which samples are so near that forces lose digits."""
    if not stepper.passages:
        return
    d = samples.kernels.description
    yield losses_of_rank(stepper, "screws", (d.variables[k].name for _, _, k in stepper.passages)) + (
        f"continued smoothly; rounding errors are magnified there (energy drift {stepper.energy_drift:.1e} J)"
    )
    solved = [*d.having("dependent"), *d.having("free")]
    sound = np.ones(len(samples.times))
    for part in samples.parts:
        for i, t, row in zip(part.rows, part.times, part.states, strict=True):
            values = np.linalg.svd(scaled_screws(part.kernels, t, row[: d.coordinates])[:, solved])[1]
            sound[i] = values[d.rank - 1] / values[0]
    errors = CLOSED / np.maximum(sound, 1e-100) ** 3
    if np.max(errors, initial=0.0) > REPORTED:
        near = ", ".join(f"{t:.9g}" for t in stepper.sampled[errors > REPORTED][:_SHOWN])
        yield (
            f"at the samples t = {near} s near such a loss of rank rounding limits accelerations and forces: "
            f"relative error up to {min(1.0, float(np.max(errors))):.0e}"
        )


def _component(entry: int, size: float) -> str:
    """Return in words an entry of the closure (3 x 4, row by row)."""
    row, column = divmod(entry, 4)
    if column == 3:
        return f"displacement along {_AXES[row]} of frame 1"
    # a small rotation is seen in the entries off the diagonal, that about an axis in those of the other two
    about = "" if row == column else f" about {_AXES[3 - row - column]} of frame 1"
    return f"rotation{about}, times {size:.4g} m"


def problem(kernels: LoopKernels, stepper: _core.Run, chosen: Options, status: int) -> str:
    """Return the message for a run that ended with this status: time, cause, remedy and last state."""
    return with_cause(_problem(kernels, stepper, chosen, status), status, chosen)


def _problem(kernels: LoopKernels, stepper: _core.Run, chosen: Options, status: int) -> str:
    d = kernels.description
    q = stepper.state[: d.coordinates]
    solved = d.having("dependent", "free")
    _, values, right = np.linalg.svd(scaled_screws(kernels, stepper.t, q)[:, solved])
    rank = d.rank
    weakest = d.row(solved[int(np.argmax(np.abs(right[min(rank, len(right)) - 1])))])
    at = f"at t = {stepper.t:.9g} s after {stepper.steps} steps"
    where = ", ".join(
        f"{v.name} {in_words(float(x), v.is_length, d)}" for v, x in zip(d.variables, q, strict=True)
    )
    if status == OUT_OF_TIME:
        return f"{out_of_time(stepper.t, chosen.t_end)} State: {where}."
    if status == _core.DRIFTED:
        return (
            f"the closure of the loop strayed by {stepper.position_drift:.4g} m "
            f"({_component(stepper.worst, d.size)}), more than max_drift = {chosen.max_drift:g} m, {at}\n"
            f"  Use the stabilisation 'projection', tighter tolerances or a smaller step. State: {where}."
        )
    if status == _core.SLIDING:
        units = {v.name: v.unit for v in d.variables} | {f"{v.name}.rate": f"{v.unit}/s" for v in d.variables}
        return of_sliding(d.switches[stepper.slid], at, f"State: {where}.", units)
    near = values[rank - 1] / values[0]
    if status == _core.NOT_FINITE:
        return (
            f"no finite accelerations {at}: a free motion has no inertia, or a load has no value there\n"
            f"  Give the links that move freely a mass and an inertia. State: {where}."
        )
    if near < 1e-2 and (names := ball_pole(kernels, stepper.t, q)):
        return (
            f"the run cannot continue {at}: the angles {', '.join(names)} of a ball joint have a pole there, "
            "a property of these angles and not of the loop\n"
            "  Turn the axes of the rows next to the ball (theta, alpha) so that its pole lies elsewhere. "
            f"State: {where}."
        )
    if status == _core.SINGULAR or near < 1e-2:
        return (
            f"the run cannot continue {at}: the loop is at a dead centre; {weakest} is least constrained "
            f"(smallest singular value of the screws: {near:.1e} of the largest)\n  State: {where}."
        )
    if status == _core.PROJECTION_FAILED:
        return f"the loop could not be closed again {at}: the step is too large\n  State: {where}."
    if status == _core.STEP_TOO_SMALL:
        return (
            f"the step became too small to continue {at}: the tolerance cannot be met there\n"
            f"  Loosen rtol and atol. State: {where}."
        )
    return unfinished(stepper, chosen, at)


class LoopStepper(Stepper):
    """A motion of a loop under forces that advances by calls."""

    def _independent(self) -> tuple[str, ...]:
        inputs: tuple[str, ...] = self._model.description.inputs
        return inputs

    def _new(self, state: State | None) -> tuple[Any, Any, float, Array, dict[str, Any]]:
        model, d = self._model, self._model.description
        kernels, (begin, rates) = model.kernels, model._begun(state)
        equations = kernels.equations([*d.having("dependent"), *d.having("free")], begin.rank)
        in_use, q = kernels, begin.q
        if ball_pole(kernels, begin.t, begin.q):
            in_use, q = in_other_angles(kernels, equations, begin.q)
        y = np.concatenate([q, rates_at(in_use, replace(begin, q=q), rates), [0.0]])
        return equations, None, begin.t, y, {}

    @property
    def state(self) -> State:
        """The present state, for :meth:`reset` and for analyses of the model."""
        state: State = self._model._as_state(self.t, *np.split(self.y, 2))
        return state

    @property
    def events(self) -> tuple[LocatedEvent, ...]:
        """No events: loops have none."""
        return ()

    @property
    def _kernels(self) -> LoopKernels:
        """The kernels with the present parameters."""
        parameters = self._model.kernels.parameter_values.copy()
        parameters[: len(self._places)] = self._equations.parameters[: len(self._places)]
        kernels: LoopKernels = self._model.kernels.at(parameters)
        return kernels

    def _evaluated(self) -> Array:
        self._run.present()
        rows = np.append(self._run.result, [[0.0]], axis=1)
        of_run = self._run.sampled, rows, self._run.references, self._run.turns
        row: Array = LoopSamples(self._kernels, self._equations.rank, *of_run).outputs()[0]
        return row

    def _cause(self, status: int) -> str:
        return problem(self._kernels, self._run, self._chosen, status)
