"""Masses, forces and couples on elastic links in large rotation.

Kernels give forces and torques over the motion of the rigid linkage. They are called with the direction of
the line between the ends of a link, or with that of a section.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime.beams.elements import SAME
from symgen.runtime.elastic.large.links import LargeLink, hermite
from symgen.runtime.elastic.motion import ElasticMotion

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

#: Gauss points of an element for forces along it: a linear force times a cubic is exact.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(3)


@dataclass(frozen=True, slots=True)
class Lumps:
    """Rigid masses at nodes: unknowns of these (masses, 3), masses [kg], moments of inertia [kg m^2]."""

    places: Indices
    masses: Array
    inertias: Array
    gravity: Array

    @property
    def diagonal(self) -> Array:
        """Entries of the mass matrix, (masses, 3)."""
        return np.stack([self.masses, self.masses, self.inertias], axis=1)

    def add(self, residual: Array, a: Array) -> None:
        """Add inertia less gravity to residuals (times, unknowns)."""
        force = self.diagonal * (a[:, self.places] - np.append(self.gravity, 0.0))
        for k, own in enumerate(self.places):
            residual[:, own] += force[:, k]

    def energies(self, q: Array, v: Array) -> Array:
        """Return kinetic energy, zero strain energy, and the potential of gravity [J]."""
        kinetic = float(np.sum(self.diagonal * v[self.places] ** 2)) / 2
        return np.array([kinetic, 0.0, -float(self.masses @ (q[self.places[:, :2]] @ self.gravity))])


@dataclass(frozen=True, slots=True)
class Along:
    """One force along a link: number of the link, row in the kernel ``loads``, unknowns and parts at nodes.

    ``ends`` are the parts of the force at each node, ``arms`` [m] those at its tangent.
    """

    link: int
    row: int
    places: Indices
    ends: Array
    arms: Array

    def add(self, residual: Array, q: Array, force: Array) -> None:
        """Subtract a force (times, 2), on fixed axes, from residuals (times, unknowns)."""
        angles = q[:, self.places[:, 2]]
        x, y = force[:, :1], force[:, 1:]
        residual[:, self.places[:, 0]] -= self.ends * x
        residual[:, self.places[:, 1]] -= self.ends * y
        residual[:, self.places[:, 2]] -= self.arms * (np.cos(angles) * y - np.sin(angles) * x)


@dataclass(frozen=True, slots=True)
class Section:
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

    def __init__(self, motion: ElasticMotion, sections: Sequence[Section]) -> None:
        self._free = motion.rigid.description.free
        self.moves: list[tuple[Section, str]] = []
        for section in sections:
            moved = {point for _, point in self.moves}
            ends = [p for p in (section.end, section.start) if p in self._free and p not in moved]
            if not ends:
                raise ModelError(
                    f"{motion.rigid.name}: elements in large rotation do not support couples between links "
                    f"whose other ends are on the ground, as {section.link}\n"
                    "  Let them act against the ground, or leave one link rigid."
                )
            self.moves.append((section, ends[0]))

    def __call__(self, ground: Callable[[str], Array], q: Array, v: Array) -> tuple[Array, Array]:
        """Return coordinates and rates of free points (times, coordinates), ends of links moved.

        ``ground`` gives the places of a point of the ground, (times, 2).
        """
        n = 2 * len(self._free)
        places, rates = q[:, :n].copy(), v[:, :n].copy()
        for section, point in self.moves:
            other, sign = (section.start, 1.0) if point == section.end else (section.end, -1.0)
            at = 2 * self._free.index(point)
            if other in self._free:
                k = 2 * self._free.index(other)
                base, velocity = places[:, k : k + 2], rates[:, k : k + 2]
            else:
                base, velocity = ground(other), np.zeros_like(places[:, :2])
            if section.place < 0:
                apart, rate = sign * (places[:, at : at + 2] - base), rates[:, at : at + 2] - velocity
                size = np.linalg.norm(apart, axis=1)[:, None]
                direction, speed = apart / size, sign * np.sum(_left(apart) * rate, axis=1)[:, None] / size**2
            else:
                angle, speed = q[:, section.place], v[:, section.place, None]
                direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
            places[:, at : at + 2] = base + sign * section.length * direction
            rates[:, at : at + 2] = velocity + sign * section.length * speed * _left(direction)
        return places, rates


def _left(vectors: Array) -> Array:
    """Return vectors (n, 2) turned by a right angle to the left."""
    return np.stack([-vectors[:, 1], vectors[:, 0]], axis=1)


def lumps_of(motion: ElasticMotion, links: Sequence[LargeLink], gravity: Array) -> Lumps | None:
    """Return the masses and moments of inertia on links, which have nodes there; None without."""
    places, masses, inertias = [], [], []
    for link in links:
        for lump in motion.lumps(link.beam.info.link):
            places.append(_node(motion, link, lump.at))
            masses.append(lump.mass)
            inertias.append(lump.inertia)
    if not places:
        return None
    return Lumps(np.array(places), np.array(masses), np.array(inertias), gravity)


def forces_along(motion: ElasticMotion, links: Sequence[LargeLink]) -> Iterator[Along]:
    """Yield the forces along links, but for those of joints, whose displacements the links share."""
    for number, link in enumerate(links):
        name = link.beam.info.link
        rows = [k for k, owner in enumerate(motion.info.loads) if owner == name]
        for row, profile in zip(rows, motion.profiles(name), strict=True):
            if motion.info.joints[row]:
                continue
            ends, arms = np.zeros(len(link.nodes)), np.zeros(len(link.nodes))
            if profile.is_point:
                own = _node(motion, link, profile.at)
                ends[int(np.flatnonzero(link.places[:, 2] == own[2])[0])] = 1.0
            else:
                nodes = np.array(link.nodes) * link.beam.properties.length
                for k, (first, size) in enumerate(zip(nodes[:-1], np.diff(nodes), strict=True)):
                    for s, weight in zip((_POINTS + 1) / 2, _WEIGHTS / 2, strict=True):
                        part = weight * size * (profile.even + profile.slope * (first + s * size))
                        shape = part * np.array(hermite(s))
                        ends[k : k + 2] += shape[[0, 2]]
                        arms[k : k + 2] += size * shape[[1, 3]]
            yield Along(number, row, link.places, ends, arms)


def _node(motion: ElasticMotion, link: LargeLink, at: float) -> Indices:
    """Return the unknowns of the node at a distance [m] from the first point of a link."""
    part = at / link.beam.properties.length
    found = [k for k, node in enumerate(link.nodes) if abs(node - part) < SAME]
    if not found:
        raise ModelError(
            f"{motion.rigid.name}: elements in large rotation have no node at {part:g} of the length of "
            f"{link.beam.info.link}, within 1 % of another one\n"
            "  Move the mass or force there to the other node, or to the end of the link."
        )
    own: Indices = link.places[found[0]]
    return own
