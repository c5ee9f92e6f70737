"""Where loads act: measures of a linkage, with the virtual work of their conjugate forces.

The value of a measure x is a function of the positions of points. A force f conjugate to it has the virtual
work f.dx, so the force f dx/dr on the positions r; an energy V(x) has the force -dV/dx. Each measure resolves
both to forces on points and couples on links.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Protocol

import sympy as sp

from symgen.symbolic.calculus import ZERO, Calculus

Vector = tuple[sp.Expr, ...]
#: Components of the value of a measure and of its rate, in energies and forces.
VALUES = tuple(sp.Symbol(f"value[{i}]", real=True) for i in range(3))
RATES = tuple(sp.Symbol(f"rate[{i}]", real=True) for i in range(3))
#: The value and the rate of a measure with one component.
VALUE, RATE = VALUES[0], RATES[0]

Gradient = dict[sp.Symbol, sp.Expr]
#: Virtual work: a force, the gradient of its conjugate quantity, and the rate of this quantity.
Work = tuple[sp.Expr, Gradient, sp.Expr]


@dataclass(frozen=True, slots=True)
class PointForce:
    """A force [N] on a point, or on the link ``link`` at this point."""

    point: str
    force: Vector
    link: str = ""


@dataclass(frozen=True, slots=True)
class Couple:
    """A couple [N m] on a link, against another link or the ground (empty)."""

    link: str
    torque: Vector
    against: str = ""


Action = PointForce | Couple


class Geometry(Protocol):
    """A linkage in its coordinates, as far as measures need it."""

    calculus: Calculus

    def position(self, point: str) -> Vector: ...
    def velocity(self, point: str) -> Vector: ...
    def along(self, link: str) -> Vector: ...
    def link_length(self, link: str) -> sp.Expr: ...
    def link_ends(self, link: str) -> tuple[str, str]: ...
    def line(self, name: str, start: str, end: str) -> Vector: ...
    def length(self, name: str, start: str, end: str) -> sp.Expr: ...
    def frame(self, link: str) -> Sequence[Vector]: ...
    def angle(self, link: str, against: str, free: sp.Expr) -> sp.Expr: ...
    def turning(self, link: str, against: str) -> tuple[Gradient, sp.Expr]: ...
    def couple_in_space(self, link: str, torque: Vector) -> list[tuple[Vector, Vector]]: ...


class CoordinatePlane(Protocol):
    """The plane across the axis with the number ``across``, at the coordinate ``level`` [m] on it."""

    @property
    def across(self) -> int: ...
    @property
    def level(self) -> sp.Expr: ...


class Measure:
    """A quantity of the linkage on which a load acts.

    ``integrable``: energies are differentiated as functions of positions; others have the virtual work of
    forces and couples: the gradient of an angle is known without an arc tangent, and that of axes of a link
    would also stretch the link. ``winds``: its energy is known up to revolutions. ``balanced``: its forces
    on points have no resultant and no moment. ``joins``: it connects the components on which it acts.
    ``section``: the point at whose sections of elastic links a couple acts; "" for rigid links. ``follows``:
    the link with which its force rotates, or with whose section at a place; "" if the force is fixed.
    ``effort``: the name of its force among outputs, ``force`` [N] or ``torque`` [N m]; "" without an output.
    ``extent``: the name of its value among outputs, ``length`` [m] or ``angle`` [rad], with ``rate``; ""
    without these.
    """

    __slots__ = ()
    integrable = True
    winds = False
    balanced = False
    joins = False
    effort = extent = ""
    section: str = ""

    @property
    def follows(self) -> str:
        return ""

    @property
    def points(self) -> tuple[tuple[str, str], ...]:
        """The points on which it acts, each after the key of the scene that names it."""
        return ()

    @property
    def links(self) -> tuple[tuple[str, str], ...]:
        """The links on which it acts, each after the key of the scene that names it; "" is the ground."""
        return ()

    def value(self, geometry: Geometry) -> Vector:
        """Return the components of its value."""
        raise NotImplementedError

    def rate(self, geometry: Geometry) -> Vector:
        """Return the components of its rate."""
        raise NotImplementedError

    def state(self, geometry: Geometry, word: str) -> sp.Expr:
        """Return a quantity of the state that a load calls ``this.word``."""
        return (self.rate if word == "rate" else self.value)(geometry)[0]

    def put(self, geometry: Geometry, expressions: Sequence[sp.Expr]) -> Vector:
        """Return expressions with value and rate substituted for ``VALUES`` and ``RATES``."""
        needed = set().union(*(e.free_symbols for e in expressions))
        known: Gradient = {}
        for symbols, of in ((VALUES, self.value), (RATES, self.rate)):
            if needed.intersection(symbols):
                known.update(zip(symbols, of(geometry), strict=False))
        return tuple(e.xreplace(known) for e in expressions)

    @property
    def slack_extent(self) -> sp.Expr:
        """The extent at which its value is zero."""
        return ZERO

    def observed(self, geometry: Geometry, expressions: Vector) -> Vector:
        """Return expressions of ``VALUES`` and ``RATES``, such as a force on fixed axes, for an output."""
        return self.fixed(geometry, self.put(geometry, expressions))

    def energy(self, geometry: Geometry, energy: sp.Expr) -> sp.Expr:
        """Return an energy [J] as a function of positions."""
        return self.put(geometry, (energy,))[0]

    def works(self, geometry: Geometry, force: Vector) -> Iterator[Work]:
        """Yield the virtual work of a force conjugate to it, by ``VALUES`` and ``RATES``: of its actions."""
        for action in self.actions(geometry, LoadTerm(self, force=force)):
            if isinstance(action, Couple):
                yield from works_of_couple(geometry, action)
            else:
                yield from components(geometry, action.force, geometry.position(action.point))

    def actions(self, geometry: Geometry, term: LoadTerm) -> Iterator[Action]:
        """Yield the forces on points and the couples on links that are equivalent to a term."""
        raise NotImplementedError

    def leaves_plane(self, plane: CoordinatePlane, force: Vector, within: Vector) -> str:
        """Return the reason why a force in space moves a linkage out of a plane; empty if it does not.

        ``within`` is the force of the same load in the plane.
        """
        raise NotImplementedError

    def fixed(self, geometry: Geometry, force: Vector) -> Vector:
        """Return a force on fixed axes."""
        return force

    def along(
        self, link: str, length: sp.Expr, places: Mapping[str, sp.Expr], force: Vector
    ) -> Iterator[ProfilePart]:
        """Yield the profiles of a force along an elastic link, whose further points are at ``places`` [m]."""
        return iter(())


@dataclass(frozen=True, slots=True)
class ProfilePart:
    """A part of a force along an elastic link.

    ``shape``: the place [m] of a force, zero, zero; or zero and the factors of 1 and x of a force per length.
    ``force`` is an expression of the values and rates of the measure ``on``.
    """

    on: Measure
    shape: Vector
    force: Vector


@dataclass(frozen=True, slots=True)
class LoadTerm:
    """The energy and the force of a load on one measure.

    Attributes
    ----------
    on
        The measure.
    energy
        Potential energy [J], a function of ``VALUES``.
    force
        Force conjugate to the measure beyond that of the energy, with as many components as its value: a
        function of ``VALUES``, ``RATES``, the time and the state. Empty without such a force.
    """

    on: Measure
    energy: sp.Expr = ZERO
    force: Vector = ()

    @property
    def conservative(self) -> Vector:
        """Force of the energy, minus its slopes by ``VALUES``; empty without an energy."""
        slopes = [-sp.diff(self.energy, s) for s in VALUES]
        size = max((i for i, s in enumerate(slopes, 1) if s != 0), default=0)
        return tuple(slopes[:size])

    @property
    def total(self) -> Vector:
        """Force of the energy and the other one together."""
        parts = zip_longest(self.conservative, self.force, fillvalue=ZERO)
        return tuple(sp.Add(*components) for components in parts)


def components(geometry: Geometry, force: Vector, place: Vector) -> Iterator[Work]:
    """Yield the virtual work of a force on a vector of the linkage, component by component."""
    for f, c in zip(force, place, strict=False):
        if f != 0:
            yield f, geometry.calculus.gradient(c), geometry.calculus.rate(c)


def works_of_couple(geometry: Geometry, couple: Couple) -> Iterator[Work]:
    """Yield the virtual work of a couple on a link."""
    if len(couple.torque) == 1:
        yield (couple.torque[0], *geometry.turning(couple.link, ""))
        return
    for arm, push in geometry.couple_in_space(couple.link, couple.torque):
        yield from components(geometry, push, arm)


def on_fixed_axes(geometry: Geometry, link: str, force: Vector) -> Vector:
    """Return a force with components along a link and to its left on fixed axes (plane)."""
    (x, y), length = geometry.along(link), geometry.link_length(link)
    return (x * force[0] - y * force[1]) / length, (y * force[0] + x * force[1]) / length
