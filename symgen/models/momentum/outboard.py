"""Terms of the momentum rows of a linkage: particles, forces and couples, by body and point.

Source: H. A. Attia, *Dynamic Analysis of a Chain of Rigid Rods*, sections 2.1 to 2.3.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import sympy as sp

from symgen.errors import DerivationError
from symgen.loads.measure import PointForce
from symgen.mechanics.rods.momentum import OpenTree, Particle, open_tree, particles, transverse
from symgen.mechanics.rods.particles import Vector
from symgen.models.momentum.cuts import Cut, check_open
from symgen.models.rods.constraints import AngleRow
from symgen.models.rods.linkage import RodsModel
from symgen.scene.rods.linkage import CarriedPoint, RigidLink
from symgen.symbolic.calculus import ONE, ZERO
from symgen.symbolic.quantity import Quantity, quantity
from symgen.symbolic.system import Definition
from symgen.symbolic.vectors import cross, cross_in_plane

#: How a place of a body moves with a point: so much with it, and so much with it turned left.
Shares = dict[str, tuple[sp.Expr, sp.Expr]]
_PLACES = {1: "at its start", 2: "at its middle", 3: "at its end", 4: "to the left of its end"}


@dataclass(frozen=True, slots=True)
class Push:
    """A force [N] at a place [m]; times an unknown where there is one."""

    place: Vector
    force: Vector
    unknown: sp.Symbol | None = None


class Outboard:
    """A linkage opened to trees, with the external loads on each of its parts.

    Internal forces and couples, which act between two items inside a part, are omitted.
    """

    def __init__(self, model: RodsModel, cuts: tuple[Cut, ...] = ()) -> None:
        self.model, self.cuts = model, cuts
        self.linkage = model.linkage
        self.link = {k.name: k for k in model.rods}
        self.tree: OpenTree = open_tree(
            [p for p in model.points if model.is_fixed(p)],
            [p for p in model.points if not model.is_fixed(p)],
            {k.name: (k.start, k.end, *(c.name for c in k.carried)) for k in model.rods},
        )
        self.definitions: dict[sp.Symbol, Definition] = {}
        check_open(self.tree, cuts)
        self.cut_forces = {
            cut: self.unknown_force(
                f"{cut.link}_{cut.point}_cut", f"force on {cut.link} where it is cut at {cut.point}"
            )
            for cut in cuts or tuple(Cut(body, point, point) for body, point in self.tree.cuts)
        }
        #: Constraints whose forces no cut and no tree takes up: guides and drives.
        self.forced = [c for c in model.constraints if not c.link and not c.carrier]

    def unknown_force(self, name: str, description: str) -> tuple[Quantity, ...]:
        """Return the components of an unknown force [N]."""
        axes = self.model.axes
        return tuple(quantity(f"{name}_{a}", "N", f"{a} component of the {description}") for a in axes)

    def define(self, name: str, expression: sp.Expr, unit: str, description: str) -> sp.Expr:
        """Name a subexpression; numbers, bare symbols and those whose name the scene has are as they are."""
        new = quantity(name, unit, description)
        if expression.is_Atom or new.symbol in self.linkage.defaults:
            return expression
        self.definitions[new.symbol] = Definition(new, expression)
        return new.symbol

    def particles(self, link: RigidLink) -> Iterator[Particle]:
        """Yield the particles of a link, with named masses."""
        for p in particles(link.mass, link.length, link.centre, link.inertia, link.offset):
            about = f"mass of the particle {p.number} of {link.name}, {_PLACES[p.number]}"
            yield p._replace(mass=self.define(f"m{p.number}_{link.name}", p.mass, "kg", about))

    def weights(self, point: str) -> Shares:
        """Return how a point moves with points that have coordinates: parts along, and turned left."""
        if point in self.model.q:
            return {point: (ONE, ZERO)}
        link, carried = self.model.carrier[point]
        if not isinstance(link, RigidLink) or not isinstance(carried, CarriedPoint):
            raise DerivationError(
                f"{self.linkage.name}: the momentum rows of the body {link.name} are not known"
            )
        return self.shares(link, carried.along, carried.across)

    def shares(self, link: RigidLink, along: sp.Expr, across: sp.Expr) -> Shares:
        """Return how a place of a link moves with points that have coordinates."""
        shares: Shares = {}
        for end, (x, y) in ((link.start, (ONE - along, -across)), (link.end, (along, across))):
            for point, (z, w) in self.weights(end).items():
                before = shares.get(point, (ZERO, ZERO))
                shares[point] = before[0] + x * z - y * w, before[1] + x * w + y * z
        return {p: share for p, share in shares.items() if any(share)}

    def place(self, link: RigidLink, along: sp.Expr, across: sp.Expr) -> Vector:
        """Return a place of a link [m]: from the end that is its inner joint, or else from its start."""
        by_end = self.tree.inner[link.name] == link.end
        x, y = (along - ONE if by_end else along), across
        base = self.model.position(link.end if by_end else link.start)
        d = self.model.along[link.name]
        turned = (-d[1], d[0]) if len(d) == 2 else (ZERO,) * 3
        return tuple(r + x * a + y * b for r, a, b in zip(base, d, turned, strict=True))

    def masses(
        self, bodies: Iterable[str], points: Iterable[str]
    ) -> Iterator[tuple[sp.Expr, Shares, Vector]]:
        """Yield every particle: mass, how it moves, and where it is."""
        for body in bodies:
            link = self.link[body]
            for p in self.particles(link):
                yield p.mass, self.shares(link, p.along, p.across), self._of_particle(link, p)
        inside = set(points)
        for placed in self.linkage.masses:
            if placed.point in inside:
                yield placed.mass, self.weights(placed.point), self.model.position(placed.point)

    def _of_particle(self, link: RigidLink, p: Particle) -> Vector:
        """Return the position of a particle of a link [m]; away from the ends it has letters of its own."""
        if p.across == 0 and p.along in (ZERO, ONE):
            return self.model.position(link.end if p.along else link.start)
        about = f"position of the particle {p.number} of {link.name}, {_PLACES[p.number]}"
        place = zip(self.model.axes, self.place(link, p.along, p.across), strict=True)
        return tuple(self.define(f"r{p.number}_{link.name}_{a}", r, "m", f"{a} {about}") for a, r in place)

    def pushes(self, bodies: Iterable[str], points: Iterable[str]) -> Iterator[Push]:
        """Yield every force on these bodies and points from outside of them."""
        bodies, points = set(bodies), set(points)
        position = self.model.position
        if any(self.linkage.gravity):
            for link in self.link.values():
                if link.name in bodies and link.mass != 0:
                    weight = tuple(link.mass * g for g in self.linkage.gravity)
                    yield Push(self.place(link, link.centre / link.length, link.offset / link.length), weight)
            for placed in self.linkage.masses:
                if placed.point in points:
                    yield Push(position(placed.point), tuple(placed.mass * g for g in self.linkage.gravity))
        yield from self._applied(bodies, points)
        for cut, force in self.cut_forces.items():
            sign = (cut.link in bodies) - (cut.point in points)
            for i, component in enumerate(force if sign else ()):
                unit = tuple(sp.Integer(sign * (i == k)) for k in range(len(force)))
                yield Push(position(cut.own if sign > 0 else cut.point), unit, component.symbol)
        for row in self.model.guides:
            sign = (row.point in points) - (row.link in bodies)
            if sign:
                force = tuple(-sign * c for c in row.by_point)
                yield Push(position(row.point), force, self.model.multipliers[row.constraint.name].symbol)

    def _applied(self, bodies: set[str], points: set[str]) -> Iterator[Push]:
        """Yield the forces of loads on these bodies and points, but for those balanced between them."""
        for _, term in self.model.loads.terms:
            if term.on.balanced and points.issuperset(p for _, p in term.on.points):
                continue
            for action in self.model.loads.actions(term):
                if isinstance(action, PointForce):
                    inside = action.link in bodies if action.link else action.point in points
                    if inside:
                        yield Push(self.model.position(action.point), action.force)

    def couples(self, bodies: Iterable[str]) -> Iterator[tuple[Vector, sp.Symbol | None]]:
        """Yield every couple on these bodies from outside of them; times an unknown where there is one."""
        inside = set(bodies)
        for body in (k for k in self.link if k in inside):
            for against, couple in self.model.loads.couples(body):
                if len(couple) == 3:
                    yield transverse(couple, self.model.along[body], self.link[body].length), None
                elif against not in inside:
                    yield couple, None
        for row in (*self.model.turned, *self.model.gears):
            torques = [self._torque(row, k) for k in row.by_along if k in inside]
            couple = tuple(sp.Add(*c) for c in zip(*torques, strict=True))
            if any(couple):
                yield couple, self.model.multipliers[row.constraint.name].symbol

    def _torque(self, row: AngleRow, link: str) -> Vector:
        """Return the couple of a row on a link over its multiplier."""
        if link in row.torques:
            return (row.torques[link],)
        along, across = self.model.along[link], row.by_along[link]
        return (-cross_in_plane(along, across),) if len(along) == 2 else cross(across, along)
