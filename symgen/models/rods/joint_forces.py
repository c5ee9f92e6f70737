"""Forces on one link at its points, from its neighbours and the loads there.

For a base point of a link it is the residual of the link alone, M_k a + J_k^T lambda - f_k, minus the forces
at the points that the link carries. At a carried point the forces on all links there balance the loads
on the point, and at a joint with rows of its own the force is the multiplier.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
import sympy as sp

from symgen.errors import SceneError
from symgen.mechanics.rods.particles import Vector, end_mass
from symgen.models.rods.constraints import ConstrainedPoints
from symgen.models.rods.points import Part, Place, bar_name
from symgen.scene.rods.linkage import RigidLink, SpatialBody, WeightedPoint
from symgen.symbolic.calculus import ZERO
from symgen.symbolic.constants import rounded
from symgen.symbolic.quantity import Entries
from symgen.symbolic.vectors import cross_in_plane, dot

#: Forces on some points of a link, to be added up.
Forces = Iterator[tuple[str, Vector]]
#: The ground as one of two links; part of a stress that others must leave over; digits of constants.
_GROUND, _DEPENDENT, _DIGITS = "", 1e-6, 30


@dataclass(frozen=True, slots=True)
class SharedLine:
    """Two points that a link has in common with another link or the ground, one link a body in space.

    The force along their line is not determined: ``link`` may push ``other`` at one of the points as much as
    it pulls at the other one.
    """

    link: str
    other: str
    first: str
    second: str

    def at(self, link: str, point: str) -> int:
        """Return the sign of the vector from the first point to the second in the force at a point."""
        of_link = (link == self.link) - (link == self.other)
        return of_link * ((point == self.first) - (point == self.second))

    @property
    def places(self) -> list[tuple[str, str]]:
        """Links and points at which it has a force."""
        links = [k for k in (self.link, self.other) if k != _GROUND]
        return [(k, p) for k in links for p in (self.first, self.second)]


class JointForces:
    """The forces on the links of one linkage, each derived once."""

    def __init__(self, model: ConstrainedPoints) -> None:
        self.model = model
        self._parts = {part.name: part for part in model.parts}
        self._part_forces: dict[str, dict[str, Vector]] = {}
        self._raw: dict[tuple[str, str], Vector] = {}
        self._pulls: dict[SharedLine, sp.Expr] = {}

    def on(self, link: str, point: str) -> Vector:
        """Return the force [N] on a link at one of its points, without weight and loads along it.

        Raises
        ------
        SceneError
            When the link lies between ground points, so that its forces are not determined.
        """
        if link in self.model.idle and all(beam.link != link for beam in self.model.linkage.elastic):
            raise SceneError(f"{link} lies between two ground points: the forces on it are not determined")
        if self._is_held_without(link, point):
            raise SceneError(
                f"{link} is held without {point}: the force there is not determined",
                hint="Its other joints hold it: record their forces.",
            )
        part = self._parts[link]
        own = [self._at_axis(part, point)] if isinstance(part, SpatialBody) else []
        return _sum([self._of_point(part, point), *own, *self._along_lines(link, point)])

    def bears_teeth(self, link: str, point: str) -> bool:
        """Return whether a link is joined at an axis of gears: forces there lack the pressure of the teeth.

        Through the axes it passes from a gear to the carrier, and from there to the ground.
        """
        there = {k.name for k in self.model.parts if point in _points(k) and k.name not in self.model.idle}
        there |= {""} if point in self.model.ground else set()
        return link in there and any(
            pair.carrier in there
            if link in pair.links
            else link == pair.carrier and not there.isdisjoint({*pair.links, ""})
            for pair in self.model.linkage.gears
        )

    def _is_held_without(self, link: str, point: str) -> bool:
        """Return whether other joints of a link leave the force at a point of it open."""
        shared = any((k.name, p.name) == (link, point) for k, p in self.model.shared)
        return shared and not any((row.link, row.point) == (link, point) for row in self.model.joints)

    def by_ground(self, point: str) -> Vector:
        """Return the part of the force of the ground at a point that lines of bodies leave to it [N]."""
        pulls = [x for k in self._lines if k.other == _GROUND for x in self._along_lines(k.link, point, [k])]
        at_axes = (self._at_axis(b, point) for b in self.model.linkage.bodies)
        return _sum([(ZERO,) * len(self.model.axes), *pulls, *at_axes])

    def _at_axis(self, body: SpatialBody, point: str) -> Vector:
        """Return the force at the hidden ground point of a hinged body: both points are one joint."""
        grounded = [b for b in body.base if b in self.model.ground]
        hidden = [b for b in grounded if b != point and self.model.linkage.point(b).hidden]
        if point in grounded and len(grounded) == 2 and hidden:
            return self._of_point(body, hidden[0])
        return (ZERO,) * len(self.model.axes)

    def tension(self, rod: RigidLink) -> sp.Expr:
        """Return the part of the multiplier of a rod that bodies on two of its points leave to it [N/m]."""
        lines = [k for k in self._lines if rod.name in (k.link, k.other)]
        parts = [rod.along(k.second) - rod.along(k.first) for k in lines]
        return sp.Add(
            *(
                -k.at(rod.name, k.first) * self._pull(k) * part**2
                for k, part in zip(lines, parts, strict=True)
            )
        )

    def _of_point(self, part: Part, p: str) -> Vector:
        """Return the force on a link at one of its points, of base points chosen for a body in space."""
        if (part.name, p) not in self._raw:
            self._raw[part.name, p] = self._force(part, p)
        return self._raw[part.name, p]

    def _force(self, part: Part, p: str) -> Vector:
        model = self.model
        if p in part.base:
            return self._on_base(part, p)
        if p in model.carrier and model.carrier[p][0] == part:
            others = [k for k in model.parts if k != part and k.name not in model.idle]
            there = [self._of_point(k, p) for k in others if p in _points(k)]
            return _sum([_on_point(model, p), *(_times(-1, x) for x in there)])
        rows = [row for row in model.joints if (row.link, row.point) == (part.name, p)]
        forces = [_times(model.multipliers[row.constraint.name].symbol, row.direction) for row in rows]
        masses = (
            [m for c, m in model.joint_masses(part) if c.name == p] if isinstance(part, RigidLink) else []
        )
        return _sum(
            [(ZERO,) * len(model.axes), *forces, *(_times(mass, model.acceleration(p)) for mass in masses)]
        )

    def _on_base(self, part: Part, p: str) -> Vector:
        """Return the force on a link at a base point, from its own equations."""
        if part.name not in self._part_forces:
            self._part_forces[part.name] = _forces_on_part(self.model, part)
        carried = [_share(part, c, p, self._of_point(part, c.name)) for c in part.carried]
        return _sum([self._part_forces[part.name][p], *(_times(-1, x) for x in carried)])

    def _along_lines(
        self, link: str, point: str, lines: Sequence[SharedLine] | None = None
    ) -> Iterator[Vector]:
        """Yield the forces on a link at a point that its lines add to those of its own equations [N]."""
        for line in self._lines if lines is None else lines:
            if line.at(link, point):
                yield _times(line.at(link, point) * self._pull(line), self._along(line))

    def _along(self, line: SharedLine) -> Vector:
        ends = self.model.position(line.first), self.model.position(line.second)
        return tuple(b - a for a, b in zip(*ends, strict=True))

    def _pull(self, line: SharedLine) -> sp.Expr:
        """Return the stress along a line over its length [N/m].

        With it the sum of the squares of the forces on all links is least, which does not depend on the order
        of links and points, nor on the base points of bodies.
        """
        if line not in self._pulls:
            coupled = [line]
            for other in coupled:  # which grows
                coupled += [k for k in self._lines if k not in coupled and {*k.places} & {*other.places}]
            uneven = [
                sp.Add(
                    *(
                        k.at(*place) * dot(self._along(k), self._of_point(self._parts[place[0]], place[1]))
                        for place in k.places
                    )
                )
                for k in coupled
            ]
            stresses = sp.Matrix([self._stress(k, coupled) for k in coupled])
            inverse = (stresses * stresses.T).inv().evalf(_DIGITS)
            for i, k in enumerate(coupled):
                self._pulls[k] = -sp.Add(*(c * x for c, x in zip(inverse.row(i), uneven, strict=True)))
        return self._pulls[line]

    @cached_property
    def _lines(self) -> list[SharedLine]:
        """The lines along which forces are not determined, without those that follow from others."""
        model = self.model
        bent = {beam.link for beam in model.linkage.elastic}
        parts = [k for k in model.parts if k.name not in {*bent, *model.idle}]
        bodies = [k for k in parts if isinstance(k, SpatialBody)]
        of_part = {
            k.name: [
                p
                for p in _points(k)
                if not model.linkage.point(p).hidden and not self._is_held_without(k.name, p)
            ]
            for k in (parts if bodies else [])
        }
        pairs = [(k.name, _GROUND) for k in bodies]
        pairs += [(a.name, b.name) for a, b in combinations(parts, 2) if a in bodies or b in bodies]
        places = {(k, p): i for i, (k, p) in enumerate((k, p) for k, named in of_part.items() for p in named)}
        lines: list[SharedLine] = []
        spanned = np.zeros((0, len(places) * len(model.axes)))
        for link, other in pairs:
            of_other = of_part[other] if other else model.ground
            for ends in combinations([p for p in of_part[link] if p in of_other], 2):
                line = SharedLine(link, other, *ends)
                drawn = self._stress(line, [line])
                stress = np.zeros((len(places), len(model.axes)))
                for place, force in zip(line.places, np.reshape(drawn, (-1, len(model.axes))), strict=True):
                    stress[places[place]] = force
                rest = stress.ravel() - spanned.T @ (spanned @ stress.ravel())
                if np.linalg.norm(rest) > _DEPENDENT * np.linalg.norm(stress):
                    spanned = np.vstack([spanned, rest / np.linalg.norm(rest)])
                    lines.append(line)
        return lines

    def _stress(self, line: SharedLine, among: Sequence[SharedLine]) -> list[sp.Expr]:
        """Return the forces of a line at all places of some lines, with the vector along it as drawn [m]."""
        ends = (self.model.linkage.point(p).at for p in (line.first, line.second))
        along = [rounded(b - a, _DIGITS) for a, b in zip(*ends, strict=True)]
        places = dict.fromkeys(place for k in among for place in k.places)
        return [line.at(*place) * x for place in places for x in along]


def _points(part: Part) -> tuple[str, ...]:
    """Return the points of a link."""
    return (*part.base, *(c.name for c in part.carried))


def _share(part: Part, carried: Place, base: str, force: Vector) -> Vector:
    """Return the force on a base point equivalent to a force on a carried point, by virtual work."""
    if isinstance(carried, WeightedPoint):
        return _times(carried.weights[part.base.index(base)], force)
    on_end = _times(carried.along, force)
    if len(force) == 2:
        on_end = _sum([on_end, _times(-carried.across, _left(force))])
    return on_end if base == part.base[1] else _sum([force, _times(-1, on_end)])


def _forces_on_part(model: ConstrainedPoints, part: Part) -> dict[str, Vector]:
    """Return M_k a + J_k^T lambda - f_k of one link alone at its base points."""
    by_point: dict[str, list[Vector]] = {p: [] for p in part.base}
    forces = _of_body(model, part) if isinstance(part, SpatialBody) else _of_link(model, part)
    for point, force in forces:
        by_point[point].append(force)
    return {p: _sum(each) for p, each in by_point.items()}


def _of_body(model: ConstrainedPoints, body: SpatialBody) -> Forces:
    accelerations = [model.acceleration(p) for p in body.base]
    for row, point, weight in zip(body.masses, body.base, body.centre, strict=True):
        yield point, _sum([_times(m, a) for m, a in zip(row, accelerations, strict=True)])
        yield point, _times(-body.mass * weight, model.linkage.gravity)
    for bar in model.bars[body.name]:
        name = bar_name(body, bar.start, bar.end)
        ends = (model.position(p) for p in (bar.start, bar.end))
        pull = _times(model.multipliers[name].symbol, tuple(b - a for a, b in zip(*ends, strict=True)))
        yield bar.end, pull
        yield bar.start, _times(-1, pull)
    for drive in model.turned:
        if body.name in drive.by_along:
            force = _times(model.multipliers[drive.constraint.name].symbol, drive.by_along[body.name])
            for end, share in drive.ends[body.name].items():
                yield end, _times(share, force)
    for _, torque in model.loads.couples(body.name):
        for point, (_, force) in zip(
            body.base[1:], model.loads.couple_in_space(body.name, torque), strict=True
        ):
            yield point, _times(-1, force)
            yield body.base[0], force


def _of_link(model: ConstrainedPoints, link: RigidLink) -> Forces:
    start, end = link.base
    a, b = (model.acceleration(p) for p in link.base)
    ends = end_mass(link.mass, link.length, link.centre, link.inertia, link.offset)
    yield start, _sum([_times(ends.a11, a), _times(ends.a12, b)])
    yield end, _sum([_times(ends.a12, a), _times(ends.a22, b)])
    gravity, share = model.linkage.gravity, link.mass * link.centre / link.length
    yield start, _times(share - link.mass, gravity)
    yield end, _times(-share, gravity)
    if link.offset != 0:
        yield start, _times(ends.cross, _left(b))
        yield end, _times(-ends.cross, _left(a))
    for point, force in model.loads.on_link(link.name):
        yield point, _times(-1, force)
    for on_along in _on_along(model, link):
        yield end, on_along
        yield start, _times(-1, on_along)
    for row in model.guides:
        if row.link == link.name:
            yield start, _times(-model.multipliers[row.constraint.name].symbol, row.by_point)


def _on_along(model: ConstrainedPoints, link: RigidLink) -> Iterator[Vector]:
    """Yield J^T lambda - f on the vector d along a link, which acts on its end and against its start."""
    d, lever = model.along[link.name], link.mass * link.offset / link.length
    if link.name in model.multipliers:  # a link between ground points has no constraint
        yield _times(model.multipliers[link.name].symbol, d)
    if link.offset != 0:
        yield _times(lever, _left(model.linkage.gravity))
    for _, torque in model.loads.couples(link.name):
        if len(torque) == 1:
            yield _times(-torque[0] / link.length**2, _left(d))
        else:
            ((_, force),) = model.loads.couple_in_space(link.name, torque)
            yield _times(-1, force)
    for row in (*model.turned, *model.gears, *model.welded_angles):
        multiplier = model.multipliers.get(row.constraint.name)
        if multiplier and link.name in row.by_along:
            yield _times(multiplier.symbol, row.by_along[link.name])
    for guide in model.guides:
        if guide.link == link.name:
            yield _times(model.multipliers[guide.constraint.name].symbol, guide.by_along)


def _on_point(model: ConstrainedPoints, point: str) -> Vector:
    """Return the loads on a point itself [N], the inertia of point masses and guides included."""
    forces = [(ZERO,) * len(model.axes), *model.loads.on_point(point)]
    for mass in model.linkage.masses:
        if mass.point == point:
            forces += [
                _times(mass.mass, model.linkage.gravity),
                _times(-mass.mass, model.acceleration(point)),
            ]
    forces += [_of_guide(model, link, point) for link, points in guided(model).items() if point in points]
    return _sum(forces)


def guided(model: ConstrainedPoints) -> dict[str, list[str]]:
    """Return the points that guides along each link guide."""
    pairs = dict.fromkeys((row.link, row.point) for row in model.guides)
    return {link: [p for k, p in pairs if k == link] for link, _ in pairs}


def guide_force(model: ConstrainedPoints, link: str, point: str) -> Entries:
    """Return the force of the guide along a link on a point [N], in the plane to the left of the link."""
    force, about = _of_guide(model, link, point), f"force of the guide along {link} on {point}"
    if len(model.shown_axes) == 3:
        return model.shown(force), "N", about
    across = cross_in_plane(model.along[link], force) / model.linkage.link(link).length
    return [across], "N", f"{about}, to the left of {link}"


def _of_guide(model: ConstrainedPoints, link: str, point: str) -> Vector:
    rows = [row for row in model.guides if (row.link, row.point) == (link, point)]
    return _sum([_times(-model.multipliers[row.constraint.name].symbol, row.by_point) for row in rows])


def _left(v: Vector) -> Vector:
    """Return a vector in the plane turned left by a right angle."""
    return (-v[1], v[0])


def _times(factor: sp.Expr | int, v: Vector) -> Vector:
    return tuple(factor * c for c in v)


def _sum(vectors: list[Vector]) -> Vector:
    return tuple(sp.Add(*components) for components in zip(*vectors, strict=True))
