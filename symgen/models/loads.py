"""Loads of a linkage: potentials of gravity and springs, and loads that do work without a potential."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import sympy as sp

from symgen.mechanics import loads
from symgen.mechanics.particles import Vector, cross, dot
from symgen.scene.linkage import (
    AngularSpring,
    DistributedForce,
    LinearSpring,
    LineForce,
    SpatialBody,
    state_of,
)
from symgen.symbolic.calculus import ONE, ZERO

if TYPE_CHECKING:
    from symgen.models.rods import RodsModel

Gradient = dict[sp.Symbol, sp.Expr]
#: A load by virtual work: a force, the gradient of what it works on, and the rate of that.
Work = tuple[sp.Expr, Gradient, sp.Expr]


class Loads:
    """The loads on one linkage."""

    def __init__(self, model: RodsModel) -> None:
        self.model, self.linkage, self.calculus = model, model.linkage, model.calculus
        self._lines: dict[str, Vector] = {}
        self._lengths: dict[str, sp.Expr] = {}

    def line(self, name: str, start: str, end: str) -> Vector:
        """Return the vector from one end of a spring or an actuator to the other [m]."""
        if name not in self._lines:
            a, b = (self.model.position(p) for p in (start, end))
            self._lines[name] = loads.vector_between(self.calculus, name, a, b, self.model.axes)
        return self._lines[name]

    def length(self, name: str, start: str, end: str) -> sp.Expr:
        """Return the present length of a spring or an actuator [m]; whoever asks divides by it."""
        if name not in self._lengths:
            self._lengths[name] = loads.distance(self.calculus, name, self.line(name, start, end))
        return self._lengths[name]

    @cached_property
    def divided(self) -> list[tuple[str, sp.Expr]]:
        """Label and length of every spring and actuator whose force is divided by its length."""
        lines: list[LinearSpring | LineForce] = [*self.linkage.springs, *self.linkage.actuators]
        return [
            (
                f"the {line.name.partition('_')[0]} between {line.start} and {line.end}",
                self._lengths[line.name],
            )
            for line in lines
            if line.name in self._lengths
        ]

    @cached_property
    def potential(self) -> sp.Expr:
        """Potential of gravity and of springs between points, and of bending in space [J]."""
        weights: dict[str, list[sp.Expr]] = {}
        terms: list[sp.Expr] = []
        gravity = self.linkage.gravity
        for k in self.model.rods:
            share = k.mass * k.centre / k.length
            weights.setdefault(k.start, []).append(k.mass - share)
            weights.setdefault(k.end, []).append(share)
            if k.offset != 0:
                d = self.model.along[k.name]
                lever = k.offset / k.length
                terms.append(loads.weight_potential(k.mass * lever, gravity, (-d[1], d[0])))
        for body in self.linkage.bodies:
            for point, weight in zip(body.base, body.centre, strict=True):
                weights.setdefault(point, []).append(body.mass * weight)
        for mass in self.linkage.masses:
            weights.setdefault(mass.point, []).append(mass.mass)
        terms += [
            loads.weight_potential(sp.Add(*masses), gravity, self.model.position(point))
            for point, masses in weights.items()
        ]
        for s in self.linkage.springs:
            if s.length == 0:
                along = self.line(s.name, s.start, s.end)
                terms.append(s.stiffness * dot(along, along) / 2)
            else:
                length = self.length(s.name, s.start, s.end)
                terms.append(loads.spring_potential(s.stiffness, s.length, length))
        if len(self.model.axes) == 3:
            terms += [self._bending(s) for s in self.linkage.torsion_springs]
        return sp.Add(*terms)

    def _bending(self, spring: AngularSpring) -> sp.Expr:
        """Return k (1 - cos(angle between two rods)): regular at every angle [J]."""
        product = dot(*(self.model.along[k] for k in (spring.against, spring.link)))
        lengths = sp.Mul(*(self.linkage.link(k).length for k in (spring.against, spring.link)))
        return spring.stiffness * (1 - product / lengths)

    def turned(self, link: str, against: str, free: sp.Expr = ZERO) -> sp.Expr:
        """Return the angle of a link from another one, or from the x axis, beyond ``free``: in (-pi, pi]."""
        d = self.model.along[link]
        other = self.model.along[against] if against else (ONE, ZERO)
        sine, cosine = cross(other, d), dot(other, d)
        c, s = sp.cos(free), sp.sin(free)
        return sp.atan2(sine * c - cosine * s, cosine * c + sine * s)

    def _turning(self, link: str, against: str) -> tuple[Gradient, sp.Expr]:
        """Return gradient and rate of the angle of a link from another one, or from the ground (plane)."""
        gradient, rate = self.model.turning(link)
        if against:
            less, slower = self.model.turning(against)
            gradient = {q: gradient.get(q, ZERO) - less.get(q, ZERO) for q in {**gradient, **less}}
            rate = rate - slower
        return gradient, rate

    @cached_property
    def wound(self) -> list[sp.Expr]:
        """Energies of the torsion springs in the plane [J]."""
        if len(self.model.axes) == 3:
            return []
        springs = self.linkage.torsion_springs
        return [s.stiffness * self.turned(s.link, s.against, s.angle) ** 2 / 2 for s in springs]

    @cached_property
    def conservative(self) -> list[Work]:
        """Torques of the torsion springs in the plane: their gradient by the links' angles, not by atan2."""
        if len(self.model.axes) == 3:
            return []
        return [
            (-s.stiffness * self.turned(s.link, s.against, s.angle), *self._turning(s.link, s.against))
            for s in self.linkage.torsion_springs
        ]

    def torsion(self, spring: AngularSpring) -> sp.Expr:
        """Return the torque of a torsion spring on its link in the plane, damping included [N m]."""
        torque = -spring.stiffness * self.turned(spring.link, spring.against, spring.angle)
        if spring.damping != 0:
            torque -= spring.damping * self._turning(spring.link, spring.against)[1]
        return torque

    def push(self, line: LinearSpring | LineForce) -> Vector:
        """Return the force of a spring or an actuator on its end; on its start it is the opposite [N]."""
        along = self.line(line.name, line.start, line.end)
        if isinstance(line, LineForce):
            (force,) = self.with_state((line.force,))
            return tuple(force * c / self.length(line.name, line.start, line.end) for c in along)
        pull = -line.stiffness
        if line.length != 0 or line.damping != 0:
            length = self.length(line.name, line.start, line.end)
            pull += (line.stiffness * line.length - line.damping * self.calculus.rate(length)) / length
        return tuple(pull * c for c in along)

    @cached_property
    def others(self) -> list[Work]:
        """Loads without potential."""
        found: list[Work] = []
        for load in self.linkage.forces:
            force = self.with_state(load.force)
            found += self._components(force, self.model.position(load.point))
        for spread in self.linkage.distributed:
            for place, force in self.shares(spread):
                found += self._components(force, self.model.position(place))
        for spring in self.linkage.springs:
            if spring.damping != 0:
                length = self.length(spring.name, spring.start, spring.end)
                rate = self.calculus.rate(length)
                found.append((-spring.damping * rate, self.calculus.gradient(length), rate))
        for actuator in self.linkage.actuators:
            length = self.length(actuator.name, actuator.start, actuator.end)
            (push,) = self.with_state((actuator.force,))
            found.append((push, self.calculus.gradient(length), self.calculus.rate(length)))
        for s in self.linkage.torsion_springs:
            if s.damping != 0:
                gradient, rate = self._turning(s.link, s.against)
                found.append((-s.damping * rate, gradient, rate))
        for torque in self.linkage.torques:
            value = self.with_state(torque.torque)
            for link, sign in ((torque.link, 1), (torque.against, -1)):
                if link:
                    found += self._couple(link, tuple(sign * c for c in value))
        return found

    def shares(self, load: DistributedForce) -> tuple[tuple[str, Vector], ...]:
        """Return the forces [N] on the two points of a link that a distributed force on it is equal to."""
        link = self.linkage.link(load.link)
        first, second = (self.fixed(load.link, f, load.turning) for f in (load.start, load.end))
        return tuple(
            (point, tuple(link.length * (2 * a + b) / 6 for a, b in zip(near, far, strict=True)))
            for point, near, far in ((link.start, first, second), (link.end, second, first))
        )

    def fixed(self, link: str, force: Vector, turning: bool) -> Vector:
        """Return a load on fixed axes; where ``turning`` it is written along a link and to its left."""
        force = self.with_state(force)
        if not turning:
            return force
        (x, y), length = self.model.along[link], self.linkage.link(link).length
        return (x * force[0] - y * force[1]) / length, (y * force[0] + x * force[1]) / length

    def _components(self, force: Vector, place: Vector) -> list[Work]:
        """Return a force on a vector of the linkage as loads of its components."""
        return [
            (f, self.calculus.gradient(c), self.calculus.rate(c))
            for f, c in zip(force, place, strict=True)
            if f != 0
        ]

    def _couple(self, link: str, torque: Vector) -> list[Work]:
        """Return a couple on a link as loads."""
        if len(torque) == 1:
            return [(torque[0], *self.model.turning(link))]
        return [
            load for arm, force in self.couple_in_space(link, torque) for load in self._components(force, arm)
        ]

    def couple_in_space(self, link: str, torque: Vector) -> list[tuple[Vector, Vector]]:
        """Return the forces [N] on vectors of a link whose work is that of a couple [N m].

        On a rod only the part of the couple across it acts: (tau x d)/l^2 on d. On a body half of
        tau x e^k on each e_k, with e^k the reciprocal vectors.
        """
        body = self.linkage.body(link)
        if body is None:
            d, squared = self.model.along[link], self.linkage.link(link).length ** 2
            return [(d, tuple(c / squared for c in product(torque, d)))]
        return [
            (edge, tuple(c / 2 for c in product(torque, partner)))
            for edge, partner in zip(self.edges(body), self.reciprocal(body), strict=True)
        ]

    def edges(self, body: SpatialBody) -> list[Vector]:
        """Return the vectors e_k from the first base point of a body to the others [m]."""
        first, *others = (self.model.position(p) for p in body.base)
        return [tuple(b - a for a, b in zip(first, other, strict=True)) for other in others]

    def reciprocal(self, body: SpatialBody) -> list[Vector]:
        """Return the vectors e^k with e^k . e_j = 1 where k = j, else 0: constant sums of the e_j [1/m]."""
        edges = self.edges(body)
        return [
            tuple(sp.Add(*(w * e[i] for w, e in zip(row, edges, strict=True))) for i in range(3))
            for row in body.inverse
        ]

    def with_state(self, expressions: Sequence[sp.Expr]) -> Vector:
        """Return expressions with what stands for quantities of the state put in."""
        return tuple(e.xreplace({s: self._state(str(s.name)) for s in state_of(e)}) for e in expressions)

    def _state(self, name: str) -> sp.Expr:
        """Return a quantity of the state, called ``owner.word``."""
        owner, _, word = name.partition(".")
        if owner in self.model.points:
            values = self.model.velocity(owner) if word.startswith("v") else self.model.position(owner)
            return values[self.model.axes.index(word[-1])]
        for actuator in self.linkage.actuators:
            if actuator.name == owner:
                length = self.length(owner, actuator.start, actuator.end)
                return length if word == "length" else self.calculus.rate(length)
        link, against = next(
            ((t.link, t.against) for t in self.linkage.torques if t.name == owner), (owner, "")
        )
        return self.turned(link, against) if word == "angle" else self._turning(link, against)[1]


def product(a: Vector, b: Vector) -> Vector:
    """Return the cross product of two vectors in space."""
    return tuple(a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3))
