"""Measures of links: angles, rotations, and places along them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import sympy as sp

from symgen.loads.measure import (
    Action,
    CoordinatePlane,
    Couple,
    Geometry,
    LoadTerm,
    Measure,
    PointForce,
    ProfilePart,
    Vector,
    Work,
    on_fixed_axes,
)
from symgen.symbolic.calculus import ONE, ZERO
from symgen.symbolic.quantity import AXES
from symgen.symbolic.vectors import cross, dot

_HALF = sp.Rational(1, 2)


class _OnLinks(Measure):
    """A measure of a link against another one, or the ground (empty)."""

    __slots__ = ()
    link: str
    against: str

    @property
    def points(self) -> tuple[tuple[str, str], ...]:
        return (("point", self.section),) if self.section else ()

    @property
    def links(self) -> tuple[tuple[str, str], ...]:
        return (("link", self.link), ("against", self.against))

    def value(self, geometry: Geometry) -> Vector:
        return (geometry.angle(self.link, self.against, ZERO),)

    def rate(self, geometry: Geometry) -> Vector:
        return (geometry.turning(self.link, self.against)[1],)


@dataclass(frozen=True, slots=True)
class Angle(_OnLinks):
    """The angle of a link beyond ``free`` [rad], from another link or the x axis (plane)."""

    link: str
    against: str
    free: sp.Expr = ZERO
    section: str = ""
    integrable = False
    winds = True
    joins = True
    effort, extent = "torque", "angle"

    @property
    def slack_extent(self) -> sp.Expr:
        return self.free

    def value(self, geometry: Geometry) -> Vector:
        return (geometry.angle(self.link, self.against, self.free),)

    def works(self, geometry: Geometry, force: Vector) -> Iterator[Work]:
        (torque,) = self.put(geometry, force)
        yield (torque, *geometry.turning(self.link, self.against))

    def actions(self, geometry: Geometry, term: LoadTerm) -> Iterator[Action]:
        yield from _couples(self.link, self.against, self.put(geometry, term.total))

    def leaves_plane(self, plane: CoordinatePlane, force: Vector, within: Vector) -> str:
        return "acts on an angle of the plane"


@dataclass(frozen=True, slots=True)
class LinkRotation(_OnLinks):
    """The rotation of a link, against another one where one is named: in space it is no coordinate."""

    link: str
    against: str = ""
    section: str = ""
    effort = "torque"

    def actions(self, geometry: Geometry, term: LoadTerm) -> Iterator[Action]:
        yield from _couples(self.link, self.against, self.put(geometry, term.force))

    def leaves_plane(self, plane: CoordinatePlane, force: Vector, within: Vector) -> str:
        outside = any(c != 0 for i, c in enumerate(force) if i != plane.across)
        return f"has a component that is not along {AXES[plane.across]}" if outside else ""


@dataclass(frozen=True, slots=True)
class DriveRotation(LinkRotation):
    """The rotation of a link by a drive, which stands on the other link or on the ground."""

    joins = True


@dataclass(frozen=True, slots=True)
class Bend(_OnLinks):
    """The cosine of the angle between two rods in space."""

    link: str
    against: str
    joins = True

    def value(self, geometry: Geometry) -> Vector:
        return (self._cosine(geometry, geometry.along(self.link)),)

    def _cosine(self, geometry: Geometry, d: Vector) -> sp.Expr:
        lengths = sp.Mul(*(geometry.link_length(k) for k in (self.against, self.link)))
        return sp.Add(*(a * b for a, b in zip(geometry.along(self.against), d, strict=True))) / lengths

    def works(self, geometry: Geometry, force: Vector) -> Iterator[Work]:
        (value,), (pull,) = self.value(geometry), self.put(geometry, force)
        yield pull, geometry.calculus.gradient(value), geometry.calculus.rate(value)

    def actions(self, geometry: Geometry, term: LoadTerm) -> Iterator[Action]:
        (pull,) = self.put(geometry, term.total)
        for link, other in ((self.link, self.against), (self.against, self.link)):
            share = pull / (geometry.link_length(link) * geometry.link_length(other))
            start, end = geometry.link_ends(link)
            on_end = tuple(share * c for c in geometry.along(other))
            yield PointForce(end, on_end, link)
            yield PointForce(start, tuple(-c for c in on_end), link)

    def leaves_plane(self, plane: CoordinatePlane, force: Vector, within: Vector) -> str:
        return "straightens two rods"


class _OfFrames(_OnLinks):
    """A measure of the axes b of a link on the axes a of another one, or of the ground, in space."""

    __slots__ = ()
    integrable = False
    joins = True

    def pairs(self, i: int) -> tuple[tuple[sp.Expr, int, int], ...]:
        """Return the factors and numbers j, k of the products a_j . b_k whose sum is its component i."""
        raise NotImplementedError

    def value(self, geometry: Geometry) -> Vector:
        a, b = geometry.frame(self.against), geometry.frame(self.link)
        return tuple(sp.Add(*(f * dot(a[j], b[k]) for f, j, k in self.pairs(i))) for i in range(3))

    def rate(self, geometry: Geometry) -> Vector:
        return tuple(geometry.calculus.rate(c) for c in self.value(geometry))

    def actions(self, geometry: Geometry, term: LoadTerm) -> Iterator[Action]:
        a, b = geometry.frame(self.against), geometry.frame(self.link)
        arms = [
            tuple(push * f * c for c in cross(b[k], a[j]))
            for i, push in enumerate(self.put(geometry, term.total))
            for f, j, k in self.pairs(i)
        ]
        yield from _couples(self.link, self.against, tuple(map(sp.Add, *arms)))

    def leaves_plane(self, plane: CoordinatePlane, force: Vector, within: Vector) -> str:
        return "acts on a rotation in space"


@dataclass(frozen=True, slots=True)
class Alignment(_OfFrames):
    """The cosines a_i . b_i of the angles between the axes of two links in space as they are drawn."""

    link: str
    against: str

    def pairs(self, i: int) -> tuple[tuple[sp.Expr, int, int], ...]:
        return ((ONE, i, i),)


@dataclass(frozen=True, slots=True)
class Twist(_OfFrames):
    """The vector n sin a of the rotation by a about n from one link to another, on the axes of the first."""

    link: str
    against: str

    def pairs(self, i: int) -> tuple[tuple[sp.Expr, int, int], ...]:
        j, k = (i + 1) % 3, (i + 2) % 3
        return (_HALF, k, j), (-_HALF, j, k)


@dataclass(frozen=True, slots=True)
class Span(Measure):
    """The points of a link (plane): a force per length [N/m], linear between its ends.

    Its four components are those at the first and at the second point of the link, along fixed axes or, where
    ``turning``, along the link and to its left, with ``with_sections`` of each section of an elastic link.
    """

    link: str
    turning: bool
    with_sections: bool = False

    @property
    def follows(self) -> str:
        return self.link if self.with_sections else ""

    @property
    def links(self) -> tuple[tuple[str, str], ...]:
        return (("link", self.link),)

    def actions(self, geometry: Geometry, term: LoadTerm) -> Iterator[Action]:
        start, end = geometry.link_ends(self.link)
        length = geometry.link_length(self.link)
        first, second = (self.fixed(geometry, f) for f in (term.force[:2], term.force[2:]))
        for point, near, far in ((start, first, second), (end, second, first)):
            share = tuple(length * (2 * a + b) / 6 for a, b in zip(near, far, strict=True))
            yield PointForce(point, share, self.link)

    def fixed(self, geometry: Geometry, force: Vector) -> Vector:
        """Return a force per length on fixed axes."""
        return on_fixed_axes(geometry, self.link, force) if self.turning else force

    def leaves_plane(self, plane: CoordinatePlane, force: Vector, within: Vector) -> str:
        return "is spread along a link of the plane"

    def along(
        self, link: str, length: sp.Expr, places: Mapping[str, sp.Expr], force: Vector
    ) -> Iterator[ProfilePart]:
        first, second = force[:2], force[2:]
        if link == self.link and first == second:
            yield ProfilePart(self, (ZERO, ONE, ZERO), first)
        elif link == self.link:
            yield ProfilePart(self, (ZERO, ONE, -1 / length), first)
            yield ProfilePart(self, (ZERO, ZERO, 1 / length), second)


def _couples(link: str, against: str, torque: Vector) -> Iterator[Couple]:
    yield Couple(link, torque, against)
    if against:
        yield Couple(against, tuple(-c for c in torque), link)
