"""The mesh of elastic links in large rotation, and the constraints of their nodes alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from symgen.errors import ModelError
from symgen.runtime._constrained import Rows
from symgen.runtime.arrays import Array
from symgen.runtime.beams.elements import kernels, meshed
from symgen.runtime.elastic.large.attached import DIRECTION, FORCE, LinkSection, Posed, at_nodes
from symgen.runtime.elastic.large.links import LargeLink, element_properties
from symgen.runtime.elastic.motion import ElasticMotion

#: Part of the length of a run over which a prescribed angle is differentiated.
_PART = 1e-4
#: Unknowns of an end on the ground, and its point.
Pin = tuple[tuple[int, int], str]


def divided(motion: ElasticMotion, elements: int, gravity: Array) -> tuple[list[LargeLink], list[Pin], int]:
    """Return the elastic links in elements, their ends on the ground, and the number of all unknowns.

    The first unknowns are the coordinates of free points, which nodes there share.
    """
    d = motion.rigid.description
    links, pins, size = list[LargeLink](), list[Pin](), d.coordinates
    for beam in motion.beams:
        name, length = beam.info.link, beam.properties.length
        info = replace(beam.info, elements=elements, nodes=())
        info = meshed(info, length, motion.lumps(name), motion.profiles(name))
        at = dict(zip(info.joint_nodes, info.points, strict=True))
        places = np.zeros((info.elements + 1, 3), dtype=np.intp)
        for node, row in enumerate(places):
            point = at.get(node)
            shared = point is not None and point in d.free
            unknowns = [2 * d.free.index(point), 2 * d.free.index(point) + 1] if point and shared else []
            row[:] = [*unknowns, *range(size, size + 3 - len(unknowns))]
            size += 3 - len(unknowns)
            if point is not None and not shared:
                pins.append(((int(row[0]), int(row[1])), point))
        nodes = tuple(info.node(k) for k in range(info.elements + 1))
        properties = element_properties(beam.properties, nodes, gravity)
        links.append(LargeLink(replace(beam, info=info), nodes, places, properties))
    return links, pins, size


def gravity_of(motion: ElasticMotion) -> Array:
    """Return the acceleration of free fall [m/s^2], which the kernels have in the axes of the links."""
    kernels_of = motion._motion
    q, u = np.split(motion._start, 2)
    columns = next(b.columns for b in kernels_of.info("energies").blocks if b.name == "energies")
    at = [columns.index(f"potential_load_{axis}") for axis in "xy"]
    force = -np.atleast_2d(kernels_of.blocks("energies", 0.0, q, u)["energies"])[0][at]
    axes = np.atleast_2d(kernels_of.blocks("links", 0.0, q, u)["links"])[0][:2]
    return at_nodes("force", 1, acting={FORCE: (1.0, 0.0, *axes, *force)})[0, :2]


def section_of(links: Sequence[LargeLink], link: str, point: str) -> LinkSection:
    """Return the section of a link at one of its joints."""
    link_number = next(k for k in links if k.beam.info.link == link)
    info = link_number.beam.info
    place = int(link_number.places[info.joint_nodes[info.points.index(point)], 2])
    return LinkSection(link, info.start, info.end, link_number.beam.properties.length, place)


def posed_by(motion: ElasticMotion, sections: Mapping[str, LinkSection], name: str) -> Posed:
    """Return the calls of kernels for the couples on a section: with the links of all their sections posed.

    Where no law reads a rotation, links stay between their ends.

    Raises
    ------
    ModelError
        For laws that also read the place of an end that is moved for a rotation.
    """
    info = motion.info
    acting = [of for of in zip(info.couples, info.reads, strict=True) if name in of[0]]
    read = {point for _, points in acting for point in points}
    if "" not in read:
        return Posed(motion, [])
    among = dict.fromkeys((name, *(other for names, _ in acting for other in names)))
    posed = Posed(motion, [sections[other] for other in among])
    if both := [(section.link, point) for section, point in posed.moves if point in read]:
        link, point = both[0]
        raise ModelError(
            f"{motion.rigid.name}: couples on {name} read the rotation of a section of {link} and the place "
            f"of {point}, which elements in large rotation do not support together\n"
            "  Write the law with one of them."
        )
    return posed


def posed_shaft(motion: ElasticMotion, crank: LargeLink) -> Posed:
    """Return the calls of kernels with an elastic crank in the direction of its first section."""
    return Posed(motion, [section_of([crank], crank.beam.info.link, crank.beam.info.start)])


def rotation_of(links: Sequence[LargeLink], name: str) -> LinkSection:
    """Return the section with a rotation of the linkage: of a link at a point, or of links welded there."""
    link, _, point = name.rpartition(".")
    welded = (k.beam.info.link for k in links if point in k.beam.info.welds)
    return section_of(links, link or next(welded), point)


def welds_to_bodies(
    motion: ElasticMotion, links: Sequence[LargeLink], start: Array, first: int, known: int
) -> Rows | None:
    """Return the welds of sections to rigid links, constraints from the row ``first`` on; None without.

    The angles are those at the start. Numbers from ``known`` on are the coordinates of points on the ground.

    Raises
    ------
    ModelError
        Where an end of a rigid link is a further point of another one.
    """
    d, welded = motion.rigid.description, motion.info.welded_bodies
    if not welded:
        return None
    # Points without coordinates that move with any of these are further points of links.
    moved = motion.rigid.evaluator.blocks("points", 0.0, start[: d.coordinates], np.ones(d.coordinates))
    points = moved["positions"]
    places = np.zeros((len(welded), 6), dtype=np.intp)
    properties, acting = np.zeros((len(welded), 8)), np.zeros((len(welded), 6))
    for row, of_kernel, turned, (point, body) in zip(places, properties, acting, welded, strict=True):
        ends = d.links[body][:2]
        moving = [p for p in ends if p not in d.free and np.any(moved["velocities"][d.points.index(p)])]
        if moving:
            raise ModelError(
                f"{motion.rigid.name}: elements in large rotation do not support a weld to {body}, whose end "
                f"{moving[0]} is a further point of another link\n"
                f"  Make {body} and that link one body."
            )
        at = [2 * d.free.index(p) if p in d.free else known + 2 * d.points.index(p) for p in ends]
        rotation = rotation_of(links, point).place
        row[:] = at[0], at[0] + 1, rotation, at[1], at[1] + 1, rotation
        first_end, second_end = (points[d.points.index(p)] for p in ends)
        along, angle = second_end - first_end, start[rotation]
        of_kernel[0] = length = float(np.hypot(*along))
        c, s = np.cos(angle), np.sin(angle)
        turned[DIRECTION : DIRECTION + 2] = np.array([[c, s], [-s, c]]) @ along / length
    kernel = kernels("corotational_node").ADDRESSES["weld"]
    inner = np.flatnonzero((places[:, :, None] < len(start)) & (places[:, None, :] < len(start)))
    # The kernel's state has second rates behind the rates.
    still = np.zeros((len(welded), 6))
    return Rows(kernel, places, places, first, still, properties, acting, inner, None)


class Supports:
    """Linear constraints of nodes: ends on the ground, welds, and the direction of a held crank.

    Attributes
    ----------
    rows
        (constraints, unknowns): times the unknowns they are the values that are given. The last row is that
        of a held crank.
    """

    def __init__(
        self,
        motion: ElasticMotion,
        links: Sequence[LargeLink],
        pins: Sequence[Pin],
        shaft: int | None,
        start: Array,
    ) -> None:
        self._motion = motion
        d = motion.rigid.description
        self._pins = [d.points.index(point) for _, point in pins]
        rows: list[dict[int, float]] = [{k: 1.0} for places, _ in pins for k in places]
        drawn: list[float] = []
        for point in dict.fromkeys(p for link in links for p in link.beam.info.welds):
            welded = [link.beam.info.link for link in links if point in link.beam.info.welds]
            first, *others = (section_of(links, name, point).place for name in welded)
            if point not in d.free and first != shaft:
                rows.append({first: 1.0})
                drawn.append(float(start[first]))
            for place in others:
                rows.append({place: 1.0, first: -1.0})
                drawn.append(float(start[place] - start[first]))
        self._drawn, self._held = np.array(drawn), shaft is not None
        if shaft is not None:
            rows.append({shaft: 1.0})
        self.rows = np.zeros((len(rows), len(start)))
        for row, entries in zip(self.rows, rows, strict=True):
            row[list(entries)] = list(entries.values())

    def values(self, t: Array) -> tuple[Array, Array]:
        """Return the given values of the rows [m, rad] and their rates, (times, rows) each."""
        values, rates = np.zeros((2, len(t), len(self.rows)))
        count = 2 * len(self._pins)
        if count:
            columns = (2 * np.array(self._pins)[:, None] + np.arange(2)).ravel()
            values[:, :count], rates[:, :count] = (x[:, columns] for x in self.points(t))
        values[:, count : count + len(self._drawn)] = self._drawn
        if self._held:
            values[:, -1], rates[:, -1] = self._motion.angle_at(t), self._speed(t)
        return values, rates

    def points(self, t: Array) -> tuple[Array, Array]:
        """Return places and velocities of all points, (times, 2 points) each: those of the ground hold."""
        start = self._motion._start
        y = np.broadcast_to(start[: len(start) // 2], (len(t), len(start) // 2))
        points = self._motion.rigid.evaluator.many_blocks("points", t, y, np.zeros_like(y))
        places, velocities = (points[name].reshape(len(t), -1) for name in ("positions", "velocities"))
        return places, velocities

    def _speed(self, t: Array) -> Array:
        """Return the rate of the direction of a held crank [rad/s]."""
        if not self._motion.info.prescribed:
            return np.full(len(t), self._motion.speed)
        h = _PART * self._motion.rigid.description.t_end
        before, less, more, after = (self._motion.angle_at(t + k * h) for k in (-2, -1, 1, 2))
        return (before - 8 * less + 8 * more - after) / (12 * h)
