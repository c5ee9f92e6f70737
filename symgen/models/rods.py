"""A linkage of rods and planar bodies in point coordinates: the derivation, step by step.

Source: H. A. Attia, *Dynamic Analysis of a Chain of Rigid Rods*, sections 2.1 to 2.3, in the symmetric
form [M J^T; J 0] [a; lambda] = [f; gamma] with the middle particle of each rod eliminated.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import sympy as sp

from symgen.errors import SceneError
from symgen.mechanics import loads
from symgen.mechanics.particles import Vector, cross, dot, end_mass
from symgen.mechanics.topology import Tree, spanning_tree
from symgen.models.constraints import Constraint, constraints
from symgen.scene.linkage import TIME, CarriedPoint, Linkage, RigidLink
from symgen.symbolic.calculus import ZERO, Calculus
from symgen.symbolic.quantity import Quantity, quantity

REFERENCE = "H. A. Attia, Dynamic Analysis of a Chain of Rigid Rods, sections 2.1 to 2.3"

Gradient = dict[sp.Symbol, sp.Expr]


class RodsModel:
    """Each property is one step of the derivation, and what outputs are made from.

    A point is *free* (it has coordinates that move), *ground* (its motion is known) or *carried* (a third
    point of a body, placed by the first two). Ground points have coordinates too while deriving, so that
    the reaction at a ground point is simply the residual of its rows; their known motion is put in at the
    end, by ``held``.
    """

    def __init__(self, linkage: Linkage) -> None:
        self.linkage = linkage
        self.axes = loads.AXES[: linkage.dimension]
        self.ground = [p.name for p in linkage.points if p.ground]
        self.carrier, self.shared = _carriers(linkage)
        self.free = [p.name for p in linkage.points if not p.ground and p.name not in self.carrier]
        names = [*self.free, *self.ground]
        self.q = self._per_point(names, "_", "m", "position")
        self.u = self._per_point(names, "_v", "m/s", "velocity")
        self.a = self._per_point(names, "_a", "m/s^2", "acceleration")
        self.calculus = Calculus(
            [x for p in names for x in self.q[p]], [x for p in names for x in self.u[p]], TIME.symbol
        )
        fixed = set(self.ground)
        self.rods = [k for k in linkage.links if not {k.start, k.end} <= fixed]
        self.idle = [k.name for k in linkage.links if {k.start, k.end} <= fixed]
        for point in self.free:
            if self.mass_entries.get((self.q[point][0].symbol,) * 2, ZERO) == 0:
                raise SceneError(
                    "this point carries no mass: nothing says how it accelerates", where=f"points.{point}"
                )

    def _per_point(
        self, names: Sequence[str], infix: str, unit: str, what: str
    ) -> dict[str, tuple[Quantity, ...]]:
        return {
            p: tuple(quantity(f"{p}{infix}{axis}", unit, f"{axis} {what} of {p}") for axis in self.axes)
            for p in names
        }

    @staticmethod
    def symbols(quantities: Sequence[Quantity]) -> Vector:
        """Return the bare symbols."""
        return tuple(x.symbol for x in quantities)

    @property
    def points(self) -> list[str]:
        """Names of all points, in the order of the scene."""
        return [p.name for p in self.linkage.points]

    @property
    def coordinates(self) -> list[Quantity]:
        """Coordinates of the free points, in order."""
        return [x for p in self.free for x in self.q[p]]

    @cached_property
    def held(self) -> dict[sp.Symbol, sp.Expr]:
        """Known motion of the ground points: position, velocity and acceleration."""
        known: dict[sp.Symbol, sp.Expr] = {}
        for name in self.ground:
            place: Vector = self.linkage.point(name).motion
            for group in (self.q, self.u, self.a):
                known.update(zip(self.symbols(group[name]), place, strict=True))
                place = tuple(sp.diff(c, TIME.symbol) for c in place)
        return known

    @cached_property
    def tree(self) -> Tree:
        """Spanning tree from the ground, and the links that close loops."""
        ends = {k.name: (k.start, k.end) for k in self.rods}
        return spanning_tree(self.ground, self.free, ends)

    @cached_property
    def along(self) -> dict[str, Vector]:
        """Vector along each link, from its start to its end [m]."""
        return {
            k.name: loads.vector_between(
                self.calculus, k.name, self.symbols(self.q[k.start]), self.symbols(self.q[k.end])
            )
            for k in self.linkage.links
        }

    def position(self, point: str) -> Vector:
        """Return the position of any point [m], linear in the coordinates."""
        if point in self.q:
            return self.symbols(self.q[point])
        return self.carried_position(*self.carrier[point])

    def carried_position(self, link: RigidLink, point: CarriedPoint) -> Vector:
        """Return r_i + x d + y (d turned left): where a body carries one of its points [m]."""
        start = self.symbols(self.q[link.start])
        d = self.along[link.name]
        turned = (-d[1], d[0]) if len(d) == 2 else (ZERO,) * len(d)
        return tuple(r + point.along * a + point.across * b for r, a, b in zip(start, d, turned, strict=True))

    def velocity(self, point: str) -> Vector:
        """Return the velocity of any point [m/s]."""
        return tuple(self.calculus.rate(c) for c in self.position(point))

    def acceleration(self, point: str) -> Vector:
        """Return the acceleration of any point [m/s^2], by the accelerations of the coordinates."""
        by_coordinate = {
            q.symbol: a.symbol for p, group in self.q.items() for q, a in zip(group, self.a[p], strict=True)
        }
        return tuple(
            sp.Add(*(slope * by_coordinate[s] for s, slope in self.calculus.gradient(c).items()))
            for c in self.position(point)
        )

    @cached_property
    def inertias(self) -> dict[tuple[str, str, str], sp.Expr]:
        """Masses of the kinetic energy: by two points, and ``dot`` or ``cross`` of their velocities [kg]."""
        found: dict[tuple[str, str, str], sp.Expr] = {}

        def add(a: str, b: str, kind: str, mass: sp.Expr) -> None:
            if mass != 0:
                found[a, b, kind] = found.get((a, b, kind), ZERO) + mass

        for k in self.rods:
            ends = end_mass(k.mass, k.length, k.centre, k.inertia, k.offset)
            add(k.start, k.start, "dot", ends.a11)
            add(k.start, k.end, "dot", ends.a12)
            add(k.end, k.end, "dot", ends.a22)
            add(k.start, k.end, "cross", -ends.cross)
        for m in self.linkage.masses:
            add(m.point, m.point, "dot", m.mass)
        return found

    @cached_property
    def mass_entries(self) -> dict[tuple[sp.Symbol, sp.Symbol], sp.Expr]:
        """Mass matrix by pairs of coordinates [kg]: the Hessian of the kinetic energy; zeros left out."""
        entries: dict[tuple[sp.Symbol, sp.Symbol], sp.Expr] = {}
        for (a, b, kind), mass in self.inertias.items():
            rows, columns = ([self.calculus.gradient(c) for c in self.position(p)] for p in (a, b))
            products = (
                [(r, c, mass) for r, c in zip(rows, columns, strict=True)]
                if kind == "dot"
                else [(rows[0], columns[1], mass), (rows[1], columns[0], -mass)]
            )
            for left, right, weight in products:
                for x, slope_x in left.items():
                    for y, slope_y in right.items():
                        value = weight * slope_x * slope_y
                        entries[x, y] = entries.get((x, y), ZERO) + value
                        if a != b:
                            entries[y, x] = entries.get((y, x), ZERO) + value
        return entries

    @cached_property
    def kinetic_energy(self) -> sp.Expr:
        """Kinetic energy [J]."""
        terms = []
        for (a, b, kind), mass in self.inertias.items():
            product = (dot if kind == "dot" else cross)(self.velocity(a), self.velocity(b))
            terms.append(mass * product / (2 if a == b else 1))
        return sp.Add(*terms)

    @cached_property
    def spring_lengths(self) -> dict[str, sp.Expr]:
        """Present length of each spring [m]."""
        lengths = {}
        for spring in self.linkage.springs:
            along = loads.vector_between(
                self.calculus, spring.name, self.position(spring.start), self.position(spring.end)
            )
            lengths[spring.name] = loads.distance(self.calculus, spring.name, along)
        return lengths

    @cached_property
    def potential_energy(self) -> sp.Expr:
        """Potential of gravity and springs [J]."""
        weights: dict[str, list[sp.Expr]] = {}
        terms: list[sp.Expr] = []
        for k in self.rods:
            share = k.mass * k.centre / k.length
            weights.setdefault(k.start, []).append(k.mass - share)
            weights.setdefault(k.end, []).append(share)
            if k.offset != 0:
                d = self.along[k.name]
                lever = k.offset / k.length
                terms.append(loads.weight_potential(k.mass * lever, self.linkage.gravity, (-d[1], d[0])))
        for mass in self.linkage.masses:
            weights.setdefault(mass.point, []).append(mass.mass)
        terms += [
            loads.weight_potential(sp.Add(*masses), self.linkage.gravity, self.position(point))
            for point, masses in weights.items()
        ]
        terms += [
            loads.spring_potential(s.stiffness, s.length, self.spring_lengths[s.name])
            for s in self.linkage.springs
        ]
        return sp.Add(*terms)

    @cached_property
    def other_loads(self) -> list[tuple[sp.Expr, Gradient, sp.Expr]]:
        """Loads without potential: each a force, the gradient of what it works on, and the rate of that."""
        found = []
        for load in self.linkage.forces:
            for component, place in zip(load.force, self.position(load.point), strict=True):
                found.append((component, self.calculus.gradient(place), self.calculus.rate(place)))
        for spring in self.linkage.springs:
            if spring.damping != 0:
                length = self.spring_lengths[spring.name]
                rate = self.calculus.rate(length)
                found.append((-spring.damping * rate, self.calculus.gradient(length), rate))
        for torque in self.linkage.torques:
            for link, sign in ((torque.link, 1), (torque.against, -1)):
                if link:
                    gradient, rate = self.turning(link)
                    found.append((sign * torque.torque, gradient, rate))
        return found

    def turning(self, link: str) -> tuple[Gradient, sp.Expr]:
        """Return gradient and rate of the direction angle of a link in the plane: d x dd / l^2."""
        d = self.along[link]
        squared = self.linkage.link(link).length ** 2
        gx, gy = (self.calculus.gradient(c) for c in d)
        gradient = {q: (d[0] * gy.get(q, ZERO) - d[1] * gx.get(q, ZERO)) / squared for q in {**gx, **gy}}
        rates = tuple(self.calculus.rate(c) for c in d)
        return gradient, cross(d, rates) / squared

    @cached_property
    def force(self) -> Gradient:
        """Force on every coordinate [N]: minus the gradient of the potential, plus the other loads."""
        parts: dict[sp.Symbol, list[sp.Expr]] = {}
        for q, slope in self.calculus.gradient(self.potential_energy).items():
            parts.setdefault(q, []).append(-slope)
        for force, gradient, _ in self.other_loads:
            for q, slope in gradient.items():
                parts.setdefault(q, []).append(force * slope)
        return {q: sp.Add(*terms) for q, terms in parts.items()}

    @cached_property
    def power(self) -> sp.Expr:
        """Power of the loads without potential, of drives and of the moving ground [W]."""
        terms = [force * rate for force, _, rate in self.other_loads]
        terms += [
            self.multipliers[row.name].symbol * sp.diff(row.expression, TIME.symbol)
            for row in self.constraints
            if TIME.symbol in row.expression.free_symbols
        ]
        for point in self.ground:
            velocity = [self.held[s] for s in self.symbols(self.u[point])]
            terms.append(dot(tuple(velocity), self.residual(point)) if any(velocity) else ZERO)
        return sp.Add(*terms)

    @cached_property
    def constraints(self) -> list[Constraint]:
        """All constraint rows."""
        return constraints(self)

    @cached_property
    def multipliers(self) -> dict[str, Quantity]:
        """Lagrange multiplier of each constraint row."""
        return {
            c.name: quantity(f"{c.name}_lambda", c.multiplier_unit, f"multiplier of {c.label}")
            for c in self.constraints
        }

    @cached_property
    def jacobian(self) -> list[Gradient]:
        """Rows of the constraint Jacobian by coordinate, ground included; zero entries left out."""
        return [self.calculus.gradient(c.expression) for c in self.constraints]

    @cached_property
    def acceleration_rhs(self) -> list[sp.Expr]:
        """Right-hand side gamma of J a = gamma: what is left of the second rate, with the ground's part."""
        rate = self.calculus.rate
        ground = [
            (q, a)
            for p in self.ground
            for q, a in zip(self.q[p], self.a[p], strict=True)
            if self.held[a.symbol] != 0
        ]
        return [
            -rate(rate(c.expression)) - sp.Add(*(row.get(q.symbol, ZERO) * a.symbol for q, a in ground))
            for c, row in zip(self.constraints, self.jacobian, strict=True)
        ]

    @cached_property
    def applied(self) -> list[sp.Expr]:
        """Force on the free coordinates, less what the acceleration of the ground takes of it [N]."""
        ground = [
            (q.symbol, a.symbol) for p in self.ground for q, a in zip(self.q[p], self.a[p], strict=True)
        ]
        return [
            self.force.get(x.symbol, ZERO)
            - sp.Add(*(self.mass_entries.get((x.symbol, q), ZERO) * self.held[a] for q, a in ground))
            for x in self.coordinates
        ]

    def residual(self, point: str) -> Vector:
        """Return M a + J^T lambda - f at a point's rows [N]: the force its pin must supply."""
        every = [x for p in self.q for x in zip(self.q[p], self.a[p], strict=True)]
        result = []
        for own in self.symbols(self.q[point]):
            terms = [self.mass_entries.get((own, q.symbol), ZERO) * a.symbol for q, a in every]
            terms += [
                row.get(own, ZERO) * self.multipliers[c.name].symbol
                for c, row in zip(self.constraints, self.jacobian, strict=True)
            ]
            result.append(sp.Add(*terms) - self.force.get(own, ZERO))
        return tuple(result)

    def rod(self, name: str) -> RigidLink | None:
        """Return the moving link of this name, if there is one."""
        return next((k for k in self.rods if k.name == name), None)


def _carriers(
    linkage: Linkage,
) -> tuple[dict[str, tuple[RigidLink, CarriedPoint]], list[tuple[RigidLink, CarriedPoint]]]:
    """Say which body places which point; where a point has a place already, the body shares it as a joint."""
    placed = {p.name for p in linkage.points if p.ground} | {
        e for k in linkage.links for e in (k.start, k.end)
    }
    carrier: dict[str, tuple[RigidLink, CarriedPoint]] = {}
    shared = []
    for link in linkage.links:
        for point in link.carried:
            if point.name in placed:
                shared.append((link, point))
            else:
                placed.add(point.name)
                carrier[point.name] = (link, point)
    return carrier, shared
