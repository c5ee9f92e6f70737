"""One run of an elastic motion, by any method, and what is said of it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError, SimulationError
from symgen.runtime import _beams
from symgen.runtime.beam_checks import warnings
from symgen.runtime.beam_forces import Motion, forces
from symgen.runtime.beam_methods import BEAM_METHODS
from symgen.runtime.beam_recovery import recovered
from symgen.runtime.checkpoint import Keeping
from symgen.runtime.elastic_modes import quasi_static
from symgen.runtime.elastic_motion import ElasticMotion
from symgen.runtime.elastic_periodic import periodic
from symgen.runtime.elastic_result import ElasticResult, is_stable, outputs
from symgen.runtime.elastic_steps import Found, Task, doubled, explicit, recorded_times
from symgen.runtime.result import Drift
from symgen.runtime.typed import made_with

Array = NDArray[np.float64]
Progress = Callable[[float], None]

#: How near one a multiplier may come: double ones, of a free crank, are split by the root of round-off.
_UNIT = 1e-4


def run(
    motion: ElasticMotion, task: Task, progress: Progress | None, keeping: Keeping | None = None
) -> ElasticResult:
    """Return the result of a run.

    Raises
    ------
    ModelError
        For options out of range, or a method that does not suit the linkage.
    SimulationError
        When the linkage cannot turn, or the motion grows out of all bounds.
    ResultError
        When a checkpoint cannot be written, or is of another run.
    """
    if keeping is not None and task.method in ("quasi-static", "periodic"):
        raise ModelError(
            f"there are no checkpoints of {task.method} motions: they are not found step by step in time"
        )
    times = recorded_times(motion, task)
    equations = motion.equations(task.form == "thesis", stepping=True)
    if task.form == "thesis":
        _check_thesis(motion)
    begun = time.perf_counter()
    if task.method == "quasi-static":
        found = Found(quasi_static(motion, equations, times), None, len(times))
    elif task.method == "periodic":
        found = periodic(motion, equations, task, times)
    elif task.method in BEAM_METHODS:
        found = doubled(motion, equations, task, times, progress, keeping)
    else:
        found = explicit(motion, equations, task, times, progress, keeping)
    wall = found.spent + time.perf_counter() - begun
    if not np.all(np.isfinite(found.displacements)):
        raise SimulationError(
            f"{motion.rigid.name}: the motion grows out of all bounds: the step is too long for "
            f"{task.method}, or the motion is unstable\n"
            "  Take more steps, or look at the Floquet multipliers: method periodic."
        )
    return _result(motion, equations, task, times, found, wall)


def _check_thesis(motion: ElasticMotion) -> None:
    """Refuse the thesis' form where what rigid links leave free turns: without R' it is no definite form."""
    status, *_, basis = motion.equations().matrices(0.0)
    motion.check(motion.equations(), status, 0.0)
    if basis is not None and np.any(basis[1]):
        raise ModelError(
            f"{motion.rigid.name}: where links keep their length, the thesis' form depends on the "
            "coordinates\n"
            "  Let them stretch: axial = true under elastic, on every link that moves and is not the crank."
        )


def _result(
    motion: ElasticMotion,
    equations: _beams.BeamEquations,
    task: Task,
    times: Array,
    found: Found,
    wall: float,
) -> ElasticResult:
    d = motion.rigid.description
    q, links, loads = motion.rigid_motion(equations, times)
    thesis = task.form == "thesis"
    whole = Motion(times, q, links, loads, found.displacements, found.rates, thesis)
    variables = [*outputs(motion, links, found.displacements), *recovered(motion, whole)]
    variables += forces(motion, equations, whole)
    notes = [*_of_speed(motion), *_of_stability(found)]
    notes += _of_reductions(motion)
    notes += _of_lengths(motion)
    notes += warnings(motion, whole, _moments(motion, times))
    if task.at is not None and task.method != "quasi-static":
        notes.append("peaks, and limits of linear theory, are those at the crank angles asked for only")
    if thesis:
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
            "floquet_error": found.floquet_error,
        },
        provenance={
            "kind": "elastic",
            "equations": d.equations,
            "method": task.method,
            "form": task.form,
            "rtol": task.rtol,
            "t_end": float(np.max(times)),
            **made_with(motion.rigid.evaluator.library, motion.rigid.typed),
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
    crank, lowest = abs(motion.speed) / (2 * math.pi), motion.lowest_frequency
    if crank < lowest:
        return []
    return [
        f"the crank turns at {crank:.4g} Hz, above the first critical speed: the lowest frequency of the "
        f"structure over the turn is {lowest:.4g} Hz"
    ]


def _of_lengths(motion: ElasticMotion) -> list[str]:
    """Say whose stress lacks that of the axial force."""
    kept = [b.info.link for b in motion.beams if not b.info.axial]
    if not kept:
        return []
    return [f"{', '.join(kept)}: kept at constant length, so that stress is that of bending only"]


def _of_reductions(motion: ElasticMotion) -> list[str]:
    """Say of which links the estimated error is not the whole one."""
    return [
        f"{info.link}: reduced ({info.reduction}): what that leaves out is not in the estimated error"
        + ("; loads between its ends do not bend it" if info.reduction == "guyan" else "")
        for info in (beam.info for beam in motion.beams)
        if info.reduction
    ]


def _of_stability(found: Found) -> list[str]:
    if not found.floquet:
        return []
    stable = is_stable(abs(found.floquet[0]), found.floquet_error)
    if stable is None:
        return [
            "not known whether it is stable: the Floquet multipliers still change as steps are halved, by "
            "vibrations that these do not resolve; take more steps a turn, or a reduction"
        ]
    nearest = min(abs(z - 1.0) for z in found.floquet)
    if stable and nearest < _UNIT:
        return [
            f"a Floquet multiplier is one within {nearest:.1g}: the steady state is not the only one, or in "
            "resonance; which is shown is left to round-off"
        ]
    if stable:
        return []
    return [
        f"unstable: the largest Floquet multiplier is {abs(found.floquet[0]):.6g}; the steady state found "
        "grows away from itself by that factor a turn"
    ]
