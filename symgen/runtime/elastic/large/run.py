"""Runs of elastic links in large rotation, by beam elements: steps by their error, recorded outputs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError, SimulationError
from symgen.runtime.beams.energies import Energies
from symgen.runtime.beams.forces import joint_force, torque
from symgen.runtime.beams.methods import GAUSS8
from symgen.runtime.elastic.exact import rigid_places, stiffness_damped
from symgen.runtime.elastic.large.collocation import Moment, moved, stacked
from symgen.runtime.elastic.large.linkage import LargeLinkage
from symgen.runtime.elastic.large.passes import RTOL, Pass, refine
from symgen.runtime.elastic.mesh import mesh_error
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.elastic.outputs import (
    bow,
    coordinate_of,
    displacement,
    length_change,
    selected,
    strains,
)
from symgen.runtime.elastic.steps import check_revolutions, turn
from symgen.runtime.integrate.pace import OutOfTime, Pace, limited, out_of_time, wall_left
from symgen.runtime.kernels.arguments import count as whole
from symgen.runtime.kernels.arguments import real
from symgen.runtime.kernels.typed import made_with
from symgen.runtime.model.arguments import LargeRotation
from symgen.runtime.result.elastic import ElasticResult
from symgen.runtime.result.records import Drift, Variable, of_model

Array = NDArray[np.float64]

#: Steps of a revolution, or of a run without, that a run starts with.
_STEPS = 128
#: Rotation of the crank in a step at most, over that in a stride of the rigid motion.
_STRIDES = 5.0
#: The most elements of a link.
_MOST_ELEMENTS = 1000


def large_run(motion: ElasticMotion, task: LargeRotation, elements: int) -> ElasticResult:
    """Return strains, forces and displacements of a linkage with its elastic links in elements.

    Raises
    ------
    ModelError
        For options out of range, or a linkage with what these elements do not support.
    SimulationError
        If the run cannot continue.
    """
    elements = whole(elements, "elements")
    if not 1 <= elements <= _MOST_ELEMENTS:
        raise ModelError(f"expected from 1 to {_MOST_ELEMENTS} elements of an elastic link, got {elements}")
    if task.checkpoint is not None or task.resume is not None:
        raise ModelError(
            "there are no checkpoints of runs in elements of large rotation\n"
            "  Leave checkpoint and resume out, or run in segments."
        )
    check_revolutions(motion, task.revolutions)
    rtol = real(RTOL if task.rtol is None else task.rtol, "rtol")
    if not 0.0 < rtol < 1.0:
        raise ModelError(f"expected rtol above zero and below 1, got {rtol!r}")
    task = replace(task, rtol=rtol)
    samples = whole(task.samples, "samples")
    if samples < 2:
        raise ModelError(f"expected 2 samples or more, got {samples}")
    if task.max_step is not None and not real(task.max_step, "max_step") > 0.0:
        raise ModelError(f"expected max_step above zero, got {task.max_step!r}")
    end = turn(motion) * task.revolutions
    times = np.linspace(0.0, end, samples)
    least = max(_STEPS * task.revolutions, end / (_STRIDES * motion.stride))
    if task.max_step is not None:
        least = max(least, end / task.max_step)
    linkage, pace = LargeLinkage(motion, elements), Pace(0.0, end)
    passes = list[Pass]()
    try:
        refine(
            passes, linkage, partial(_outputs, motion, linkage), partial(drift_of, linkage),
            times, least, rtol, pace, task.progress,
        )  # fmt: skip
    except OutOfTime as stop:
        raise _out_of_time(motion, linkage, task, times, stop, passes, pace) from None
    made = _result(motion, linkage, task, times, passes[-1], pace.wall)
    made._estimate_later(partial(_by_elements, motion, elements, times, passes[-1], wall_left()))
    return made


def _by_elements(
    motion: ElasticMotion, elements: int, times: Array, coarse: Pass, max_wall: float | None
) -> float | None:
    """Return by how much stresses change in twice as many elements, over their peak; None if not known."""
    with limited(max_wall):
        finer = LargeLinkage(motion, 2 * elements)
        try:
            found, _ = moved(finer, GAUSS8, times, coarse.steps, Pace(0.0, float(times[-1])))
        except (OutOfTime, SimulationError):
            return None
        return mesh_error(coarse.variables, _outputs(motion, finer, found))


def _out_of_time(
    motion: ElasticMotion,
    linkage: LargeLinkage,
    task: LargeRotation,
    times: Array,
    stop: OutOfTime,
    passes: Sequence[Pass],
    pace: Pace,
) -> SimulationError:
    """Return the error of a run that took all of its wall time, with its last motion."""
    problem = f"{motion.rigid.name}: {out_of_time(stop.t, float(times[-1]))}"
    last, reached = passes[-1] if passes else None, times
    if last is None:
        reached = times[stop.reached]
        variables = _outputs(motion, linkage, stop.found)
        last = Pass(variables, 0, 0, math.inf, drift_of(linkage, stop.found))
    partial_result = _result(motion, linkage, task, reached, last, pace.wall)
    return SimulationError(problem, time=stop.t, partial=partial_result)


def _outputs(motion: ElasticMotion, linkage: LargeLinkage, found: Sequence[Moment]) -> list[Variable]:
    times, q, v, a, multipliers = stacked(found)
    d, made = motion.rigid.description, list[Variable]()
    for name, k, at, fibre in motion.stations:
        link = linkage.links[k]
        axial, curvature = link.strains(q, v, a, at)
        made += strains(name, link.beam, at, fibre * curvature, axial)
    rigid = rigid_places(motion, times)
    for k, point in enumerate(d.free):
        place = q[:, 2 * k : 2 * k + 2]
        made.append(displacement(point, place - rigid[point]))
        made.append(Variable(f"{point}.position", "m", f"position of {point}", ("x", "y"), place))
    for link in linkage.links:
        info, name = link.beam.info, link.beam.info.link
        first, last = (q[:, link.places[end, :2]] for end in (0, -1))
        made.append(length_change(name, np.linalg.norm(last - first, axis=1) - link.beam.properties.length))
        ends = link.end_forces(q, v, a)
        for point, force in ((info.start, ends[:, 0, :2]), (info.end, ends[:, -1, 3:5])):
            made.append(joint_force(name, point, force))
    for name, k, at, _ in motion.stations:
        made.append(bow(name, linkage.links[k].beam, at, linkage.links[k].deflection(q, at)))
    if (of_shaft := linkage.torque(times, q, v, a, multipliers)) is not None:
        made.append(torque(motion.info.crank, of_shaft))
    kinetic, strain, potential, dissipated = linkage.energies(times, q, v, a)
    # Loads on elastic links have no potential energy among those of rigid parts.
    known = None if linkage.loaded else potential
    return [*made, *Energies(kinetic, strain, known, dissipated, None, None, None).variables()]


def drift_of(linkage: LargeLinkage, found: Sequence[Moment]) -> Drift:
    """Return the largest errors of the constraints, and of the energy where all forces are accounted for."""
    t, q, v, a, _ = stacked(found)
    errors, rates = [linkage.errors(m.t, m.q) for m in found], linkage.rates(t, q, v)
    energy = exchanged = math.nan
    if linkage.motion.info.shaft_alone and not linkage.loaded:
        kinetic, strain, potential, _ = linkage.energies(t, q, v, a)
        balance = kinetic + strain + potential - [m.work for m in found]
        energy = float(np.max(np.abs(balance - balance[0])))
        exchanged = float(max(np.ptp(kinetic), np.ptp(strain + potential)))
    constraint, velocity = (float(np.max(np.abs(x), initial=0.0)) for x in (errors, rates))
    return Drift(constraint, velocity, energy, exchanged)


def _result(
    motion: ElasticMotion,
    linkage: LargeLinkage,
    task: LargeRotation,
    times: Array,
    one: Pass,
    wall: float,
) -> ElasticResult:
    d = motion.rigid.description
    return ElasticResult(
        **of_model(
            d,
            motion.rigid.parameters,
            method="large-rotation",
            form=f"{task.elements} elements a link",
            rtol=task.rtol,
            t_end=float(times[-1]),
            **made_with(motion.rigid.evaluator.library, motion.rigid.typed),
        ),
        axes=d.axes,
        coordinate=coordinate_of(motion, times),
        variables=selected(one.variables, motion),
        drift=one.drift,
        final={},
        statistics={
            "unknowns": linkage.unknowns - linkage.multipliers,
            "steps": one.steps * (len(times) - 1),
            "corrections": one.corrections,
            "error": one.error if math.isfinite(one.error) else None,
            "wall_s": wall,
            "floquet": [],
            "floquet_error": None,
        },
        notes=(
            *d.remarks,
            *stiffness_damped(motion, "elements in large rotation"),
            *_unlike(motion, one, task.rtol),
        ),
        times=times if motion.speed else None,
    )


def _unlike(motion: ElasticMotion, one: Pass, rtol: float | None) -> Iterator[str]:
    """Yield notes on an error above the tolerance, and on links that stretch against the scene."""
    if rtol is not None and one.error > rtol:
        yield (
            f"the error by time steps does not reach rtol = {rtol:g}: links vibrate from an abrupt start, "
            "undamped, too fast for the steps; give a shorter run, damping, or shorter steps by max_step"
        )
    stretching = [beam.info.link for beam in motion.beams if not beam.info.axial]
    if stretching:
        yield f"elements in large rotation stretch, though {', '.join(stretching)} has axial = false"
