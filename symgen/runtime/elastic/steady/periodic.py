"""Steady states of a crank at constant speed or with a motor, by shooting, with their Floquet multipliers."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np

from symgen.errors import ModelError, SimulationError
from symgen.runtime import _beams
from symgen.runtime.arrays import Array
from symgen.runtime.beams.methods import GAUSS, RADAU
from symgen.runtime.elastic.jumps import check_repeats
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.elastic.outputs import FINER, SAFETY, Counts, Errors, Solution, known, next_factor
from symgen.runtime.elastic.steady.floquet import (
    RESONANT,
    HeldModes,
    by_size,
    held_modes,
    open_phase_of,
    without,
)
from symgen.runtime.elastic.steps import Task, first_steps, step_counts, stepped
from symgen.runtime.integrate.pace import Pace, Progress, is_spent, wall_left
from symgen.runtime.result.elastic import FLOQUET_SETTLED, ElasticResult, beyond_linear_theory
from symgen.runtime.result.records import Coordinate, Drift, Variable
from symgen.runtime.result.speed_response import SpeedResponse

#: Steps per revolution with which shooting begins.
_FIRST_STEPS = 64
#: Steps per revolution to which they are doubled at most.
_MOST_STEPS = 1 << 16
#: The least number of recorded times that runs are compared at, if there are as many.
_COMPARED = 60
#: Most unknowns for which all states of one revolution are stepped together.
_SHOOTING = 400
#: Estimated error of the largest multiplier, over it, for which steps are added once.
_CLOSE = 1e-6
#: The least multiplier that errors are compared with.
_NONE = 1e-300
#: The most steps times squared states that are spent on the largest multiplier alone: vibrations too fast to
#: show in a strain have multipliers too.
_WORTH = 1 << 23


def periodic(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    task: Task,
    times: Array,
    pace: Pace,
    passes: list[Solution],
) -> Solution:
    """Find the state that repeats after a revolution, and the Floquet multipliers.

    The periodic state y solves (I - Phi) y = y_1, with y_1 the state after one revolution from rest. Results
    with fewer steps are appended to ``passes``.

    Raises
    ------
    OutOfTime
        When the wall time is spent.
    ModelError
        When the crank stands still, or there are more unknowns than are stepped together.
    SimulationError
        When the linkage cannot turn, or the most steps do not suffice.
    """
    if not motion.speed:
        raise ModelError(
            f"{motion.rigid.name}: {motion.without_revolutions}: there is no revolution to repeat"
        )
    _check_size(motion)
    if not motion.has_motor:
        check_repeats(motion, equations)
    free = motion.layout.unknowns - motion.layout.constraints
    per_turn = first_steps(motion, task, _FIRST_STEPS)
    worth = _WORTH / (2 * free + 1) ** 2
    held = held_modes(motion, task.form == "thesis")
    compare = partial(_compared, motion, times)

    def whole(shot: _Shot) -> list[Solution]:
        return _followed(motion, equations, times, [shot], [step_counts(motion, times, shot.per_turn)], pace)

    shot = _shot(motion, equations, per_turn, pace, held)
    if task.steps is not None:
        passes += whole(shot)

        @cache
        def errors() -> tuple[float, float | None]:
            # Each pose is found from the one before: equations of its own give the same bits at any time.
            alone, clock = motion.equations(task.form == "thesis", stepping=True), Pace(0.0, motion.period)
            return compare(
                alone, shot, _shot(motion, alone, math.ceil(FINER * per_turn), clock, held), clock
            )[1:]

        if wall_left() is not None:
            errors()
        return replace(passes[0], errors=errors)
    # While more steps are needed, as a rule, the second run has twice as many and is the next to be compared.
    ratio, more, before, closed = 2.0, 1.0, 0.0, False
    while True:
        other = _shot(motion, equations, math.ceil(ratio * per_turn), pace, held)
        if wall_left() is not None:
            passes += whole(shot)
        result, error, shift = compare(equations, shot, other, pace)
        apart = math.inf if shift is None else shift / max(abs(shot.multipliers[0]), _NONE)
        sure = apart <= FLOQUET_SETTLED
        settled = apart <= _CLOSE or (sure and closed) or 2 * per_turn > worth
        if error <= task.rtol and settled:
            passes[:] = [result] if result else whole(shot)
            return replace(passes[0], errors=known(error, shift))
        if per_turn >= _MOST_STEPS:
            problem = f"shooting does not come within {task.rtol:g} of the peak stress"
            raise SimulationError(f"{motion.rigid.name}: {problem}")
        falls = task.rtol < error < before * more ** (-GAUSS.order / 2)
        more = next_factor(error, task.rtol, GAUSS.order, falls)
        if closed := error <= task.rtol and sure:
            more = next_factor(apart, _CLOSE, GAUSS.order, True)
        before = error
        if more <= ratio:
            shot, more = other, ratio
        else:
            shot = _shot(motion, equations, math.ceil(more * per_turn), pace, held)
        fallen = more ** (-GAUSS.order / 2)
        last = error * fallen <= task.rtol and (closed or apart * fallen <= FLOQUET_SETTLED)
        per_turn, ratio = shot.per_turn, FINER if last else 2.0


def _compared(
    motion: ElasticMotion,
    times: Array,
    equations: _beams.BeamEquations,
    shot: _Shot,
    other: _Shot,
    pace: Pace,
) -> tuple[Solution | None, float, float | None]:
    """Return the steady state of a shot, its error by another, and that of its largest multiplier.

    The first is None where a few of the times are compared.
    """
    every = 1 if len(motion.jumps) else len(times) // max(shot.per_turn, _COMPARED)
    at = times[::every] if every > 1 else times
    counts = [step_counts(motion, at, x.per_turn) for x in (shot, other)]
    if at is times:  # where recorded times end shorter steps, those of the other run are shorter still
        counts[1] = np.maximum(counts[1], np.ceil(FINER * counts[0]).astype(np.intp))
    else:  # the steady state at all times has steps half as long, whose error is far smaller
        counts[1] = counts[0]
    result, finer = _followed(motion, equations, at, [shot, other], counts, pace)
    parts = Errors(motion, equations, at, GAUSS.order).of(result.displacements, finer.displacements)
    sizes = abs(shot.multipliers[0]), abs(other.multipliers[0])
    shift = None if shot.error is None else SAFETY * abs(sizes[1] - sizes[0]) + shot.error
    return result if at is times else None, float(np.max(parts)), shift


def again(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    times: Array,
    counts: Counts,
    per_turn: int,
    pace: Pace,
) -> Array:
    """Return displacements of the steady state, with such steps per revolution and from time to time.

    Raises ModelError when there are more unknowns than are stepped together.
    """
    _check_size(motion)
    shot = _shot(motion, equations, per_turn, pace)
    return _followed(motion, equations, times, [shot], [counts], pace)[0].displacements


def _check_size(motion: ElasticMotion) -> None:
    free = motion.layout.unknowns - motion.layout.constraints
    if free > _SHOOTING:
        raise ModelError(
            f"{motion.rigid.name}: shooting steps {2 * free} states together, "
            f"expected at most {2 * _SHOOTING}\n"
            '  Reduce the links: reduction = { kind = "craig-bampton", modes = 3 } under elastic.'
        )


@dataclass(frozen=True, slots=True)
class _Shot:
    """The periodic state (S, S') at time zero, the Floquet multipliers, and the number of steps.

    ``phase`` is absent where the rotation of the shaft is prescribed. A motor leaves the phase of the crank
    open: of the displacements along that, ``phase`` (S, S') at time zero with the multiplier ``unit``, near
    one, the loads add ``lag`` times in a revolution, which is a small change of the period. ``error`` is that
    of the multipliers of fast vibrations, None where some are not resolved.
    """

    start: tuple[Array, Array]
    multipliers: tuple[complex, ...]
    per_turn: int
    steps: int
    error: float | None = 0.0
    phase: tuple[Array, Array] | None = None
    unit: float = 1.0
    lag: float = 0.0


def _followed(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    times: Array,
    shots: Sequence[_Shot],
    counts: Sequence[Counts],
    pace: Pace,
) -> list[Solution]:
    """Return the steady states of shots at times, without the lag of a crank with a motor.

    Those with the same steps to each time, see :func:`step_counts`, are stepped together: most of a step is
    the assembly of its matrices. The loads act on the first column only; the others are what other starts,
    and the phase, add to it.
    """
    if any(not np.array_equal(steps_of_shot, counts[0]) for steps_of_shot in counts):
        return [
            result
            for shot, steps_of_shot in zip(shots, counts, strict=True)
            for result in _followed(motion, equations, times, [shot], [steps_of_shot], pace)
        ]
    first, part = shots[0], times / motion.period
    columns = [first.start, *((s - first.start[0], v - first.start[1]) for s, v in (x.start for x in shots))]
    columns += [shot.phase for shot in shots if shot.phase is not None]
    starts = np.hstack([s for s, _ in columns]), np.hstack([v for _, v in columns])
    both = stepped(motion, equations, GAUSS, times, counts[0], starts, pace=pace)
    results = []
    for k, shot in enumerate(shots):
        steps, lag = shot.steps + int(np.sum(counts[0])), shot.lag * part * shot.unit**-part
        states = [x[:, :, 0] + x[:, :, 1 + k] for x in both]
        if shot.phase is not None:
            free = (x[:, :, 1 + len(shots) + k] for x in both)
            states = [y - lag[:, None] * x for x, y in zip(free, states, strict=True)]
        results.append(Solution(states[0], states[1], steps, floquet=shot.multipliers, counts=counts[0]))
    return results


def _shot(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    per_turn: int,
    pace: Pace,
    held: HeldModes | None = None,
) -> _Shot:
    """Step all states over one revolution, and solve for the periodic state."""
    status, *_, basis = equations.matrices(0.0)
    motion.check(equations, status, 0.0)
    n = motion.layout.unknowns
    columns = np.array([np.eye(n), np.zeros((n, n)), np.zeros((n, n))]) if basis is None else basis
    free = columns.shape[2]
    # Columns of modes, each of the size of its own frequency: slow ones keep their digits.
    shapes, sizes = (held.shapes, held.frequencies) if held else (np.eye(free), np.ones(free))
    s = np.hstack([np.zeros((n, 1)), columns[0] @ shapes / sizes, np.zeros((n, free))])
    v = np.hstack([np.zeros((n, 1)), columns[1] @ shapes / sizes, columns[0] @ shapes])
    ends = np.append(motion.jumps[motion.jumps[:, 0] > 0.0, 0], motion.period)
    counts = step_counts(motion, ends, per_turn)
    (end_s,), (end_v,) = stepped(
        motion, equations, RADAU, ends, counts, (s, v), pace=pace, recorded=ends[-1:]
    )
    # The free unknowns are those that R copies: one row of R is a unit row for each.
    rows = [int(np.flatnonzero(np.all(columns[0] == np.eye(free)[k], axis=1))[0]) for k in range(free)]
    end = np.vstack(
        [sizes[:, None] * np.linalg.solve(shapes, end_s[rows]), np.linalg.solve(shapes, end_v[rows])]
    )
    if not np.all(np.isfinite(end)):
        raise SimulationError(f"{motion.rigid.name}: the motion grows without bound within one revolution")
    transition, forced = end[:, 1:], end[:, 0]

    def state(y: Array) -> tuple[Array, Array]:
        p, pv = shapes @ (y[:free] / sizes), shapes @ y[free:]
        return (columns[0] @ p)[:, None], (columns[1] @ p + columns[0] @ pv)[:, None]

    open_phase = open_phase_of(transition) if motion.has_motor else None
    phase = open_phase[0] if open_phase else None
    raw = without(np.linalg.eigvals(transition), phase)
    multipliers, error = held.multipliers(transition, per_turn, phase) if held else (raw, None)
    if open_phase is not None:
        unit, right, left = open_phase
        lag = float(left @ forced)
        forced = forced - lag * right
        # The phase keeps its place in the sums, far from one, and has no part in the state.
        transition = transition - unit * np.outer(right, left)
    if np.min(np.abs(raw - 1.0)) <= RESONANT * max(1.0, np.max(np.abs(raw))):
        raise SimulationError(
            f"{motion.rigid.name}: no unique steady state: a free vibration repeats itself after each "
            "revolution, so that loads amplify it without bound, or leave its amplitude undetermined\n"
            "  Change the speed, or give the links damping: elastic.damping."
        )
    y = np.asarray(np.linalg.solve(np.eye(2 * free) - transition, forced), dtype=float)
    shot = _Shot(state(y), by_size(multipliers), per_turn, int(np.sum(counts)), error)
    return shot if open_phase is None else replace(shot, phase=state(right), unit=unit, lag=lag)


def speed_response(
    model: Any, speeds: Sequence[float], rtol: float, samples: int, progress: Progress | None
) -> SpeedResponse:
    """Return the steady states at crank speeds [rad/s]; see :meth:`symgen.Model.speed_response`."""
    if len(speeds) < 1 or not all(math.isfinite(s) and s != 0.0 for s in speeds):
        raise ModelError(f"expected crank speeds, finite and not zero, got {list(speeds)!r}")
    begun = time.perf_counter()
    name, per_speed = _parameter(model)
    runs: list[ElasticResult] = []
    pace = Pace(0.0, len(speeds), "{:.0f} of {:.0f} crank speeds")
    for k, speed in enumerate(speeds):
        changed = model.with_parameters(**{name: per_speed * speed})
        try:
            runs.append(changed.periodic(rtol=rtol, samples=samples))
        except SimulationError as error:
            if not is_spent():
                raise
            response = _swept(model, speeds[:k], runs, time.perf_counter() - begun) if runs else None
            problem = f"{error}\n  {k} of {len(speeds)} speeds were found."
            raise SimulationError(problem, time=error.time, partial=response) from None
        pace.spent(k + 1.0)
        if progress:
            progress((k + 1) / len(speeds))
    return _swept(model, speeds, runs, time.perf_counter() - begun)


def _parameter(model: Any) -> tuple[str, float]:
    """Return the tunable parameter proportional to the speed of the crank, and its value per speed."""
    speed = model.crank_speed
    for name, value in model.parameters.items():
        doubled = model.with_parameters(**{name: 2 * value}).crank_speed
        if speed and value and math.isclose(doubled, 2 * speed, rel_tol=1e-12):
            return name, value / speed
    raise ModelError(
        f"{model.name} has no tunable parameter that the speed of the crank is proportional to\n"
        '  Name one in the scene: speed = { value = "95 rpm", tunable = true } under [parameters], and '
        'speed = "speed" under [crank].'
    )


def _swept(model: Any, speeds: Sequence[float], runs: Sequence[ElasticResult], wall: float) -> SpeedResponse:
    first = runs[0]
    peaks = [
        Variable(v.name, v.unit, f"largest {v.about}", (), np.array([r.peaks[v.name] for r in runs]))
        for v in first.variables
        if v.name in first.peaks
    ]
    largest = np.array([abs(r.floquet[0]) for r in runs])
    peaks.append(Variable("floquet", "1", "largest Floquet multiplier of a revolution", (), largest))
    return SpeedResponse(
        name=model.name,
        title=model.description.title,
        axes=first.axes,
        units=first.units,
        coordinate=Coordinate("speed", "rad/s", "crank speed", np.array(speeds, dtype=float)),
        variables=tuple(peaks),
        drift=Drift(),
        final={},
        statistics={
            "first_critical": 2 * math.pi * model.lowest_frequency,
            "floquet_errors": [r.statistics["floquet_error"] for r in runs],
            "error": max(r.statistics["error"] for r in runs),
            "wall_s": wall,
        },
        provenance={**first.provenance, "method": "speed-response", "parameters": dict(model.parameters)},
        notes=_notes(runs),
    )


def _notes(runs: Sequence[ElasticResult]) -> tuple[str, ...]:
    """Return the note on the number of speeds at which linear theory does not hold."""
    beyond = sum(beyond_linear_theory(r.notes) for r in runs)
    if not beyond:
        return ()
    return (f"linear theory does not hold at {beyond} of {len(runs)} speeds: see 'symgen periodic' at one",)
