"""Constraint rows of a linkage: one function for each kind of constraint."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import sympy as sp

from symgen.mechanics.rods.loads import vector_between
from symgen.mechanics.rods.particles import Vector, length_constraint
from symgen.models.rods.loads import Loads
from symgen.models.rods.points import Points, bar_name
from symgen.scene.rods.linkage import Linkage, RigidLink
from symgen.symbolic.calculus import ONE, ZERO, chained
from symgen.symbolic.quantity import Quantity, quantity
from symgen.symbolic.switch import Sign
from symgen.symbolic.vectors import cross, cross_in_plane, dot


@dataclass(frozen=True, slots=True)
class Motion:
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
    motion: Motion | None = None
    carrier: str = ""

    @property
    def multiplier_unit(self) -> str:
        """Unit of the Lagrange multiplier: force times length over the constraint's unit."""
        return {"m^2": "N/m", "m": "N"}[self.unit]


def _lengths(model: Points) -> Iterator[Constraint]:
    """(d.d - l^2)/2, Eq. (3a) halved."""
    for rod in model.rods:
        expression = length_constraint(model.along[rod.name], rod.length)
        yield Constraint(rod.name, f"the length of link {rod.name}", expression, rod.length, "m^2", rod.name)


def _shapes(model: Points) -> Iterator[Constraint]:
    """(d.d - l^2)/2 between the base points of a body in space."""
    for body in model.linkage.bodies:
        for bar in body.bars:
            start, end = (model.position(p) for p in (bar.start, bar.end))
            name, label = bar_name(body, bar.start, bar.end), f"the shape of link {body.name}"
            along = vector_between(model.calculus, name, start, end, model.axes)
            yield Constraint(name, label, length_constraint(along, bar.length), bar.length, "m^2", name)


def _shared_joints(model: Points) -> Iterator[Constraint]:
    """r_p = (1 - z) r_i + z r_j where the point p of a link is already placed by another component."""
    free = {q.symbol for q in model.coordinates}
    for link, point in model.shared:
        carried = model.carried_position(link, point)
        for axis, coordinate, other in zip(model.axes, model.position(point.name), carried, strict=True):
            name = f"{link.name}_{point.name}_{axis}"
            if not free & model.calculus.gradient(coordinate - other).keys():
                continue  # ground on ground: the row constrains no moving point
            label = f"the joint {point.name} of link {link.name}"
            if model.linkage.point(point.name).hidden:
                label = f"a rigid joint of link {link.name}"
            yield Constraint(name, label, coordinate - other, ONE, "m", carrier=link.name)


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
    points = [model.linkage.point(p) for p in (start, end)]
    moved = [tuple(b - a for a, b in zip(p.at, p.motion, strict=True)) for p in points if p.ground]
    return len(moved) == 2 and moved[0] == moved[1]


def _across_a_turning_rod(
    model: Points, guide: str, link: RigidLink, point: str, there: Vector
) -> Iterator[GuideRow]:
    """Yield n . (r - z d) = 0 for two vectors n across d, with z d the part of r along d.

    n = d x c and (d x c) x d / l, where c is the axis x or z, whichever is more transverse to d: with a
    constant c, or one that follows d continuously, both vanish in some direction. The rates n . (r' - z d')
    and n . (r'' - z d'' - 2 z' d') are those of the rows with n held constant. The motion that they allow
    does not depend on the choice of n, so that it is smooth where c jumps.
    """
    calculus, d, r = model.calculus, model.along[link.name], there
    name = f"{guide}_{point}"

    def named(noun: str, vector: Vector, unit: str, about: str) -> Vector:
        return tuple(
            calculus.define(f"{name}_{noun}_{axis}", c, unit, f"{axis} component of {about}")
            for axis, c in zip(model.axes, vector, strict=True)
        )

    about = f"1 where {link.name} is along x more than along z, -1 where less"
    squared = dot(d, d) if link.name in model.idle else link.length**2
    more = (d[0] - d[2]) * (d[0] + d[2]) / squared
    side = calculus.define(f"{name}_side", Sign(more), "1", about)
    # For a side of zero c is not along d either: its components x and z differ then.
    c = ((1 - side) / 2, ZERO, 1 + side)
    z = calculus.define(f"{name}_place", dot(d, r) / squared, "1", f"place of {point} along {link.name}")
    first = named("across", cross(d, c), "m", f"a vector across {link.name}")
    upright = tuple(x / link.length for x in cross(first, d))
    second = named("upright", upright, "m", f"a vector across {link.name} and the other one")
    rates_of_d, rates_of_r = (tuple(calculus.rate(x) for x in v) for v in (d, r))
    sliding = tuple(a - z * b for a, b in zip(rates_of_r, rates_of_d, strict=True))
    speed = calculus.define(f"{name}_speed", dot(d, sliding) / squared, "1/s", f"rate of {name}_place")
    scale = sp.sqrt(dot(first, first))
    label = f"the guide of {point} along {link.name}"
    for i, n in enumerate((first, second), 1):
        by_along = tuple(-z * x for x in n)
        motion = Motion(
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
    """A row on directions of links, with its derivatives by the vectors along them."""

    constraint: Constraint
    by_along: dict[str, Vector]


def turning_rows(model: Points) -> Iterator[AngleRow]:
    """n.d = 0 with n across the prescribed direction of a link; a.d = a.d0 of a revolute joint in space."""
    for hinge in model.linkage.hinges:
        hinge_frame, label = model.hinges[hinge.link], f"the revolute joint of {hinge.link} at {hinge.point}"
        row = Constraint(f"{hinge.link}_hinge", label, hinge_frame.error(model.along[hinge.link]), ONE, "m")
        yield AngleRow(row, {hinge.link: hinge_frame.axis})
    for driver in model.linkage.drivers:
        name, frame = driver.link, model.hinges.get(driver.link)
        across = frame.tangent(driver.angle) if frame else (-sp.sin(driver.angle), sp.cos(driver.angle))
        row = Constraint(
            f"{name}_drive", f"the drive of link {name}", dot(across, model.along[name]), ONE, "m"
        )
        yield AngleRow(row, {name: across})


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


class ConstrainedPoints(Points):
    """Points of a linkage with the loads on them, their constraint rows and the multipliers of these."""

    def __init__(self, linkage: Linkage) -> None:
        super().__init__(linkage)
        self.loads = Loads(self)

    @cached_property
    def constraints(self) -> list[Constraint]:
        """All constraint rows: rod lengths first, in the order of the links."""
        rows = [*_lengths(self), *_shapes(self), *_shared_joints(self)]
        rows += [row.constraint for row in self.guides]
        rows += [row.constraint for row in self.turned]
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
    def guides(self) -> tuple[GuideRow, ...]:
        """The rows of guides."""
        return tuple(guide_rows(self))

    @cached_property
    def turned(self) -> tuple[AngleRow, ...]:
        """The rows of revolute joints in space, and of drives."""
        return tuple(turning_rows(self))

    @cached_property
    def welded_angles(self) -> tuple[AngleRow, ...]:
        """The rows of welds."""
        return tuple(angle_rows(self))

    @cached_property
    def multipliers(self) -> dict[str, Quantity]:
        """Lagrange multiplier of each constraint row."""
        return {
            c.name: quantity(f"{c.name}_lambda", c.multiplier_unit, f"multiplier of {c.label}")
            for c in self.constraints
        }
