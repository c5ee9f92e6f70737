"""Loads of a linkage: potentials, virtual work, forces on points and couples on links."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property, partial

import sympy as sp

from symgen.loads.load import Load, StatedOutput
from symgen.loads.measure import (
    RATE,
    VALUE,
    Action,
    Couple,
    Gradient,
    LoadTerm,
    Measure,
    PointForce,
    Work,
)
from symgen.loads.of_points import Length
from symgen.mechanics.rods import loads
from symgen.mechanics.rods.particles import Vector
from symgen.models.rods.points import Points
from symgen.scene.rods.linkage import SpatialBody, state_of
from symgen.symbolic.calculus import ONE, ZERO
from symgen.symbolic.quantity import Entries, quantity
from symgen.symbolic.vectors import cross, cross_in_plane, dot

#: Units of the extents and efforts of measures.
_UNITS = {"length": "m", "angle": "rad", "force": "N", "torque": "N*m"}


class Loads:
    """The loads on one linkage; it is the :class:`~symgen.loads.measure.Geometry` on which they act."""

    def __init__(self, model: Points) -> None:
        self.model, self.linkage, self.calculus = model, model.linkage, model.calculus
        self.position, self.velocity = model.position, model.velocity
        self._lines: dict[str, Vector] = {}
        self._lengths: dict[str, sp.Expr] = {}
        self._frames: dict[str, tuple[Vector, ...]] = {}
        self._actions: dict[LoadTerm, list[Action]] = {}
        placed = [load for _, _, load in self.linkage.placed_loads]
        #: Couples by the forces in joints, by load: unknowns behind the multipliers.
        self.of_joints = {
            x.name: quantity(f"{x.name}_couple", "N*m", f"couple of {x.noun} {x.name.rpartition('_')[2]}")
            for x in placed
            if x.of_joint
        }
        #: Efforts of drives that keep motions, by load: unknowns behind the multipliers.
        self.efforts = {
            x.name: quantity(f"{x.name}_effort", _UNITS[on.effort], f"effort of {x.noun} {number}")
            for _, number, x in self.linkage.placed_loads
            if x.is_sought and not self.linkage.kinematic
            for on in x.measures(len(model.axes))
        }
        #: Every load with its terms by measure.
        self.terms: list[tuple[Load, LoadTerm]] = [(x, t) for x in placed for t in x.terms(len(model.axes))]

    def along(self, link: str) -> Vector:
        """Return the vector along a link [m]."""
        return self.model.along[link]

    def link_length(self, link: str) -> sp.Expr:
        """Return the length of a link [m]."""
        return self.linkage.link(link).length

    def link_ends(self, link: str) -> tuple[str, str]:
        """Return the first two points of a link."""
        ends = self.linkage.link(link)
        return ends.start, ends.end

    def line(self, name: str, start: str, end: str) -> Vector:
        """Return the vector from one end of a spring or an actuator to the other [m]."""
        if name not in self._lines:
            a, b = (self.model.position(p) for p in (start, end))
            self._lines[name] = loads.vector_between(self.calculus, name, a, b, self.model.axes)
        return self._lines[name]

    def length(self, name: str, start: str, end: str) -> sp.Expr:
        """Return the present length of a spring or an actuator [m]; callers divide by it."""
        if name not in self._lengths:
            self._lengths[name] = loads.distance(self.calculus, name, self.line(name, start, end))
        return self._lengths[name]

    def frame(self, link: str) -> tuple[Vector, ...]:
        """Return axes fixed in a link: along it and to its left, in space those of the drawing."""
        if link not in self._frames:
            self._frames[link] = tuple(self._axes(link))
        return self._frames[link]

    def _axes(self, link: str) -> Iterator[Vector]:
        size = len(self.model.axes)
        unit = [tuple(ONE if i == k else ZERO for k in range(size)) for i in range(size)]
        if not link:
            yield from unit
            return
        body = self.linkage.body(link)
        if body is None:
            (x, y), length = self.along(link), self.link_length(link)
            yield x / length, y / length
            yield -y / length, x / length
            return
        first, *others = (self.linkage.point(p).at for p in body.base)
        drawn = [tuple(b - a for a, b in zip(first, other, strict=True)) for other in others]
        for axis, letter in zip(unit, self.model.axes, strict=True):
            parts = [
                sp.Add(*(w * dot(e, axis) for w, e in zip(row, drawn, strict=True))) for row in body.inverse
            ]
            vector = (
                sp.Add(*(p * e[i] for p, e in zip(parts, self.edges(body), strict=True))) for i in range(size)
            )
            yield tuple(
                self.calculus.define(
                    f"{link}_{letter}_{c}", v, "1", f"{c} component of the {letter} axis of {link} as drawn"
                )
                for c, v in zip(self.model.axes, vector, strict=True)
            )

    @cached_property
    def divided(self) -> list[tuple[str, sp.Expr]]:
        """Label and length of every line between points by whose length a force is divided."""
        return [
            (f"the {load.noun} between {term.on.start} and {term.on.end}", self._lengths[term.on.name])
            for load, term in self.terms
            if isinstance(term.on, Length) and term.on.name in self._lengths
        ]

    @cached_property
    def potential(self) -> sp.Expr:
        """Potential of gravity and of the loads whose measures are differentiated as they are [J]."""
        terms = list(self._weights())
        terms += [t.on.energy(self, t.energy) for _, t in self.terms if t.energy != 0 and t.on.integrable]
        return sp.Add(*terms)

    def _weights(self) -> Iterator[sp.Expr]:
        """Yield the potential of gravity, point by point [J]."""
        weights: dict[str, list[sp.Expr]] = {}
        gravity = self.linkage.gravity
        for k in self.model.massive:
            ratio = k.centre / k.length
            share = k.mass * ratio
            rest = sp.Mul(k.mass, 1 - ratio) if ratio.is_Rational else k.mass - share
            weights.setdefault(k.start, []).append(rest)
            weights.setdefault(k.end, []).append(share)
            if k.offset != 0:
                d = self.model.along[k.name]
                lever = k.offset / k.length
                yield loads.weight_potential(k.mass * lever, gravity, (-d[1], d[0]))
        for body in self.linkage.bodies:
            for point, weight in zip(body.base, body.centre, strict=True):
                weights.setdefault(point, []).append(body.mass * weight)
        for mass in self.linkage.masses:
            weights.setdefault(mass.point, []).append(mass.mass)
        for point, masses in weights.items():
            yield loads.weight_potential(sp.Add(*masses), gravity, self.model.position(point))

    def angle(self, link: str, against: str, free: sp.Expr = ZERO) -> sp.Expr:
        """Return the angle of a link from another one, or from the x axis, minus ``free``.

        It is the value nearest to its reference, if it has one, otherwise to 0.
        """
        windings = ((w.link, w.against, w.free, w.reference.symbol) for w in self.linkage.windings)
        near = next((r for *angle, r in windings if angle == [link, against, free]), ZERO)
        d = self.model.along[link]
        other = self.model.along[against] if against else (ONE, ZERO)
        sine, cosine = cross_in_plane(other, d), dot(other, d)
        c, s = sp.cos(free + near), sp.sin(free + near)
        return near + sp.atan2(sine * c - cosine * s, cosine * c + sine * s)

    def turning(self, link: str, against: str) -> tuple[Gradient, sp.Expr]:
        """Return gradient and rate of the angle of a link from another one, or from the ground (plane)."""
        gradient, rate = self.model.turning(link)
        if against:
            less, slower = self.model.turning(against)
            gradient = {q: gradient.get(q, ZERO) - less.get(q, ZERO) for q in {**gradient, **less}}
            rate = rate - slower
        return gradient, rate

    @cached_property
    def wound(self) -> list[sp.Expr]:
        """Energies whose gradient is not that of the expression: those of angles in the plane [J]."""
        angles = (t for _, t in self.terms if t.energy != 0 and not t.on.integrable)
        return [t.on.energy(self, t.energy) for t in angles]

    @cached_property
    def conservative(self) -> list[Work]:
        """Virtual work of the energies of ``wound``."""
        angles = (t for _, t in self.terms if t.energy != 0 and not t.on.integrable)
        return [work for t in angles for work in t.on.works(self, t.conservative)]

    @cached_property
    def others(self) -> list[Work]:
        """Virtual work of the forces without potential."""
        return [w for _, t in self.terms if t.force for w in t.on.works(self, self.with_state(t.force))]

    def power(self, load: Load) -> sp.Expr:
        """Return the power of a load on the linkage [W]: minus the rate of its energy, and its other work."""
        terms = [*load.terms(len(self.model.axes))]
        energies = (t.on.energy(self, t.energy) for t in terms if t.energy != 0 and t.on.integrable)
        angles = (t for t in terms if t.energy != 0 and not t.on.integrable)
        works = (w for t in angles for w in t.on.works(self, t.conservative))
        rates = [-self.calculus.rate(energy) for energy in energies]
        return sp.Add(*rates, *(force * rate for force, _, rate in works), -self.dissipated(load))

    def dissipated(self, load: Load) -> sp.Expr:
        """Return the power that a load without potential takes out of the linkage [W]."""
        terms = (t for t in load.terms(len(self.model.axes)) if t.force)
        works = (w for t in terms for w in t.on.works(self, self.with_state(t.force)))
        return sp.Add(*(-force * rate for force, _, rate in works))

    @cached_property
    def outputs(self) -> dict[str, Callable[[], Entries]]:
        """Outputs of all loads by name, each to be derived; vectors are on fixed axes."""
        known: dict[str, Callable[[], Entries]] = {}
        for table, number, load in self.linkage.placed_loads:
            if isinstance(load, StatedOutput):
                known[load.word] = partial(self._stated, load)
                continue
            terms = [*load.terms(len(self.model.axes))]
            owner, named = f"{table}.{number}", f"{load.noun} {number}"
            for on in (t.on for t in terms if t.on.extent):
                known[f"{owner}.{on.extent}"] = partial(self._extent, on, named)
                known[f"{owner}.rate"] = partial(self._rate, on, named)
            known |= {f"{owner}.{t.on.effort}": partial(self._effort, t, named) for t in terms if t.on.effort}
            known[f"{owner}.power"] = partial(self._power, self.power, load, f"power of {named}")
            if not load.expressions and any(t.force for t in terms):
                about = f"power that {named} dissipates"
                known[f"{owner}.dissipated_power"] = partial(self._power, self.dissipated, load, about)
        return known

    def _stated(self, output: StatedOutput) -> Entries:
        return self.with_state([output.value]), output.unit, output.meaning

    def _extent(self, on: Measure, named: str) -> Entries:
        extent = on.observed(self, (VALUE + on.slack_extent,))
        return extent, _UNITS[on.extent], f"{on.extent} of {named}"

    def _rate(self, on: Measure, named: str) -> Entries:
        return on.observed(self, (RATE,)), f"{_UNITS[on.extent]}/s", f"rate of the {on.extent} of {named}"

    def _effort(self, term: LoadTerm, named: str) -> Entries:
        on, shown = term.on, self.model.shown
        if sought := [x for x, t in self.terms if t == term and x.is_sought]:
            return [self.efforts[sought[0].name].symbol], _UNITS[on.effort], f"{on.effort} of {named}"
        force = on.observed(self, self.with_state(term.total))
        if len(force) > 1:
            force = shown(force)
        elif on.effort == "torque" and not on.extent and self.linkage.plane:
            force = shown((ZERO, ZERO), force[0])
        return force, _UNITS[on.effort], f"{on.effort} of {named}"

    def _power(self, of: Callable[[Load], sp.Expr], load: Load, about: str) -> Entries:
        return [of(load)], "W", about

    @cached_property
    def from_outside(self) -> list[tuple[sp.Expr, Gradient]]:
        """Weight and the loads that join no components: forces, with the gradients of their measures."""
        terms = [t for _, t in self.terms if not t.on.joins]
        energies = [t.on.energy(self, t.energy) for t in terms if t.energy != 0]
        forces = [(-ONE, self.calculus.gradient(sp.Add(*self._weights(), *energies)))]
        works = (w for t in terms if t.force for w in t.on.works(self, self.with_state(t.force)))
        return [*forces, *((force, slopes) for force, slopes, _ in works)]

    def actions(self, term: LoadTerm) -> list[Action]:
        """Return the equivalent forces on points and couples on links of a term."""
        if term not in self._actions:
            stated = LoadTerm(term.on, term.energy, self.with_state(term.force))
            self._actions[term] = list(term.on.actions(self, stated))
        return self._actions[term]

    def on_point(self, point: str) -> Iterator[Vector]:
        """Yield the forces on a point itself [N]."""
        for _, term in self.terms:
            if any(p == point for _, p in term.on.points):
                yield from (x.force for x in self._forces(term) if x.point == point and not x.link)

    def on_link(self, link: str) -> Iterator[tuple[str, Vector]]:
        """Yield the forces on a link at its points, those of loads along it [N]."""
        for _, term in self.terms:
            if any(k == link for _, k in term.on.links):
                yield from ((x.point, x.force) for x in self._forces(term) if x.link == link)

    def couples(self, link: str) -> Iterator[tuple[str, Vector]]:
        """Yield the couples on a link [N m], each after the link against which it acts, "" for the ground."""
        for _, term in self.terms:
            if any(k == link for _, k in term.on.links):
                for x in self.actions(term):
                    if isinstance(x, Couple) and x.link == link and x.torque:
                        yield x.against, x.torque

    def _forces(self, term: LoadTerm) -> Iterator[PointForce]:
        return (x for x in self.actions(term) if isinstance(x, PointForce))

    def couple_in_space(self, link: str, torque: Vector) -> list[tuple[Vector, Vector]]:
        """Return the forces [N] on vectors of a link equivalent in work to a couple [N m].

        On a rod only the transverse part of the couple acts: (tau x d)/l^2 on d. On a body half of
        tau x e^k on each e_k, with e^k the reciprocal vectors.
        """
        body = self.linkage.body(link)
        if body is None:
            d, squared = self.model.along[link], self.linkage.link(link).length ** 2
            return [(d, tuple(c / squared for c in cross(torque, d)))]
        return [
            (edge, tuple(c / 2 for c in cross(torque, partner)))
            for edge, partner in zip(self.edges(body), self.reciprocal(body), strict=True)
        ]

    def edges(self, body: SpatialBody) -> list[Vector]:
        """Return the vectors e_k from the first base point of a body to the others [m]."""
        first, *others = (self.model.position(p) for p in body.base)
        return [tuple(b - a for a, b in zip(first, other, strict=True)) for other in others]

    def reciprocal(self, body: SpatialBody) -> list[Vector]:
        """Return the vectors e^k with e^k . e_j = 1 if k = j, else 0: constant combinations of e_j [1/m]."""
        edges = self.edges(body)
        return [
            tuple(sp.Add(*(w * e[i] for w, e in zip(row, edges, strict=True))) for i in range(3))
            for row in body.inverse
        ]

    def with_state(self, expressions: Sequence[sp.Expr]) -> Vector:
        """Return expressions with the quantities of the state substituted."""
        return tuple(e.xreplace({s: self._state(str(s.name)) for s in state_of(e)}) for e in expressions)

    def _state(self, name: str) -> sp.Expr:
        """Return the quantity ``owner.word`` of the state."""
        owner, _, word = name.partition(".")
        if word == "effort":
            return self.efforts[owner].symbol
        if word == "couple":
            return self.of_joints[owner].symbol
        if word == "state":
            return self.model.u[owner][0].symbol
        if owner in self.model.points:
            values = self.model.velocity(owner) if word.startswith("v") else self.model.position(owner)
            return values[self.model.axes.index(word[-1])]
        measure = self.linkage.measure(owner)
        if measure:
            return measure.state(self, word)
        return self.angle(owner, "") if word == "angle" else self.turning(owner, "")[1]
