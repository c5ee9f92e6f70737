"""An elastic motion in time: steps, as many as a tolerance needs, and their error."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from symgen.errors import ModelError, SimulationError
from symgen.precision import FLOAT64
from symgen.runtime import _beams, _core
from symgen.runtime.arrays import Array
from symgen.runtime.beams.methods import BEAM_METHODS, BeamMethod
from symgen.runtime.elastic.checkpoint import Stages
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.elastic.outputs import (
    FINER,
    SAFETY,
    SAFETY_FEWER,
    Counts,
    Errors,
    Solution,
    compared_run,
    finer_counts,
    known,
    next_factor,
)  # fmt: skip
from symgen.runtime.integrate.checkpoint import Keeping, mark_of_kernels
from symgen.runtime.integrate.options import TIGHTEST, end_of_scene, recorded_at
from symgen.runtime.integrate.pace import OutOfTime, Pace, Progress, wall_left
from symgen.runtime.kernels.arguments import is_real, out_of_range
from symgen.runtime.kernels.typed import library_of_runs

#: S and S' at time zero, (unknowns, 1) each; None at rest and undeformed.
Start = tuple[Array, Array] | None

#: Steps per revolution that a run begins with, and the most that ``rtol`` adds: Newmark's method takes
#: 800,000 for ``thesis_four_bar`` at 1e-4.
_FIRST, _MOST = 256, 1 << 20
#: The most steps per revolution that may be requested.
_MOST_A_TURN = 10_000_000
#: An error of which so much is left in the last of so many parts of a run is reduced on the first, if so many
#: times are recorded; the least part of the steps found there that the whole run takes; and by how much its
#: error may grow faster than in proportion: steps that do not suffice cost another run.
_LASTING, _PART, _FEW, _LEAST, _GROWN = 0.4, 8, 64, 0.6, 2.0
#: The order of methods whose errors fall too slowly to confirm their order.
_SLOW = 2


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
    n, pace = motion.layout.unknowns, pace or Pace(0.0, float(np.max(times)))
    s, v = start or (np.zeros((n, 1)), np.zeros((n, 1)))
    shape = s.shape if s.shape[1] > 1 else (n,)
    before = stages.next((len(times), *shape)) if stages else None
    if before:
        return before
    pace.restart(0.0)
    steps = _beams.BeamSteps(equations, method, s.shape[1])
    motion.check(equations, steps.start(0.0, s, v), 0.0)
    order = np.argsort(times, kind="stable")
    displacements, rates = np.zeros((len(times), *shape)), np.zeros((len(times), *shape))
    reached, steps_done = stages.resumed(steps, displacements, rates) if stages else (0, 0)
    now = float(times[order[reached - 1]]) if reached else 0.0
    cause = f", with {int(np.sum(counts))} steps"
    jumps, unseen = motion.jumps.tolist(), 0
    while reached and jumps and jumps[0][0] <= now:
        now = max(now, jumps.pop(0)[1])
    for place in range(reached, len(times)):
        k, count = order[place], int(counts[place])
        t = float(times[k])
        while steps_done < count and t > now:
            if unseen <= 0:
                unseen = pace.chunk()
            to = min(steps_done + unseen, count)
            status = steps.advance(now, t, count, steps_done, to)
            if status == _core.NOT_FINITE:
                displacements[:] = np.nan
                return stages.finished(displacements, rates) if stages else (displacements, rates)
            motion.check(equations, status, t)
            unseen, steps_done = unseen - (to - steps_done), to
            at = now + (t - now) * steps_done / count
            over = unseen <= 0 and pace.spent(at, cause)
            if stages:
                stages.keep(at, steps, displacements, rates, (place, steps_done), last=over)
            if progress:
                progress(at / float(times[order[-1]]))
            if over:
                indices = np.sort(order[:place])
                results = displacements[indices], rates[indices], int(np.sum(counts[:place]))
                raise OutOfTime(at, Solution(*results), indices)
        now, steps_done = max(t, now), 0
        displacements[k], rates[k] = steps.displacements.reshape(shape), steps.rates.reshape(shape)
        if jumps and t == jumps[0][0]:
            now = jumps.pop(0)[1]
            if not method.collocated:
                motion.check(equations, steps.start(now, steps.displacements, steps.rates), now)
    return stages.finished(displacements, rates) if stages else (displacements, rates)


def adapted(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    task: Task,
    times: Array,
    progress: Progress | None,
    keeping: Keeping | None,
    pace: Pace,
    passes: list[Solution],
    start: Start = None,
) -> Solution:
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
        identity = (repr(task), times.tobytes().hex(), *motion.identity)
        library = library_of_runs(motion.rigid.evaluator.library, motion.rigid.typed)
        stages = Stages(mark_of_kernels(motion.rigid.evaluator, library, equations, *identity), keeping)
    spent = stages.spent if stages else 0.0
    errors = Errors(motion, equations, times, method.order)
    counts = step_counts(motion, times, first_steps(motion, task, _FIRST))

    def run(counts: Counts) -> Solution:
        both = stepped(motion, equations, method, times, counts, start, progress, stages, pace)
        passes.append(Solution(*both, int(np.sum(counts)), spent=spent, counts=counts))
        return passes[-1]

    most = max(_MOST * max(1.0, task.revolutions), float(np.sum(counts)))
    states = run(counts)
    if task.steps is not None:
        return replace(states, errors=_estimated(motion, task, times, states, start, stages))
    order = np.argsort(times, kind="stable")
    more, before = 1.0, 0.0
    while np.sum(counts) <= most:
        finer = finer_counts(counts)
        compared = run(finer)
        parts = errors.of(states.displacements, compared.displacements)[order]
        error = float(np.max(parts))
        if error <= task.rtol:
            return replace(states, errors=known(error))
        errors.check_round_off(task.method, task.rtol)
        # Vibrations that decay need their steps only up to the last time at which they show.
        last = int(np.flatnonzero(parts > task.rtol)[-1])
        falls = error < before * more ** (-method.order / 2)
        late = parts[-len(parts) // _PART :]
        lasts = not falls and len(times) >= _FEW and np.max(late) > max(task.rtol, _LASTING * error)
        more = next_factor(error, task.rtol, method.order, falls)
        early = np.arange(len(counts)) <= last
        needed = np.where(early, np.ceil(more * counts - 1e-9).astype(np.intp), counts)
        counts = finer if more <= FINER else needed
        before, resolved = error, False
        if lasts:
            counts, resolved = _counts_by_part(motion, equations, task, times, counts, errors, start)
            before = math.inf
        if np.array_equal(counts, finer):
            states = compared
        elif np.sum(counts) <= most:
            states = run(counts)
        if resolved and np.sum(counts) <= most:
            # These steps suffice, as a rule, and a run with fewer takes less time.
            error = _by_another(errors, method, counts, states.displacements, start, falls=True)
            if error <= task.rtol:
                return replace(states, errors=known(error))
            more, before = next_factor(error, task.rtol, method.order, True), error
            counts = np.ceil(more * counts - 1e-9).astype(np.intp)
            if np.sum(counts) <= most:
                states = run(counts)
    remedy = (
        "Take gauss, whose error falls faster, or a larger rtol."
        if method.order <= _SLOW
        else "A revolution may have too many vibrations to follow from rest: take periodic or quasi-static, "
        "or fewer revolutions."
    )
    raise SimulationError(
        f"{motion.rigid.name}: {task.method} does not come within {task.rtol:g} of the peak stress "
        f"with {most / max(1.0, task.revolutions):.0f} steps per revolution\n  {remedy}"
    )


def _estimated(
    motion: ElasticMotion, task: Task, times: Array, states: Solution, start: Start, stages: Stages | None
) -> Callable[[], tuple[float | None, float | None]]:
    """Return a function that computes the error of a run; called at once if the run is limited or kept."""
    counts = step_counts(motion, times, first_steps(motion, task, _FIRST))

    @cache
    def errors() -> tuple[float | None, float | None]:
        # Each pose is found from the one before: equations of its own give the same bits at any time.
        equations, method = motion.equations(task.form == "thesis", stepping=True), BEAM_METHODS[task.method]
        of = Errors(motion, equations, times, method.order)
        return _by_another(of, method, counts, states.displacements, start, stages), None

    if stages or wall_left() is not None:
        errors()
    return errors


def _by_another(
    errors: Errors,
    method: BeamMethod,
    counts: Counts,
    displacements: Array,
    start: Start,
    stages: Stages | None = None,
    falls: bool = False,
) -> float:
    """Return the error of a run by another, with fewer steps if whole numbers of steps allow.

    ``falls``: errors are known to fall as the order of the method says.
    """
    places, others, growth = compared_run(errors.times, counts, method.order)
    of = errors.motion, errors.equations, method, errors.times[places], others, start, None, stages
    safety = (SAFETY / (growth - 1.0) if falls else SAFETY_FEWER) if growth else None
    return float(np.max(errors.of(displacements[places], stepped(*of)[0], places, safety)))


def _counts_by_part(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    task: Task,
    times: Array,
    counts: Counts,
    errors: Errors,
    start: Start,
) -> tuple[Counts, bool]:
    """Return the counts that the first part of a run needs, and the whole if its error grows evenly.

    Also whether the error of the part was seen to fall as the order of the method says.
    """
    method = BEAM_METHODS[task.method]
    part = np.argsort(times, kind="stable")[: len(times) // _PART]
    pace = Pace(0.0, float(times[part[-1]]))
    before = 0.0
    while np.sum(counts) < _MOST:
        counts_of_part = counts[: len(part)]
        finer = finer_counts(counts_of_part)
        states, compared = (
            stepped(motion, equations, method, times[part], c, start, pace=pace)[0]
            for c in (counts_of_part, finer)
        )
        error = float(np.max(errors.of(states, compared, part)))
        falls = method.order > _SLOW and error < before * 2.0 ** (1 - method.order)
        if error <= task.rtol or falls:
            needed = (_GROWN * _PART * error / task.rtol) ** (1 / method.order)
            factor = max(needed, _LEAST) if falls else min(max(needed, _LEAST), 1.0)
            return np.ceil(factor * counts - 1e-9).astype(np.intp), falls
        errors.check_round_off(task.method, task.rtol)
        counts, before = 2 * counts, error
    return counts, False
