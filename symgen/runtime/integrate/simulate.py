"""One run: the compiled step loop, called in chunks of steps, and the errors of runs that cannot continue."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symgen.errors import Interrupted, ModelError, ResultError, SimulationError
from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.checkpoint import CheckpointOptions, Checkpoints, RunCheckpoints, mark_of
from symgen.runtime.integrate.options import Options, recorded_at
from symgen.runtime.integrate.pace import ENDS, OUT_OF_TIME, Pace, Progress
from symgen.runtime.integrate.redundancy import slack
from symgen.runtime.kernels.description import EventInfo
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.kernels.typed import Typed, library_of_runs
from symgen.runtime.result.recording import Recording
from symgen.runtime.result.result import Result
from symgen.runtime.result.state import State

#: Recorded times up to this number are cached for the next run.
_STORED = 10_000
#: Steps before the first look at the clock, times the size of the state.
_SMALL = 1000
#: After so many steps an adaptive run is ended if, at their pace, ``max_steps`` would not reach its end.
_JUDGED = 100_000


def effects_of(events: Iterable[EventInfo]) -> list[int]:
    """Return the effects of events on a run, as bits of the core."""
    return [
        _core.ENDS_RUN * e.ends_run | _core.REVOLVES * e.revolves | _core.PROBED * e.probed for e in events
    ]


def stepper_of(
    equations: Any,
    chosen: Options,
    t0: float,
    y0: Array,
    times: Array,
    places_only: bool = False,
    directions: Sequence[int] = (),
    terminal: Sequence[int] = (),
    **more: Any,
) -> _core.Run:
    """Return a run from y0 at t0 [s] with checked options, which records ``times`` [s]."""
    return _core.Run(
        equations, chosen.method, t0, y0, chosen.t_end, chosen.rtol, chosen.atol, chosen.step, times,
        _core.STABILISATIONS[chosen.stabilisation], chosen.max_drift, chosen.max_step, places_only,
        directions, terminal, **more,
    )  # fmt: skip


def run(
    evaluator: Evaluator,
    t0: float,
    y: Array,
    redundant: tuple[int, ...],
    chosen: Options,
    progress: Progress | None,
    typed: Typed | None = None,
    keeping: CheckpointOptions | None = None,
    tangent: Evaluator | None = None,
    t_eval: ArrayLike | None = None,
    given: State | None = None,
) -> Result:
    """Integrate from y = (q, u) and return the result; ``redundant`` constraints follow from the others.

    ``typed`` are kernels in the type to integrate in, those of the evaluator when absent; ``tangent`` the
    kernels of the analysis of that name, for methods that need it; ``t_eval`` the times to record instead of
    equally spaced ones. ``given`` is the state of the caller that y is of, which may violate the constraints.
    A run by a default method that cannot continue is repeated with the options ``chosen.otherwise``.

    Raises
    ------
    SimulationError
        If the run cannot continue, naming time and cause; the error carries the samples recorded till then.
    """
    check_end(t0, chosen)

    def repeated(options: Options, keeping: CheckpointOptions | None) -> Result:
        return run(evaluator, t0, y, redundant, options, progress, typed, keeping, tangent, t_eval, given)

    equations, y0 = equations_of(evaluator, y, redundant, chosen, typed, tangent)
    events = evaluator.description.events
    stepper = stepper_of(
        equations,
        chosen,
        t0,
        y0,
        sample_times(t0, chosen, t_eval),
        places_only=evaluator.outputs_by_places,
        directions=[e.direction for e in events],
        terminal=effects_of(events),
    )
    library = library_of_runs(evaluator.library, typed)
    more = (*events, np.asarray(t_eval).tolist()) if t_eval is not None else events
    mark = mark_of(evaluator, library, equations, chosen, t0, y0, *more) if keeping else ""

    def recorded(wall: float) -> Result:
        if evaluator.description.switches or evaluator.description.windings:
            # Samples are evaluated with the loads' own branches.
            equations.set_parameters(evaluator.parameter_values)
        of = Recording(evaluator, equations, stepper, chosen, wall, library, redundant, given)
        return Result._later(of)

    def cause(status: int) -> str:
        from symgen.runtime.integrate.failures import problem

        return problem(status, stepper, equations, evaluator, chosen)

    return carried_out(stepper, t0, chosen, progress, keeping, mark, repeated, recorded, cause)


def carried_out(
    stepper: _core.Run,
    t0: float,
    chosen: Options,
    progress: Progress | None,
    keeping: CheckpointOptions | None,
    mark: str,
    repeated: Callable[[Options, CheckpointOptions | None], Result],
    recorded: Callable[[float], Result],
    cause: Callable[[int], str],
) -> Result:
    """Advance a run to its end; return its result, or that of the run that replaces it.

    ``mark`` distinguishes its checkpoints from those of other runs. A run by a default method that cannot
    continue, or whose checkpoint is of the other method, is ``repeated`` with ``chosen.otherwise``.
    ``recorded`` returns the result after a wall time [s], ``cause`` the message for a status.

    Raises
    ------
    SimulationError
        If the run cannot continue, with the samples recorded till then.
    Interrupted
        For Ctrl-C, with these samples.
    """
    begun, checkpoints = perf_counter(), None
    try:
        if keeping is not None:
            try:
                checkpoints = RunCheckpoints(stepper, mark, keeping)
            except ResultError:  # it may be of the other method
                if chosen.otherwise:
                    return repeated(chosen.otherwise, keeping)
                raise
        status, wall = drive(stepper, t0, chosen, progress, checkpoints)
        ended = status in (_core.DONE, _core.ENDED, OUT_OF_TIME, _core.DRIFTED)
        if chosen.otherwise and not ended and stepper.steps < chosen.max_steps:
            return repeated(chosen.otherwise, keeping and replace(keeping, resume=None))
    except Interrupted:  # of the run that replaces this one
        raise
    except KeyboardInterrupt as stop:
        partial = recorded(perf_counter() - begun) if stepper.recorded else None
        raise Interrupted(str(stop), partial) from None
    result = recorded(wall)
    if status in (_core.DONE, _core.ENDED):
        return result
    raise SimulationError(cause(status), time=stepper.t, partial=result if stepper.recorded else None)


def equations_of(
    evaluator: Evaluator,
    y: Array,
    redundant: tuple[int, ...],
    chosen: Options,
    typed: Typed | None = None,
    tangent: Evaluator | None = None,
) -> tuple[_core.KernelEquations, Array]:
    """Return the equations of a run from y = (q, u), and y with the work of loads where it is integrated."""
    if evaluator.couples:
        _check_explicit(evaluator, chosen)
    allowed = slack(evaluator, y[: len(y) // 2]) if redundant else np.inf
    if redundant and typed is not None:
        allowed = typed.precision.coarsened(allowed)
    equations = evaluator.equations(
        len(redundant), allowed, stabilisation=chosen.rate, typed=typed, tangent=tangent
    )
    return equations, np.append(y, 0.0) if equations.extra else y


def _check_explicit(evaluator: Evaluator, chosen: Options) -> None:
    """Check that a run with unknowns behind the multipliers is by an explicit method."""
    of = "unknown efforts: their" if evaluator.efforts else "friction of bearings: its"
    if chosen.method.kind != "explicit":
        raise ModelError(
            f"{evaluator.description.name}: {chosen.method.name} is not for {of} slopes are not derived\n"
            "  Choose dop853, dopri5 or rk4."
        )


def check_end(t0: float, chosen: Options) -> None:
    """Raise ModelError where a run ends before it starts [s]."""
    if chosen.t_end <= t0:
        raise ModelError(f"expected t_end after the start at t = {t0:g} s, got {chosen.t_end:g} s")


def sample_times(t0: float, chosen: Options, t_eval: ArrayLike | None) -> Array:
    """Return the times at which a run records its state; raise ModelError for ``t_eval`` out of range."""
    if t_eval is not None:
        return recorded_at(t_eval, t0, chosen.t_end)
    return (_times if chosen.samples <= _STORED else _times.__wrapped__)(t0, chosen.t_end, chosen.samples)


@lru_cache(maxsize=16)
def _times(t0: float, t_end: float, samples: int) -> Array:
    """Return equally spaced times, the last exactly the end; not to be written to."""
    times: Array = np.arange(samples, dtype=float) * ((t_end - t0) / (samples - 1)) + t0
    times[-1] = t_end
    times.flags.writeable = False
    return times


def drive(
    stepper: _core.Run,
    t0: float,
    chosen: Options,
    progress: Progress | None,
    checkpoints: Checkpoints | None = None,
    pace: Pace | None = None,
    control: Callable[[], int] | None = None,
    by_step: bool = False,
) -> tuple[int, float]:
    """Step to the end in chunks of time; return the last status and the wall time [s].

    ``pace`` is that of runs one after the other. ``control`` is called at the start of a run that continues
    and at each of its ends, or after each step: it moves the end and returns MORE, or another status to end
    the run. The status
    is MORE if ``max_steps`` were too few, or are too few at the pace of the last steps, and OUT_OF_TIME if
    ``max_wall`` is spent. A resumed run continues from its checkpoint; an interrupt, such as Ctrl-C, leaves
    one.
    """
    # Checkpoints are kept where the clock is looked at: from the first steps on.
    first = 0 if checkpoints else _SMALL // max(stepper.dim, 1)
    pace = pace or Pace(stepper.t, chosen.t_end, first=first)
    spent = checkpoints.spent if checkpoints else 0.0
    try:
        status = _driven(stepper, t0, chosen, progress, checkpoints, pace, control, by_step)
    except KeyboardInterrupt:
        if checkpoints and (remedy := checkpoints.leave(stepper)):
            raise KeyboardInterrupt(remedy) from None
        raise
    return status, spent + pace.wall


def _driven(
    stepper: _core.Run,
    t0: float,
    chosen: Options,
    progress: Progress | None,
    checkpoints: Checkpoints | None,
    pace: Pace,
    control: Callable[[], int] | None,
    by_step: bool,
) -> int:
    """Return the last status of a run by :func:`drive`."""
    status = _core.MORE if stepper.steps or stepper.recorded else stepper.begin()
    if control and status == _core.MORE:
        status = control()
    judged, ends = (stepper.steps, stepper.t), ENDS.get()
    if ends:
        ends.clear()
    while status == _core.MORE:
        if stepper.steps >= chosen.max_steps:
            break
        if stepper.steps - judged[0] >= _JUDGED:
            advance = (stepper.t - judged[1]) / (stepper.steps - judged[0])
            if chosen.rtol and advance * (chosen.max_steps - stepper.steps) < chosen.t_end - stepper.t:
                break
            judged = stepper.steps, stepper.t
        chunk = pace.chunk() if ends is None and not by_step else 1
        status = stepper.advance(min(chunk, chosen.max_steps - stepper.steps))
        if ends is not None:
            ends.append(stepper.t)
        if control and (status == _core.DONE or (by_step and status == _core.MORE)):
            status = control()
        over = status == _core.MORE and pace.spent(stepper.t, partial(_short, stepper))
        if checkpoints and status == _core.MORE:
            checkpoints.look(stepper, last=over)
        if progress:
            progress((stepper.t - t0) / (chosen.t_end - t0))
        if over:
            status = OUT_OF_TIME
    return status


def _short(stepper: _core.Run) -> str:
    """Return the step size, and stiffness if seen, as the cause of a slow run."""
    return f", in steps of {stepper.h:.2g} s{' (the motion is stiff)' if stepper.stiff else ''}"
