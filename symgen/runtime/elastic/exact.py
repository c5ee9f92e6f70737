"""Elastic links in large rotation, by the rods method: the arbiter of linear theory.

See ``symgen.scene.elastic.segments`` for the rods. A run starts undeformed, moving as the rigid linkage does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from symgen.errors import ModelError, SimulationError
from symgen.runtime.arrays import Array
from symgen.runtime.beams.elements import at as value_at
from symgen.runtime.beams.links import Beam
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.elastic.outputs import coordinate_of, displacement, length_change, selected, strains
from symgen.runtime.elastic.steps import check_revolutions, turn
from symgen.runtime.integrate.pace import unlimited
from symgen.runtime.kernels.arguments import real
from symgen.runtime.model.arguments import LargeRotation
from symgen.runtime.result.elastic import ElasticResult
from symgen.runtime.result.records import Variable, of_model
from symgen.runtime.result.result import Result
from symgen.runtime.result.state import State
from symgen.runtime.rods.model.rods import RodModel

#: Largest axial strain of rods that keep their length: what depends on lengths is off by that part.
STRETCH = 0.01

#: Number of rods of a link and relative tolerance of the local error, where none are given.
SEGMENTS, RTOL = 12, 1e-7
#: Relative tolerance of a rigid motion with free coordinates.
_RIGID_RTOL = 1e-10


@dataclass(frozen=True)
class DividedLink:
    """One elastic link in rods.

    ``rods`` and ``inner`` are their names and those of the points between them, ``nodes`` where they meet, as
    shares of the length, both ends included.
    """

    beam: Beam
    rods: tuple[str, ...]
    inner: tuple[str, ...]
    nodes: Array

    @property
    def spacing(self) -> float:
        """Distance of neighbouring directions [m]: the length of a whole rod."""
        return float(self.nodes[-1] - self.nodes[-2]) * self.beam.properties.length

    def axial_force(self, tensions: Array, at: float) -> Array:
        """Return the axial force [N] at a share of the length from the tensions of the rods (times, rods).

        What keeps the length of a rod is the axial force at its middle, to the second order in its length.
        """
        middles = (self.nodes[1:] + self.nodes[:-1]) / 2
        k = min(max(int(np.searchsorted(middles, at)), 1), len(middles) - 1)
        part = (at - middles[k - 1]) / (middles[k] - middles[k - 1])
        return (1.0 - part) * tensions[:, k - 1] + part * tensions[:, k]

    def curvature(self, angles: Array, at: float) -> Array:
        """Return the curvature [1/m] at a share of the length from the directions of the rods (times, rods).

        Between the joints it is linear. At an end that turns freely there is none; a clamped end is half a
        rod from the first joint, and the line through the first two joints is drawn on to it.
        """
        turned = np.diff(angles, axis=1)
        bent = (turned - 2 * math.pi * np.round(turned / (2 * math.pi))) / self.spacing
        clamped = self.nodes[1] - self.nodes[0] < 0.75 * (self.nodes[-1] - self.nodes[-2])
        first = 1.5 * bent[:, :1] - 0.5 * bent[:, 1:2] if clamped else np.zeros((len(bent), 1))
        every = np.hstack([first, bent, np.zeros((len(bent), 1))])
        k = min(max(int(np.searchsorted(self.nodes, at)), 1), len(self.nodes) - 1)
        part = (at - self.nodes[k - 1]) / (self.nodes[k] - self.nodes[k - 1])
        return (1.0 - part) * every[:, k - 1] + part * every[:, k]


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
        raise ModelError("give t_end or revolutions, not both")
    if not real(task.t_end, "t_end") > 0.0:
        raise ModelError(f"expected t_end above zero, got {task.t_end!r}")
    return task.t_end


def exact_run(motion: ElasticMotion, rods: RodModel, task: LargeRotation) -> ElasticResult:
    """Return strains and displacements of a linkage whose elastic links are the rods of another model.

    Raises
    ------
    ModelError
        For options out of range.
    SimulationError
        If the run cannot continue.
    """
    end = end_of_run(motion, task)
    rtol = RTOL if task.rtol is None else task.rtol
    cuts = _cuts(motion, rods)
    state = _state(motion.rigid, rods, cuts)
    try:
        result = rods.simulate(
            end,
            rtol=rtol,
            samples=task.samples,
            state=state,
            max_step=task.max_step,
            checkpoint=task.checkpoint,
            checkpoint_every=task.checkpoint_every,
            resume=task.resume,
            progress=task.progress,
        )
    except SimulationError as error:
        if error.partial is not None:
            error.partial = _result(motion, cuts, error.partial, task)
        raise
    return _result(motion, cuts, result, task)


def _cuts(motion: ElasticMotion, rods: RodModel) -> tuple[DividedLink, ...]:
    places = rods.with_parameters(**{p.name: p.default for p in rods.description.tunable}).initial_state()
    links, cuts = rods.description.links, []
    for beam in motion.beams:
        prefix = f"{beam.info.link}__"
        segments = [name for name in links if name.startswith(prefix)]
        points = [links[segments[0]][0], *(links[name][1] for name in segments)]
        lengths = [np.linalg.norm(places.positions[b] - places.positions[a]) for a, b in pairwise(points)]
        nodes = np.concatenate([[0.0], np.cumsum(lengths)]) / np.sum(lengths)
        cuts.append(DividedLink(beam, tuple(segments), tuple(points[1:-1]), nodes))
    return tuple(cuts)


def _state(rigid: RodModel, rods: RodModel, cuts: tuple[DividedLink, ...]) -> State:
    """Return the rods in line and moving as the rigid links do."""
    start = rigid.initial_state()
    places, velocities = dict(start.positions), dict(start.velocities)
    for cut in cuts:
        ends = cut.beam.info.start, cut.beam.info.end
        for name, share in zip(cut.inner, cut.nodes[1:-1].tolist(), strict=True):
            for kind in (places, velocities):
                kind[name] = (1.0 - share) * kind[ends[0]] + share * kind[ends[1]]
    free = rods.description.free
    return rods.state({p: places[p] for p in free}, {p: velocities[p] for p in free})


def _result(
    motion: ElasticMotion, cuts: tuple[DividedLink, ...], result: Result, task: LargeRotation
) -> ElasticResult:
    d, times = motion.rigid.description, result.time

    def of_rods(cut: DividedLink, word: str) -> Array:
        return np.stack([result.variable(f"{rod}.{word}").values for rod in cut.rods], axis=1)

    variables: list[Variable] = []
    for name, k, at, fibre in motion.stations:
        cut = cuts[k]
        properties = cut.beam.properties
        x = at * properties.length
        stiffness = sum(c * x**i for i, c in enumerate(properties.axial))
        bending = cut.curvature(of_rods(cut, "angle"), at) * fibre
        axial = cut.axial_force(of_rods(cut, "tension"), at) / stiffness
        variables += strains(name, cut.beam, at, bending, axial)
    places = {p: result.variable(f"{p}.position").values for p in d.points if f"{p}.position" in result}
    rigid = rigid_places(motion, times)
    variables += [displacement(p, places[p] - rigid[p]) for p in d.free]
    for cut in cuts:
        info = cut.beam.info
        apart = np.linalg.norm(places[info.end] - places[info.start], axis=1)
        variables.append(length_change(info.link, apart - cut.beam.properties.length))
    return ElasticResult(
        **of_model(
            d,
            result.provenance["parameters"],
            **{name: result.provenance[name] for name in ("equations", "t_end", "backend")},
            method="large-rotation",
            form=f"{len(cuts[0].rods)} rods a link",
            rtol=RTOL if task.rtol is None else task.rtol,
        ),
        axes=d.axes,
        coordinate=coordinate_of(motion, times),
        variables=selected(variables, d),
        drift=result.drift,
        final=result.final,
        statistics={
            "unknowns": len(result.final),
            "steps": result.statistics["steps"],
            "evaluations": result.statistics["evaluations"],
            "error": None,
            "wall_s": result.statistics["wall_s"],
            "floquet": [],
            "floquet_error": None,
        },
        notes=(*result.notes, *_notes(motion, len(cuts[0].rods)), *_of_stretch(cuts, result)),
        times=times if motion.speed else None,
    )


def rigid_places(motion: ElasticMotion, times: Array) -> dict[str, Array]:
    """Return the positions of the free points in the rigid motion, (times, 2) each."""
    d = motion.rigid.description
    if motion.undetermined:
        if not times[-1]:
            start = motion.rigid.initial_state().positions
            return {p: np.array([start[p]]) for p in d.free}
        with unlimited():
            rigid = motion.rigid.simulate(float(times[-1]), samples=len(times), rtol=_RIGID_RTOL)
        return {p: rigid.variable(f"{p}.position").values for p in d.free}
    if motion.has_motor:
        motion = motion.about(motion.machine.path(float(times[-1])))
    (q, _, _), _, _ = motion.rigid_motion(motion.equations(), times)
    return {p: q[:, 2 * k : 2 * k + 2] for k, p in enumerate(d.free)}


def _of_stretch(cuts: tuple[DividedLink, ...], result: Result) -> list[str]:
    """Name links whose axial force would stretch them so far that a constant length is no approximation."""
    notes = []
    for cut in cuts:
        p = cut.beam.properties
        middles = (cut.nodes[1:] + cut.nodes[:-1]) / 2 * p.length
        tensions = np.stack([result.variable(f"{rod}.tension").values for rod in cut.rods], axis=1)
        strain = np.abs(tensions) / np.array([value_at(p.axial, x) for x in middles.tolist()])
        k = int(np.argmax(np.max(strain, axis=1)))
        if (worst := float(np.max(strain[k]))) > STRETCH:
            notes.append(
                f"{cut.beam.info.link}: its axial force at t = {result.time[k]:.6g} s would strain it by "
                f"{worst:.3g}, beyond {STRETCH:g}: rods with springs do not stretch, so that lengths and "
                "deflections are off by about that part"
            )
    return notes


def _notes(motion: ElasticMotion, segments: int) -> list[str]:
    """Return the notes on effects that rods with springs between them neglect."""
    notes = [
        f"the error of {segments} rods per link is not estimated: it falls with the square of their number; "
        f"compare with {2 * segments}; the error by time steps is that of the tolerance of each step",
        "links in rods are inextensible: the axial strain follows from the axial force",
    ]
    notes += stiffness_damped(motion, "rods")
    sheared = [b.info.link for b in motion.beams if any(b.properties.shear)]
    if sheared:
        notes.append(f"shear is omitted from {', '.join(sheared)}")
    return notes


def stiffness_damped(motion: ElasticMotion, parts: str) -> Iterator[str]:
    """Yield notes on damping other than in proportion to the stiffness, which ``parts`` do not have."""
    damped = [b.info.link for b in motion.beams if b.properties.mass_damping or b.properties.ratio]
    if damped:
        names = ", ".join(damped)
        yield f"{parts} are damped by stiffness only: damping by mass or a ratio is omitted from {names}"
    if len(motion.layout.damped):
        yield f"modal damping of the structure is omitted: {parts} have no such modes"
