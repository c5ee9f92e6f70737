"""The steady state of a crank at constant speed, by shooting, with its Floquet multipliers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError, SimulationError
from symgen.runtime import _beams
from symgen.runtime.beam_methods import GAUSS
from symgen.runtime.elastic_motion import ElasticMotion
from symgen.runtime.elastic_result import FLOQUET_SETTLED
from symgen.runtime.elastic_steps import Errors, Found, Task, step_counts, stepped

Array = NDArray[np.float64]

#: Steps a turn that shooting begins with, and the most that it is doubled to.
_FIRST, _MOST = 64, 1 << 16
#: The most unknowns of which all states of one turn are stepped together.
_SHOOTING = 400
#: How near to one, over the largest, a multiplier leaves the steady state undetermined.
_RESONANT = 1e-9
#: The most steps times squared states that are spent on the largest multiplier alone: vibrations too fast to
#: show in a strain have multipliers too.
_WORTH = 1 << 23


def periodic(motion: ElasticMotion, equations: _beams.BeamEquations, task: Task, times: Array) -> Found:
    """Find the state that repeats after a turn, (I - Phi) y = y of a turn from rest, and the multipliers.

    Raises
    ------
    ModelError
        When the crank stands still, or there are more unknowns than are stepped together.
    SimulationError
        When the linkage cannot turn, or the most steps do not suffice.
    """
    if not motion.speed:
        raise ModelError(f"{motion.rigid.name}: the crank stands still: there is no turn to repeat")
    free = motion.layout.unknowns - motion.layout.constraints
    if free > _SHOOTING:
        raise ModelError(
            f"{motion.rigid.name}: shooting steps {2 * free} states together, "
            f"expected at most {2 * _SHOOTING}\n"
            '  Reduce the links: reduction = { kind = "craig-bampton", modes = 3 } under elastic.'
        )
    errors = Errors(motion, equations, times, GAUSS.order)
    # The estimates need two runs: with half the steps asked for, then with these.
    per_turn = task.steps // 2 if task.steps and task.steps > 1 else task.steps or _FIRST
    worth = _WORTH / (2 * free + 1) ** 2
    slowest = 2.0 * motion.lowest_frequency * motion.period
    before: Array | None = None
    largest, error = 0.0, None
    shift: float | None = None
    while True:
        start, multipliers, steps = _shot(motion, equations, per_turn)
        counts = step_counts(motion, times, per_turn)
        found, rates = stepped(motion, equations, GAUSS, times, counts, start)
        if before is not None:
            error = errors.of(before, found)
            # Steps longer than half a vibration turn all multipliers to one, and agree on it.
            shift = abs(abs(multipliers[0]) - largest) if per_turn >= slowest else None
        known = shift is not None and shift <= FLOQUET_SETTLED * abs(multipliers[0])
        enough = error is not None and error <= task.rtol
        enough = enough and (known or max(2 * per_turn, slowest) > worth)
        if per_turn == task.steps or (enough and task.steps is None):
            return Found(found, rates, steps + int(np.sum(counts)), error, multipliers, shift)
        if per_turn >= _MOST:
            raise SimulationError(
                f"{motion.rigid.name}: shooting does not come within {task.rtol:g} of the peak stress"
            )
        before, largest = found, abs(multipliers[0])
        per_turn = task.steps or 2 * per_turn


def _shot(
    motion: ElasticMotion, equations: _beams.BeamEquations, per_turn: int
) -> tuple[tuple[Array, Array], tuple[complex, ...], int]:
    """Return the periodic state at time zero, the Floquet multipliers, and the number of steps."""
    status, *_, basis = equations.matrices(0.0)
    motion.check(equations, status, 0.0)
    n = motion.layout.unknowns
    own = np.array([np.eye(n), np.zeros((n, n)), np.zeros((n, n))]) if basis is None else basis
    free = own.shape[2]
    s = np.hstack([np.zeros((n, 1)), own[0], np.zeros((n, free))])
    v = np.hstack([np.zeros((n, 1)), own[1], own[0]])
    steps = _beams.BeamSteps(equations, GAUSS, 2 * free + 1)
    motion.check(equations, steps.start(0.0, s, v), 0.0)
    motion.check(equations, steps.advance(0.0, motion.period, per_turn), motion.period)
    ends_s, ends_v = steps.displacements, steps.rates
    # The free unknowns are those that R copies: one row of R is a unit row for each.
    rows = [int(np.flatnonzero(np.all(own[0] == np.eye(free)[k], axis=1))[0]) for k in range(free)]
    end = np.vstack([ends_s[rows], ends_v[rows]])
    if not np.all(np.isfinite(end)):
        raise SimulationError(f"{motion.rigid.name}: the motion grows out of all bounds within one turn")
    transition, forced = end[:, 1:], end[:, 0]
    multipliers = np.linalg.eigvals(transition)
    multipliers = multipliers[np.argsort(-np.abs(multipliers), kind="stable")]
    if np.min(np.abs(multipliers - 1.0)) <= _RESONANT * max(1.0, abs(multipliers[0])):
        raise SimulationError(
            f"{motion.rigid.name}: no single steady state: a vibration repeats itself each turn, so that "
            "the load builds it up without end, or any of it may be there\n"
            "  Change the speed, or give the links damping: elastic.damping."
        )
    y = np.linalg.solve(np.eye(2 * free) - transition, forced)
    p, pv = y[:free], y[free:]
    start = (own[0] @ p)[:, None], (own[1] @ p + own[0] @ pv)[:, None]
    return start, tuple(complex(z) for z in multipliers), steps.steps
