"""An elastic motion in time: steps, as many as a tolerance needs, and their error."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError, SimulationError
from symgen.precision import FLOAT64
from symgen.runtime import _beams, _core
from symgen.runtime.beams.methods import BEAM_METHODS, BeamMethod
from symgen.runtime.elastic.kept import Stages
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.elastic.outputs import FEWER, FINER, Errors
from symgen.runtime.integrate.checkpoint import Keeping, mark_of_kernels
from symgen.runtime.integrate.options import TIGHTEST, end_of_scene, recorded_at
from symgen.runtime.integrate.pace import OutOfTime, Pace
from symgen.runtime.kernels.arguments import is_real, out_of_range
from symgen.runtime.kernels.typed import library_of_runs

Array = NDArray[np.float64]
Counts = NDArray[np.intp]
Progress = Callable[[float], None]
#: S and S' at time zero, (unknowns, 1) each; None at rest and undeformed.
Start = tuple[Array, Array] | None

#: Steps per revolution that a run begins with, and the most that it is doubled to.
_FIRST, _MOST = 256, 1 << 18
#: The least number of times that runs with fewer and with more steps are compared at, if not at all.
_SHARED = 60
#: The most steps per revolution that may be requested.
_MOST_A_TURN = 10_000_000
#: An error of which so much is left in the last of so many parts of a run is reduced on the first, if so many
#: times are recorded; the least part of the steps found there that the whole run takes; and by how much its
#: error may grow faster than in proportion: steps that do not suffice cost another run.
_LASTING, _PART, _FEW, _LEAST, _GROWN = 0.4, 8, 64, 0.6, 2.0
#: Runs in a row after which errors that grow are round-off, in types coarser than doubles.
_ROUNDED = 2


@dataclass(frozen=True, slots=True)
class Task:
    """Options of a run; see :meth:`symgen.Model.simulate`. ``t_end`` applies to cranks at rest.

    ``initial`` may be amplitudes [m] of the first modes.
    """

    method: str
    samples: int
    revolutions: float = 1.0
    steps: int | None = None
    rtol: float = 1e-4
    at: tuple[float, ...] | None = None
    form: str = "exact"
    max_step: float | None = None
    t_end: float | None = None
    t_eval: tuple[float, ...] | None = None
    initial: str | tuple[float, ...] = "undeformed"


@dataclass(frozen=True, slots=True)
class Found:
    """Displacements and their rates (times, unknowns) at the recorded times, and their cost.

    ``rates`` is None where the elastic motion itself adds nothing: quasi-static. ``floquet_error`` is that of
    the largest multiplier, ``spent`` the wall time [s] taken before the run was resumed, ``counts`` the steps
    to each time from the one before.
    """

    displacements: Array
    rates: Array | None
    steps: int
    error: float | None = None
    floquet: tuple[complex, ...] = ()
    floquet_error: float | None = None
    spent: float = 0.0
    counts: Counts | None = None

    def at(self, places: NDArray[np.intp]) -> Found:
        """Return the results at some of the times."""
        rates = None if self.rates is None else self.rates[places]
        return replace(self, displacements=self.displacements[places], rates=rates)


def recorded_times(motion: ElasticMotion, task: Task) -> Array:
    """Return the times [s] that a run records.

    Raises
    ------
    ModelError
        For options out of range.
    """
    check_revolutions(motion, task.revolutions)
    if not 2 <= task.samples <= 10_000_000:
        raise ModelError(f"expected between 2 and 10 million samples, got {task.samples!r}")
    if not 0.0 < task.rtol < 1.0:
        raise ModelError(f"expected rtol above zero and below one, got {task.rtol!r}")
    if task.max_step is not None and not (is_real(task.max_step) and task.max_step > 0):
        raise out_of_range("max_step", task.max_step)
    if task.max_step is not None and not turn(motion) / task.max_step <= _MOST_A_TURN:
        raise ModelError(
            f"expected max_step of at least {turn(motion) / _MOST_A_TURN:.2g} s, got {task.max_step!r}"
        )
    if task.rtol < TIGHTEST * FLOAT64.epsilon:
        raise ModelError(f"expected rtol of at least {TIGHTEST * FLOAT64.epsilon:.2g}, got {task.rtol!r}")
    if task.at is not None:
        if len(task.at) == 0 or not all(map(math.isfinite, task.at)):
            raise ModelError(f"expected finite crank angles [rad], at least one, got {list(task.at)!r}")
        last = math.ceil(task.revolutions) - 1 if motion.speed else 0
        # The start of the first revolution is its end, unless the angle is zero.
        again = bool(motion.speed) and last == 0
        return np.array(
            [motion.time_at(a, last) or (motion.time_at(a, 1) if again and a else 0.0) for a in task.at]
        )
    end = turn(motion) * task.revolutions if motion.speed or task.t_end is None else task.t_end
    return np.linspace(0.0, end, task.samples) if task.t_eval is None else recorded_at(task.t_eval, 0.0, end)


def check_revolutions(motion: ElasticMotion, revolutions: float) -> None:
    """Raise ModelError for a number of revolutions out of range, or of a crank that has none."""
    if not (revolutions > 0 and math.isfinite(revolutions)):
        raise ModelError(f"expected revolutions above zero, got {revolutions!r}")
    if not motion.speed and revolutions != 1.0:
        raise ModelError(
            f"{motion.without_revolutions}; expected no revolutions, got {revolutions!r}\n"
            "  Leave revolutions out; t_end under [analysis] is the end of the run."
        )


def turn(motion: ElasticMotion) -> float:
    """Return the time [s] that steps are counted over."""
    return motion.period if motion.speed else end_of_scene(motion.rigid.description.t_end)


def first_steps(motion: ElasticMotion, task: Task, least: int) -> int:
    """Return the steps a revolution to begin with: those given, or so many that none is above ``max_step``.

    Raises
    ------
    ModelError
        When both are given, or a number of steps out of range.
    """
    if task.steps is None:
        return least if task.max_step is None else max(least, math.ceil(turn(motion) / task.max_step))
    if task.max_step is not None:
        raise ModelError("give steps (a revolution) or max_step, not both")
    if not 1 <= task.steps <= _MOST_A_TURN:
        raise ModelError(f"expected between 1 and 10 million steps per revolution, got {task.steps!r}")
    return task.steps


def step_counts(motion: ElasticMotion, times: Array, per_turn: int) -> Counts:
    """Return the number of steps to each time, in rising order, from the one before it, at least one."""
    gaps = np.diff(np.sort(times), prepend=0.0)
    counts = np.maximum(1, np.ceil(gaps / turn(motion) * per_turn - 1e-9)).astype(np.intp)
    return np.where(gaps > 0.0, counts, 0)


def finer_counts(counts: Counts) -> Counts:
    """Return the steps of the run that a run is compared with: at least ``FINER`` times as many."""
    return np.ceil(FINER * counts - 1e-9).astype(np.intp)


def compared_run(times: Array, counts: Counts, order: int) -> tuple[NDArray[np.intp], Counts, bool]:
    """Return the times of a run that tells the error of a run, its steps to each, and whether they are fewer.

    The times are places of ``times`` in rising order: all, or every so many of equally spaced ones, back from
    the last. The steps are more where no whole numbers of fewer steps do.
    """
    least, most = FEWER
    places = np.argsort(times, kind="stable")
    gaps = np.diff(times[places])
    even = len(gaps) and np.min(gaps) > (1 - 1e-9) * np.max(gaps)
    for every in range(1, max(1, len(times) // _SHARED if even else 1) + 1):
        shared = np.arange(len(times) - 1, -1, -every)[::-1]
        taken = np.diff(np.cumsum(counts)[shared], prepend=0)
        fewer = np.ceil(taken / most ** (1 / order) - 1e-9)
        growth = (taken / np.maximum(fewer, 1.0))[taken > 0] ** order
        if np.all(growth[int(every > 1) :] >= least):
            return places[shared], fewer.astype(np.intp), True
    return places, finer_counts(counts), False


def next_factor(error: float, rtol: float, order: int, falls: bool) -> float:
    """Return by how much to multiply steps: twice at most, and twice until errors fall as the order says."""
    return min((error / rtol) ** (1 / order), 2.0) if falls else 2.0


def stepped(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    method: BeamMethod,
    times: Array,
    counts: Counts,
    start: Start = None,
    progress: Progress | None = None,
    stages: Stages | None = None,
    pace: Pace | None = None,
) -> tuple[Array, Array]:
    """Return displacements and rates at the times, (times, unknowns) each, stepping from time zero.

    From a start with many columns, (unknowns, columns), they are (times, unknowns, columns). They are not a
    number where the motion of a column grows beyond all numbers.

    Parameters
    ----------
    counts
        See :func:`step_counts`.
    start
        S and S' at time zero.
    stages
        Checkpoints of this run and those before it.
    pace
        Clock of the run.

    Raises
    ------
    OutOfTime
        When the wall time is spent.
    SimulationError
        When the linkage cannot turn.
    ResultError
        When a checkpoint cannot be written, or is of another run.
    """
    before = stages.next() if stages else None
    if before:
        return before
    n, pace = motion.layout.unknowns, pace or Pace(0.0, float(np.max(times)))
    pace.restart(0.0)
    s, v = start or (np.zeros((n, 1)), np.zeros((n, 1)))
    steps = _beams.BeamSteps(equations, method, s.shape[1])
    motion.check(equations, steps.start(0.0, s, v), 0.0)
    order = np.argsort(times, kind="stable")
    shape = s.shape if s.shape[1] > 1 else (n,)
    found, rates = np.zeros((len(times), *shape)), np.zeros((len(times), *shape))
    reached, taken = stages.resumed(steps, found, rates) if stages else (0, 0)
    now = float(times[order[reached - 1]]) if reached else 0.0
    cause = f", with {int(np.sum(counts))} steps"
    jumps, unseen = motion.jumps.tolist(), 0
    while reached and jumps and jumps[0][0] <= now:
        now = max(now, jumps.pop(0)[1])
    for place in range(reached, len(times)):
        k, count = order[place], int(counts[place])
        t = float(times[k])
        while taken < count and t > now:
            if unseen <= 0:
                unseen = pace.chunk()
            to = min(taken + unseen, count)
            status = steps.advance(now, t, count, taken, to)
            if status == _core.NOT_FINITE:
                found[:] = np.nan
                return stages.finished(found, rates) if stages else (found, rates)
            motion.check(equations, status, t)
            unseen, taken = unseen - (to - taken), to
            at = now + (t - now) * taken / count
            over = unseen <= 0 and pace.spent(at, cause)
            if stages:
                stages.look(at, steps, found, rates, (place, taken), last=over)
            if progress:
                progress(at / float(times[order[-1]]))
            if over:
                done = np.sort(order[:place])
                raise OutOfTime(at, Found(found[done], rates[done], int(np.sum(counts[:place]))), done)
        now, taken = max(t, now), 0
        found[k], rates[k] = steps.displacements.reshape(shape), steps.rates.reshape(shape)
        if jumps and t == jumps[0][0]:
            now = jumps.pop(0)[1]
            if not method.collocated:
                motion.check(equations, steps.start(now, steps.displacements, steps.rates), now)
    return stages.finished(found, rates) if stages else (found, rates)


def adapted(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    task: Task,
    times: Array,
    progress: Progress | None,
    keeping: Keeping | None,
    pace: Pace,
    passes: list[Found],
    start: Start = None,
) -> Found:
    """Take the requested steps, or as many as ``rtol`` needs; append complete runs to ``passes``.

    The error of a run follows from another with finer steps, or where steps are given from one with fewer, if
    whole numbers of steps allow. Where it falls as
    the method's order says, it gives the steps that are needed; before, where steps do not resolve a
    vibration, they are doubled, on the first part of the run if the error lasts. Steps after the last time
    with too large an error are kept.

    Raises
    ------
    OutOfTime
        When the wall time is spent.
    ModelError
        For options out of range.
    SimulationError
        When the linkage cannot turn, or the most steps do not suffice.
    ResultError
        When a checkpoint cannot be written, or is of another run.
    """
    method = BEAM_METHODS[task.method]
    stages = None
    if keeping is not None:
        told = (repr(task), times.tobytes().hex(), *motion.told)
        library = library_of_runs(motion.rigid.evaluator.library, motion.rigid.typed)
        stages = Stages(mark_of_kernels(motion.rigid.evaluator, library, equations, *told), keeping)
    spent = stages.spent if stages else 0.0
    errors = Errors(motion, equations, times, method.order)
    counts = step_counts(motion, times, first_steps(motion, task, _FIRST))

    def run(counts: Counts, shown: Progress | None = None) -> tuple[Array, Array]:
        found, rates = stepped(
            motion, equations, method, times, counts, start, progress=shown, stages=stages, pace=pace
        )
        passes.append(Found(found, rates, int(np.sum(counts)), spent=spent, counts=counts))
        return found, rates

    if task.steps is not None:
        found = run(counts, progress)
        places, others, fewer = compared_run(times, counts, method.order)
        other = stepped(motion, equations, method, times[places], others, start, None, stages, pace)[0]
        parts = errors.of(found[0][places], other, places, fewer)
        error = float(np.max(parts))
        return Found(*found, int(np.sum(counts)), error, spent=spent, counts=counts)
    order = np.argsort(times, kind="stable")
    found = run(counts, progress)
    more, before = 1.0, 0.0
    while np.sum(counts) < _MOST * max(1.0, task.revolutions):
        finer = finer_counts(counts)
        compared = run(finer, progress)
        parts = errors.of(found[0], compared[0])[order]
        error = float(np.max(parts))
        if error <= task.rtol:
            return Found(*found, int(np.sum(counts)), error, spent=spent, counts=counts)
        _check_round_off(motion, task, errors)
        # Vibrations that decay need their steps only up to the last time at which they show.
        last = int(np.flatnonzero(parts > task.rtol)[-1])
        falls = error < before * more ** (-method.order / 2)
        late = parts[-len(parts) // _PART :]
        lasts = not falls and len(times) >= _FEW and np.max(late) > max(task.rtol, _LASTING * error)
        more = next_factor(error, task.rtol, method.order, falls)
        early = np.arange(len(counts)) <= last
        needed = np.where(early, np.ceil(more * counts - 1e-9).astype(np.intp), counts)
        counts = finer if more <= FINER else needed
        before = error
        if lasts:
            counts, before = _counts_by_part(motion, equations, task, times, counts, errors, start), math.inf
        found = compared if np.array_equal(counts, finer) else run(counts, progress)
    raise SimulationError(
        f"{motion.rigid.name}: {task.method} does not come within {task.rtol:g} of the peak stress "
        f"with {_MOST} steps per revolution\n"
        "  A revolution may have too many vibrations to follow from rest: take periodic or quasi-static, or "
        "fewer revolutions."
    )


def _counts_by_part(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    task: Task,
    times: Array,
    counts: Counts,
    errors: Errors,
    start: Start,
) -> Counts:
    """Return the counts that the first part of a run needs, and the whole if its error grows evenly."""
    method = BEAM_METHODS[task.method]
    part = np.argsort(times, kind="stable")[: len(times) // _PART]
    pace = Pace(0.0, float(times[part[-1]]))
    while np.sum(counts) < _MOST:
        own = counts[: len(part)]
        finer = finer_counts(own)
        found, compared = (
            stepped(motion, equations, method, times[part], c, start, pace=pace)[0] for c in (own, finer)
        )
        error = float(np.max(errors.of(found, compared, part)))
        if error <= task.rtol:
            needed = (_GROWN * _PART * error / task.rtol) ** (1 / method.order)
            return np.ceil(min(max(needed, _LEAST), 1.0) * counts - 1e-9).astype(np.intp)
        _check_round_off(motion, task, errors)
        counts = 2 * counts
    return counts


def _check_round_off(motion: ElasticMotion, task: Task, errors: Errors) -> None:
    """Raise SimulationError where more steps only add round-off."""
    typed = motion.rigid.typed
    if typed and typed.precision.epsilon > FLOAT64.epsilon and errors.grown >= _ROUNDED:
        raise SimulationError(
            f"{motion.rigid.name}: {task.method} does not come within {task.rtol:g} of the peak stress in "
            f"{typed.precision.name}: shorter steps only add round-off, and {errors.least:.1e} is the best\n"
            "  Give a larger --rtol, or take float64."
        )
