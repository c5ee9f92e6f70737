"""What the momentum rows of a linkage are summed from: particles, forces and couples, by body and point.

Source: H. A. Attia, *Dynamic Analysis of a Chain of Rigid Rods*, sections 2.1 to 2.3.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import sympy as sp

from symgen.mechanics.momentum import OpenTree, Particle, open_tree, particles
from symgen.mechanics.particles import Vector, dot
from symgen.models.constraints import Constraint
from symgen.models.rods import RodsModel
from symgen.scene.linkage import RigidLink
from symgen.symbolic.calculus import ONE, ZERO
from symgen.symbolic.quantity import Quantity, quantity
from symgen.symbolic.system import Definition

#: How a place of a body moves with a point: so much with it, and so much with it turned left.
Shares = dict[str, tuple[sp.Expr, sp.Expr]]


@dataclass(frozen=True, slots=True)
class Push:
    """A force [N] at a place [m]; times an unknown where there is one."""

    place: Vector
    force: Vector
    unknown: sp.Symbol | None = None


class Outboard:
    """A linkage opened to trees, and what acts on each part of it from outside.

    Whatever acts between two things is left out when both are inside: it has neither resultant nor moment.
    """

    def __init__(self, model: RodsModel) -> None:
        self.model = model
        self.linkage = model.linkage
        self.link = {k.name: k for k in model.rods}
        self.tree: OpenTree = open_tree(
            model.ground,
            [p for p in model.points if p not in model.ground],
            {k.name: (k.start, k.end, *(c.name for c in k.carried)) for k in model.rods},
        )
        self.definitions: dict[sp.Symbol, Definition] = {}
        self.cut_forces = {
            (body, point): self.unknown_force(
                f"{body}_{point}_cut", f"force on {body} where it is cut at {point}"
            )
            for body, point in self.tree.cuts
        }
        joints = {f"{k.name}_{p.name}_{axis}" for k, p in model.shared for axis in model.axes}
        #: Constraints whose forces no cut and no tree takes up: guides and drives.
        self.forced = [c for c in model.constraints if not c.link and c.name not in joints]

    def unknown_force(self, name: str, description: str) -> tuple[Quantity, ...]:
        """Return the components of an unknown force [N]."""
        axes = self.model.axes
        return tuple(quantity(f"{name}_{a}", "N", f"{a} component of the {description}") for a in axes)

    def define(self, name: str, expression: sp.Expr, unit: str, description: str) -> sp.Expr:
        """Name a subexpression; numbers and bare symbols are handed back as they are."""
        if expression.is_Atom:
            return expression
        new = quantity(name, unit, description)
        self.definitions[new.symbol] = Definition(new, expression)
        return new.symbol

    def particles(self, link: RigidLink) -> tuple[Particle, ...]:
        """Return the particles of a link."""
        return particles(link.mass, link.length, link.centre, link.inertia, link.offset)

    def weights(self, point: str) -> Shares:
        """Return how a point moves with points that have coordinates: parts along, and turned left."""
        if point in self.model.q:
            return {point: (ONE, ZERO)}
        link, carried = self.model.carrier[point]
        return _shares(link, carried.along, carried.across)

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
            for mass, x, y in self.particles(link):
                yield mass, _shares(link, x, y), self.place(link, x, y)
        inside = set(points)
        for placed in self.linkage.masses:
            if placed.point in inside:
                yield placed.mass, self.weights(placed.point), self.model.position(placed.point)

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
        for load in self.linkage.forces:
            if load.point in points:
                yield Push(position(load.point), load.force)
        for spring in self.linkage.springs:
            sign = (spring.start in points) - (spring.end in points)
            if sign:
                pull = self.spring_forces[spring.name]
                yield Push(position(spring.start if sign > 0 else spring.end), tuple(sign * c for c in pull))
        for (body, point), force in self.cut_forces.items():
            sign = (body in bodies) - (point in points)
            for i, component in enumerate(force if sign else ()):
                unit = tuple(sp.Integer(sign * (i == k)) for k in range(len(force)))
                yield Push(position(point), unit, component.symbol)
        for constraint in self.forced:
            point, along, normal = self.guide(constraint)
            sign = (point in points) - (along in bodies)
            if point and sign:
                force = tuple(-sign * c for c in normal)
                yield Push(position(point), force, self.model.multipliers[constraint.name].symbol)

    def couples(self, bodies: Iterable[str]) -> Iterator[tuple[Vector, sp.Symbol | None]]:
        """Yield every couple on these bodies from outside of them; times an unknown where there is one."""
        inside = set(bodies)
        for torque in self.linkage.torques:
            sign = (torque.link in inside) - (torque.against in inside)
            if sign:
                yield (sign * torque.torque,), None
        for driver in self.linkage.drivers:
            if driver.link in inside:
                unknown = self.model.multipliers[f"{driver.link}_drive"].symbol
                yield (-self.link[driver.link].length,), unknown

    @cached_property
    def spring_forces(self) -> dict[str, Vector]:
        """Force of each spring on its start [N]."""
        found = {}
        for spring in self.linkage.springs:
            ends = (spring.start, spring.end)
            along, rates = (
                tuple(b - a for a, b in zip(*(of(p) for p in ends), strict=True))
                for of in (self.model.position, self.model.velocity)
            )
            span = self.define(
                f"{spring.name}_span", sp.sqrt(dot(along, along)), "m", f"length of {spring.name}"
            )
            pull = spring.stiffness * (span - spring.length) + spring.damping * dot(along, rates) / span
            about = f"force over length of {spring.name}"
            pull = self.define(f"{spring.name}_pull", pull / span, "N/m", about)
            found[spring.name] = tuple(pull * c for c in along)
        return found

    def guide(self, constraint: Constraint) -> tuple[str, str, Vector]:
        """Return the guided point, the link along which it slides, and the row's derivative by the point."""
        for guide in self.linkage.guides:
            for point in guide.points:
                if constraint.name.startswith(f"{guide.name}_{point}"):
                    d = self.model.along[guide.along]
                    if len(d) == 2:
                        return point, guide.along, (-d[1], d[0])
                    gradient = self.model.calculus.gradient(constraint.expression)
                    its = self.model.symbols(self.model.q[point])
                    return point, guide.along, tuple(gradient.get(s, ZERO) for s in its)
        return "", "", ()


def _shares(link: RigidLink, along: sp.Expr, across: sp.Expr) -> Shares:
    shares = {link.start: (ONE - along, -across), link.end: (along, across)}
    return {p: share for p, share in shares.items() if any(share)}
