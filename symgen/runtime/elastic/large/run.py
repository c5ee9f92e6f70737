"""Runs and equilibria of elastic links in large rotation, by beam elements, and their outputs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from symgen.errors import ModelError, OptionsError
from symgen.runtime.arrays import Array
from symgen.runtime.beams.energies import Energies
from symgen.runtime.beams.forces import joint_force, torque
from symgen.runtime.elastic.control.run import controlled_run
from symgen.runtime.elastic.control.stepper import SystemStepper, stepper
from symgen.runtime.elastic.large.collocation import MotionState, stacked
from symgen.runtime.elastic.large.linkage import LargeLinkage
from symgen.runtime.elastic.large.passes import LargeMotion, refined_run
from symgen.runtime.elastic.large.shaking import in_large_rotation
from symgen.runtime.elastic.large.statics import described, resting
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.elastic.outputs import (
    bow,
    coordinate_of,
    displacement,
    length_change,
    of_states,
    strains,
)
from symgen.runtime.elastic.run import outputs_of_runs
from symgen.runtime.elastic.steps import check_revolutions, turn
from symgen.runtime.integrate.pace import limited, unlimited
from symgen.runtime.kernels.arguments import count as whole
from symgen.runtime.kernels.arguments import real
from symgen.runtime.model.elastic_arguments import ElasticRun, ElasticStepping, LargeRotation
from symgen.runtime.result.elastic import ElasticResult
from symgen.runtime.result.equilibrium import Equilibrium
from symgen.runtime.result.records import Variable
from symgen.runtime.rods.model.rods import RodModel

#: Steps of a revolution, or of a run without, that a run starts with.
_STEPS = 128
#: Rotation of the crank in a step at most, over that in a stride of the rigid motion.
_STRIDES = 5.0
#: Relative tolerance of a rigid motion with free coordinates.
_RIGID_RTOL = 1e-10
#: The most elements of a link.
_MOST_ELEMENTS = 1000

#: Function that returns the outputs of a motion.
Outputs = Callable[[ElasticMotion, LargeLinkage, Sequence[MotionState]], list[Variable]]


def large_run(motion: ElasticMotion, task: LargeRotation, elements: int) -> ElasticResult:
    """Return strains, forces and displacements of a linkage with its elastic links in elements.

    Raises
    ------
    ModelError
        For options out of range, or a linkage with what these elements do not support.
    SimulationError
        If the run cannot continue.
    """
    end = end_of_run(motion, task)
    large = large_motion(motion, elements)
    return refined_run(large, task, end, least_steps(motion, end), task.keeping())


def end_of_run(motion: ElasticMotion, task: LargeRotation) -> float:
    """Return the end of a run in large rotation [s]: that given, or after one revolution or so many.

    Raises
    ------
    ModelError
        For both, or one that is out of range.
    """
    if task.t_end is None:
        revolutions = 1.0 if task.revolutions is None else task.revolutions
        check_revolutions(motion, revolutions)
        return turn(motion) * revolutions
    if task.revolutions is not None:
        raise OptionsError("give {t_end} or {revolutions}, not both")
    if not real(task.t_end, "t_end") > 0.0:
        raise ModelError(f"expected t_end above zero, got {task.t_end!r}")
    return task.t_end


def equilibrium(motion: ElasticMotion, rigid: RodModel, elements: int, t: float, stable: bool) -> Equilibrium:
    """Return an equilibrium of a linkage with its elastic links in elements and the input held at a time [s].

    Loads bend the links from the pose of ``rigid``, the linkage with rigid links, that is in equilibrium.

    Raises
    ------
    ModelError
        For a number of elements out of range, an input in motion, and as :func:`.statics.equilibrium`.
    SimulationError
        Where the linkage with rigid links has no equilibrium.
    """
    linkage = LargeLinkage(motion, counted(elements))
    pose = rigid.equilibrium(at=t, stable=stable).state
    start = linkage.posed(t, pose.q, pose.u)
    linkage.start()
    linkage.follow(t, start.q, start.v)
    at, of = resting(linkage, t, stable, start)
    q, v, a = (x[None] for x in (at.q, at.v, at.a))
    forces = [force for link in linkage.links for force in link.forces(q, v, a).values()]
    d, on_links = motion.rigid.description, dict[str, Array]()
    drawn = motion.rigid.initial_state().positions
    for link in linkage.links:
        info = link.beam.info
        for point in d.links[info.link][2:]:
            if point not in d.free:
                fraction = np.linalg.norm(drawn[point] - drawn[info.start]) / link.beam.properties.length
                on_links[point] = link.place(q, float(fraction))[0]
    places = {p: pose.positions[p][None] for p in d.free}
    of_runs = partial(outputs_of_runs, motion)
    return described(linkage, at, of, forces, outputs(motion, linkage, [at], places), on_links, of_runs)


def large_motion(motion: ElasticMotion, elements: int, outputs_of: Outputs | None = None) -> LargeMotion:
    """Return a linkage with its elastic links in elements; its outputs by default are those of runs."""
    elements = counted(elements)
    return LargeMotion(
        motion.rigid,
        LargeLinkage(motion, elements),
        partial(LargeLinkage, motion, 2 * elements),
        partial(outputs_of or outputs, motion),
        partial(coordinate_of, motion),
        max(beam.properties.modulus for beam in motion.beams),
        f"{elements} elements a link",
        (*_stiffness_damped(motion), *_stretching(motion), *_free(motion)),
        motion.identity,
        of_runs=partial(outputs_of_runs, motion),
    )


def controlled_links(model: Any, request: ElasticRun, elements: int) -> ElasticResult:
    """Return a run with a controller, in so many elements of each link.

    Raises
    ------
    ModelError
        For options of linear theory, and as :func:`.controlled_run`.
    """
    large = replace(request, controller=None, sample=None).in_large_rotation
    if large is None:
        raise ModelError(
            "controllers are for elastic links in large rotation: linear theory prescribes the rigid motion\n"
            "  Leave out options of linear theory: t_end, revolutions, rtol, samples and max_step remain."
        )
    motion = model.motion(True)
    with limited(request.max_wall):
        end, request = end_of_run(motion, large), replace(request, samples=large.samples)
        return controlled_run(model, request, partial(_controlled, motion, elements), end)


def stepper_of_links(model: Any, request: ElasticStepping, elements: int) -> SystemStepper:
    """Return a motion that advances by calls, in so many elements of each link if the request has none."""
    count = elements if request.elements is None else request.elements
    return stepper(model, request, partial(_controlled, model.motion(True), count))


def _controlled(motion: ElasticMotion, elements: int) -> LargeMotion:
    """Return a linkage whose inputs change; without displacements, for its rigid motion is not known."""
    return large_motion(motion, elements, partial(outputs, rigid={}))


def counted(elements: int) -> int:
    """Return a number of elements; raise ModelError where it is out of range."""
    elements = whole(elements, "elements")
    if not 1 <= elements <= _MOST_ELEMENTS:
        raise ModelError(f"expected from 1 to {_MOST_ELEMENTS} elements of an elastic link, got {elements}")
    return elements


def least_steps(motion: ElasticMotion, end: float) -> float:
    """Return the number of steps that a run to a time [s] starts with."""
    return max(_STEPS * end / turn(motion), end / (_STRIDES * motion.stride))


def _free(motion: ElasticMotion) -> Iterator[str]:
    """Yield notes on free coordinates and states, for which linear theory has no rigid motion."""
    if motion.rigid.description.states:
        yield "[states] feed back to the motion: rigid and elastic coordinates are integrated with them"
    if motion.undetermined:
        yield (
            f"the crank, {motion.info.crank}, does not determine the rigid motion of "
            f"{', '.join(motion.undetermined)}: rigid and elastic coordinates are integrated together"
        )


def outputs(
    motion: ElasticMotion,
    linkage: LargeLinkage,
    moments: Sequence[MotionState],
    rigid: Mapping[str, Array] | None = None,
) -> list[Variable]:
    """Return strains, displacements, forces, torque and energies.

    Displacements are from places of the free points with rigid links, (times, 2) each, of those among
    ``rigid``: by default those of the rigid motion.
    """
    times, q, v, a, multipliers = stacked(moments)
    d, variables = motion.rigid.description, list[Variable]()
    for name, k, at, fibre in motion.stations:
        link = linkage.links[k]
        axial, curvature = link.strains(q, v, a, at)
        variables += strains(name, link.beam, at, fibre * curvature, axial)
    rigid = _rigid_places(motion, times) if rigid is None else rigid
    for k, point in enumerate(d.free):
        place = q[:, 2 * k : 2 * k + 2]
        if point in rigid:
            variables.append(displacement(point, place - rigid[point]))
        variables.append(Variable(f"{point}.position", "m", f"position of {point}", ("x", "y"), place))
    for link in linkage.links:
        name = link.beam.info.link
        first, last = (q[:, link.places[end, :2]] for end in (0, -1))
        variables.append(
            length_change(name, np.linalg.norm(last - first, axis=1) - link.beam.properties.length)
        )
        variables += [joint_force(name, point, force) for point, force in link.forces(q, v, a).items()]
    for name, k, at, _ in motion.stations:
        variables.append(bow(name, linkage.links[k].beam, at, linkage.links[k].deflection(q, at)))
    variables += [*of_states(d, v, a), *in_large_rotation(linkage, motion.rigid, moments)]
    if (of_shaft := linkage.torque(times, q, v, a, multipliers)) is not None:
        variables.append(torque(motion.info.crank, of_shaft))
    kinetic, strain, potential, dissipated = linkage.energies(times, q, v, a)
    # Loads on elastic links have no potential energy among those of rigid parts.
    known = None if linkage.loaded else potential
    return [*variables, *Energies(kinetic, strain, known, dissipated, None, None, None).variables()]


def _stretching(motion: ElasticMotion) -> Iterator[str]:
    """Yield the note on links that stretch against the scene."""
    stretching = [beam.info.link for beam in motion.beams if not beam.info.axial]
    if stretching:
        yield f"elements in large rotation stretch, though {', '.join(stretching)} has axial = false"


def _rigid_places(motion: ElasticMotion, times: Array) -> dict[str, Array]:
    """Return the positions of the free points in the rigid motion, (times, 2) each."""
    d = motion.rigid.description
    if d.states and motion.info.mode in ("motor", "free"):
        q = motion.machine.coordinates(times)
        return {p: q[:, 2 * k : 2 * k + 2] for k, p in enumerate(d.free)}
    if motion.undetermined or d.states:
        if not times[-1]:
            start = motion.rigid.initial_state().positions
            return {p: np.array([start[p]]) for p in d.free}
        with unlimited():
            rigid = motion.rigid.simulate(float(times[-1]), samples=len(times), rtol=_RIGID_RTOL)
        return {p: rigid.variable(f"{p}.position").values for p in d.free}
    if motion.has_motor and times[-1]:
        motion = motion.about(motion.machine.path(float(times[-1])))
    (q, _, _), _, _ = motion.rigid_motion(motion.equations(), times)
    return {p: q[:, 2 * k : 2 * k + 2] for k, p in enumerate(d.free)}


def _stiffness_damped(motion: ElasticMotion) -> Iterator[str]:
    """Yield notes on damping other than in proportion to the stiffness, which these elements do not have."""
    damped = [b.info.link for b in motion.beams if b.properties.mass_damping or b.properties.ratio]
    if damped:
        names = ", ".join(damped)
        yield (
            "elements in large rotation are damped by stiffness only: damping by mass or a ratio is omitted "
            f"from {names}"
        )
    if len(motion.layout.damped):
        yield "modal damping of the structure is omitted: elements in large rotation have no such modes"
