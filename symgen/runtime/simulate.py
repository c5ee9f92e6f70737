"""One run: the compiled loop driven in chunks, and what is said when it cannot go on."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError, SimulationError
from symgen.runtime import _core
from symgen.runtime.causes import without_direction
from symgen.runtime.description import Description
from symgen.runtime.evaluate import Evaluator
from symgen.runtime.options import Options
from symgen.runtime.recording import recorded
from symgen.runtime.redundancy import slack
from symgen.runtime.result import Result
from symgen.runtime.typed import Typed

Array = NDArray[np.float64]
Progress = Callable[[float], None]

_CHUNK_SECONDS = 0.05
#: Pivots that keep less than this are worth a word when a run fails.
_NEAR = 1e-2


def run(
    evaluator: Evaluator,
    t0: float,
    q: Array,
    u: Array,
    redundant: tuple[int, ...],
    chosen: Options,
    progress: Progress | None,
    typed: Typed | None = None,
    tangent: Evaluator | None = None,
) -> Result:
    """Integrate from a state and return the result; ``redundant`` constraints follow from the others.

    ``typed`` are kernels in the type to integrate in, those of the evaluator when absent; ``tangent`` the
    kernels of the analysis of that name, for methods that need it.

    Raises
    ------
    SimulationError
        When the run cannot go on, naming time and cause; the error carries what was recorded till then.
    """
    if chosen.t_end <= t0:
        raise ModelError(f"expected t_end after the start at t = {t0:g} s, got {chosen.t_end:g} s")
    allowed = slack(evaluator, q)
    if typed is not None:
        allowed = typed.precision.coarsened(allowed)
    equations = evaluator.equations(
        len(redundant), allowed, stabilisation=chosen.rate, typed=typed, tangent=tangent
    )
    times = np.linspace(t0, chosen.t_end, chosen.samples)
    times[-1] = chosen.t_end
    y0 = np.concatenate([q, u, np.zeros(equations.extra)])
    if not np.all(np.isfinite(y0)):
        raise ModelError("the start state holds a number that is not finite")
    stepper = _core.Run(
        equations,
        chosen.method,
        t0,
        y0,
        chosen.t_end,
        chosen.rtol,
        chosen.atol,
        chosen.step,
        times,
        stabilisation=_core.STABILISATIONS.index(chosen.stabilisation),
        max_drift=chosen.max_drift,
        directions=[e.direction for e in evaluator.description.events],
        terminal=[e.ends_run for e in evaluator.description.events],
    )
    status, wall = drive(stepper, t0, chosen, progress)
    library = typed.kernels(False) if typed and not typed.is_plain else evaluator.library
    result = recorded(evaluator, equations, stepper, redundant, chosen, wall, library)
    if status in (_core.DONE, _core.ENDED):
        return result
    raise SimulationError(
        _problem(status, stepper, equations, evaluator, chosen),
        time=stepper.t,
        partial=result if stepper.recorded else None,
    )


def drive(stepper: _core.Run, t0: float, chosen: Options, progress: Progress | None) -> tuple[int, float]:
    """Step to the end in chunks of time; return the last status and the wall time [s]."""
    begun = time.perf_counter()
    status = stepper.begin()
    chunk, tick = 256, begun
    while status == _core.MORE:
        if stepper.steps >= chosen.max_steps:
            break
        status = stepper.advance(min(chunk, chosen.max_steps - stepper.steps))
        now = time.perf_counter()
        chunk = max(16, min(1 << 20, int(chunk * _CHUNK_SECONDS / max(now - tick, 1e-6))))
        tick = now
        if progress:
            progress((stepper.t - t0) / (chosen.t_end - t0))
    return status, time.perf_counter() - begun


def _problem(
    status: int,
    stepper: _core.Run,
    equations: _core.Equations,
    evaluator: Evaluator,
    chosen: Options,
) -> str:
    description = evaluator.description
    free, axes = description.free, description.axes
    at = f"at t = {stepper.t:.9g} s after {stepper.steps} steps"
    where = ", ".join(
        f"{p} ({', '.join(f'{x:.6g}' for x in stepper.state[i * len(axes) : (i + 1) * len(axes)])}) m"
        for i, p in enumerate(free[:8])
    )
    if status == _core.DRIFTED:
        return (
            f"{description.labels[stepper.worst]} strayed by {stepper.position_drift:.2g} m, more than "
            f"max_drift = {chosen.max_drift:g} m, {at}\n  Use the stabilisation 'projection', tighter "
            f"tolerances or a smaller step. State: {where}."
        )
    if status == _core.CONTRADICTED:
        return (
            f"a redundant constraint contradicts the others by {equations.missed:.2g} m {at}: the linkage "
            "cannot be in two places\n  Make the lengths, drives and motions of the ground agree. "
            f"State: {where}."
        )
    if status == _core.SINGULAR and equations.lost < equations.redundant:
        return (
            f"a constraint that was redundant at the start is no longer so {at}: the linkage contradicts "
            f"itself by more than can be told from a free motion\n  State: {where}."
        )
    if status == _core.SINGULAR:
        name = description.unknown(equations.weakest)
        if equations.weakest < description.coordinates:
            return f"the mass matrix lost its positive definiteness {at}: {name} carries no mass"
        return (
            f"the constraints lost rank {at}: {name} is no longer independent of the others (a dead centre "
            f"of the linkage, or a redundant link)\n  State: {where}."
        )
    near_lost_rank = _near_singular(stepper, equations, description)
    if status == _core.UNSOLVED and not near_lost_rank:
        return (
            f"the implicit equations of a step of {chosen.method.name} could not be solved {at}: the step is "
            f"too large for the motion\n  Use a smaller step. State: {where}."
        )
    if status == _core.PROJECTION_FAILED and not near_lost_rank:
        return (
            f"the state could not be brought back onto the constraints {at}: the step is too large for the "
            f"motion, or the start is off the constraints\n  Use a smaller step or tighter tolerances. "
            f"State: {where}."
        )
    if status in (_core.PROJECTION_FAILED, _core.UNSOLVED) or (
        status == _core.STEP_TOO_SMALL and near_lost_rank
    ):
        cause = "the linkage comes to a dead centre, which it cannot be taken through"
        hint = "Start elsewhere, or change the lengths."
        if description.drives:
            cause = "the linkage comes to a dead centre, beyond which its drives cannot take it"
            hint = "'symgen kinematics SCENE' shows how far the drives go."
        return f"the run cannot go on {at}{near_lost_rank}: {cause}\n  {hint} State: {where}."
    q, u, _ = np.split(stepper.state, [description.coordinates, 2 * description.coordinates])
    reached = 2 * stepper.h * float(np.max(np.abs(u), initial=0.0))
    line = without_direction(evaluator, stepper.t, q, u, reached)
    near = f"; {line}" if line else near_lost_rank
    if status == _core.NOT_FINITE:
        return (
            f"a number that is not finite appeared in the step {at}{near}\n"
            f"  Use a smaller step. Last good state: {where}."
        )
    if status == _core.STEP_TOO_SMALL:
        return (
            f"the step became too small to go on {at}: the tolerance cannot be met there"
            f"{near or _stiff(stepper)}"
            f"\n  Loosen rtol and atol. State: {where}."
        )
    return f"the run was not finished within max_steps, {at}\n  Raise max_steps or shorten the run."


def _stiff(stepper: _core.Run) -> str:
    if stepper.stiff:
        return f", the motion has been stiff since t = {stepper.t_stiff:.6g} s"
    return ", the motion may be stiff"


def _near_singular(stepper: _core.Run, equations: _core.Equations, description: Description) -> str:
    """Say so when the constraints of the last good state are close to losing rank."""
    equations.check(stepper.t, np.append(stepper.state, 0.0))
    if equations.soundness > _NEAR:
        return ""
    name = description.unknown(equations.weakest)
    return f"; the constraints nearly lose rank there: {name} keeps {equations.soundness:.1e} of its pivot"
