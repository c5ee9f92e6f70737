"""Momentum rows of bodies modelled as particles: terms of the recursive form of the equations of motion.

Source: H. A. Attia, *Dynamic Analysis of a Chain of Rigid Rods*, Eqs. (1) to (15). A linkage is opened to
trees by cutting joints; all bodies outboard of a body's inner joint have a moment of momentum about that
joint whose rate is the moment of the loads. No internal force appears. ``docs/method_rods.md`` lists the
errors of the available text and where each is corrected.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import sympy as sp

from symgen.mechanics.rods.particles import Vector, particle_masses
from symgen.symbolic.vectors import cross, cross_in_plane, dot

ZERO, ONE, HALF = sp.Integer(0), sp.Integer(1), sp.Rational(1, 2)


class Particle(NamedTuple):
    """Particle of a body: mass [kg], at start + along*d + across*(d rotated left), d from start to end."""

    mass: sp.Expr
    along: sp.Expr
    across: sp.Expr

    @property
    def number(self) -> int:
        """The number as in the source: 1 at the start, 2 in the middle, 3 at the end; 4 beside the end."""
        return 1 + int(2 * self.along + 3 * self.across)


def particles(
    mass: sp.Expr, length: sp.Expr, centre: sp.Expr, inertia: sp.Expr, offset: sp.Expr = ZERO
) -> tuple[Particle, ...]:
    """Return the particles that replace a rod (section 2.1), or a planar body on two of its points.

    A centre of mass off the line needs a fourth particle, at a right angle to the left of the end: it has the
    transverse first moment, and the others are changed to preserve mass, axial first and second moment.

    Parameters
    ----------
    mass, length, centre, inertia, offset
        As for :func:`symgen.mechanics.rods.particles.end_mass`.
    """
    fourth = mass * offset / length
    about_centre = inertia + mass * offset**2 - fourth * length**2
    start, middle, end = particle_masses(mass, length, centre, about_centre)
    masses = [
        Particle(start - fourth, ZERO, ZERO),
        Particle(middle, HALF, ZERO),
        Particle(end, ONE, ZERO),
        Particle(fourth, ZERO, ONE),
    ]
    return tuple(p for p in masses if p.mass != 0)


@dataclass(frozen=True, slots=True)
class OpenTree:
    """A linkage opened to trees.

    ``inner`` is the inner joint of each body, ``carried`` the points it carries, ``cuts`` the pairs (body,
    point) of a body cut from a point with another carrier, ``roots`` the first point of each part
    without ground point. Bodies are ordered from the ground outward.
    """

    inner: Mapping[str, str]
    carried: Mapping[str, tuple[str, ...]]
    cuts: tuple[tuple[str, str], ...]
    roots: tuple[str, ...]

    def outboard(self, body: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return the bodies and the points that move when a body rotates about its inner joint."""
        bodies, points = [body], list(self.carried[body])
        for point in points:
            for other in self.hanging(point):
                bodies.append(other)
                points.extend(self.carried[other])
        return tuple(bodies), tuple(points)

    def hanging(self, point: str) -> tuple[str, ...]:
        """Return the bodies that hang on a point."""
        return tuple(body for body, joint in self.inner.items() if joint == point)

    def beyond(self, point: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return all bodies and points that hang on a point, including the point itself."""
        parts = [self.outboard(body) for body in self.hanging(point)]
        return tuple(b for bodies, _ in parts for b in bodies), (point, *(p for _, ps in parts for p in ps))


def open_tree(ground: Iterable[str], points: Sequence[str], bodies: Mapping[str, Sequence[str]]) -> OpenTree:
    """Walk the bodies breadth first from the ground points, and cut where a point is reached twice.

    Parameters
    ----------
    ground
        Names of the fixed points.
    points
        Names of the moving points.
    bodies
        The points of every body that moves.
    """
    waiting = list(ground)
    seen = set(waiting)
    inner: dict[str, str] = {}
    carried: dict[str, tuple[str, ...]] = {}
    cuts: list[tuple[str, str]] = []
    roots: list[str] = []
    for first in [None, *points]:
        if first is not None:
            if first in seen:
                continue
            roots.append(first)
            waiting.append(first)
            seen.add(first)
        while waiting:
            joint = waiting.pop(0)
            for body, its in bodies.items():
                if joint in its and body not in inner:
                    inner[body] = joint
                    carried[body] = tuple(p for p in its if p not in seen)
                    cuts.extend((body, p) for p in its if p in seen and p != joint)
                    seen.update(its)
                    waiting.extend(carried[body])
    return OpenTree(inner, carried, tuple(cuts), tuple(roots))


def on_loop(ground: Collection[str], bodies: Mapping[str, Sequence[str]], body: str, point: str) -> bool:
    """Return whether the joint of a body at a point is on a loop; all ground points are one body.

    Parameters
    ----------
    ground
        Names of the fixed points.
    bodies
        The points of every body.
    body, point
        The joint.
    """
    parts = [ground, *(its for name, its in bodies.items() if name != body)]
    reached = {p for p in bodies[body] if p != point}
    before = 0
    while len(reached) > before:
        before = len(reached)
        reached.update(*(its for its in parts if not reached.isdisjoint(its)))
    return point in reached


def moment(lever: Vector, force: Vector) -> Vector:
    """Return lever x force: one component in the plane, three in space."""
    return (cross_in_plane(lever, force),) if len(lever) == 2 else cross(lever, force)


def effective_lever(lever: Vector, along: sp.Expr, across: sp.Expr) -> Vector:
    """Return h with h x a = lever x (along*a + across*(a rotated left)) for every a."""
    straight = tuple(along * c for c in lever)
    if across == 0:
        return straight
    x, y = lever
    return straight[0] + across * y, straight[1] - across * x


def transverse(couple: Vector, along: Vector, length: sp.Expr) -> Vector:
    """Return the part of a couple transverse to a rod; a rod without spin inertia takes no other."""
    axial = dot(couple, along) / length**2
    return tuple(c - axial * d for c, d in zip(couple, along, strict=True))


def smallest_axis(along: Vector) -> Vector:
    """Return the coordinate axis e on which a vector in space has its smallest component."""
    x, y, z = (sp.Abs(c) for c in along)
    is_x, is_y = sp.And(x <= y, x <= z), y <= z
    first = sp.Piecewise((ONE, is_x), (ZERO, True))
    second = sp.Piecewise((ZERO, is_x), (ONE, is_y), (ZERO, True))
    return first, second, 1 - first - second


def perpendicular(along: Vector, axis: Vector) -> tuple[Vector, sp.Expr]:
    """Return e x d and its norm: with e of :func:`smallest_axis` at least 0.8 of the norm of d.

    The unit vectors u_bar along e x d and u_hat along d x u_bar are those of section 2.2 for e = z. They need
    no trigonometry and are regular in every direction, while the principal arc tangent of the text makes the
    two rows of Eq. (13) singular for rods at 45 degrees.
    """
    along_axis = dot(along, axis)
    return moment(axis, along), sp.sqrt(dot(along, along) - along_axis**2)
