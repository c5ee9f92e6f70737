"""Forces on one link at its points, from its neighbours and the loads there.

For a base point of a link it is the residual of the link alone, M_k a + J_k^T lambda - f_k, minus the forces
at the points that the link carries. At a carried point the forces on all links there balance the loads
on the point, and at a joint with rows of its own the force is the multiplier.
"""

from __future__ import annotations

from collections.abc import Iterator

import sympy as sp

from symgen.errors import SceneError
from symgen.mechanics.rods.particles import Vector, end_mass
from symgen.models.rods.constraints import ConstrainedPoints
from symgen.models.rods.points import Part, Place, bar_name
from symgen.scene.rods.linkage import RigidLink, SpatialBody, WeightedPoint
from symgen.symbolic.calculus import ZERO
from symgen.symbolic.vectors import dot

#: Forces on some points of a link, to be added up.
Forces = Iterator[tuple[str, Vector]]


class JointForces:
    """The forces on the links of one linkage, each derived once."""

    def __init__(self, model: ConstrainedPoints) -> None:
        self.model = model
        self._parts = {part.name: part for part in model.parts}
        self._part_forces: dict[str, dict[str, Vector]] = {}
        self._joint_forces: dict[tuple[str, str], Vector] = {}

    def on(self, link: str, point: str) -> Vector:
        """Return the force [N] on a link at one of its points, without weight and loads along it.

        Raises
        ------
        SceneError
            When the link lies between ground points, so that its forces are not determined.
        """
        if link in self.model.idle and all(beam.link != link for beam in self.model.linkage.elastic):
            raise SceneError(f"{link} lies between two ground points: the forces on it are not determined")
        shared = any((k.name, p.name) == (link, point) for k, p in self.model.shared)
        if shared and not any((row.link, row.point) == (link, point) for row in self.model.joints):
            raise SceneError(
                f"{link} is held without {point}: the force there is not determined",
                hint="Its other joints hold it: record their forces.",
            )
        return self._on(link, point)

    def _on(self, link: str, point: str) -> Vector:
        """Return the same, zero at a joint that nothing depends on."""
        if (link, point) not in self._joint_forces:
            self._joint_forces[link, point] = self._force(self._parts[link], point)
        return self._joint_forces[link, point]

    def _force(self, part: Part, p: str) -> Vector:
        model = self.model
        if p in part.base:
            return _sum([self._on_base(part, p), self.evened(part, p)])
        if p in model.carrier and model.carrier[p][0] == part:
            others = [k for k in model.parts if k != part and k.name not in model.idle]
            there = [self._on(k.name, p) for k in others if p in (*k.base, *(c.name for c in k.carried))]
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
        carried = [_share(part, c, p, self._on(part.name, c.name)) for c in part.carried]
        return _sum([self._part_forces[part.name][p], *(_times(-1, x) for x in carried)])

    def evened(self, part: Part, p: str) -> Vector:
        """Return the correction of a force at a base point to the minimum norm, or to that of an axis.

        For a body in space that is held at two ground points only the sum of the forces along their line is
        determined. Without the correction, the order of its base points would decide their parts.
        """
        grounded = [b for b in part.base if b in self.model.ground]
        if not isinstance(part, SpatialBody) or p not in grounded or len(grounded) != 2:
            return (ZERO,) * len(self.model.axes)
        other = grounded[1 - grounded.index(p)]
        if self.model.linkage.point(other).hidden:  # both are one joint
            return self._on_base(part, other)
        line = _sum([self.model.position(other), _times(-1, self.model.position(p))])
        less = _sum([self._on_base(part, other), _times(-1, self._on_base(part, p))])
        return _times(dot(line, less) / (2 * dot(line, line)), line)


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
            for end, share in model.arm_ends(body.name).items():
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
    for row in (*model.turned, *model.welded_angles):
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
    for row in model.guides:
        if row.point == point:
            forces.append(_times(-model.multipliers[row.constraint.name].symbol, row.by_point))
    return _sum(forces)


def _left(v: Vector) -> Vector:
    """Return a vector in the plane turned left by a right angle."""
    return (-v[1], v[0])


def _times(factor: sp.Expr | int, v: Vector) -> Vector:
    return tuple(factor * c for c in v)


def _sum(vectors: list[Vector]) -> Vector:
    return tuple(sp.Add(*components) for components in zip(*vectors, strict=True))
