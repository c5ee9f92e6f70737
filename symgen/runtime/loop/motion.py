"""The motion of a loop under forces: the compiled step loop over its joint variables."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symgen.errors import ModelError
from symgen.runtime import _core, _loop
from symgen.runtime.arrays import Array
from symgen.runtime.closure.mobility import scaled_screws
from symgen.runtime.closure.start import Closed
from symgen.runtime.integrate.checkpoint import CheckpointOptions, mark_of
from symgen.runtime.integrate.controlled import controlled
from symgen.runtime.integrate.failures import of_sliding, unfinished, with_cause
from symgen.runtime.integrate.options import Options
from symgen.runtime.integrate.pace import OUT_OF_TIME, Progress, out_of_time
from symgen.runtime.integrate.prescribed import check_prescribed
from symgen.runtime.integrate.simulate import carried_out, check_end, sample_times, stepper_of
from symgen.runtime.integrate.stepper import Stepper
from symgen.runtime.kernels.typed import library_of_runs
from symgen.runtime.loop.ball_poles import ball_pole, in_other_angles
from symgen.runtime.loop.kernels import LoopKernels, in_words
from symgen.runtime.loop.samples import AXES, LoopRecording, LoopSamples
from symgen.runtime.model.arguments import RunArguments
from symgen.runtime.result.records import LocatedEvent
from symgen.runtime.result.result import Result
from symgen.runtime.result.state import State

#: Kernels that may depend on inputs and are the first that an evaluation calls.
_FORCED = ("motion", "events")


@dataclass(frozen=True, slots=True)
class LoopStart:
    """Start of a motion: a closed pose, and rates of all variables; at a pole of ball angles those given.

    ``y`` is its state (q, u, work).
    """

    pose: Closed
    rates: Array
    at_pole: bool
    y: Array = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "y", np.concatenate([self.pose.q, self.rates, [0.0]]))


def start_at(kernels: LoopKernels, pose: Closed, rates: Array) -> LoopStart:
    """Return the start of a motion at a closed pose; of the ``rates`` those of free variables matter."""
    at_pole = bool(ball_pole(kernels, pose.t, pose.q))
    return LoopStart(pose, rates if at_pole else rates_at(kernels, pose, rates), at_pole)


def begun(kernels: LoopKernels, start: LoopStart) -> tuple[_loop.LoopEquations, Array]:
    """Return the equations of a motion and its state (q, u, work) at the start, in their present angles."""
    equations = kernels.stepping(kernels.solved, start.pose.rank)
    if start.at_pole:
        in_use, q = in_other_angles(kernels, equations, start.pose.q)
        pose = replace(start.pose, q=q)
        start = LoopStart(pose, rates_at(in_use, pose, start.rates), at_pole=True)
    return equations, start.y


def _check_inputs(kernels: LoopKernels, start: float, stop: float) -> None:
    """Raise SimulationError if an input, or its rate, jumps between two times [s]."""
    d = kernels.description
    if not d.switches:
        return
    scale = kernels.scale[kernels.inputs]

    def sides(k: int, times: Array) -> Array:
        parameters = np.array(kernels.parameter_values)
        if is_table := k >= len(d.switches) - d.tables:
            parameters[len(parameters) - len(d.switches) + k] = _core.WHICH_PIECE
        rows = np.zeros((len(times), 2 * d.coordinates + 1))
        work = np.zeros((len(times), kernels.work_size + 1))
        values = kernels.at(parameters).many("events", times, rows, work)["switches"][:, k]
        return values if is_table else np.where(values < 0.0, -1.0, 1.0)

    def prescribed(t: float) -> tuple[Array, Array]:
        values, rates, _ = kernels.prescribed(t).T
        return values / scale, rates / scale

    check_prescribed(d.switches, sides, [prescribed], start, stop)


def run(
    kernels: LoopKernels,
    start: LoopStart,
    chosen: Options,
    progress: Progress | None,
    keeping: CheckpointOptions | None = None,
    t_eval: ArrayLike | None = None,
) -> Result:
    """Integrate from a start and return the result, at times ``t_eval`` where these are given.

    A run by a default method that cannot continue is repeated with the options ``chosen.otherwise``.

    Raises
    ------
    SimulationError
        If the run cannot continue, naming time, row and cause; the error carries the recorded samples.
    ResultError
        When a checkpoint cannot be written, or is of another run.
    """
    t0 = start.pose.t
    check_end(t0, chosen)
    _check_inputs(kernels, t0, chosen.t_end)

    def repeated(options: Options, keeping: CheckpointOptions | None) -> Result:
        return run(kernels, start, options, progress, keeping, t_eval)

    equations, y0 = begun(kernels, start)
    times = sample_times(t0, chosen, t_eval)
    stepper = stepper_of(equations, chosen, t0, y0, times)
    library = library_of_runs(kernels.library, kernels.typed)
    more = () if t_eval is None else (times.tolist(),)
    mark = mark_of(kernels, library, equations, chosen, t0, y0, *more) if keeping else ""

    def recorded(wall: float) -> Result:
        return Result._later(LoopRecording(kernels, equations, stepper, chosen, wall, library))

    def cause(status: int) -> str:
        return problem(kernels, stepper, chosen, status)

    return carried_out(stepper, t0, chosen, progress, keeping, mark, repeated, recorded, cause)


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


def _component(entry: int, size: float) -> str:
    """Return in words an entry of the closure (3 x 4, row by row)."""
    row, column = divmod(entry, 4)
    if column == 3:
        return f"displacement along {AXES[row]} of frame 1"
    # a small rotation is seen in the entries off the diagonal, that about an axis in those of the other two
    about = "" if row == column else f" about {AXES[3 - row - column]} of frame 1"
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
        f"{v.name} {in_words(float(x), v.is_length, d)}"
        for v, x in zip(d.variables, q, strict=True)
        if v.role != "state"
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
        units |= d.states
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
        start, kernels = self._model._begun(state), self._model.kernels
        if self._law is not None:
            library = self._law.steered(self, kernels.library, kernels.parameter_values, _FORCED)
            kernels = LoopKernels(kernels.description, library, kernels.parameter_values)
        equations, y = begun(kernels, start)
        self._begin = start.pose.q
        return equations, self._model.kernels.equations(kernels.solved, equations.rank), start.pose.t, y, {}

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
        y, turns, table = self._run.present()
        return self._output_row(self._kernels, self.t, y, turns, table)

    def _in_table(self, y: Array, parameters: Array, near: Array) -> Array:
        turns = parameters[len(self._places) :][: len(self._model.description.balls)]
        if not turns.any():
            return y
        self._view.set_parameters(parameters)
        found: Array = self._view.turn_back(y, near if len(near) else self._begin)
        turns[:] = 0.0
        return found

    def _outputs_at(self, t: float, y: Array, parameters: Array, turns: Array) -> Array:
        kernels = self._model.kernels.at(parameters)
        return self._output_row(kernels, t, y, np.zeros(len(self._model.description.balls)), y)

    def _output_row(self, kernels: LoopKernels, t: float, y: Array, turns: Array, table: Array) -> Array:
        states = np.append(y, 0.0)[None]
        return LoopSamples(kernels, self._view, np.array([t]), states, turns[None], table[None]).outputs()[0]

    def _state_at(self, t: float, y: Array, parameters: Array) -> State:
        state: State = self._model._as_state(t, *np.split(y, 2))
        return state

    def _cause(self, status: int) -> str:
        return problem(self._kernels, self._run, self._chosen, status)


def controlled_run(model: Any, request: RunArguments, chosen: Options) -> Result:
    """Integrate with a controller and return the result: see :meth:`symgen.Model.simulate`."""
    stepper, control = controlled(model, LoopStepper, request, chosen)
    status, wall = control.run(request.progress)
    of = model.kernels, stepper._equations, stepper._run
    return control.finished(Result._later(LoopRecording(*of, chosen, wall, model.library, control)), status)


def of_loops(chosen: Options) -> Options:
    """Return the options of a run; raise ModelError for a method that loops do not take."""
    if chosen.method.kind not in ("explicit", "taylor"):
        raise ModelError(f"{chosen.method.name} is for linkages of points and links, not for loops of joints")
    return chosen
