"""Masses, forces and couples on elastic links in large rotation.

Kernels give forces and torques over the motion of the rigid linkage. They are called with the direction of
the line between the ends of a link, or with that of a section. Those of ``corotational_node`` are derived in
:mod:`symgen.mechanics.elastic.nodes`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from symgen.errors import ModelError
from symgen.runtime._constrained import Elements
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.beams.elements import SAME, kernels
from symgen.runtime.elastic.large.links import LargeLink
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.kernels.evaluate import at_rows

#: Properties that the kernels ``corotational_node`` read, and the numbers that each writes.
_PROPERTIES = ("length", "g_x", "g_y", "start", "even", "slope", "mass", "inertia")
_WRITTEN = {"shares": 4, "force": 3, "follower": 6, "far_end": 6, "chord": 2}
#: Columns of their states, x, y and theta of two nodes with first rates, and of forces.
PLACE, ANGLE, OTHER, VELOCITY, SPEED, MOVING = 0, 2, 3, 6, 8, 9
FORCE, DIRECTION, COMPONENTS = 0, 2, 4


def at_nodes(
    kernel: str,
    count: int,
    state: Mapping[int, ArrayLike] = MappingProxyType({}),
    acting: Mapping[int, ArrayLike] = MappingProxyType({}),
    **properties: float,
) -> Array:
    """Return the results of a kernel of ``corotational_node``, (count, numbers).

    ``state`` and ``acting`` have numbers of all rows, (count, k) or (k,), by their first column.
    """
    rows, work = np.zeros((count, 18)), np.zeros((count, 6))
    for into, arrays in ((rows, state), (work, acting)):
        for at, values in arrays.items():
            into[:, at : at + np.shape(values)[-1]] = values
    p = _properties(**properties)
    return at_rows(kernels("corotational_node").ADDRESSES[kernel], rows, 6, p, _WRITTEN[kernel], work)


def _properties(**given: float) -> Array:
    return np.array([given.get(name, 0.0) for name in _PROPERTIES])


@dataclass(frozen=True, slots=True)
class ForceAlongLink:
    """One force along a link: number of the link, row in the kernel ``loads``, unknowns and shares at nodes.

    ``shares`` are those of the force at each node, and at its tangent [m], (nodes, 2).
    """

    link: int
    row: int
    places: Indices
    shares: Array

    def add(self, residual: Array, q: Array, axes: Array, force: Array) -> None:
        """Subtract a force from residuals (times, unknowns).

        ``axes`` are cosine and sine of the direction of the link, ``force`` the components in it, (times, 2).
        """
        times, nodes = len(q), len(self.places)
        each = np.repeat(np.hstack([axes, force]), nodes, axis=0)
        acting = {FORCE: np.hstack([np.tile(self.shares, (times, 1)), each])}
        state = {PLACE: q[:, self.places].reshape(-1, 3)}
        forces = at_nodes("force", times * nodes, state, acting).reshape(times, nodes, 3)
        for k, unknowns in enumerate(self.places):
            residual[:, unknowns] -= forces[:, k]


@dataclass(frozen=True, slots=True)
class FollowerForce:
    """One force along a link that rotates with its sections: number of the link, row in the kernel ``loads``.

    It acts at the one node with unknowns ``places`` (1, 3), or on the elements between these nodes, by the
    properties of the kernel ``follower`` for each, ``spread``.
    """

    link: int
    row: int
    places: Indices
    spread: tuple[Mapping[str, float], ...] = ()

    def add(self, residual: Array, q: Array, axes: Array, force: Array) -> None:
        """Subtract a force from residuals (times, unknowns); ``force`` has its components, (times, 2)."""
        if not self.spread:
            (node,) = self.places
            angle = q[:, node[2]]
            axes = np.stack([np.cos(angle), np.sin(angle)], axis=1)
            acting: dict[int, ArrayLike] = {FORCE: (1.0, 0.0), DIRECTION: axes, COMPONENTS: force}
            residual[:, node] -= at_nodes("force", len(q), {PLACE: q[:, node]}, acting)
        for element, profile in zip(self.elements, self.spread, strict=False):
            state = {PLACE: q[:, element]}
            residual[:, element] -= at_nodes("follower", len(q), state, {COMPONENTS: force}, **profile)

    @property
    def elements(self) -> Indices:
        """Unknowns of the elements, (elements, 6)."""
        return np.hstack([self.places[:-1], self.places[1:]])


@dataclass(frozen=True, slots=True)
class LinkSection:
    """A section of an elastic link: the link, its ends, its length [m], and the unknown of its rotation.

    Without an unknown, -1, it stands for the line between the ends.
    """

    link: str
    start: str
    end: str
    length: float
    place: int = -1


class Posed:
    """Calls of kernels with the links of sections in the direction of these."""

    def __init__(self, motion: ElasticMotion, sections: Sequence[LinkSection]) -> None:
        self._free, self._coordinates = motion.rigid.description.free, motion.rigid.description.coordinates
        moves = next(self._choices(sections, ()), None)
        if moves is None:
            raise ModelError(
                f"{motion.rigid.name}: elements in large rotation do not support couples between links "
                f"whose other ends are on the ground, as {sections[-1].link}\n"
                "  Let them act against the ground, or leave one link rigid."
            )
        self.moves = moves

    def _choices(
        self, sections: Sequence[LinkSection], moves: tuple[tuple[LinkSection, str], ...]
    ) -> Iterator[tuple[tuple[LinkSection, str], ...]]:
        """Yield moves of an end of each section, none of which moves a link that has its direction."""
        if not sections:
            yield moves
        still = {point for section, _ in moves for point in (section.start, section.end)}
        for section in sections:
            others = [s for s in sections if s is not section]
            for point in (section.end, section.start):
                if point in self._free and point not in still:
                    yield from self._choices(others, (*moves, (section, point)))

    def __call__(self, ground: Callable[[str], Array], q: Array, v: Array) -> tuple[Array, Array, Array]:
        """Return coordinates and rates of the rigid linkage (times, coordinates), ends of links moved.

        The third result are second rates of moved ends where links rotate at a constant rate. ``ground``
        gives the places of a point of the ground, (times, 2).
        """
        n = self._coordinates
        places, rates, second = q[:, :n].copy(), v[:, :n].copy(), np.zeros((len(q), n))
        for section, point in self.moves:
            backwards = point == section.start
            (base, velocity), (end, moving) = (
                self._at(name, ground, places, rates)
                for name in ((section.end, section.start) if backwards else (section.start, section.end))
            )
            if section.place < 0:
                apart = (end, moving, base, velocity) if backwards else (base, velocity, end, moving)
                angle, speed = direction_of(*apart)
            else:
                angle, speed = q[:, [section.place]], v[:, [section.place]]
            length = -section.length if backwards else section.length
            state = {PLACE: base, ANGLE: angle, VELOCITY: velocity, SPEED: speed}
            ends = at_nodes("far_end", len(q), state, length=length)
            at = slice(2 * self._free.index(point), 2 * self._free.index(point) + 2)
            places[:, at], rates[:, at], second[:, at] = np.split(ends, 3, axis=1)
        return places, rates, second

    def _at(
        self, point: str, ground: Callable[[str], Array], places: Array, rates: Array
    ) -> tuple[Array, Array]:
        """Return place and velocity of a point, (times, 2) each."""
        if point not in self._free:
            return ground(point), np.zeros((len(places), 2))
        k = 2 * self._free.index(point)
        return places[:, k : k + 2], rates[:, k : k + 2]


def direction_of(start: Array, velocity: Array, end: Array, moving: Array) -> tuple[Array, Array]:
    """Return the direction of the line between two points and its rate, (times, 1) each.

    Places and velocities of the points are (times, 2).
    """
    state = {PLACE: start, VELOCITY: velocity, OTHER: end, MOVING: moving}
    chord = at_nodes("chord", len(start), state)
    return chord[:, :1], chord[:, 1:]


def bodies_on(motion: ElasticMotion, links: Sequence[LargeLink], gravity: Array) -> list[Elements]:
    """Return the masses and moments of inertia on links, which have nodes there: one part, or none.

    Each is an element whose nodes are both that of the body.
    """
    places, properties, (x, y) = [], [], gravity
    for link in links:
        for lump in motion.lumps(link.beam.info.link):
            places.append(np.tile(_node(motion, link, lump.at), 2))
            properties.append(_properties(g_x=x, g_y=y, mass=lump.mass, inertia=lump.inertia))
    if not places:
        return []
    of_nodes = kernels("corotational_node").ADDRESSES
    return [Elements(of_nodes, np.array(places), np.array(properties), damped=False)]


def forces_along(
    motion: ElasticMotion, links: Sequence[LargeLink]
) -> Iterator[ForceAlongLink | FollowerForce]:
    """Yield the forces along links, but for those of joints, whose displacements the links share."""
    for number, link in enumerate(links):
        name = link.beam.info.link
        rows = [k for k, owner in enumerate(motion.info.loads) if owner == name]
        for row, profile in zip(rows, motion.profiles(name), strict=True):
            if motion.info.joints[row]:
                continue
            nodes = np.array(link.nodes) * link.beam.properties.length
            spread = tuple(
                {"length": length, "start": start, "even": profile.even, "slope": profile.slope}
                for start, length in zip(nodes[:-1], np.diff(nodes), strict=True)
            )
            if profile.is_point:
                unknowns = _node(motion, link, profile.at)
                spread = ()
            if profile.follows:
                places = unknowns[None] if profile.is_point else link.places
                yield FollowerForce(number, row, places, spread)
                continue
            shares = np.zeros((len(link.nodes), 2))
            if profile.is_point:
                shares[link.places[:, 2] == unknowns[2], 0] = 1.0
            for k, of_element in enumerate(spread):
                shares[k : k + 2] += at_nodes("shares", 1, **of_element).reshape(2, 2)
            acted = np.any(shares, axis=1)
            yield ForceAlongLink(number, row, link.places[acted], shares[acted])


def _node(motion: ElasticMotion, link: LargeLink, at: float) -> Indices:
    """Return the unknowns of the node at a distance [m] from the first point of a link."""
    part = at / link.beam.properties.length
    nodes = [k for k, node in enumerate(link.nodes) if abs(node - part) < SAME]
    if not nodes:
        raise ModelError(
            f"{motion.rigid.name}: elements in large rotation have no node at {part:g} of the length of "
            f"{link.beam.info.link}, within 1 % of another one\n"
            "  Move the mass or force there to the other node, or to the end of the link."
        )
    return link.places[nodes[0]]
