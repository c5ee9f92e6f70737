"""Runs in large rotation with more and more steps, until the error by time steps is within its tolerance."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from symgen.errors import ModelError, SimulationError
from symgen.runtime.arrays import Array
from symgen.runtime.beams.methods import GAUSS8
from symgen.runtime.elastic.large.checkpoint import SampleCheckpoints
from symgen.runtime.elastic.large.collocation import ConstrainedSystem, MotionState, moved, stacked
from symgen.runtime.elastic.large.events import Events
from symgen.runtime.elastic.mesh import mesh_error, unknown
from symgen.runtime.elastic.outputs import selected
from symgen.runtime.integrate.checkpoint import Keeping, mark_of_kernels
from symgen.runtime.integrate.pace import OutOfTime, Pace, Progress, limited, out_of_time, wall_left
from symgen.runtime.kernels.arguments import count as whole
from symgen.runtime.kernels.arguments import real
from symgen.runtime.kernels.typed import build_settings
from symgen.runtime.model.arguments import Refined
from symgen.runtime.result.elastic import ElasticResult
from symgen.runtime.result.records import Coordinate, Drift, Variable, of_model
from symgen.runtime.rods.model.rods import RodModel

#: Error by time steps over the peak stress of a station, where ``rtol`` is not given.
RTOL = 2e-3
#: Peak strain below which a link counts as unstrained: round-off of its places.
_UNSTRAINED = 1e-10
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

    def error(self, coarse: Sequence[Variable], fine: Sequence[Variable]) -> float:
        """Return the difference of stresses of two runs over their peak at a station, the largest of all.

        Lower peaks of strains count as 1e-10: the strains of a link that nothing strains are round-off, which
        no steps or elements reduce.
        """
        return mesh_error(coarse, fine, _UNSTRAINED * self.modulus)


@dataclass(frozen=True, slots=True)
class Refinement:
    """Outputs, events and counts of a run with ``steps`` steps between two of its ``count`` samples.

    ``error`` is the error of stresses by time steps over their peak; infinite as long as it is not known.
    ``balance`` is that of :func:`drift_of`.
    """

    variables: list[Variable]
    steps: int
    corrections: int
    error: float
    drift: Drift
    balance: float | None
    count: int
    events: Events


def refined_run(
    of: LargeMotion, request: Refined, end: float, least: float, keeping: Keeping | None = None
) -> ElasticResult:
    """Return the result of a run to a time [s], with at least so many steps, and with checkpoints.

    Raises
    ------
    ModelError
        For options out of range.
    SimulationError
        Where Newton's method does not converge, however short the steps; with the last motion when the wall
        time is spent.
    """
    rtol = real(RTOL if request.rtol is None else request.rtol, "rtol")
    if not 0.0 < rtol < 1.0:
        raise ModelError(f"expected rtol above zero and below 1, got {rtol!r}")
    samples = whole(request.samples, "samples")
    if samples < 2:
        raise ModelError(f"expected 2 samples or more, got {samples}")
    if request.max_step is not None:
        if not real(request.max_step, "max_step") > 0.0:
            raise ModelError(f"expected max_step above zero, got {request.max_step!r}")
        least = max(least, end / request.max_step)
    times, pace, passes = np.linspace(0.0, end, samples), Pace(0.0, end), list[Refinement]()
    record: SampleCheckpoints | None = None
    if keeping is not None:
        evaluator, identity = of.rigid.evaluator, (of.form, rtol, least, times.tobytes().hex(), *of.identity)
        mark = mark_of_kernels(evaluator, evaluator.library, evaluator.equations(), *identity)
        record = SampleCheckpoints(of.system, mark, keeping)
    spent = record.spent if record else 0.0
    try:
        _refine(passes, of, times, least, rtol, pace, request.progress, record)
    except OutOfTime as stop:
        if record:
            record.save()
        problem, result = out_of_time(stop.t, end), _result(of, times, passes[-1], rtol, pace.wall + spent)
        raise SimulationError(f"{of.rigid.name}: {problem}", time=stop.t, partial=result) from None
    final = _result(of, times, passes[-1], rtol, pace.wall + spent)
    final._estimate_later(partial(_by_elements, of, times[: passes[-1].count], passes[-1], wall_left()))
    return final


def _refine(
    passes: list[Refinement],
    of: LargeMotion,
    times: Array,
    least: float,
    rtol: float,
    pace: Pace,
    progress: Progress | None,
    record: SampleCheckpoints | None = None,
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
    steps, initial = math.ceil(least / (len(times) - 1)), of.start(of.system)
    if record and record.before:
        moments, before, corrections = record.before
        variables, drift = of.outputs(of.system, moments), drift_of(of.system, moments)
        none = Events(of.rigid, GAUSS8)
        passes.append(Refinement(variables, before, corrections, math.inf, *drift, len(moments), none))
    steps = record.steps or steps if record else steps
    while True:
        events = Events(of.rigid, GAUSS8)
        at_step = events.step if of.rigid.description.events else None
        resumed, at_sample = (record.resumed(), partial(record.look, steps)) if record else (None, None)
        try:
            moments, stepper = moved(
                of.system, GAUSS8, times, steps, pace, progress, at_step, at_sample, resumed, initial
            )
        except OutOfTime as stop:
            if not passes:
                variables, drift = of.outputs(of.system, stop.states), drift_of(of.system, stop.states)
                passes.append(Refinement(variables, 0, 0, math.inf, *drift, len(stop.states), events))
            raise
        except SimulationError:
            if passes or steps * (len(times) - 1) > _MOST:
                raise
        else:
            variables, count = of.outputs(of.system, moments), len(moments)
            if count < 2:
                last = events.located[-1]
                raise ModelError(
                    f"{of.rigid.name}: the event {last.name!r} ends the run at t = {last.time:.6g} s, before "
                    "the second sample\n  Give more samples."
                )
            if passes:
                both = min(count, passes[-1].count)
                pair = (_first(of_run, both) for of_run in (passes[-1].variables, variables))
                passes[-1] = replace(passes[-1], error=of.error(*pair))
                if passes[-1].error <= rtol or steps * (len(times) - 1) > _MOST:
                    return
            drift = drift_of(of.system, moments)
            corrections = stepper.corrections + (resumed.corrections if resumed else 0)
            passes.append(Refinement(variables, steps, corrections, math.inf, *drift, count, events))
            if record:
                record.finished(moments, steps, corrections)
        steps *= 2
        pace.restart(0.0)


def _first(variables: Sequence[Variable], count: int) -> list[Variable]:
    """Return so many of the first samples of outputs."""
    return [replace(v, values=v.values[:count]) for v in variables]


def _by_elements(of: LargeMotion, times: Array, coarse: Refinement, max_wall: float | None) -> float | str:
    """Return the change of stresses in twice as many elements, over their peak, or why it is not known.

    Both runs have the steps of ``coarse``, or as many more as Newton's method needs with the finer elements.
    """
    end, steps, variables, reason = float(times[-1]), coarse.steps, coarse.variables, ""
    with limited(max_wall):
        finer = of.finer()
        while steps * (len(times) - 1) <= _MOST or steps == coarse.steps:
            run = partial(moved, method=GAUSS8, times=times, steps=steps, pace=Pace(0.0, end))
            try:
                moments, _ = run(finer, initial=of.start(finer))
                if steps > coarse.steps:
                    variables = of.outputs(of.system, run(of.system, initial=of.start(of.system))[0])
                return of.error(variables, of.outputs(finer, moments))
            except (OutOfTime, ModelError) as problem:
                return unknown(problem)
            except SimulationError as problem:
                reason, steps = unknown(problem), 2 * steps
    return reason


def drift_of(system: ConstrainedSystem, moments: Sequence[MotionState]) -> tuple[Drift, float | None]:
    """Return the largest errors of the constraints, of the energy, and of the balance of powers.

    The last is the largest difference between the input power and the sum of the dissipated power and the
    rate of all energies, as means from one moment to the next, over the largest of these powers. It is None
    for a single moment, where nothing does work or is damped, and where not all work is accounted for.
    """
    t, q, v, a, _ = stacked(moments)
    rows = system.core.rows(t, q, v, *system.prescribed(t))
    constraint, velocity = (float(np.max(np.abs(x), initial=0.0)) for x in rows)
    if not system.accounted:
        return Drift(constraint, velocity), None
    kinetic, strain, potential, dissipated = system.energies(t, q, v, a)
    energy, work = kinetic + strain + potential, np.array([m.work for m in moments])
    error, exchanged = energy - work, max(np.ptp(kinetic), np.ptp(strain + potential))
    drift = Drift(constraint, velocity, float(np.max(np.abs(error - error[0]))), float(exchanged))
    damping = (dissipated[1:] + dissipated[:-1]) / 2
    rate, net, imbalance = (np.diff(x) / np.diff(t) for x in (energy, work, error))
    change, *powers = (float(np.max(np.abs(x), initial=0.0)) for x in (rate, damping, net + damping))
    # The error of a constant energy is no share of its own changes.
    return drift, float(np.max(np.abs(imbalance))) / max(change, *powers) if any(powers) else None


def _result(of: LargeMotion, times: Array, one: Refinement, rtol: float, wall: float) -> ElasticResult:
    times = times[: one.count]
    d, rigid, coordinate = of.rigid.description, of.rigid, of.coordinate(times)
    notes = [*of.notes, *one.events.notes()]
    if one.error > rtol:
        notes.append(
            f"the error by time steps does not reach rtol = {rtol:g}: links vibrate, as from an abrupt "
            "start, too fast for the steps; give a shorter run, damping, or shorter steps by max_step"
        )
    attributes = {"method": "large-rotation", "form": of.form, "rtol": rtol, "t_end": float(times[-1])}
    attributes |= {"initial": of.initial}
    return ElasticResult(
        **of_model(d, rigid.parameters, **attributes, **build_settings(rigid.evaluator.library, rigid.typed)),
        axes=d.axes,
        coordinate=coordinate,
        variables=selected(one.variables, d),
        drift=one.drift,
        final={},
        statistics={
            "unknowns": of.system.unknowns - of.system.multipliers,
            "steps": one.steps * (len(times) - 1),
            "corrections": one.corrections,
            "error": one.error if math.isfinite(one.error) else None,
            "power_balance": one.balance,
            "wall_s": wall,
            "floquet": [],
            "floquet_error": None,
        },
        events=tuple(one.events.located),
        notes=(*d.remarks, *notes),
        times=None if coordinate.name == "time" else times,
    )
