"""Runs of elastic links in large rotation with a controller at a sampling interval."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np

from symgen.errors import ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.elastic.control.stepper import SystemStepper, limits_of, stepper_options
from symgen.runtime.elastic.large.collocation import MotionState
from symgen.runtime.elastic.large.passes import LargeMotion, constraint_drift, events_of, result_of
from symgen.runtime.integrate.controlled import controlled
from symgen.runtime.model.arguments import RunArguments
from symgen.runtime.model.elastic_arguments import ElasticRun, RunInSpace
from symgen.runtime.result.elastic import ElasticResult
from symgen.runtime.result.recording import notes_on_events
from symgen.runtime.result.records import Variable
from symgen.runtime.rods.following.jumps import check_rigid_motion


def controlled_run(
    model: Any, request: ElasticRun | RunInSpace, motion: Callable[[], LargeMotion], end: float
) -> ElasticResult:
    """Run to a time [s] with a controller at a sampling interval and return the result.

    Raises
    ------
    ModelError
        For a controller without a sampling interval, and as :func:`.controlled`.
    SimulationError
        When the run cannot continue, or its controller fails; with the recorded samples.
    """
    begun, samples = perf_counter(), 361 if request.samples is None else request.samples
    rtol, longest = limits_of(request.rtol, "max_step", request.max_step)
    if request.sample is None:
        raise ModelError(
            "expected sample, the time between two calls of the controller [s], got none\n"
            "  A continuous law of elastic links is part of their scene: expressions in loads, and [states]."
        )
    make = partial(SystemStepper, motion=motion, rtol=rtol, longest=longest)
    arguments = RunArguments(controller=request.controller, sample=request.sample)
    if isinstance(request, ElasticRun):
        arguments = replace(arguments, checkpoint=request.checkpoint, resume=request.resume)
    stepper, control = controlled(model, make, arguments, stepper_options(end, samples))
    check_rigid_motion(stepper.of.rigid, 0.0, end)
    status, _ = control.run(request.progress)
    run, of = stepper._run, stepper.of
    moments, parts = list[MotionState](), list[tuple[Variable, ...]]()
    for rows, values in _alike(control.held(run)):
        stepper._take(values)
        some = []
        for k in rows:
            of.system.recall(float(run.sampled[k]))
            some.append(stepper.moment(float(run.sampled[k]), run.result[k], first=k == 0))
        parts.append(of.selected(of.outputs(of.system, some)))
        moments += some
    variables = [
        replace(of_each[0], values=np.concatenate([v.values for v in of_each]))
        for of_each in zip(*parts, strict=True)
    ]
    statistics = {"steps": run.steps, "corrections": stepper._equations.evaluations}
    statistics |= {"error": None, "power_balance": None}
    drift = constraint_drift(of.system, moments)
    events = events_of(of.rigid, stepper._equations.n, run.events)
    notes = [control.note, *notes_on_events(of.rigid.evaluator, run)]
    result = result_of(of, run.sampled.copy(), variables, notes, drift, events, statistics, rtol, begun)
    result._cache["controls"] = control
    control.finished(result, status)
    return result


def _alike(held: Array) -> Iterator[tuple[range, Array]]:
    """Yield the numbers of successive samples with the same parameters, and these."""
    ends = [*(np.flatnonzero(np.any(np.diff(held, axis=0), axis=1)) + 1).tolist(), len(held)]
    for begin, end in zip([0, *ends], ends, strict=False):
        yield range(begin, end), held[begin]
