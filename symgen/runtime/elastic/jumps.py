"""Loads of elastic links along the rigid motion: jumps, explicit methods, which stop at each, repetition."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from symgen.errors import ModelError, SimulationError
from symgen.precision import FLOAT64
from symgen.runtime import _beams, _core
from symgen.runtime.arrays import Array
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.elastic.outputs import Errors, Solution
from symgen.runtime.elastic.steps import Progress, Start, Task, turn
from symgen.runtime.integrate.checkpoint import Keeping, RunCheckpoints, mark_of
from symgen.runtime.integrate.options import TIGHTEST
from symgen.runtime.integrate.pace import OUT_OF_TIME, OutOfTime, check_wall, wall_left
from symgen.runtime.kernels.typed import library_of_runs
from symgen.runtime.result.recording import wound

#: Least number of evaluations per revolution, and the angle by which references of angles move.
_LOOKS, _QUARTER = 720, np.pi / 2
#: Largest number of evaluations that are in memory together.
_BLOCK = 4096
#: Half the interval that is omitted about a jump, in units of the rounding of the end of the run.
_BLUR = 64
#: Halvings of the time from the end of a run to the middle of a smooth pulse, at each of which a step ends.
_GRADED = 40
#: Part of a revolution that an adaptive run tries as its first step.
_FIRST_TRIED = 4096
#: Poses of a revolution that are compared with those of the next, the part of its largest value by which a
#: number may differ, and the part of the largest number that is none.
_POSES, _PERIODIC, _NOTHING = 7, 1e-6, 1e-12
#: Steps of methods with a fixed step per revolution, by default; tolerances of the run that gives the error
#: of an adaptive one, over its own: the second where the first is too tight for round-off.
_FIXED, _OTHER = 2048, (0.01, 10.0)


@dataclass(slots=True)
class _Before:
    """Continuous angles, and sides of the switching points, at the last look of the block before."""

    angles: Array
    sides: Array


def jump_times(motion: ElasticMotion, end: float, per_turn: int) -> Array:
    """Return the last time before and the first after every jump of the loads in (0, end) [s], (jumps, 2).

    Smooth pulses in the time have many, ever nearer to their middle, so that steps resolve any width.
    ``per_turn`` is the least number of times a revolution at which distances from switching points are
    evaluated. What passes zero and comes back between two looks is not seen.

    Raises
    ------
    SimulationError
        When the linkage cannot move, or the wall time is spent.
    """
    if not motion.rigid.description.switches:
        return np.zeros((0, 2))
    typed = motion.rigid.typed
    rounding = max(FLOAT64.epsilon, typed.precision.epsilon if typed else 0.0)  # times are doubles
    blur = _BLUR * rounding * end
    count = math.ceil(max(_LOOKS, per_turn) * max(1.0, end / turn(motion)))
    instants: list[tuple[float, float]] = []
    middles: list[float] = []
    before: _Before | None = None
    for first in range(0, count, _BLOCK):
        check_wall("looking for jumps of the loads")
        looks = np.arange(first, min(first + _BLOCK, count) + 1)
        times = end * (looks + 0.4 * np.sin(looks**2.0)) / count
        if first == 0:
            times[0] = 0.0
        if looks[-1] == count:
            times[-1] = end
        here: set[tuple[float, float]] = set()
        while True:
            # Of a triangle, the corners show only where its tip is looked at.
            pairs, last = _passed(motion, times, blur, before)
            passed = {p: k for p, k in pairs if not _known(p, here)}
            if not passed:
                break
            here |= set(passed)
            middles += [low for (low, _), k in passed.items() if k in motion.rigid.description.pulses]
            times = np.union1d(times, [t for pair in passed for t in pair])
        instants += here
        before = last
    jumps = _merged(sorted(instants), blur, end)
    if not middles:
        return jumps
    steps = end * 0.5 ** np.arange(1, _GRADED)
    graded = np.unique([m + side * steps for m in middles for side in (-1, 1)])
    graded = graded[(graded > 0.0) & (graded < end)]
    apart = [t for t in graded if not np.any((jumps[:, 0] <= t) & (t <= jumps[:, 1]))]
    both: Array = np.concatenate([jumps, np.column_stack([apart, apart])])
    return both[np.argsort(both[:, 0], kind="stable")]


def _known(pair: tuple[float, float], pairs: set[tuple[float, float]]) -> bool:
    return any(a <= pair[0] and pair[1] <= b for a, b in pairs)


def _passed(
    motion: ElasticMotion, times: Array, blur: float, before: _Before | None
) -> tuple[list[tuple[tuple[float, float], int]], _Before]:
    """Return a time before and one after every point passed between two of the times, by halving."""
    continuous = _angles(motion, times, before)
    angles = np.round(continuous / _QUARTER) * _QUARTER
    sides = np.sign(_distances(motion, times, angles))
    if before is not None:
        sides[0] = np.where(sides[0] == 0.0, before.sides, sides[0])
    for row in range(1, len(sides)):
        sides[row] = np.where(sides[row] == 0.0, sides[row - 1], sides[row])
    places, which = np.nonzero(sides[:-1] * sides[1:] < 0.0)
    low, high, after = times[places], times[places + 1], sides[places + 1, which]
    angles = angles[places]
    while np.any(wide := high - low > blur):
        check_wall("looking for jumps of the loads")
        middle = (low + high) / 2
        order = np.argsort(middle[wide], kind="stable")
        back = np.argsort(order)
        rows = _distances(motion, middle[wide][order], angles[wide][order])[back]
        beyond = rows[np.arange(len(rows)), which[wide]] * after[wide] > 0.0
        high[wide] = np.where(beyond, middle[wide], high[wide])
        low[wide] = np.where(beyond, low[wide], middle[wide])
    begins = np.flatnonzero((sides[0] == 0.0) & (sides[1] != 0.0)).tolist() if before is None else []
    pairs = zip(low.tolist(), high.tolist(), strict=True)
    passages = [((0.0, 0.0), k) for k in begins] + list(zip(pairs, which.tolist(), strict=True))
    return passages, _Before(continuous[-1], sides[-1])


def _states(motion: ElasticMotion, times: Array) -> tuple[Array, Array]:
    moved = motion.moved()
    status, states, *_ = moved.along(np.ascontiguousarray(times))
    if status != _core.DONE:
        motion.check(motion.equations(), status, moved.t)
    n = motion.rigid.description.coordinates
    return states[:, :n], states[:, n : 2 * n]


def _angles(motion: ElasticMotion, times: Array, before: _Before | None) -> Array:
    """Return the angles in loads at rising times, continuous over revolutions."""
    if not motion.rigid.description.windings:
        return np.zeros((len(times), 0))
    angles = motion.rigid.evaluator.many_blocks("events", times, *_states(motion, times))["windings"]
    angles = angles.reshape(len(times), -1)
    if before is not None:
        angles[0] = before.angles
    return np.unwrap(angles, axis=0)


def _distances(motion: ElasticMotion, times: Array, references: Array) -> Array:
    """Return the distances from all switching points at rising times, (times, points)."""
    evaluator, (q, u) = motion.rigid.evaluator, _states(motion, times)
    distances = np.zeros((len(times), len(motion.rigid.description.switches)))
    for parameters, rows in wound(evaluator, references):
        of = type(evaluator)(evaluator.description, evaluator.library, parameters)
        gaps = of.many_blocks("events", times[rows], q[rows], u[rows])["switches"]
        distances[rows] = gaps.reshape(len(rows), -1)
    return distances


def _merged(pairs: list[tuple[float, float]], blur: float, end: float) -> Array:
    """Return the jumps in order, each with its blur, those that overlap as one."""
    merged: list[tuple[float, float]] = []
    for low, high in pairs:
        before, after = max(low - blur, 0.0), high + blur
        if merged and before <= merged[-1][1]:
            merged[-1] = merged[-1][0], max(after, merged[-1][1])
        elif after < end:
            merged.append((before, after))
    return np.array(merged).reshape(-1, 2)


def explicit(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    task: Task,
    times: Array,
    progress: Progress | None,
    keeping: Keeping | None = None,
    start: Start = None,
) -> Solution:
    """Step from jump to jump of the loads, each a run of its own.

    Raises
    ------
    OutOfTime
        When the wall time is spent.
    ModelError
        For checkpoints of such runs.
    SimulationError
        When the linkage cannot turn.
    ResultError
        When a checkpoint cannot be written, or is of another run.
    """
    from symgen.runtime.integrate.options import options
    from symgen.runtime.integrate.simulate import drive

    n = motion.layout.unknowns
    end = float(np.max(times))
    fixed = task.method == "rk4"
    step = turn(motion) / (task.steps or _FIXED) if fixed else None
    typed = motion.rigid.typed
    kind = typed.precision if typed else FLOAT64
    rtol = None if fixed else task.rtol
    limits = {"precision": kind, "max_step": task.max_step}
    chosen = options(end, task.method, rtol, None, step, 2, 1_000_000_000, **limits)
    if keeping is not None and len(motion.jumps):
        raise ModelError(
            f"{motion.rigid.name}: expected no checkpoint, since {task.method} stops at jumps of the loads\n"
            "  Take the method gauss, or leave the checkpoint out."
        )
    order = np.argsort(times, kind="stable")
    states = np.zeros((len(times), 2 * n))
    state = np.zeros(2 * n) if start is None else np.concatenate(start)[:, 0]
    begin, taken_steps, steps, spent = 0.0, 0, 0, 0.0
    for until, after in [*motion.jumps.tolist(), (end, end)]:
        last = int(np.searchsorted(times[order], until, side="right"))
        stepper = _core.Run(
            equations,
            chosen.method,
            begin,
            state,
            until,
            chosen.rtol,
            chosen.atol,
            # A first step guessed from rest would look ahead to the end of the run, along the rigid motion.
            chosen.step or turn(motion) / _FIRST_TRIED,
            np.maximum(times[order[taken_steps:last]], begin),
            max_step=chosen.max_step,
        )
        checkpoints = None
        if keeping is not None:
            identity = (repr(task), times.tobytes().hex(), *motion.identity)
            library = library_of_runs(motion.rigid.evaluator.library, typed)
            mark = mark_of(
                motion.rigid.evaluator, library, equations, chosen, 0.0, np.zeros(2 * n), *identity
            )
            checkpoints = RunCheckpoints(stepper, mark, keeping)
        status, _ = drive(stepper, 0.0, chosen, progress, checkpoints)
        spent = checkpoints.spent if checkpoints else 0.0
        steps += stepper.steps
        if status == _core.NOT_FINITE:
            return Solution(np.full((len(times), n), np.nan), None, steps)
        motion.check(equations, _core.DONE if status == OUT_OF_TIME else status, stepper.t)
        reached = order[: taken_steps + stepper.recorded]
        states[reached[taken_steps:]] = stepper.result[:, : 2 * n]
        if status == OUT_OF_TIME:
            states, reached = states[np.sort(reached)], np.sort(reached)
            raise OutOfTime(stepper.t, Solution(states[:, :n], states[:, n:], steps, spent=spent), reached)
        state, begin, taken_steps = states[order[last - 1]], after, last
    return Solution(states[:, :n], states[:, n:], steps, spent=spent)


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
        finer = replace(task, steps=2 * (task.steps or _FIXED))
        if task.method != "rk4":
            tight, looser = (task.rtol * factor for factor in _OTHER)
            finer = replace(task, rtol=tight if tight >= TIGHTEST * FLOAT64.epsilon else looser)
        # Each pose is found from the one before: equations of its own give the same bits at any time.
        equations = motion.equations(task.form == "thesis", stepping=True)
        try:
            other = explicit(motion, equations, finer, times, None, start=start)
        except SimulationError:  # shorter steps than round-off allows
            return None, None
        of = Errors(motion, equations, times, 1)
        return float(np.max(of.of(solution.displacements, other.displacements, safety=1.0))), None

    if wall_left() is not None:
        errors()
    return replace(solution, errors=errors)


def check_repeats(motion: ElasticMotion, equations: _beams.BeamEquations) -> None:
    """Check that loads at constant speed are the same one revolution later."""
    # Not at the start itself, where loads may jump.
    times = motion.period * (np.arange(_POSES) + 1 / np.e) / _POSES
    both = []
    for outputs in ([equations.motion.evaluate(t) for t in times + late] for late in (0.0, motion.period)):
        for status, *_ in outputs:
            motion.check(equations, status, equations.motion.t)
        both.append([np.array(part) for part in zip(*(rest for _, _, *rest in outputs), strict=True)])
    for now, later in zip(*both, strict=True):
        size = np.abs(now)
        least = _NOTHING * np.max(size, initial=0.0)
        if np.any(np.abs(later - now) > _PERIODIC * np.max(size, initial=0.0, axis=0) + least):
            raise ModelError(
                f"{motion.rigid.name}: loads depend on the time t, or on the number of revolutions, so that "
                "no revolution repeats\n  Run it from the start: method gauss."
            )
