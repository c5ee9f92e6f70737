"""One run of an elastic motion: steps, doubled until they suffice, or a periodic steady state by shooting."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError, SimulationError
from symgen.runtime import _beam_steps, _beams, _core
from symgen.runtime.beam_checks import warnings
from symgen.runtime.beam_forces import Motion, forces
from symgen.runtime.beam_methods import BEAM_METHODS, GAUSS_6
from symgen.runtime.beam_recovery import recovered
from symgen.runtime.elastic_modes import elastic_modes, quasi_static
from symgen.runtime.elastic_motion import ElasticMotion
from symgen.runtime.elastic_result import ElasticResult, outputs
from symgen.runtime.result import Drift

Array = NDArray[np.float64]
Progress = Callable[[float], None]

#: Steps a turn that a run begins with, and the most that it is doubled to.
_FIRST, _MOST = 256, 1 << 18
#: The most unknowns of which all states of one turn are stepped together.
_SHOOTING = 400
#: Part of the largest strain below which one is round-off.
_NOISE = 1e-9


@dataclass(frozen=True, slots=True)
class Task:
    """What is asked of a run; see :meth:`symgen.runtime.elastic_model.ElasticModel.run`."""

    method: str
    revolutions: float
    steps: int | None
    rtol: float
    samples: int
    at: tuple[float, ...] | None
    form: str


@dataclass(frozen=True, slots=True)
class _Found:
    """Displacements and their rates (times, unknowns) at the recorded times, and what they cost."""

    displacements: Array
    rates: Array | None
    steps: int
    error: float | None = None
    floquet: tuple[complex, ...] = ()
    notes: tuple[str, ...] = ()


def run(motion: ElasticMotion, task: Task, progress: Progress | None) -> ElasticResult:
    """Return the result of a run.

    Raises
    ------
    ModelError
        For options out of range, or a method that does not suit the linkage.
    SimulationError
        When the linkage cannot turn, or the motion grows out of all bounds.
    """
    times = _times(motion, task)
    equations = motion.equations(task.form == "thesis")
    begun = time.perf_counter()
    if task.method == "quasi-static":
        found = _Found(quasi_static(motion, equations, times), None, len(times))
    elif task.method == "periodic":
        found = _periodic(motion, equations, task, times)
    elif task.method in BEAM_METHODS:
        found = _doubled(motion, equations, task, times, progress)
    else:
        found = _explicit(motion, equations, task, times, progress)
    wall = time.perf_counter() - begun
    if not np.all(np.isfinite(found.displacements)):
        raise SimulationError(
            f"{motion.rigid.name}: the motion grows out of all bounds: the step is too long for {task.method}, "
            "or the motion is unstable\n  Take more steps, or look at the Floquet multipliers: method periodic."
        )
    return _result(motion, equations, task, times, found, wall)


def _times(motion: ElasticMotion, task: Task) -> Array:
    if not task.revolutions > 0 or not math.isfinite(task.revolutions):
        raise ModelError(f"expected revolutions above zero, got {task.revolutions!r}")
    if task.samples < 2:
        raise ModelError(f"expected 2 samples or more, got {task.samples!r}")
    if task.at is not None:
        last = motion.period * (math.ceil(task.revolutions) - 1) if motion.speed else 0.0
        return np.array(
            [last + (motion.time_at(a) or (motion.period if last == 0.0 and a else 0.0)) for a in task.at]
        )
    if not motion.speed:
        return np.linspace(0.0, motion.rigid.description.t_end, task.samples)
    return np.linspace(0.0, motion.period * task.revolutions, task.samples)


def _stepped(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    task: Task,
    times: Array,
    per_turn: int,
    start: tuple[Array, Array] | None = None,
    progress: Progress | None = None,
) -> tuple[Array, Array, int]:
    """Return displacements and rates at the times, stepping from time zero, and the number of steps."""
    n = motion.layout.unknowns
    steps = _beam_steps.BeamSteps(equations, BEAM_METHODS.get(task.method, GAUSS_6), 1)
    s, v = start or (np.zeros((n, 1)), np.zeros((n, 1)))
    motion.check(equations, steps.start(0.0, s, v), 0.0)
    turn = motion.period if motion.speed else motion.rigid.description.t_end
    order = np.argsort(times, kind="stable")
    found, rates, now = np.zeros((len(times), n)), np.zeros((len(times), n)), 0.0
    for k in order:
        t = float(times[k])
        if t > now:
            count = max(1, math.ceil((t - now) / turn * per_turn - 1e-9))
            status = steps.advance(now, t, count)
            if status == _core.NOT_FINITE:
                return np.full_like(found, np.nan), rates, steps.steps
            motion.check(equations, status, t)
            now = t
            if progress:
                progress(t / float(times[order[-1]]))
        found[k], rates[k] = steps.displacements[:, 0], steps.rates[:, 0]
    return found, rates, steps.steps


def _doubled(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    task: Task,
    times: Array,
    progress: Progress | None,
) -> _Found:
    """Step with what is asked, or double the steps until two runs agree."""
    if task.steps is not None:
        if task.steps < 1:
            raise ModelError(f"expected 1 step a turn or more, got {task.steps!r}")
        half = max(1, task.steps // 2)
        coarse, *_ = _stepped(motion, equations, task, times, half)
        fine, rates, count = _stepped(motion, equations, task, times, task.steps, progress=progress)
        return _Found(fine, rates, count, _difference(motion, equations, times, coarse, fine, task.method))
    per_turn = _FIRST
    coarse, *_ = _stepped(motion, equations, task, times, per_turn)
    while per_turn < _MOST:
        per_turn *= 2
        fine, rates, count = _stepped(motion, equations, task, times, per_turn, progress=progress)
        error = _difference(motion, equations, times, coarse, fine, task.method)
        if error <= task.rtol:
            return _Found(fine, rates, count, error)
        coarse = fine
    raise SimulationError(
        f"{motion.rigid.name}: {task.method} does not come within {task.rtol:g} of the peak "
        f"with {_MOST} steps a turn"
    )


def _difference(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    times: Array,
    coarse: Array,
    fine: Array,
    method: str,
) -> float:
    """Return the largest error of the finer run over the peak of a strain, by the order of the method."""
    if not (np.all(np.isfinite(coarse)) and np.all(np.isfinite(fine))):
        return math.inf
    links = _links(equations, times)
    before, found = outputs(motion, links, coarse), outputs(motion, links, fine)
    pairs = [(a.values, b.values) for a, b in zip(before, found, strict=True) if b.name.endswith("strain")]
    least = _NOISE * max((float(np.max(np.abs(b))) for _, b in pairs), default=0.0)
    worst = 0.0
    for a, b in pairs:
        peak = float(np.max(np.abs(b)))
        if peak > least:
            worst = max(worst, float(np.max(np.abs(a - b))) / peak)
    return worst / (2 ** BEAM_METHODS[method].order - 1)


def _explicit(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    task: Task,
    times: Array,
    progress: Progress | None,
) -> _Found:
    """Step by an explicit method of the step loop of rods."""
    from symgen.runtime import _stepper
    from symgen.runtime.options import options
    from symgen.runtime.simulate import drive

    n = motion.layout.unknowns
    turn = motion.period if motion.speed else motion.rigid.description.t_end
    end = float(np.max(times))
    fixed = task.method == "rk4"
    step = turn / (task.steps or 2048) if fixed else None
    chosen = options(end, task.method, None if fixed else task.rtol, None, step, 2, 1_000_000_000)
    order = np.argsort(times, kind="stable")
    stepper = _stepper.Stepper(
        equations,
        chosen.method,
        0.0,
        np.zeros(2 * n),
        end,
        chosen.rtol,
        chosen.atol,
        chosen.step,
        times[order],
    )
    status, _ = drive(stepper, 0.0, chosen, progress)
    if status == _core.NOT_FINITE:
        return _Found(np.full((len(times), n), np.nan), None, stepper.steps)
    motion.check(equations, status, stepper.t)
    found = np.zeros((len(times), 2 * n))
    found[order] = stepper.result[:, : 2 * n]
    return _Found(found[:, :n], found[:, n:], stepper.steps)


def _periodic(motion: ElasticMotion, equations: _beams.BeamEquations, task: Task, times: Array) -> _Found:
    """Find the state that repeats after a turn, (I - Phi) y = y of a turn from rest, and the multipliers."""
    if not motion.speed:
        raise ModelError(f"{motion.rigid.name}: the crank stands still: there is no turn to repeat")
    free = motion.layout.unknowns - motion.layout.constraints
    if free > _SHOOTING:
        raise ModelError(
            f"{motion.rigid.name}: shooting steps {2 * free} states together, "
            f"expected at most {2 * _SHOOTING}\n"
            '  Reduce the links: reduction = { kind = "craig-bampton", modes = 3 } under elastic.'
        )
    per_turn, before = task.steps or _FIRST, None
    while True:
        start, multipliers, steps = _shot(motion, equations, per_turn)
        found, rates, more = _stepped(motion, equations, task, times, per_turn, start)
        error = None
        if before is not None:
            error = _difference(motion, equations, times, before, found, GAUSS_6.name)
        if task.steps is not None or (error is not None and error <= task.rtol):
            break
        if per_turn >= _MOST:
            raise SimulationError(
                f"{motion.rigid.name}: shooting does not come within {task.rtol:g} of the peak"
            )
        before, per_turn = found, 2 * per_turn
    return _Found(found, rates, steps + more, error, multipliers)


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
    steps = _beam_steps.BeamSteps(equations, GAUSS_6, 2 * free + 1)
    motion.check(equations, steps.start(0.0, s, v), 0.0)
    motion.check(equations, steps.advance(0.0, motion.period, per_turn), motion.period)
    ends_s, ends_v = steps.displacements, steps.rates
    # The free unknowns are those that R copies: one row of R is a unit row for each.
    rows = [int(np.flatnonzero(np.all(own[0] == np.eye(free)[k], axis=1))[0]) for k in range(free)]
    end = np.vstack([ends_s[rows], ends_v[rows]])
    transition, forced = end[:, 1:], end[:, 0]
    multipliers = np.linalg.eigvals(transition)
    multipliers = multipliers[np.argsort(-np.abs(multipliers), kind="stable")]
    y = np.linalg.solve(np.eye(2 * free) - transition, forced)
    p, pv = y[:free], y[free:]
    start = (own[0] @ p)[:, None], (own[1] @ p + own[0] @ pv)[:, None]
    return start, tuple(complex(z) for z in multipliers), steps.steps


def _links(equations: _beams.BeamEquations, times: Array) -> Array:
    """Return the motion of the links at the times, (times, links, 10)."""
    found = np.zeros((len(times), equations.motion.count, 10))
    for k in np.argsort(times, kind="stable"):
        found[k] = equations.motion.evaluate(float(times[k]))[2].reshape(-1, 10)
    return found


def _recorded(equations: _beams.BeamEquations, task: Task, times: Array, found: _Found) -> Motion:
    """Return the motion found with the rigid motion below it."""
    made: list[list[Array]] = [[] for _ in range(3)]
    order = np.argsort(times, kind="stable")
    for t in times[order].tolist():
        _, y, links, _, _, loads = equations.motion.evaluate(t)
        for part, value in zip(made, (y, links.reshape(-1, 10), loads.reshape(-1, 3)), strict=True):
            part.append(value)
    back = np.argsort(order)
    q, links, loads = (np.array(part)[back] for part in made)
    return Motion(times, q, links, loads, found.displacements, found.rates, task.form == "thesis")


def _result(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    task: Task,
    times: Array,
    found: _Found,
    wall: float,
) -> ElasticResult:
    d = motion.rigid.description
    whole = _recorded(equations, task, times, found)
    links = whole.links
    variables = [*outputs(motion, links, found.displacements), *recovered(motion, whole)]
    variables += forces(motion, equations, whole)
    notes = [*found.notes, *_of_speed(motion), *_of_stability(found)]
    notes += warnings(motion, links, found.displacements, _moments(motion, times))
    if task.form == "thesis":
        notes.append("the thesis' form, which takes the turning of axes as constant: for comparison only")
    return ElasticResult(
        name=d.name,
        title=d.title,
        axes=d.axes,
        time=times,
        variables=tuple(variables),
        drift=Drift(0.0, 0.0, 0.0, 0.0),
        final={},
        statistics={
            "angle_deg": np.degrees(motion.angle_at(times)).tolist(),
            "turns": bool(motion.speed),
            "unknowns": motion.layout.unknowns - motion.layout.constraints,
            "steps": found.steps,
            "error": found.error,
            "wall_s": wall,
            "floquet": [[z.real, z.imag] for z in found.floquet],
        },
        provenance={
            "kind": "elastic",
            "equations": d.equations,
            "method": task.method,
            "form": task.form,
            "rtol": task.rtol,
            "t_end": float(np.max(times)),
            "backend": motion.rigid.backend,
            "parameters": dict(motion.rigid.parameters),
        },
        notes=tuple(notes),
    )


def _moments(motion: ElasticMotion, times: Array) -> list[str]:
    if not motion.speed:
        return [f"{t:.6g} s" for t in times.tolist()]
    return [f"crank angle {angle:.6g} degrees" for angle in np.degrees(motion.angle_at(times)).tolist()]


def _of_speed(motion: ElasticMotion) -> list[str]:
    """Say where the crank turns faster than the lowest frequency of the structure."""
    if not motion.speed:
        return []
    equations = motion.equations()
    lowest = math.inf
    for t in np.linspace(0.0, motion.period, 25)[:-1].tolist():
        found = elastic_modes(motion, equations, t).frequencies
        moving = found[found > 1e-6 * found[-1]]
        lowest = min(lowest, float(moving[0]))
    crank = abs(motion.speed) / (2 * math.pi)
    if crank < lowest:
        return []
    return [
        f"the crank turns at {crank:.4g} Hz, above the first critical speed: the lowest frequency of the "
        f"structure over the turn is {lowest:.4g} Hz"
    ]


def _of_stability(found: _Found) -> list[str]:
    if not found.floquet or abs(found.floquet[0]) <= 1 + 1e-6:
        return []
    return [
        f"unstable: the largest Floquet multiplier is {abs(found.floquet[0]):.6g}; the steady state found "
        "grows away from itself by that factor a turn"
    ]
