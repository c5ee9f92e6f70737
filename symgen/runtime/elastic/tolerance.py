"""As many steps of an elastic motion as a tolerance needs, and the error of a run by another."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from symgen.errors import SimulationError
from symgen.precision import FLOAT64
from symgen.runtime import _beams
from symgen.runtime.arrays import Array
from symgen.runtime.beams.methods import BEAM_METHODS, BeamMethod
from symgen.runtime.elastic.checkpoint import ConsecutiveCheckpoints
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
from symgen.runtime.elastic.steps import FIXED, Start, Task, explicit, first_steps, step_counts, stepped
from symgen.runtime.integrate.options import TIGHTEST
from symgen.runtime.integrate.pace import Pace, Progress, wall_left

#: Steps per revolution that a run begins with.
_FIRST_STEPS = 256
#: Most steps per revolution that ``rtol`` adds: newmark takes 800,000 for ``thesis_four_bar`` at 1e-4.
MOST_STEPS = 1 << 20
#: Parts of a run, the first of which is used to reduce an error that lasts to the last.
_PARTS = 8
#: Error in the last part that lasts, over the largest.
_LASTING = 0.4
#: Recorded times from which a run is divided into parts.
_FEW = 64
#: Least steps of the whole run, over those that its first part needs.
_LEAST = 0.6
#: Growth of the error over the run, over that in proportion to time: too few steps cost another run.
_GROWN = 2.0
#: The order of methods whose errors fall too slowly to confirm their order.
_SLOW = 2
#: Steps of such a method, over those that it begins with, of which a note tells.
_MANY = 100
#: Tolerances of the run that gives the error of an adaptive one, over its own: the second where the first is
#: too tight for round-off.
_OTHER = (0.01, 10.0)


def adapted(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    task: Task,
    times: Array,
    progress: Progress | None,
    stages: ConsecutiveCheckpoints | None,
    pace: Pace,
    passes: list[Solution],
    start: Start = None,
) -> Solution:
    """Take the requested steps, or as many as ``rtol`` needs; append complete runs to ``passes``.

    The error of a run follows from another with finer steps, or where steps are given from one with fewer, if
    whole numbers of steps allow. Where it falls as the method's order says, it gives the steps that are
    needed; before, where steps do not resolve a vibration, they are doubled, on the first part of the run if
    the error lasts. Steps after the last time with too large an error are kept.

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
    errors = Errors(motion, equations, times, method.order)
    counts = step_counts(motion, times, first_steps(motion, task, _FIRST_STEPS))

    def run(counts: Counts) -> Solution:
        both = stepped(motion, equations, method, times, counts, start, progress, stages, pace)
        passes.append(Solution(*both, int(np.sum(counts)), counts=counts))
        return passes[-1]

    most = max(MOST_STEPS * max(1.0, task.revolutions), float(np.sum(counts)))
    states = run(counts)
    if task.steps is not None:
        return replace(states, errors=_estimated(motion, task, times, states, counts, start, stages))
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
        late = parts[-len(parts) // _PARTS :]
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
    motion: ElasticMotion,
    task: Task,
    times: Array,
    states: Solution,
    counts: Counts,
    start: Start,
    stages: ConsecutiveCheckpoints | None,
) -> Callable[[], tuple[float | None, float | None]]:
    """Return a function that computes the error of a run; called at once if the run is limited or kept."""

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
    stages: ConsecutiveCheckpoints | None = None,
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
    part = np.argsort(times, kind="stable")[: len(times) // _PARTS]
    pace = Pace(0.0, float(times[part[-1]]))
    before = 0.0
    while np.sum(counts) < MOST_STEPS:
        counts_of_part = counts[: len(part)]
        finer = finer_counts(counts_of_part)
        states, compared = (
            stepped(motion, equations, method, times[part], c, start, pace=pace)[0]
            for c in (counts_of_part, finer)
        )
        error = float(np.max(errors.of(states, compared, part)))
        falls = method.order > _SLOW and error < before * 2.0 ** (1 - method.order)
        if error <= task.rtol or falls:
            needed = (_GROWN * _PARTS * error / task.rtol) ** (1 / method.order)
            factor = max(needed, _LEAST) if falls else min(max(needed, _LEAST), 1.0)
            return np.ceil(factor * counts - 1e-9).astype(np.intp), falls
        errors.check_round_off(task.method, task.rtol)
        counts, before = 2 * counts, error
    return counts, False


def with_error(
    motion: ElasticMotion, task: Task, times: Array, solution: Solution, start: Start = None
) -> Solution:
    """Return an explicit run with its error, computed when it is read; at once if the wall time is limited.

    It is the change of stresses in another run: with half the step, or a hundredth of the tolerance.

    Raises
    ------
    OutOfTime
        When the wall time is spent.
    """

    @cache
    def errors() -> tuple[float | None, float | None]:
        finer = replace(task, steps=2 * (task.steps or FIXED))
        if task.method != "rk4":
            tight, looser = (task.rtol * factor for factor in _OTHER)
            finer = replace(task, rtol=tight if tight >= TIGHTEST * FLOAT64.epsilon else looser)
        # Each pose is found from the one before: equations of its own give the same bits at any time.
        equations = motion.equations(task.form == "thesis", stepping=True)
        try:
            other = explicit(motion, equations, finer, times, start=start)
        except SimulationError:  # shorter steps than round-off allows
            return None, None
        of = Errors(motion, equations, times, 1)
        return float(np.max(of.of(solution.displacements, other.displacements, safety=1.0))), None

    if wall_left() is not None:
        errors()
    return replace(solution, errors=errors)


def of_steps(task: Task, states: Solution) -> list[str]:
    """Report very many steps of a slow method, and steps added to those requested: recorded times end one."""
    taken = 0 if states.counts is None else int(np.sum(states.counts))
    if task.steps is None:
        many = taken > _MANY * _FIRST_STEPS * max(task.revolutions, 1.0)
        slow = task.method in BEAM_METHODS and BEAM_METHODS[task.method].order <= _SLOW
        if not (many and slow):
            return []
        return [
            f"{task.method} took {taken} steps to come within {task.rtol:g} of the peak stress, since its "
            "error falls with the square of the step; gauss, of order "
            f"{BEAM_METHODS['gauss'].order}, takes far fewer"
        ]
    if taken <= math.ceil(task.steps * max(task.revolutions, 1.0)):
        return []
    return [
        f"{task.steps} steps per revolution were requested, {taken} were taken: every "
        "recorded time ends a step; request fewer samples for longer steps"
    ]
