"""Points of a linkage: kinds, positions, velocities and accelerations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

import sympy as sp

from symgen.loads.measure import Gradient
from symgen.mechanics.rods import loads
from symgen.mechanics.rods.hinge import HingeFrame, hinge_frame
from symgen.mechanics.rods.particles import Vector, end_mass, joint_mass
from symgen.mechanics.rods.topology import Tree, spanning_tree
from symgen.scene.rods.linkage import TIME, Bar, CarriedPoint, Linkage, RigidLink, SpatialBody, WeightedPoint
from symgen.symbolic.calculus import ZERO, Calculus, partial
from symgen.symbolic.constants import Replacement
from symgen.symbolic.quantity import Quantity, quantity
from symgen.symbolic.vectors import cross, cross_in_plane, dot

Part = RigidLink | SpatialBody
Place = CarriedPoint | WeightedPoint
#: Slopes below which vectors between points are constant: round-off of the drawing.
_DRAWN = 1e-9


class Points:
    """Points of a linkage in terms of coordinates.

    A point is *free* (it has coordinates that move), *ground* (its motion is prescribed) or *carried* (placed
    by the base points of one link: it adds no unknowns). Where a link carries a point that is already placed,
    or has coordinates of its own, the link *shares* it, as a joint with rows of its own. Ground points have
    coordinates too during the derivation, so that the reaction at a ground point is the residual of its rows;
    their motion is substituted at the end, by ``held``.
    """

    def __init__(self, linkage: Linkage) -> None:
        self.linkage = linkage
        self.axes, self.shown_axes = linkage.axes, linkage.shown_axes
        self.parts: tuple[Part, ...] = (*linkage.links, *linkage.bodies)
        self.ground = [p.name for p in linkage.points if p.ground]
        self._held = frozenset(self.ground)
        self.carrier, self.shared = _carriers(self.parts, self.ground)
        #: Points with coordinates of their own.
        self.moving = [p.name for p in linkage.points if not p.ground and p.name not in self.carrier]
        #: Owners of coordinates: these points, and behind them the first-order states.
        self.free = [*self.moving, *(s.name for s in linkage.states)]
        names = [*self.moving, *self.ground]
        self.q = self._per_point(names, "_", "m", "position")
        self.u = self._per_point(names, "_v", "m/s", "velocity")
        self.a = self._per_point(names, "_a", "m/s^2", "acceleration")
        for s in linkage.states:
            unit, of_rate, of_integral = s.units
            self.q[s.name] = (quantity(s.integral, of_integral, f"integral of {s.about}"),)
            self.u[s.name] = (quantity(s.name, unit, s.about),)
            self.a[s.name] = (quantity(f"{s.name}_rate", of_rate, f"rate of {s.about}"),)
        self.calculus = Calculus(
            [x for of in self.q.values() for x in of], [x for of in self.u.values() for x in of], TIME.symbol
        )
        fixed = [self.is_fixed(k.start) and self.is_fixed(k.end) for k in linkage.links]
        self.rods = [k for k, is_fixed in zip(linkage.links, fixed, strict=True) if not is_fixed]
        self.idle = [k.name for k, is_fixed in zip(linkage.links, fixed, strict=True) if is_fixed]
        #: Moving links, and those between fixed points that have weight.
        self.massive = [
            k for k, is_fixed in zip(linkage.links, fixed, strict=True) if not is_fixed or k.mass != 0
        ]
        self._along: dict[str, Vector] = {}

    def _per_point(
        self, names: Sequence[str], infix: str, unit: str, noun: str
    ) -> dict[str, tuple[Quantity, ...]]:
        return {
            p: tuple(quantity(f"{p}{infix}{axis}", unit, f"{axis} {noun} of {p}") for axis in self.axes)
            for p in names
        }

    @staticmethod
    def symbols(quantities: Sequence[Quantity]) -> Vector:
        """Return the bare symbols."""
        return tuple(x.symbol for x in quantities)

    @property
    def points(self) -> list[str]:
        """Names of all points, in the order of the scene; those added by symgen come last."""
        return [p.name for p in self.linkage.points]

    @property
    def coordinates(self) -> list[Quantity]:
        """Coordinates of the free points, in order."""
        return [x for p in self.free for x in self.q[p]]

    @cached_property
    def held(self) -> dict[sp.Symbol, sp.Expr]:
        """Prescribed motion of the ground points: position, velocity and acceleration."""
        known: dict[sp.Symbol, sp.Expr] = {}
        for name in self.ground:
            place: Vector = self.linkage.point(name).motion
            for group in (self.q, self.u, self.a):
                known.update(zip(self.symbols(group[name]), place, strict=True))
                place = tuple(partial(c, TIME.symbol) for c in place)
        return known

    @cached_property
    def in_place(self) -> Replacement:
        """The prescribed motion of the ground points, and multipliers of motions as zero, substituted."""
        without = (sp.Symbol(multiplier_of(m.name), real=True) for m in self.linkage.motions)
        return Replacement(self.held | dict.fromkeys(without, ZERO))

    def supports(self, point: str) -> tuple[str, ...]:
        """Return the free and ground points that place a point: itself if it has coordinates."""
        if point not in self.carrier:
            return (point,)
        part, _ = self.carrier[point]
        return tuple(dict.fromkeys(s for base in part.base for s in self.supports(base)))

    def is_fixed(self, point: str) -> bool:
        """Return whether only ground points place a point."""
        return all(s in self._held for s in self.supports(point))

    @cached_property
    def tree(self) -> Tree:
        """Spanning tree from the ground, and the links that close loops."""
        ends = {k.name: (k.start, k.end) for k in self.rods if k.name not in self.implied}
        held = [(k, b) for k in self.linkage.bodies for b in self.bars[k.name]]
        bars = {bar_name(k, b.start, b.end): (b.start, b.end) for k, b in held}
        bodies = {bar_name(k, b.start, b.end): k.name for k, b in held}
        supports = {p: self.supports(p) for p in self.carrier}
        return spanning_tree(self.ground, self.moving, {**ends, **bars}, supports, bodies)

    def varies(self, component: sp.Expr) -> bool:
        """Return whether an expression depends on coordinates by more than the digits of the drawing."""
        slopes = self.calculus.gradient(component)
        constants = self.linkage.constants
        free = (slopes[x.symbol].xreplace(constants) for x in self.coordinates if x.symbol in slopes)
        return any(not (k.is_number and abs(k) < _DRAWN) for k in free)

    @cached_property
    def bars(self) -> dict[str, tuple[Bar, ...]]:
        """The distances that each body in space keeps, without those that its neighbours keep."""
        return {
            body.name: tuple(
                bar
                for bar in body.bars
                if any(
                    self.varies(b - a)
                    for a, b in zip(self.position(bar.start), self.position(bar.end), strict=True)
                )
            )
            for body in self.linkage.bodies
        }

    @cached_property
    def implied(self) -> frozenset[str]:
        """Rods between points of a body in space, which keeps their length without their help."""
        of_bodies = [set(_names(body)) for body in self.linkage.bodies]
        bases = [set(body.base) for body in self.linkage.bodies]
        return frozenset(
            k.name
            for k in self.rods
            if k.as_drawn
            and not self.linkage.elastic
            and any(points.issuperset(k.base) for points in of_bodies)
            and not any(base.issuperset(k.base) for base in bases)
        )

    def common_points(self, joint: int) -> tuple[str, ...]:
        """Return the points in which the link of a shared joint meets another component of that joint."""
        link, point = self.shared[joint]
        if self.linkage.elastic or not _keeps_shape(link):
            return ()
        pending = {(k.name, p.name) for k, p in self.shared[joint:]}
        shift = self.shift(point.name)
        ground = [p for p in self.ground if self.shift(p) == shift]
        others = [("", ground), *((k.name, _names(k)) for k in self.parts if k != link and _keeps_shape(k))]
        found: list[tuple[str, ...]] = [()]
        for name, points in others:
            if point.name in points and (name, point.name) not in pending:
                joined = [p for p in points if (name, p) not in pending and (link.name, p) not in pending]
                found.append(tuple(p for p in _names(link) if p in joined and p != point.name))
        return max(found, key=len)

    def shift(self, point: str) -> Vector:
        """Return the motion of a point from where it is drawn, which ground points have [m]."""
        placed, constants = self.linkage.point(point), self.linkage.constants
        return tuple(a.xreplace(constants) - b for a, b in zip(placed.motion, placed.at, strict=True))

    @cached_property
    def along(self) -> dict[str, Vector]:
        """Vector along each link, from its start to its end [m]."""
        return {k.name: self.vector_along(k.name) for k in self.linkage.links}

    @cached_property
    def hinges(self) -> dict[str, HingeFrame]:
        """Frame of the revolute joint of each rod in space that has one, as drawn."""
        rods = [hinge for hinge in self.linkage.hinges if self.linkage.body(hinge.link) is None]
        ends = {hinge.link: self.linkage.link(hinge.link).base for hinge in rods}
        return {h.link: hinge_frame(h.axis, self.drawn_from(*ends[h.link])) for h in rods}

    def drawn_from(self, start: str, end: str) -> Vector:
        """Return the vector between two points as drawn [m]."""
        places = (self.linkage.point(p).at for p in (start, end))
        return tuple(b - a for a, b in zip(*places, strict=True))

    def farthest(self, points: Sequence[str], start: str, axis: Vector) -> str:
        """Return the point that is drawn farthest from an axis through a point."""

        def distance(point: str) -> float:
            moment = cross(axis, self.drawn_from(start, point))
            return self.linkage.number(dot(moment, moment))

        return max(points, key=distance)

    def vector_along(self, link: str) -> Vector:
        """Return the vector along one link, which other links may need before theirs [m]."""
        if link not in self._along:
            start, end = (self.position(p) for p in self.linkage.link(link).base)
            self._along[link] = loads.vector_between(self.calculus, link, start, end, self.axes)
        return self._along[link]

    def shown(self, vector: Vector, across: sp.Expr = ZERO) -> Vector:
        """Return a vector by the axes of the scene; ``across`` is its component normal to the plane."""
        plane = self.linkage.plane
        return plane.lifted(vector, across) if plane else vector

    def shown_position(self, point: str) -> Vector:
        """Return the position of any point [m] by the axes of the scene."""
        plane = self.linkage.plane
        return self.shown(self.position(point), plane.level if plane else ZERO)

    def position(self, point: str) -> Vector:
        """Return the position of any point [m], linear in the coordinates."""
        if point in self.q:
            return self.symbols(self.q[point])
        return self.carried_position(*self.carrier[point])

    def carried_position(self, part: Part, point: Place) -> Vector:
        """Return the place of a point in a link [m]: r_i + x d + y (d rotated left), or by weights."""
        if isinstance(point, WeightedPoint):
            return self.weighted(part, point.weights)
        start, d = self.position(part.base[0]), self.vector_along(part.name)
        turned = (-d[1], d[0]) if len(d) == 2 else (ZERO,) * len(d)
        return tuple(r + point.along * a + point.across * b for r, a, b in zip(start, d, turned, strict=True))

    def weighted(self, part: Part, weights: Vector) -> Vector:
        """Return the weighted sum of the base points of a link [m]."""
        places = [self.position(p) for p in part.base]
        return tuple(
            sp.Add(*(w * place[i] for w, place in zip(weights, places, strict=True)))
            for i in range(len(self.axes))
        )

    def joint_masses(self, link: RigidLink) -> Iterator[tuple[CarriedPoint, sp.Expr]]:
        """Yield the points of a link with coordinates of their own, and the part of its mass at each."""
        joined = [c for c in link.carried if c.joined]
        if link.mass != 0:
            ends = end_mass(link.mass, link.length, link.centre, link.inertia, link.offset)
            yield from ((c, joint_mass(ends, c.along, c.across, len(joined))) for c in joined)

    def velocity(self, point: str) -> Vector:
        """Return the velocity of any point [m/s]."""
        return tuple(self.calculus.rate(c) for c in self.position(point))

    def turning(self, link: str) -> tuple[Gradient, sp.Expr]:
        """Return gradient and rate of the direction angle of a link in the plane: d x dd / l^2."""
        d = self.along[link]
        squared = self.linkage.link(link).length ** 2
        gx, gy = (self.calculus.gradient(c) for c in d)
        products = ((-d[1], gx), (d[0], gy))
        gradient = {
            q: sp.Add(*(sp.Mul(lever, g[q]) for lever, g in products if q in g)) / squared
            for q in {**gx, **gy}
        }
        rates = tuple(self.calculus.rate(c) for c in d)
        return gradient, cross_in_plane(d, rates) / squared

    def turning_acceleration(self, link: str) -> sp.Expr:
        """Return the second time derivative of the direction angle of a link in the plane [rad/s^2]."""
        gradient, rate = self.turning(link)
        slopes = (slope * self.acceleration_of[q] for q, slope in gradient.items())
        return sp.Add(self.calculus.rate(rate), *slopes)

    def acceleration(self, point: str) -> Vector:
        """Return the acceleration of any point [m/s^2], by the accelerations of the coordinates."""
        return tuple(
            sp.Add(*(slope * self.acceleration_of[s] for s, slope in self.calculus.gradient(c).items()))
            for c in self.position(point)
        )

    @cached_property
    def acceleration_of(self) -> dict[sp.Symbol, sp.Symbol]:
        """The acceleration of every coordinate, ground included."""
        return {
            q.symbol: a.symbol for p, group in self.q.items() for q, a in zip(group, self.a[p], strict=True)
        }


def bar_name(body: SpatialBody, start: str, end: str) -> str:
    """Return the name of the row that keeps two base points of a body apart."""
    return f"{body.name}_{start}_{end}"


def multiplier_of(row: str) -> str:
    """Return the name of the multiplier of a row."""
    return f"{row}_lambda"


def _names(part: Part) -> tuple[str, ...]:
    """Return the points of a link."""
    return (*part.base, *(c.name for c in part.carried))


def _keeps_shape(part: Part) -> bool:
    return not isinstance(part, RigidLink) or part.as_drawn


def _carriers(
    parts: Sequence[Part], ground: Sequence[str]
) -> tuple[dict[str, tuple[Part, Place]], list[tuple[Part, Place]]]:
    """Determine the link that places each point; one already placed, or joined, becomes a shared joint."""
    carrier: dict[str, tuple[Part, Place]] = {}
    shared: list[tuple[Part, Place]] = []
    for part in parts:
        for point in part.carried:
            joined = point.joined
            has_carrier = joined or point.name in ground or point.name in carrier
            if has_carrier or _rests_on(part, point.name, carrier):
                shared.append((part, point))
            else:
                carrier[point.name] = (part, point)
    return carrier, shared


def _rests_on(part: Part, point: str, carrier: dict[str, tuple[Part, Place]]) -> bool:
    """Return whether a link's base is placed by a point."""
    return any(b == point or (b in carrier and _rests_on(carrier[b][0], point, carrier)) for b in part.base)
