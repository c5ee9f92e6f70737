"""Force and moment on the ground of a linkage with elastic links, by Newton's laws of the whole."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.beams.forces import ElasticForces, RunMotion, of_coordinates
from symgen.runtime.elastic.large.collocation import MotionState, stacked
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.result.records import Variable

if TYPE_CHECKING:
    from symgen.runtime.elastic.large.linkage import LargeLinkage
    from symgen.runtime.elastic.space.linkage import LinkageInSpace
    from symgen.runtime.rods.model.rods import RodModel

#: Place of a joint on an elastic link (times, axes), force, and couple (times, components).
OnLink = tuple[Array, Array, Array]
_OUTPUTS = {
    "shaking_force": ("N", "force of the linkage on the ground"),
    "shaking_moment": ("N*m", "moment of the linkage on the ground about the origin"),
}


def in_linear_theory(
    motion: ElasticMotion,
    rigid: Sequence[Array],
    run: RunMotion,
    accelerations: Array,
    acting: ElasticForces,
) -> Iterator[Variable]:
    """Yield the outputs if the scene selects them.

    ``rigid`` is the first result of :meth:`ElasticMotion.rigid_motion`.
    """
    if not _selected(motion.rigid):
        return
    at = of_coordinates(motion)
    rates = np.zeros_like(run.displacements) if run.rates is None else run.rates
    by_order = zip(rigid, (run.displacements, rates, accelerations), strict=True)
    q, u, a = (x[:, : len(at)] + more[:, at] for x, more in by_order)
    points = motion.rigid.evaluator.many_blocks("points", run.times, q, u)["positions"]
    place = {p: points[:, k] for k, p in enumerate(motion.rigid.description.points)}
    still = np.zeros_like(points[:, 0])
    pairs = zip(motion.beams, acting.at_joints, strict=True)
    on_links = [
        (place[p], force, still[:, :1])
        for beam, ends in pairs
        for p, force in zip(beam.info.points, ends, strict=True)
    ]
    shafts = [f"{b.info.link}.torque" for b in motion.beams]  # that of a rigid crank acts on no elastic link
    couples = (v.values for v in acting.variables if v.name.endswith(".couple") or v.name in shafts)
    on_links += [(still, still, couple[:, None]) for couple in couples]
    yield from _shaking(motion.rigid, run.times, q, u, a, on_links)


def in_large_rotation(
    linkage: LargeLinkage, rigid: RodModel, moments: Sequence[MotionState]
) -> list[Variable]:
    """Return the outputs if the scene selects them, and no load acts along an elastic link."""
    if linkage.loaded or not _selected(rigid):
        return []
    t, q, v, a, _ = stacked(moments)
    on_links = []
    for link in linkage.links:
        forces = link.end_forces(q, v, a)
        for node, end in ((0, forces[:, 0, :3]), (-1, forces[:, -1, 3:])):
            on_links.append((q[:, link.places[node, :2]], end[:, :2], end[:, 2:]))
    n = rigid.description.coordinates
    return _shaking(rigid, t, q[:, :n], v[:, :n], a[:, :n], on_links, linkage.taken)


def in_space(linkage: LinkageInSpace, moments: Sequence[MotionState]) -> list[Variable]:
    """Return the outputs if the scene selects them."""
    t, q, v, a, _ = stacked(moments)
    if np.iscomplexobj(q) or not _selected(linkage.rigid):
        return []
    on_links: list[OnLink] = []
    for link in linkage.links:
        of_elements = link.values("residual", q, v, a)
        for first, nodes in ((0, link.places[:-1]), (12, link.places[1:])):
            states = q[:, nodes].reshape(len(t), -1, 4, 3)
            forces = of_elements[..., first : first + 12].reshape(states.shape)
            couples = np.sum(np.cross(states[:, :, 1:], forces[:, :, 1:]), axis=2)
            parts = (states[:, :, 0], forces[:, :, 0], couples)
            on_links += zip(*(np.moveaxis(part, 1, 0) for part in parts), strict=True)
    n = linkage.rigid.description.coordinates
    return _shaking(linkage.rigid, t, q[:, :n], v[:, :n], a[:, :n], on_links, linkage.taken)


def _selected(rigid: RodModel) -> bool:
    """Return whether the scene selects one of them: their kernel is derived then."""
    elastic = rigid.description.elastic
    names = (elastic.outputs if elastic else None) or ()
    return any(name.partition(".")[0] in _OUTPUTS for name in names)


def _shaking(
    rigid: RodModel,
    t: Array,
    q: Array,
    u: Array,
    a: Array,
    on_links: Iterable[OnLink],
    taken: Array | None = None,
) -> list[Variable]:
    """Return the outputs, from the motion of points (times, coordinates) and what joints exert on links.

    That is inertia less weight and loads of each elastic link. The kernel has weight and loads from outside
    less inertia of all other parts; ``taken`` are values of the tunable parameters other than of the model.
    """
    kernels = rigid.analysis("shaking")
    kernels = kernels if taken is None else kernels.with_tunable(taken)
    blocks = kernels.many_blocks("shaking", t, q, u, a)
    force, moment = (np.array(blocks[name]).reshape(len(t), -1) for name in _OUTPUTS)
    for place, push, couple in on_links:
        force = force - push
        moment = moment - _moments(place, push) - couple
    axes = rigid.description.axes
    values = (force, moment if moment.shape[1] > 1 else moment[:, 0])
    return [
        Variable(name, unit, about, axes if v.ndim == 2 else (), v)
        for (name, (unit, about)), v in zip(_OUTPUTS.items(), values, strict=True)
    ]


def _moments(place: Array, force: Array) -> Array:
    """Return moments about the origin, (times, components)."""
    if place.shape[1] == 3:
        return np.cross(place, force)
    return (place[:, 0] * force[:, 1] - place[:, 1] * force[:, 0])[:, None]
