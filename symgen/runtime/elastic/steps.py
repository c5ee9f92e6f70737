"""Elastic motions in time by the step loop of all runs: with counted steps, and by explicit methods."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace

import numpy as np

from symgen.errors import ModelError, OptionsError
from symgen.precision import FLOAT64
from symgen.runtime import _beams, _core
from symgen.runtime.arrays import Array
from symgen.runtime.beams.methods import BeamMethod, integrator_of
from symgen.runtime.elastic.checkpoint import ConsecutiveCheckpoints
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.elastic.outputs import Counts, Solution
from symgen.runtime.integrate.options import TIGHTEST, Options, end_of_scene, options, recorded_at
from symgen.runtime.integrate.pace import OUT_OF_TIME, OutOfTime, Pace, Progress
from symgen.runtime.integrate.simulate import drive, stepper_of
from symgen.runtime.kernels.arguments import is_real, out_of_range

#: S and S' at time zero, (unknowns, 1) each; None at rest and undeformed.
Start = tuple[Array, Array] | None

#: Part of a revolution that an adaptive run tries as its first step.
_FIRST_TRIED = 4096
#: Steps of methods with a fixed step per revolution, by default.
FIXED = 2048
#: The most steps per revolution that may be requested.
_MOST_A_TURN = 10_000_000


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


def check_thesis(motion: ElasticMotion) -> None:
    """Refuse the thesis' form for free motions that rotate with rigid links: it is not unique without R'."""
    status, *_, basis = motion.equations().matrices(0.0)
    motion.check(motion.equations(), status, 0.0)
    if basis is not None and np.any(basis[1]):
        raise ModelError(
            f"{motion.rigid.name}: where links keep their length, the thesis' form depends on the "
            "coordinates\n"
            "  Let them stretch: axial = true under elastic, on every link that moves and is not the crank."
        )


def turn(motion: ElasticMotion) -> float:
    """Return the time [s] that steps are counted over."""
    return motion.period if motion.speed else end_of_scene(motion.rigid.description.t_end)


def first_steps(motion: ElasticMotion, task: Task, least: int) -> int:
    """Return the steps per revolution of the first pass: given, or ``least``, or as ``max_step`` requires.

    Raises
    ------
    ModelError
        When both are given, or a number of steps out of range.
    """
    if task.steps is None:
        return least if task.max_step is None else max(least, math.ceil(turn(motion) / task.max_step))
    if task.max_step is not None:
        raise OptionsError("give {steps} (per revolution) or {max_step}, not both")
    if not 1 <= task.steps <= _MOST_A_TURN:
        raise ModelError(f"expected between 1 and 10 million steps per revolution, got {task.steps!r}")
    return task.steps


def step_counts(motion: ElasticMotion, times: Array, per_turn: int) -> Counts:
    """Return the number of steps to each time, in rising order, from the one before it, at least one."""
    gaps = np.sort(times)
    gaps[1:] -= gaps[:-1].copy()
    counts = np.maximum(1, np.ceil(gaps / turn(motion) * per_turn - 1e-9)).astype(np.intp)
    counts[gaps <= 0.0] = 0
    return counts


def _before_jumps(motion: ElasticMotion, times: Array) -> Array:
    """Return times; those within a jump of the loads are replaced by its begin."""
    for low, high in motion.jumps.tolist():
        times = np.where((low < times) & (times <= high), low, times)
    return times


def integrated(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    chosen: Options,
    nodes: Array,
    counts: Counts,
    times: Array,
    start: Start = None,
    progress: Progress | None = None,
    stages: ConsecutiveCheckpoints | None = None,
    pace: Pace | None = None,
) -> tuple[Array, Array, int]:
    """Return displacements, rates and the number of steps of a run by the step loop of all, from time zero.

    The former are (times, unknowns); from a start with many columns, (times, unknowns, columns).
    Displacements are not a number where the motion of a column grows beyond all numbers. No step leads across
    a jump of the loads that begins at a node.

    Parameters
    ----------
    nodes, counts
        Rising times at which steps end, the last that of the run, and the numbers of equal steps to each from
        the one before; -1 for steps of the method's own choice.
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
    s, v = start or np.zeros((2, motion.layout.unknowns, 1))
    shape = s.shape if s.shape[1] > 1 else s.shape[:1]
    states = np.zeros((2, len(times), *shape))
    before = stages.next(states.shape) if stages else None
    if before is not None:
        return *before, int(np.sum(counts))
    times, nodes = (_before_jumps(motion, x) for x in (times, np.append(0.0, nodes)))
    order, counts = np.argsort(times, kind="stable"), np.append(0, counts)
    jumps = motion.jumps[motion.jumps[:, 1] < nodes[-1]]
    if len(jumps):
        jumps = jumps[np.isin(jumps[:, 0], nodes)]
        nodes, counts = np.append(nodes, jumps[:, 1]), np.append(counts, np.zeros(len(jumps), np.intp))
        sorting = np.argsort(nodes, kind="stable")
        nodes, counts = nodes[sorting], counts[sorting]
    first = np.append(True, nodes[1:] != nodes[:-1])
    batch = equations if s.shape[1] == 1 else _beams.BeamBatch(equations, s.shape[1])
    chosen = replace(chosen, t_end=float(nodes[-1]))
    grid = {"nodes": nodes[first], "counts": counts[first]} if chosen.t_end else {}
    run = stepper_of(batch, chosen, 0.0, np.ravel([s, v]), times[order], **grid)
    if stages:
        stages.resume(run)
    if pace:
        pace.restart(run.t)
    status, _ = drive(run, 0.0, chosen, progress if chosen.t_end else None, stages, pace)
    reached = order[: run.recorded]
    states[:, reached] = run.result.reshape(-1, 2, *shape).swapaxes(0, 1)
    if status == OUT_OF_TIME:
        indices = np.sort(reached)
        raise OutOfTime(run.t, Solution(states[0, indices], states[1, indices], run.steps), indices)
    if status == _core.NOT_FINITE:
        states[0] = np.nan
    else:
        motion.check(equations, status, run.t)
    if stages:
        stages.finished(states)
    return *states, run.steps


def stepped(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    method: BeamMethod,
    times: Array,
    counts: Counts,
    start: Start = None,
    progress: Progress | None = None,
    stages: ConsecutiveCheckpoints | None = None,
    pace: Pace | None = None,
    recorded: Array | None = None,
) -> tuple[Array, Array]:
    """Return displacements and rates at the times, or at those recorded: see :func:`integrated`.

    Steps end at all times; :func:`step_counts` gives their number to each.
    """
    end = float(np.max(times))
    chosen = Options(integrator_of(method), end, 0.0, 0.0, 0.0, len(times), sys.maxsize, stabilisation="raw")
    at = times if recorded is None else recorded
    nodes, pace = np.sort(times), pace or Pace(0.0, end)
    return integrated(motion, equations, chosen, nodes, counts, at, start, progress, stages, pace)[:2]


def explicit(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    task: Task,
    times: Array,
    progress: Progress | None = None,
    stages: ConsecutiveCheckpoints | None = None,
    start: Start = None,
) -> Solution:
    """Return displacements and rates at the times by an explicit method: see :func:`integrated`."""
    end, fixed, typed = float(np.max(times)), task.method == "rk4", motion.rigid.typed
    step = turn(motion) / (task.steps or FIXED) if fixed else None
    limits = {"precision": typed.precision if typed else FLOAT64, "max_step": task.max_step}
    chosen = options(end, task.method, None if fixed else task.rtol, None, step, 2, 1_000_000_000, **limits)
    # A first step guessed from rest would look ahead to the end of the run, along the rigid motion.
    chosen = replace(chosen, step=chosen.step or turn(motion) / _FIRST_TRIED)
    nodes = np.append(motion.jumps[:, 0], end)
    counts = np.full(len(nodes), -1)
    return Solution(*integrated(motion, equations, chosen, nodes, counts, times, start, progress, stages))
