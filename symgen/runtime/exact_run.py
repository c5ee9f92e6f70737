"""Elastic links in large rotation, by the rods method: the arbiter of linear theory.

See ``symgen.scene.segments`` for the rods. A run starts undeformed, moving as the rigid linkage does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime.beams import Beam
from symgen.runtime.elastic_motion import ElasticMotion
from symgen.runtime.elastic_result import ElasticResult, displacement, length_change, strains
from symgen.runtime.model import Model
from symgen.runtime.result import Result, Variable
from symgen.runtime.state import State

Array = NDArray[np.float64]
Progress = Callable[[float], None]


@dataclass(frozen=True, slots=True)
class ExactTask:
    """What is asked of a run: see :meth:`symgen.runtime.elastic_model.ElasticModel.exact`."""

    segments: int
    revolutions: float
    rtol: float
    samples: int


@dataclass(frozen=True)
class Cut:
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
        found: Array = (1.0 - part) * tensions[:, k - 1] + part * tensions[:, k]
        return found

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
        found: Array = (1.0 - part) * every[:, k - 1] + part * every[:, k]
        return found


def exact_run(
    motion: ElasticMotion, rods: Model, task: ExactTask, progress: Progress | None, kept: Mapping[str, Any]
) -> ElasticResult:
    """Return strains and displacements of a linkage whose elastic links are the rods of another model.

    ``kept`` are the options of checkpoints of :meth:`symgen.runtime.model.Model.simulate`.

    Raises
    ------
    ModelError
        For options out of range.
    SimulationError
        When the run cannot go on.
    """
    if not (task.revolutions > 0 and math.isfinite(task.revolutions)):
        raise ModelError(f"expected revolutions above zero, got {task.revolutions!r}")
    turn = motion.period if motion.speed else motion.rigid.description.t_end
    cuts = _cuts(motion, rods)
    state = _state(motion.rigid, rods, cuts)
    end = turn * task.revolutions
    result = rods.simulate(end, rtol=task.rtol, samples=task.samples, state=state, progress=progress, **kept)
    return _result(motion, cuts, result, task)


def _cuts(motion: ElasticMotion, rods: Model) -> tuple[Cut, ...]:
    places = rods.with_parameters(**{p.name: p.default for p in rods.description.parameters}).initial_state()
    links, made = rods.description.links, []
    for beam in motion.beams:
        prefix = f"{beam.info.link}__"
        own = [name for name in links if name.startswith(prefix)]
        points = [links[own[0]][0], *(links[name][1] for name in own)]
        lengths = [np.linalg.norm(places.positions[b] - places.positions[a]) for a, b in pairwise(points)]
        nodes = np.concatenate([[0.0], np.cumsum(lengths)]) / np.sum(lengths)
        made.append(Cut(beam, tuple(own), tuple(points[1:-1]), nodes))
    return tuple(made)


def _state(rigid: Model, rods: Model, cuts: tuple[Cut, ...]) -> State:
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


def _result(motion: ElasticMotion, cuts: tuple[Cut, ...], result: Result, task: ExactTask) -> ElasticResult:
    d, times = motion.rigid.description, result.time

    def of_rods(cut: Cut, word: str) -> Array:
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
    rigid = _rigid_places(motion, times)
    variables += [displacement(p, places[p] - rigid[p]) for p in d.free]
    for cut in cuts:
        info = cut.beam.info
        apart = np.linalg.norm(places[info.end] - places[info.start], axis=1)
        variables.append(length_change(info.link, apart - cut.beam.properties.length))
    return ElasticResult(
        name=d.name,
        title=d.title,
        axes=d.axes,
        time=times,
        variables=tuple(variables),
        drift=result.drift,
        final=result.final,
        statistics={
            "angle_deg": np.degrees(motion.angle_at(times)).tolist(),
            "turns": bool(motion.speed),
            "unknowns": len(result.final),
            "steps": result.statistics["steps"],
            "evaluations": result.statistics["evaluations"],
            "error": None,
            "wall_s": result.statistics["wall_s"],
            "floquet": [],
            "floquet_error": None,
        },
        provenance={
            "kind": "elastic",
            "equations": result.provenance["equations"],
            "method": "exact",
            "form": f"{task.segments} rods a link",
            "rtol": task.rtol,
            "t_end": result.provenance["t_end"],
            "backend": result.provenance["backend"],
            "parameters": dict(result.provenance["parameters"]),
        },
        notes=(*result.notes, *_notes(motion, task.segments)),
    )


def _rigid_places(motion: ElasticMotion, times: Array) -> dict[str, Array]:
    """Return where the free points are in the rigid motion, (times, 2) each."""
    equations, d = motion.equations(), motion.rigid.description
    found = np.zeros((len(times), d.coordinates))
    for i, t in enumerate(times.tolist()):
        status, y = equations.motion.evaluate(t)[:2]
        motion.check(equations, status, t)
        found[i] = y[: d.coordinates]
    return {p: found[:, 2 * k : 2 * k + 2] for k, p in enumerate(d.free)}


def _notes(motion: ElasticMotion, segments: int) -> list[str]:
    """Say what rods with springs between them leave out."""
    notes = [
        f"the error of {segments} rods a link is not estimated: it falls with the square of their number; "
        f"compare with {2 * segments}",
        "links in rods keep their length: axial strain is what the axial force would give",
    ]
    damped = [b.info.link for b in motion.beams if b.properties.mass_damping or b.properties.ratio]
    if damped:
        names = ", ".join(damped)
        notes.append(f"rods are damped by stiffness only: what mass or a ratio gives is left out of {names}")
    sheared = [b.info.link for b in motion.beams if any(b.properties.shear)]
    if sheared:
        notes.append(f"shear is left out of {', '.join(sheared)}")
    return notes
