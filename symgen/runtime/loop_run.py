"""The motion of a loop under forces: the compiled step loop over its joint variables."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from symgen.errors import SimulationError
from symgen.runtime import _core, _loop
from symgen.runtime.checkpoint import Keeping, mark_of
from symgen.runtime.failures import unfinished
from symgen.runtime.loop_kernels import LoopKernels, in_words
from symgen.runtime.loop_start import Closed, scaled_screws
from symgen.runtime.options import Options
from symgen.runtime.result import Drift, Result
from symgen.runtime.simulate import drive
from symgen.runtime.turn import converters, variables
from symgen.runtime.typed import library_of_runs, made_with

Array = NDArray[np.float64]

_AXES = ("x", "y", "z")


def run(
    kernels: LoopKernels,
    begin: Closed,
    chosen: Options,
    progress: Callable[[float], None] | None,
    keeping: Keeping | None = None,
) -> Result:
    """Integrate from the closed start and return the result, outputs in the scene's units.

    Raises
    ------
    SimulationError
        When the run cannot go on, naming time, row and cause; the error carries what was recorded till then.
    ResultError
        When a checkpoint cannot be written, or is of another run.
    """
    d = kernels.description
    equations = kernels.stepping([*d.having("dependent"), *d.having("free")], begin.rank)
    y0 = np.concatenate([begin.q, rates_at_start(kernels, begin), [0.0]])
    times = np.linspace(begin.t, chosen.t_end, chosen.samples)
    stepper = _core.Run(
        equations,
        chosen.method,
        begin.t,
        y0,
        chosen.t_end,
        chosen.rtol,
        chosen.atol,
        chosen.step,
        times,
        stabilisation=_core.STABILISATIONS.index(chosen.stabilisation),
        max_drift=chosen.max_drift,
    )
    checkpoints = None
    if keeping is not None:
        library = library_of_runs(kernels.library, kernels.typed)
        checkpoints = keeping.of(stepper, mark_of(kernels, library, equations, chosen, begin.t, y0))
    status, wall = drive(stepper, begin.t, chosen, progress, checkpoints)
    result = _recorded(kernels, equations, stepper, chosen, wall)
    if status == _core.DONE:
        return result
    problem = _problem(kernels, stepper, chosen, status)
    raise SimulationError(problem, time=stepper.t, partial=result if stepper.recorded else None)


def rates_at_start(kernels: LoopKernels, begin: Closed) -> Array:
    """Return the rates at the start: those given, and the dependent ones that go with them."""
    d = kernels.description
    u = np.array([v.start_rate for v in d.variables])
    u[kernels.inputs] = kernels.prescribed(begin.t)[:, 1]
    scale = np.array([d.size if v.is_length else 1.0 for v in d.variables])
    solved, given = d.having("dependent"), d.having("input", "free")
    screws = scaled_screws(kernels, begin.t, begin.q)
    asked = screws[:, given] @ (u / scale)[given]
    u[solved] = -np.linalg.lstsq(screws[:, solved], asked, rcond=None)[0] * scale[solved]
    return u


def _recorded(
    kernels: LoopKernels,
    equations: _loop.LoopEquations,
    stepper: _core.Run,
    chosen: Options,
    wall: float,
) -> Result:
    d = kernels.description
    n, times = d.coordinates, stepper.sampled
    info = d.kernel("outputs")
    rows = np.column_stack([stepper.result, np.zeros(len(times))])
    out = np.zeros((len(times), (info.out_size if info else 0) + 1))
    if len(times) and info:
        # States are recorded as doubles, and outputs follow from them.
        solver = kernels.equations([*d.having("dependent"), *d.having("free")], equations.rank)
        found = solver.solutions(times, rows)
        work = np.zeros((len(times), kernels.work_size + 1))
        work[:, : n + 6] = found[:, : n + 6]
        _core.call_many(kernels.library.addresses["outputs"], times, rows, n, kernels.parameters, work, out)
    q, u = np.split(stepper.state[: 2 * n], 2)
    units = converters(d)
    return Result(
        name=d.name,
        title=d.title,
        axes=_AXES,
        time=times,
        variables=tuple(variables(d, out)),
        drift=Drift(
            stepper.position_drift,
            stepper.velocity_drift,
            stepper.energy_drift,
            max(
                stepper.kinetic_max - stepper.kinetic_min, stepper.potential_max - stepper.potential_min, 0.0
            ),
        ),
        final={
            v.name: {"value": x / units[v.unit][1], "rate": s / units[v.unit][1], "unit": units[v.unit][0]}
            for v, x, s in zip(d.variables, q.tolist(), u.tolist(), strict=True)
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
            "equations": d.equations,
            "method": chosen.method.name,
            "rtol": chosen.rtol,
            "atol": chosen.atol,
            "step": chosen.step,
            "t_end": chosen.t_end,
            "stabilisation": chosen.stabilisation,
            **made_with(kernels.library, kernels.typed),
            "parameters": {p.name: x for p, x in zip(d.parameters, kernels.given.tolist(), strict=True)},
        },
    )


def _component(entry: int, size: float) -> str:
    """Return in words an entry of the closure (3 x 4, row by row)."""
    row, column = divmod(entry, 4)
    if column == 3:
        return f"displacement along {_AXES[row]} of frame 1"
    # a small rotation is seen in the entries off the diagonal, that about an axis in those of the other two
    about = "" if row == column else f" about {_AXES[3 - row - column]} of frame 1"
    return f"rotation{about}, times {size:.4g} m"


def _problem(kernels: LoopKernels, stepper: _core.Run, chosen: Options, status: int) -> str:
    d = kernels.description
    q = stepper.state[: d.coordinates]
    solved = d.having("dependent", "free")
    _, values, right = np.linalg.svd(scaled_screws(kernels, stepper.t, q)[:, solved])
    rank = d.rank
    weakest = d.row(solved[int(np.argmax(np.abs(right[min(rank, len(right)) - 1])))])
    at = f"at t = {stepper.t:.9g} s after {stepper.steps} steps"
    where = ", ".join(
        f"{v.name} {in_words(float(x), v.is_length, d)}" for v, x in zip(d.variables, q, strict=True)
    )
    if status == _core.DRIFTED:
        return (
            f"the closure of the loop strayed by {stepper.position_drift:.4g} m "
            f"({_component(stepper.worst, d.size)}), more than max_drift = {chosen.max_drift:g} m, {at}\n"
            f"  Use the stabilisation 'projection', tighter tolerances or a smaller step. State: {where}."
        )
    near = values[rank - 1] / values[0]
    if status == _core.NOT_FINITE:
        return (
            f"no finite accelerations {at}: a free motion has no inertia, or a load has no value there\n"
            f"  Give the links that move freely a mass and an inertia. State: {where}."
        )
    if status == _core.SINGULAR or near < 1e-2:
        return (
            f"the run cannot go on {at}: the screws lose rank there (least singular value {near:.1e} of the "
            f"largest, {weakest} the least held), a dead centre of the loop\n  State: {where}."
        )
    if status == _core.PROJECTION_FAILED:
        return f"the loop could not be closed again {at}: the step is too large\n  State: {where}."
    if status == _core.STEP_TOO_SMALL:
        return (
            f"the step became too small to go on {at}: the tolerance cannot be met there\n"
            f"  Loosen rtol and atol. State: {where}."
        )
    return unfinished(stepper, chosen, at)
