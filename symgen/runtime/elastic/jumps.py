"""Loads of elastic links along the rigid motion: the times of their jumps, and their repetition."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from symgen.errors import ModelError
from symgen.precision import FLOAT64
from symgen.runtime import _beams, _core
from symgen.runtime.arrays import Array
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.elastic.steps import turn
from symgen.runtime.integrate.pace import check_wall
from symgen.runtime.result.recording import wound

#: Least number of evaluations of the loads per revolution.
_PROBES = 720
#: Angle by which references of angles move [rad].
_QUARTER = np.pi / 2
#: Largest number of evaluations that are in memory together.
_BLOCK = 4096
#: Half the interval that is omitted about a jump, in units of the rounding of the end of the run.
_BLUR = 64
#: Halvings of the time from the end of a run to the middle of a smooth pulse, at each of which a step ends.
_GRADED = 40
#: Poses of a revolution that are compared with those of the next.
_POSES = 7
#: Largest difference between two revolutions, over the largest value of a load.
_PERIODIC = 1e-6
#: Loads below this part of the largest count as zero.
_NOTHING = 1e-12


@dataclass(slots=True)
class _Before:
    """Continuous angles, and sides of the switching points or pieces of tables, at the last look before."""

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
    count = math.ceil(max(_PROBES, per_turn) * max(1.0, end / turn(motion)))
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
    sides = _sides(motion, times, angles)
    if before is not None:
        sides[0] = np.where(sides[0] == 0.0, before.sides, sides[0])
    for row in range(1, len(sides)):
        sides[row] = np.where(sides[row] == 0.0, sides[row - 1], sides[row])
    places, which = np.nonzero((sides[:-1] != sides[1:]) & (sides[:-1] != 0.0))
    low, high, first = times[places], times[places + 1], sides[places, which]
    angles = angles[places]
    while np.any(wide := high - low > blur):
        check_wall("looking for jumps of the loads")
        middle = (low + high) / 2
        order = np.argsort(middle[wide], kind="stable")
        back = np.argsort(order)
        rows = _sides(motion, middle[wide][order], angles[wide][order])[back]
        here = rows[np.arange(len(rows)), which[wide]]
        beyond = (here != first[wide]) & (here != 0.0)
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


def _sides(motion: ElasticMotion, times: Array, references: Array) -> Array:
    """Return the sides of all switching points at rising times, of tables the pieces, (times, points)."""
    evaluator, (q, u) = motion.rigid.evaluator, _states(motion, times)
    description = motion.rigid.description
    signs = len(description.switches) - description.tables
    distances = np.zeros((len(times), len(description.switches)))
    last = description.of_held.stop
    for values, rows in wound(evaluator, references):
        parameters = values.copy()
        parameters[last - description.tables : last] = _core.WHICH_PIECE
        of = type(evaluator)(evaluator.description, evaluator.library, parameters)
        gaps = of.many_blocks("events", times[rows], q[rows], u[rows])["switches"]
        distances[rows] = gaps.reshape(len(rows), -1)
    distances[:, :signs] = np.sign(distances[:, :signs])
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


def check_repeats(motion: ElasticMotion, equations: _beams.BeamEquations) -> None:
    """Check that loads at constant speed are the same one revolution later."""
    # Not at the start itself, where loads may jump.
    times = motion.period * (np.arange(_POSES) + 1 / np.e) / _POSES
    both = []
    moved = motion.moved() if motion.rigid.typed else equations.motion  # in doubles
    for outputs in ([moved.evaluate(t) for t in times + late] for late in (0.0, motion.period)):
        for status, *_ in outputs:
            motion.check(equations, status, moved.t)
        both.append([np.array(part) for part in zip(*(rest for _, _, *rest in outputs), strict=True)])
    for now, later in zip(*both, strict=True):
        size = np.abs(now)
        least = _NOTHING * np.max(size, initial=0.0)
        if np.any(np.abs(later - now) > _PERIODIC * np.max(size, initial=0.0, axis=0) + least):
            raise ModelError(
                f"{motion.rigid.name}: loads depend on the time t, or on the number of revolutions, so that "
                "no revolution repeats\n  Run it from the start: method gauss."
            )
