"""Runs in large rotation with more and more steps, until the error by time steps is within its tolerance."""

from __future__ import annotations

import math
import operator
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from symgen.errors import ModelError, SimulationError
from symgen.runtime.arrays import Array
from symgen.runtime.beams.methods import GAUSS8
from symgen.runtime.beams.selection import none, note_of_omitted, selected
from symgen.runtime.elastic.large.checkpoint import RefinementCheckpoints
from symgen.runtime.elastic.large.collocation import ConstrainedSystem, MotionState, SystemRun, stacked
from symgen.runtime.elastic.mesh import mesh_error, unknown
from symgen.runtime.integrate.checkpoint import CheckpointOptions, mark_of_kernels
from symgen.runtime.integrate.pace import OutOfTime, Progress, limited, out_of_time, wall_left
from symgen.runtime.kernels.arguments import count as whole
from symgen.runtime.kernels.arguments import real
from symgen.runtime.kernels.typed import build_settings
from symgen.runtime.model.elastic_arguments import Refined
from symgen.runtime.result.elastic import ElasticResult
from symgen.runtime.result.recording import motion, notes_on_events
from symgen.runtime.result.records import Coordinate, Drift, LocatedEvent, Variable, of_model
from symgen.runtime.rods.following.jumps import check_rigid_motion
from symgen.runtime.rods.model.rods import RodModel

#: Error by time steps over the peak stress of a station, where ``rtol`` is not given.
RTOL = 2e-3
#: Peak strain below which a link counts as unstrained: round-off of its places.
_UNSTRAINED = 1e-10
#: Peak of a first-order state below which it is round-off.
_SMALL = 1e-100
#: The most steps of a reported run that ``rtol`` adds.
_MOST = 20_000


@dataclass(frozen=True, slots=True)
class LargeMotion:
    """A linkage with elastic links in large rotation: its equations, and the content of its results.

    Attributes
    ----------
    finer
        Function that returns the equations with twice the elements.
    outputs
        Function that returns the outputs of a motion by the equations.
    coordinate
        Function that returns the coordinate of results by times [s].
    start
        Function that returns the motion at the start by the equations.
    modulus
        Largest Young's modulus of the links [Pa].
    initial
        The initial state in words, or amplitudes of modes [m].
    form, notes
        See :class:`~symgen.runtime.result.elastic.ElasticResult`.
    of_runs
        Function that returns the outputs of runs by linear theory.
    identity
        Data that determine a run, in addition to the rigid linkage and its parameters.
    """

    rigid: RodModel
    system: ConstrainedSystem
    finer: Callable[[], ConstrainedSystem]
    outputs: Callable[[Any, Sequence[MotionState]], list[Variable]]
    coordinate: Callable[[Array], Coordinate]
    modulus: float
    form: str
    notes: tuple[str, ...] = ()
    identity: tuple[str, ...] = ()
    start: Callable[[Any], MotionState] = operator.methodcaller("start")
    initial: str | Sequence[float] = "undeformed"
    of_runs: Callable[[], Iterable[Variable]] = none

    def selected(self, variables: Iterable[Variable]) -> tuple[Variable, ...]:
        """Return the outputs that the scene selects; raise SceneError where there is no such output."""
        return selected(variables, self.rigid.description, self.of_runs)

    def error(self, coarse: Sequence[Variable], fine: Sequence[Variable]) -> float:
        """Return the difference of stresses of two runs over their peak at a station, the largest of all.

        Lower peaks of strains count as 1e-10: the strains of a link that nothing strains are round-off, which
        no steps or elements reduce. First-order states count as stresses do.
        """
        pairs = zip(coarse, fine, strict=True)
        states = [(a.values, b.values) for a, b in pairs if b.name in self.rigid.description.states]
        apart = (float(np.max(np.abs(a - b)) / max(np.max(np.abs(b)), _SMALL)) for a, b in states)
        return max(mesh_error(coarse, fine, _UNSTRAINED * self.modulus), *apart, 0.0)


@dataclass(frozen=True, slots=True)
class Refinement:
    """A run, at its end, and its outputs.

    ``error`` is the error of stresses by time steps over their peak; infinite as long as it is not known.
    ``balance`` is that of :func:`drift_of`.
    """

    run: SystemRun
    variables: list[Variable]
    error: float
    drift: Drift
    balance: float | None

    @property
    def count(self) -> int:
        """Number of samples."""
        return self.run.stepper.recorded


def events_of(
    of: RodModel, unknowns: int, events: Iterable[tuple[float, int, bool | None, Array]]
) -> Iterator[LocatedEvent]:
    """Yield the events of a run of so many unknowns, those of a linkage with rigid links."""
    points = of.description.coordinates
    for t, i, rising, y in events:
        state = np.concatenate([y[:points], y[unknowns : unknowns + points]])
        yield LocatedEvent(of.description.events[i].name, t, rising, motion(of.evaluator, t, state))


def refined_run(
    of: LargeMotion, request: Refined, end: float, least: float, keeping: CheckpointOptions | None = None
) -> ElasticResult:
    """Return the result of a run to a time [s], with a least number of steps and with checkpoints.

    Raises
    ------
    ModelError
        For options out of range.
    SimulationError
        Where Newton's method does not converge, however short the steps; with the last motion when the wall
        time is spent; where a prescribed motion, or its rate, jumps.
    """
    rtol = real(RTOL if request.rtol is None else request.rtol, "rtol")
    if not 0.0 < rtol < 1.0:
        raise ModelError(f"expected rtol above zero and below 1, got {rtol!r}")
    samples = whole(request.samples, "samples")
    if not 2 <= samples <= 10_000_000:
        raise ModelError(f"expected between 2 and 10 million samples, got {samples}")
    if request.max_step is not None:
        if not real(request.max_step, "max_step") > 0.0:
            raise ModelError(f"expected max_step above zero, got {request.max_step!r}")
        least = max(least, end / request.max_step)
    check_rigid_motion(of.rigid, 0.0, end)
    times, begun, passes = np.linspace(0.0, end, samples), time.perf_counter(), list[Refinement]()
    record: RefinementCheckpoints | None = None
    if keeping is not None:
        evaluator, identity = of.rigid.evaluator, (of.form, rtol, least, times.tobytes().hex(), *of.identity)
        mark = mark_of_kernels(evaluator, evaluator.library, evaluator.equations(), *identity)
        record = RefinementCheckpoints(mark, keeping)
    begun -= record.spent if record else 0.0
    try:
        _refine(passes, of, times, least, rtol, request.progress, record)
    except OutOfTime as stop:
        problem, result = out_of_time(stop.t, end), _result(of, times, passes[-1], rtol, begun)
        raise SimulationError(f"{of.rigid.name}: {problem}", time=stop.t, partial=result) from None
    final = _result(of, times, passes[-1], rtol, begun)
    final._estimate_later(partial(_by_elements, of, times[: passes[-1].count], passes[-1], wall_left()))
    return final


def _refine(
    passes: list[Refinement],
    of: LargeMotion,
    times: Array,
    least: float,
    rtol: float,
    progress: Progress | None,
    record: RefinementCheckpoints | None = None,
) -> None:
    """Append runs with twice the steps each to ``passes``, from ``least`` on, until the error is ``rtol``.

    The error of a run is the change of its stresses with twice the steps: 1 - 2^-8 of the error, by the order
    of the method. The last run with twice the steps is not appended.

    Raises
    ------
    SimulationError
        Where Newton's method does not converge, however short the steps.
    OutOfTime
        When the wall time is spent; ``passes`` has then a run, if need be the first one so far.
    """
    initial, steps = of.start(of.system), math.ceil(least / (len(times) - 1))
    of.selected(of.outputs(of.system, [initial]))

    def begun(steps: int) -> SystemRun:
        run = SystemRun(of.system, GAUSS8, times, steps, initial, rigid=of.rigid.evaluator)
        return record.begin(run) if record else run

    def take(run: SystemRun) -> None:
        moments = run.moments()
        variables, drift = of.outputs(of.system, moments), drift_of(of.system, moments)
        passes.append(Refinement(run, variables, math.inf, *drift))

    if record and record.steps[1]:
        before, steps = record.steps
        if before:
            take(record.finished(begun(before)))
    while True:
        run = begun(steps)
        try:
            run.run(progress, record)
        except OutOfTime:
            if not passes:
                take(run)
            raise
        except SimulationError:
            if passes or steps * (len(times) - 1) > _MOST:
                raise
        else:
            if run.stepper.recorded < 2:
                name, t = of.rigid.description.events[run.stepper.ended_by].name, run.stepper.t
                raise ModelError(
                    f"{of.rigid.name}: the event {name!r} ends the run at t = {t:.6g} s, before the second "
                    "sample\n  Give more samples."
                )
            take(run)
            if len(passes) > 1:
                coarse, fine = passes[-2:]
                both = min(coarse.count, fine.count)
                error = of.error(*(_first(x.variables, both) for x in (coarse, fine)))
                passes[-2] = replace(coarse, error=error)
                if error <= rtol or steps * (len(times) - 1) > _MOST:
                    passes.pop()
                    return
            if record:
                record.finished(run)
        steps *= 2


def _first(variables: Sequence[Variable], count: int) -> list[Variable]:
    """Return the first samples of outputs, ``count`` of them."""
    return [replace(v, values=v.values[:count]) for v in variables]


def _by_elements(of: LargeMotion, times: Array, coarse: Refinement, max_wall: float | None) -> float | str:
    """Return the change of stresses in twice as many elements, over their peak, or why it is not known.

    Both runs have the steps of ``coarse``, or as many more as Newton's method needs with the finer elements.
    """
    steps, variables, reason = coarse.run.steps, coarse.variables, ""

    def outputs_of(system: ConstrainedSystem) -> list[Variable]:
        run = SystemRun(system, GAUSS8, times, steps, of.start(system)).run()
        return of.outputs(system, run.moments())

    with limited(max_wall):
        finer = of.finer()
        while steps * (len(times) - 1) <= _MOST or steps == coarse.run.steps:
            try:
                fine = outputs_of(finer)
                if steps > coarse.run.steps:
                    variables = outputs_of(of.system)
                return of.error(variables, fine)
            except (OutOfTime, ModelError) as problem:
                return unknown(problem)
            except SimulationError as problem:
                reason, steps = unknown(problem), 2 * steps
    return reason


def constraint_drift(system: ConstrainedSystem, moments: Sequence[MotionState]) -> Drift:
    """Return the largest errors of the constraints."""
    t, q, v, _, _ = stacked(moments)
    rows = system.core.rows(t, q, v, *system.prescribed(t))
    return Drift(*(float(np.max(np.abs(x), initial=0.0)) for x in rows))


def drift_of(system: ConstrainedSystem, moments: Sequence[MotionState]) -> tuple[Drift, float | None]:
    """Return the largest errors of the constraints, of the energy, and of the balance of powers.

    The last is the largest difference between the input power and the sum of the dissipated power and the
    rate of all energies, as means from one moment to the next, over the largest of these powers. It is None
    for a single moment, where nothing does work or is damped, and where not all work is accounted for.
    """
    t, q, v, a, _ = stacked(moments)
    drift = constraint_drift(system, moments)
    if not system.accounted:
        return drift, None
    kinetic, strain, potential, dissipated = system.energies(t, q, v, a)
    energy, work = kinetic + strain + potential, np.array([m.work for m in moments])
    error, exchanged = energy - work, max(np.ptp(kinetic), np.ptp(strain + potential))
    drift = replace(drift, energy=float(np.max(np.abs(error - error[0]))), energy_exchanged=float(exchanged))
    damping = (dissipated[1:] + dissipated[:-1]) / 2
    rate, net, imbalance = (np.diff(x) / np.diff(t) for x in (energy, work, error))
    change, *powers = (float(np.max(np.abs(x), initial=0.0)) for x in (rate, damping, net + damping))
    # The error of a constant energy is no share of its own changes.
    return drift, float(np.max(np.abs(imbalance))) / max(change, *powers) if any(powers) else None


def _result(of: LargeMotion, times: Array, one: Refinement, rtol: float, begun: float) -> ElasticResult:
    times = times[: one.count]
    notes = [*notes_on_events(of.rigid.evaluator, one.run.stepper)]
    if one.error > rtol:
        notes.append(
            f"the error by time steps does not reach rtol = {rtol:g}: links vibrate, as from an abrupt "
            "start, too fast for the steps; give a shorter run, damping, or shorter steps by max_step"
        )
    statistics = {
        "steps": one.run.steps * (len(times) - 1) if one.run.is_whole else 0,
        "corrections": one.run.equations.evaluations,
        "error": one.error if math.isfinite(one.error) else None,
        "power_balance": one.balance,
    }
    events = events_of(of.rigid, of.system.unknowns, one.run.stepper.events)
    return result_of(of, times, of.selected(one.variables), notes, one.drift, events, statistics, rtol, begun)


def result_of(
    of: LargeMotion,
    times: Array,
    shown: Sequence[Variable],
    notes: Iterable[str],
    drift: Drift,
    events: Iterable[LocatedEvent],
    statistics: dict[str, Any],
    rtol: float,
    begun: float,
) -> ElasticResult:
    """Return the result of a run by its selected outputs; the clock was at ``begun`` [s] at its start."""
    d, rigid, coordinate = of.rigid.description, of.rigid, of.coordinate(times)
    attributes = {"method": "large-rotation", "form": of.form, "rtol": rtol, "t_end": float(times[-1])}
    attributes |= {"initial": of.initial}
    return ElasticResult(
        **of_model(d, rigid.parameters, **attributes, **build_settings(rigid.evaluator.library, rigid.typed)),
        axes=d.axes,
        coordinate=coordinate,
        variables=tuple(shown),
        drift=drift,
        final={},
        statistics={
            "unknowns": of.system.unknowns - of.system.multipliers,
            **statistics,
            "wall_s": time.perf_counter() - begun,
            "floquet": [],
            "floquet_error": None,
        },
        events=tuple(events),
        notes=(*d.remarks, *of.notes, *note_of_omitted(shown, d), *notes),
        times=None if coordinate.name == "time" else times,
    )
