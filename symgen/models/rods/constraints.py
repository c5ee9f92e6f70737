"""Constraint rows of a linkage: one function for each kind of constraint."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import sympy as sp

from symgen.mechanics.rods.across import named_vector, vectors_across
from symgen.mechanics.rods.gear import mesh_change, mesh_error, mesh_slopes, turns
from symgen.mechanics.rods.loads import vector_between
from symgen.mechanics.rods.particles import Vector, length_constraint
from symgen.models.rods.drives import AngleDrive, Drive, angle_drive, other_drives
from symgen.models.rods.drives.motion import motion_error
from symgen.models.rods.loads import Loads
from symgen.models.rods.points import Points, bar_name, multiplier_of
from symgen.scene.rods.linkage import Linkage, RigidLink
from symgen.symbolic.calculus import ONE, ZERO, chained
from symgen.symbolic.quantity import Quantity, quantity
from symgen.symbolic.vectors import cross, cross_in_plane, dot


@dataclass(frozen=True, slots=True)
class RowDerivatives:
    """Derivatives of a row on the constraints.

    Its gradient by coordinate, its rate, and the part of its second rate that holds no acceleration.
    """

    gradient: dict[sp.Symbol, sp.Expr]
    rate: sp.Expr
    second_rate: sp.Expr


@dataclass(frozen=True, slots=True)
class Constraint:
    """One row Phi = 0.

    ``expression`` over ``scale`` is an error in metres; ``unit`` is the unit of the expression, ``label``
    its name in messages, ``link`` the rod, or the bar of a body, whose length it constrains, and ``carrier``
    the link that a point is joined to. ``motion`` holds the derivatives of a row in a frame of its own; None
    selects those of the expression.
    """

    name: str
    label: str
    expression: sp.Expr
    scale: sp.Expr
    unit: str
    link: str = ""
    motion: RowDerivatives | None = None
    carrier: str = ""

    @property
    def multiplier_unit(self) -> str:
        """Unit of the Lagrange multiplier: force times length over the constraint's unit."""
        return {"m^2": "N/m", "m": "N"}.get(self.unit, "SI")


def _lengths(model: Points) -> Iterator[Constraint]:
    """(d.d - l^2)/2, Eq. (3a) halved."""
    for rod in model.rods:
        if rod.name in model.implied:
            continue
        expression = length_constraint(model.along[rod.name], rod.length)
        yield Constraint(rod.name, f"the length of link {rod.name}", expression, rod.length, "m^2", rod.name)


def _shapes(model: Points) -> Iterator[Constraint]:
    """(d.d - l^2)/2 between the base points of a body in space."""
    for body in model.linkage.bodies:
        for bar in model.bars[body.name]:
            start, end = (model.position(p) for p in (bar.start, bar.end))
            name, label = bar_name(body, bar.start, bar.end), f"the shape of link {body.name}"
            along = vector_between(model.calculus, name, start, end, model.axes)
            yield Constraint(name, label, length_constraint(along, bar.length), bar.length, "m^2", name)


@dataclass(frozen=True, slots=True)
class JointRow:
    """A row of a point of a link that is already placed: ``direction`` is that of its force on the link."""

    constraint: Constraint
    link: str
    point: str
    direction: Vector


def joint_rows(model: Points) -> Iterator[JointRow]:
    """Rows n . (r_p - (1 - z) r_i - z r_j) = 0 of points p of links that another component places already.

    The directions n are the axes. In space, where the link has more points in common with the other
    component, they are those that these leave free: none of the rows then follows from the others.
    """
    for number, (link, point) in enumerate(model.shared):
        carried = model.carried_position(link, point)
        gap = tuple(a - b for a, b in zip(model.position(point.name), carried, strict=True))
        gap = tuple(c if model.varies(c) else ZERO for c in gap)
        label = f"the joint {point.name} of link {link.name}"
        if model.linkage.point(point.name).hidden:
            label = f"a rigid joint of link {link.name}"
        name = f"{link.name}_{point.name}"
        for suffix, n, scale, moves in _directions(model, number):
            along = dot(n, gap)
            if along == 0:
                continue
            motion = None
            if moves:  # the gap is zero, so that n counts as constant
                slopes = _chained(model, (n, gap))
                motion = RowDerivatives(slopes, dot(n, tuple(model.calculus.rate(c) for c in gap)), ZERO)
            unit = "m^2" if moves else "m"
            row = Constraint(f"{name}_{suffix}", label, along, scale, unit, motion=motion, carrier=link.name)
            yield JointRow(row, link.name, point.name, n)


def _directions(model: Points, number: int) -> Iterator[tuple[str, Vector, sp.Expr, bool]]:
    """Yield name, direction and scale of the rows of a joint, and whether the direction moves."""
    link, point = model.shared[number]
    common = model.common_points(number) if len(model.axes) == 3 else ()
    if not common:
        for i, axis in enumerate(model.axes):
            yield axis, tuple(ONE if i == k else ZERO for k in range(len(model.axes))), ONE, False
        return
    places = [model.linkage.point(p).at for p in (point.name, *common)]
    drawn = np.array([[model.linkage.number(c) for c in at] for at in places])
    arms = drawn[1:] - drawn[0]
    size, far = np.max(np.linalg.norm(arms, axis=1)), int(np.argmax(np.linalg.norm(arms, axis=1)))
    spread = np.linalg.svd(arms[np.arange(len(arms)) != far] - arms[far], compute_uv=False)
    rank = int(np.sum(spread > _APART * size))
    in_line = int(np.sum(np.linalg.svd(arms, compute_uv=False) > _APART * size)) <= rank
    if rank >= 2 or in_line:
        return
    name, here = f"{link.name}_{point.name}", model.position(point.name)

    def arm(k: int) -> Vector:
        return tuple(b - a for a, b in zip(here, model.position(common[k]), strict=True))

    length = sp.sqrt(sp.Add(*((b - a) ** 2 for a, b in zip(places[0], places[far + 1], strict=True))))
    if rank == 0:
        line = f"the line from {point.name} to {common[far]}"
        vectors = vectors_across(model.calculus, name, line, arm(far), length**2, length)
    else:
        other = int(np.argmax(np.linalg.norm(np.cross(arms, arms[far]), axis=1)))
        normal = tuple(c / length for c in cross(arm(far), arm(other)))
        vectors = [
            named_vector(model.calculus, f"{name}_normal", normal, f"the normal of the joints of {link.name}")
        ]
    for i, n in enumerate(vectors, 1):
        yield str(i), n, sp.sqrt(dot(n, n)), True


#: The part of the distance of joints by which others must be off their line or plane.
_APART = 1e-6


@dataclass(frozen=True, slots=True)
class GuideRow:
    """A row of a guide, with its derivatives by the vector along the link and by the guided point."""

    constraint: Constraint
    link: str
    point: str
    by_along: Vector
    by_point: Vector


def guide_rows(model: Points) -> Iterator[GuideRow]:
    """(r_p - r_a) x d = 0, Eq. (16b): a point stays on the line of a link."""
    for guide in model.linkage.guides:
        link = model.linkage.link(guide.along)
        d = model.along[link.name]
        start = model.position(link.start)
        for point in guide.points:
            there = tuple(b - a for a, b in zip(start, model.position(point), strict=True))
            label = f"the guide of {point} along {link.name}"
            if len(d) == 2:
                row = Constraint(f"{guide.name}_{point}", label, cross_in_plane(d, there), link.length, "m^2")
                yield GuideRow(row, link.name, point, (there[1], -there[0]), (-d[1], d[0]))
                continue
            if not _keeps_direction(model, link.start, link.end):
                yield from _across_a_turning_rod(model, guide.name, link, point, there)
                continue
            for i in _constrained_components(model, link.start, link.end):
                j, k = (i + 1) % 3, (i + 2) % 3
                name = f"{guide.name}_{point}_{model.axes[i]}"
                row = Constraint(name, label, d[j] * there[k] - d[k] * there[j], link.length, "m^2")
                by_d, by_r = [ZERO] * 3, [ZERO] * 3
                by_d[j], by_d[k], by_r[k], by_r[j] = there[k], -there[j], d[j], -d[k]
                yield GuideRow(row, link.name, point, tuple(by_d), tuple(by_r))


def _keeps_direction(model: Points, start: str, end: str) -> bool:
    """Return whether a link between ground points keeps its direction."""
    moved = [model.shift(p) for p in (start, end) if model.linkage.point(p).ground]
    return len(moved) == 2 and moved[0] == moved[1]


def _across_a_turning_rod(
    model: Points, guide: str, link: RigidLink, point: str, there: Vector
) -> Iterator[GuideRow]:
    """Yield n . (r - z d) = 0 for two vectors n across d, with z d the part of r along d.

    The rates n . (r' - z d') and n . (r'' - z d'' - 2 z' d') are those of the rows with n held constant. The
    motion that they allow does not depend on the choice of n, so that it is smooth where that jumps.
    """
    calculus, d, r = model.calculus, model.along[link.name], there
    name = f"{guide}_{point}"
    squared = dot(d, d) if link.name in model.idle else link.length**2
    vectors = vectors_across(model.calculus, name, link.name, d, squared, link.length)
    z = calculus.define(f"{name}_place", dot(d, r) / squared, "1", f"place of {point} along {link.name}")
    rates_of_d, rates_of_r = (tuple(calculus.rate(x) for x in v) for v in (d, r))
    sliding = tuple(a - z * b for a, b in zip(rates_of_r, rates_of_d, strict=True))
    speed = calculus.define(f"{name}_speed", dot(d, sliding) / squared, "1/s", f"rate of {name}_place")
    scale = sp.sqrt(dot(vectors[0], vectors[0]))
    label = f"the guide of {point} along {link.name}"
    for i, n in enumerate(vectors, 1):
        by_along = tuple(-z * x for x in n)
        motion = RowDerivatives(
            _chained(model, (n, r), (by_along, d)), dot(n, sliding), -2 * speed * dot(n, rates_of_d)
        )
        bound = Constraint(f"{name}_{i}", label, dot(n, r), scale, "m^2", motion=motion)
        yield GuideRow(bound, link.name, point, by_along, n)


def _chained(model: Points, *parts: tuple[Vector, Vector]) -> dict[sp.Symbol, sp.Expr]:
    """Return the gradient by coordinate of vectors, each with the derivative by its components in front."""
    pairs = (pair for slopes, vector in parts for pair in zip(slopes, vector, strict=True))
    return chained((slope, model.calculus.gradient(component)) for slope, component in pairs)


def _constrained_components(model: Points, start: str, end: str) -> list[int]:
    """Return the two components of a cross product that are independent where the link is drawn."""
    ends = (model.linkage.point(p).at for p in (start, end))
    drawn = [abs(model.linkage.number(b - a)) for a, b in zip(*ends, strict=True)]
    return [i for i in range(3) if i != drawn.index(max(drawn))]


@dataclass(frozen=True, slots=True)
class AngleRow:
    """A row on directions of links, with its derivatives by the vectors along them, or the arms of bodies.

    ``ends`` are the parts with which base points count in the arms of bodies. ``torques`` of the row on links
    in the plane, over its multiplier [m], are stated where they are simpler than those of the derivatives.
    """

    constraint: Constraint
    by_along: dict[str, Vector]
    ends: Mapping[str, Mapping[str, sp.Expr]] = field(default_factory=dict)
    torques: Mapping[str, sp.Expr] = field(default_factory=dict)


def turning_rows(model: ConstrainedPoints) -> Iterator[AngleRow]:
    """a.d = a.d0 of a revolute joint of a rod in space, and the rows of drives of angles."""
    points = {hinge.link: hinge.point for hinge in model.linkage.hinges}
    for link, frame in model.hinges.items():  # a body has two points on its axis
        label = f"the revolute joint of {link} at {points[link]}"
        row = Constraint(f"{link}_hinge", label, frame.error(model.along[link]), ONE, "m")
        yield AngleRow(row, {link: frame.axis})
    for drive in model.angle_drives:
        label, across = f"the drive of link {drive.owner}", drive.across
        row = Constraint(drive.row, label, dot(across, drive.arm), ONE, "m")
        yield AngleRow(row, {drive.owner: across, **drive.slopes}, drive.ends, drive.torques)


def angle_rows(model: Points) -> Iterator[AngleRow]:
    """|a||b| sin of the change of the angle from b to a: it is constant where links are welded."""
    for angle in model.linkage.welded_angles:
        if {angle.link, angle.other} <= {"", *model.idle}:
            continue
        (ax, ay), length = model.along[angle.link], model.linkage.link(angle.link).length
        bx, by = model.along[angle.other] if angle.other else (ONE, ZERO)
        c, s = angle.cosine, angle.sine
        expression = c * (bx * ay - by * ax) - s * (ax * bx + ay * by)
        slopes = {angle.link: (-c * by - s * bx, c * bx - s * by)}
        if angle.other:
            slopes[angle.other] = (c * ay - s * ax, -c * ax - s * ay)
            row = Constraint(angle.name, angle.label, expression, length, "m^2")
        else:
            row = Constraint(angle.name, angle.label, expression, ONE, "m")
        yield AngleRow(row, slopes)


def gear_rows(model: Points) -> Iterator[AngleRow]:
    """Yield the mesh of gears, times the length of the first link over its teeth: an error at its end."""
    for pair in model.linkage.gears:
        factors, first = turns(pair.links, pair.teeth, pair.carrier), pair.links[0]
        links = {k: model.linkage.link(k) for k in factors}
        ends = {k: [model.linkage.point(p).at for p in link.base] for k, link in links.items()}
        drawn = {k: tuple(b - a for a, b in zip(*at, strict=True)) for k, at in ends.items()}
        size = links[first].length / pair.teeth[0]
        by_sum = mesh_slopes(factors, model.along, {k: link.length for k, link in links.items()})
        slopes = {k: tuple(size * c for c in v) for k, v in by_sum.items()}
        gradient = _chained(model, *((v, model.along[k]) for k, v in slopes.items()))
        rate = sp.Add(*(slope * model.calculus.rate(q) for q, slope in gradient.items()))
        motion = RowDerivatives(gradient, rate, model.calculus.rate(rate))
        label = f"the gears of {' and '.join(pair.links)}"
        change = mesh_change(factors, model.along, drawn)
        about = f"change of the mesh of {label} from the drawing"
        error = size * mesh_error(model.calculus.define(f"{pair.name}_change", change, "rad", about))
        yield AngleRow(Constraint(pair.name, label, error, ONE, "m", motion=motion), slopes)


class ConstrainedPoints(Points):
    """Points of a linkage with the loads on them, their constraint rows and the multipliers of these."""

    def __init__(self, linkage: Linkage) -> None:
        super().__init__(linkage)
        self.loads = Loads(self)

    @cached_property
    def constraints(self) -> list[Constraint]:
        """All constraint rows: rod lengths first, in the order of the links."""
        rows = [*_lengths(self), *_shapes(self)]
        rows += [row.constraint for row in self.joints]
        rows += [row.constraint for row in self.guides]
        rows += [row.constraint for row in (*self.turned, *self.gears)]
        for m in self.linkage.motions:
            rows.append(Constraint(m.name, f"the motion of {m.text}", motion_error(self.loads, m), ONE, "m"))
        angles = [row.constraint for row in self.welded_angles]
        # At rest hinges determine the pose of a frame as far as they can, and welds the remaining freedoms.
        return [*rows, *(angles if self.linkage.moves else self._holding(rows, angles))]

    def _holding(self, rows: Sequence[Constraint], angles: Sequence[Constraint]) -> list[Constraint]:
        """Return the angles that fix freedoms of no other constraint.

        Constraints count as independent where each can have a coordinate of its own.
        """
        coordinates = [x.symbol for x in self.coordinates]
        owners: dict[sp.Symbol, Constraint] = {}

        def owns(row: Constraint, seen: set[sp.Symbol]) -> bool:
            slopes = self.calculus.gradient(row.expression)
            for x in coordinates:
                if x in slopes and x not in seen:
                    seen.add(x)
                    if x not in owners or owns(owners[x], seen):
                        owners[x] = row
                        return True
            return False

        if angles:
            for row in rows:
                owns(row, set())
        return [row for row in angles if owns(row, set())]

    @cached_property
    def joints(self) -> tuple[JointRow, ...]:
        """The rows of points of links that are placed already."""
        return tuple(joint_rows(self))

    @cached_property
    def guides(self) -> tuple[GuideRow, ...]:
        """The rows of guides."""
        return tuple(guide_rows(self))

    @cached_property
    def sliding(self) -> list[str]:
        """The guides of two points or more of one body, whose line is then parallel to that of the guide."""
        bodies = [{k.start, k.end, *(c.name for c in k.carried)} for k in self.rods]
        return [
            guide.name
            for guide in self.linkage.guides
            if len(guide.points) > 1 and any(points.issuperset(guide.points) for points in bodies)
        ]

    @cached_property
    def angle_drives(self) -> tuple[AngleDrive, ...]:
        """The drives of the angles of links."""
        return tuple(angle_drive(self, driver) for driver in self.linkage.drivers)

    @cached_property
    def drives(self) -> tuple[Drive, ...]:
        """All that is prescribed as a function of time."""
        return (*self.angle_drives, *other_drives(self))

    @cached_property
    def turned(self) -> tuple[AngleRow, ...]:
        """The rows of revolute joints in space, and of drives."""
        return tuple(turning_rows(self))

    @cached_property
    def gears(self) -> tuple[AngleRow, ...]:
        """The rows of gears."""
        return tuple(gear_rows(self))

    @cached_property
    def welded_angles(self) -> tuple[AngleRow, ...]:
        """The rows of welds."""
        return tuple(angle_rows(self))

    @cached_property
    def multipliers(self) -> dict[str, Quantity]:
        """Lagrange multiplier of each constraint row."""
        return {
            c.name: quantity(multiplier_of(c.name), c.multiplier_unit, f"multiplier of {c.label}")
            for c in self.constraints
        }
