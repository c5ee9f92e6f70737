"""One run: options checked, the compiled loop driven in chunks, outputs evaluated, drift gathered."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError, SimulationError
from symgen.runtime import _core
from symgen.runtime.causes import without_direction
from symgen.runtime.description import Description
from symgen.runtime.evaluate import Evaluator, part
from symgen.runtime.integrators import integrator
from symgen.runtime.integrators.tableau import ExplicitRungeKutta
from symgen.runtime.result import Drift, Result, Variable

Array = NDArray[np.float64]
Progress = Callable[[float], None]

#: Tightest relative tolerance that float64 can meet.
TIGHTEST = 100 * np.finfo(float).eps
_CHUNK_SECONDS = 0.05
#: Pivots that keep less than this are worth a word when a run fails.
_NEAR = 1e-3


@dataclass(frozen=True, slots=True)
class Options:
    """How to run: checked by :func:`options`."""

    method: ExplicitRungeKutta
    t_end: float
    rtol: float
    atol: float
    step: float
    samples: int
    max_steps: int


def options(
    t_end: float,
    method: str | None,
    rtol: float | None,
    atol: float | None,
    step: float | None,
    samples: int,
    max_steps: int,
) -> Options:
    """Check the options of a run and fill in the defaults.

    Raises
    ------
    ModelError
        When one is out of its range, or does not go with the method.
    """
    chosen = integrator(method or ("dop853" if step is None else "rk4"))
    for name, value in (("t_end", t_end), ("rtol", rtol), ("atol", atol), ("step", step)):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise ModelError(f"expected {name} to be a finite number above zero, got {value!r}")
    if not 2 <= samples <= 10_000_000:
        raise ModelError(f"expected between 2 and 10 million samples, got {samples}")
    if max_steps < 1:
        raise ModelError(f"expected max_steps of at least 1, got {max_steps}")
    if chosen.adaptive:
        if step is not None:
            raise ModelError(f"{chosen.name} chooses its own step: give rtol and atol, or another method")
        rtol = 1e-9 if rtol is None else rtol
        if rtol < TIGHTEST:
            raise ModelError(f"rtol = {rtol:g} is below {TIGHTEST:.2g}, the tightest that float64 can meet")
        return Options(chosen, t_end, rtol, 1e-3 * rtol if atol is None else atol, 0.0, samples, max_steps)
    if rtol is not None or atol is not None:
        raise ModelError(f"{chosen.name} has a fixed step: give step instead of rtol and atol")
    if step is None:
        raise ModelError(f"{chosen.name} has a fixed step: give it one, such as step=1e-3")
    if step < 1e-12 * t_end:
        raise ModelError(f"step = {step:g} s is too small against t_end = {t_end:g} s for float64")
    return Options(chosen, t_end, 0.0, 0.0, step, samples, max_steps)


def run(
    evaluator: Evaluator, t0: float, q: Array, u: Array, chosen: Options, progress: Progress | None
) -> Result:
    """Integrate from a state and return the result.

    Raises
    ------
    SimulationError
        When the run cannot go on, naming time and cause; the error carries what was recorded till then.
    """
    if chosen.t_end <= t0:
        raise ModelError(f"expected t_end after the start at t = {t0:g} s, got {chosen.t_end:g} s")
    equations = equations_of(evaluator)
    times = np.linspace(t0, chosen.t_end, chosen.samples)
    times[-1] = chosen.t_end
    y0 = np.concatenate([q, u, np.zeros(equations.extra)])
    if not np.all(np.isfinite(y0)):
        raise ModelError("the start state holds a number that is not finite")
    stepper = _core.Stepper(
        equations, chosen.method, t0, y0, chosen.t_end, chosen.rtol, chosen.atol, chosen.step, times
    )
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
    wall = time.perf_counter() - begun
    result = _result(evaluator, stepper, times, chosen, wall, equations)
    if status == _core.DONE:
        return result
    raise SimulationError(
        _problem(status, stepper, equations, evaluator),
        time=stepper.t,
        partial=result if stepper.recorded else None,
    )


def equations_of(evaluator: Evaluator) -> _core.Equations:
    """Return the compiled view of a model's kernels."""
    description = evaluator.description
    return _core.Equations(
        evaluator.library.addresses,
        description.coordinates,
        len(description.constraints),
        int(description.work_of_loads),
        evaluator.parameters[:-1],
        evaluator.work_size,
        description.first_pivot,
    )


def weakest_name(index: int, description: Description) -> str:
    """Return what an unknown of the equations of motion is called in messages."""
    axes, n = description.axes, description.coordinates
    if index < n:
        return f"the {axes[index % len(axes)]} motion of point {description.free[index // len(axes)]}"
    return description.labels[index - n]


def _problem(
    status: int,
    stepper: _core.Stepper,
    equations: _core.Equations,
    evaluator: Evaluator,
) -> str:
    description = evaluator.description
    free, axes = description.free, description.axes
    at = f"at t = {stepper.t:.9g} s after {stepper.steps} steps"
    where = ", ".join(
        f"{p} ({', '.join(f'{x:.6g}' for x in stepper.state[i * len(axes) : (i + 1) * len(axes)])}) m"
        for i, p in enumerate(free[:8])
    )
    if status == _core.SINGULAR:
        name = weakest_name(equations.weakest, description)
        if equations.weakest < description.coordinates:
            return f"the mass matrix lost its positive definiteness {at}: {name} carries no mass"
        return (
            f"the constraints lost rank {at}: {name} is no longer independent of the others (a dead centre "
            f"of the linkage, or a redundant link)\n  State: {where}."
        )
    if status == _core.PROJECTION_FAILED:
        return (
            f"the state could not be brought back onto the constraints {at}: the step is too large for the "
            f"motion\n  Use a smaller step or tighter tolerances. State: {where}."
        )
    q, u, _ = np.split(stepper.state, [description.coordinates, 2 * description.coordinates])
    reached = 2 * stepper.h * float(np.max(np.abs(u), initial=0.0))
    line = without_direction(evaluator, stepper.t, q, u, reached)
    near = f"; {line}" if line else _near_singular(stepper, equations, description)
    if status == _core.NOT_FINITE:
        return (
            f"a number that is not finite appeared in the step {at}{near}\n"
            f"  Use a smaller step. Last good state: {where}."
        )
    if status == _core.STEP_TOO_SMALL:
        return (
            f"the step became too small to go on {at}: the tolerance cannot be met there"
            f"{near or ', the motion may be stiff'}"
            f"\n  Loosen rtol and atol. State: {where}."
        )
    return f"the run was not finished within max_steps, {at}\n  Raise max_steps or shorten the run."


def _near_singular(stepper: _core.Stepper, equations: _core.Equations, description: Description) -> str:
    """Say so when the constraints of the last good state are close to losing rank."""
    equations.check(stepper.t, np.append(stepper.state, 0.0))
    if equations.soundness > _NEAR:
        return ""
    name = weakest_name(equations.weakest, description)
    return f"; the constraints nearly lose rank there: {name} keeps {equations.soundness:.1e} of its pivot"


def _result(
    evaluator: Evaluator,
    stepper: _core.Stepper,
    times: Array,
    chosen: Options,
    wall: float,
    equations: _core.Equations,
) -> Result:
    description = evaluator.description
    recorded = stepper.recorded
    states = np.ascontiguousarray(stepper.result)
    variables = []
    info = description.kernel("outputs")
    if info is not None and recorded:
        out = np.zeros((recorded, info.out_size + 1))
        addresses = evaluator.library.addresses
        work = np.zeros(evaluator.work_size + description.coordinates + len(description.constraints) + 1)
        first = addresses["accelerations"] if info.work_size else 0
        _core.call_many(
            addresses["outputs"],
            first,
            np.ascontiguousarray(times[:recorded]),
            np.column_stack([states, np.zeros(recorded)]),
            description.coordinates,
            evaluator.parameters,
            np.zeros(evaluator.work_size + 1),
            work,
            out,
        )
        variables = [
            Variable(b.name, b.unit, b.about, b.rows, _squeezed(part(out, b), b.shape)) for b in info.blocks
        ]
    final = evaluator.blocks("points", stepper.t, *np.split(stepper.state[: 2 * description.coordinates], 2))
    drift = Drift(
        constraint=stepper.position_drift,
        velocity=stepper.velocity_drift,
        energy=stepper.energy_drift,
        energy_exchanged=max(
            stepper.kinetic_max - stepper.kinetic_min, stepper.potential_max - stepper.potential_min, 0.0
        ),
    )
    return Result(
        name=description.name,
        title=description.title,
        axes=description.axes,
        time=times[:recorded],
        variables=tuple(variables),
        drift=drift,
        final={
            p: {"position": final["positions"][i].tolist(), "velocity": final["velocities"][i].tolist()}
            for i, p in enumerate(description.points)
        },
        statistics={
            "t": stepper.t,
            "steps": stepper.steps,
            "rejected": stepper.rejected,
            "evaluations": equations.evaluations,
            "factorisations": equations.factorisations,
            "wall_s": wall,
        },
        provenance={
            "equations": description.equations,
            "method": chosen.method.name,
            "rtol": chosen.rtol,
            "atol": chosen.atol,
            "step": chosen.step,
            "t_end": chosen.t_end,
            "backend": evaluator.library.backend,
            "parameters": {
                p.name: value
                for p, value in zip(description.parameters, evaluator.parameters.tolist(), strict=False)
            },
        },
    )


def _squeezed(values: Array, shape: tuple[int, int]) -> Array:
    return values[..., 0] if shape == (1, 1) else values
