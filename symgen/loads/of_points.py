"""Measures of points: the position of one, the distance and the vector between two."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import sympy as sp

from symgen.loads.measure import (
    RATE,
    RATES,
    VALUE,
    VALUES,
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
    components,
    on_fixed_axes,
    works_of_couple,
)
from symgen.symbolic.calculus import ZERO
from symgen.symbolic.quantity import AXES
from symgen.symbolic.vectors import cross, cross_in_plane, dot

_SQUARE = sp.Symbol("value^2", real=True)


@dataclass(frozen=True, slots=True)
class Position(Measure):
    """The position of a point [m]; the force on it has the same axes, or those of a link that it follows."""

    point: str
    link: str = ""
    effort = "force"

    @property
    def points(self) -> tuple[tuple[str, str], ...]:
        return (("point", self.point),)

    @property
    def follows(self) -> str:
        return self.link

    @property
    def links(self) -> tuple[tuple[str, str], ...]:
        return (("link", self.link),) if self.link else ()

    def value(self, geometry: Geometry) -> Vector:
        return geometry.position(self.point)

    def rate(self, geometry: Geometry) -> Vector:
        return geometry.velocity(self.point)

    def actions(self, geometry: Geometry, term: LoadTerm) -> Iterator[Action]:
        total = self.fixed(geometry, self.put(geometry, term.total))
        yield PointForce(self.point, (*total, *[ZERO] * (len(self.value(geometry)) - len(total))))

    def fixed(self, geometry: Geometry, force: Vector) -> Vector:
        return on_fixed_axes(geometry, self.link, force) if self.link else force

    def leaves_plane(self, plane: CoordinatePlane, force: Vector, within: Vector) -> str:
        k = plane.across
        held = {VALUES[k]: plane.level, RATES[k]: ZERO}
        for symbols in (VALUES, RATES):
            held |= {symbols[k - 2]: symbols[0], symbols[k - 1]: symbols[1]}
        put = [c.xreplace(held) for c in (*force, *[ZERO] * (3 - len(force)))]
        if put[k] != 0:
            return f"has a component along {AXES[k]}"
        same = (put[k - 2], put[k - 1]) == (*within, *[ZERO] * (2 - len(within)))
        return "" if same else "acts otherwise in space"

    def along(
        self, link: str, length: sp.Expr, places: Mapping[str, sp.Expr], force: Vector
    ) -> Iterator[ProfilePart]:
        if self.point in places and self.link in ("", link):
            yield ProfilePart(self, (places[self.point], ZERO, ZERO), force)


@dataclass(frozen=True, slots=True)
class Length(Measure):
    """The distance between two points beyond ``slack`` [m]; the force pushes them apart.

    ``name`` is the name of the vector between them. If the energy depends on the square of the distance alone
    and there is no other force, nothing divides by the distance.
    """

    name: str
    start: str
    end: str
    slack: sp.Expr = ZERO
    balanced = True
    joins = True
    effort, extent = "force", "length"

    @property
    def slack_extent(self) -> sp.Expr:
        return self.slack

    @property
    def points(self) -> tuple[tuple[str, str], ...]:
        return (("between", self.start), ("between", self.end))

    def value(self, geometry: Geometry) -> Vector:
        return (geometry.length(self.name, self.start, self.end) - self.slack,)

    def rate(self, geometry: Geometry) -> Vector:
        return (geometry.calculus.rate(geometry.length(self.name, self.start, self.end)),)

    def state(self, geometry: Geometry, word: str) -> sp.Expr:
        return self.rate(geometry)[0] if word == "rate" else self.value(geometry)[0] + self.slack

    def observed(self, geometry: Geometry, expressions: Vector) -> Vector:
        if any(e.has(RATE) for e in expressions):
            return self.put(geometry, expressions)
        line = geometry.line(self.name, self.start, self.end)
        length = sp.sqrt(dot(line, line))  # by which nothing divides: the points may coincide
        return tuple(e.xreplace({VALUE: length - self.slack}) for e in expressions)

    def energy(self, geometry: Geometry, energy: sp.Expr) -> sp.Expr:
        by_square = self._by_square(energy)
        if by_square is None:
            return self.put(geometry, (energy,))[0]
        line = geometry.line(self.name, self.start, self.end)
        return by_square.xreplace({_SQUARE: sp.Add(*(c * c for c in line))})

    def works(self, geometry: Geometry, force: Vector) -> Iterator[Work]:
        length = geometry.length(self.name, self.start, self.end)
        (push,) = self.put(geometry, force)
        yield push, geometry.calculus.gradient(length), geometry.calculus.rate(length)

    def actions(self, geometry: Geometry, term: LoadTerm) -> Iterator[Action]:
        line = geometry.line(self.name, self.start, self.end)
        factor = self._per_length(geometry, term.energy, term.force)
        push = tuple(factor * c for c in line)
        yield PointForce(self.end, push)
        yield PointForce(self.start, tuple(-c for c in push))

    def _per_length(self, geometry: Geometry, energy: sp.Expr, force: Vector) -> sp.Expr:
        """Return the force over the length [N/m]: of a linear spring as a part that is regular at zero."""
        further = sp.Add(*self.put(geometry, force))
        by_square = self._by_square(energy)
        if by_square is not None:
            regular = (-2 * sp.diff(by_square, _SQUARE)).xreplace(
                {_SQUARE: sp.Add(*(c * c for c in geometry.line(self.name, self.start, self.end)))}
            )
        else:
            push = -sp.diff(energy, VALUE)
            slope = sp.diff(push, VALUE)
            linear = not slope.has(VALUE) and push.xreplace({VALUE: ZERO}) == 0
            regular = slope if linear else ZERO
            further += -slope * self.slack if linear else self.put(geometry, (push,))[0]
        if further == 0:
            return regular
        return regular + further / geometry.length(self.name, self.start, self.end)

    def _by_square(self, energy: sp.Expr) -> sp.Expr | None:
        """Return an energy by the square of the length; None where it depends on the length otherwise."""
        if self.slack != 0:
            return None
        by_square = energy.xreplace({VALUE**2: _SQUARE})
        return None if by_square.has(VALUE) else by_square

    def leaves_plane(self, plane: CoordinatePlane, force: Vector, within: Vector) -> str:
        return ""


@dataclass(frozen=True, slots=True)
class Offset(Measure):
    """The vector between two points [m] by its components on the axes of the link ``frame``, or the ground.

    ``name`` is the name of the vector.
    """

    name: str
    start: str
    end: str
    frame: str = ""
    joins = True
    effort = "force"

    @property
    def integrable(self) -> bool:  # type: ignore[override]
        return not self.frame

    @property
    def points(self) -> tuple[tuple[str, str], ...]:
        return (("between", self.start), ("between", self.end))

    @property
    def links(self) -> tuple[tuple[str, str], ...]:
        return (("against", self.frame),) if self.frame else ()

    def value(self, geometry: Geometry) -> Vector:
        line = geometry.line(self.name, self.start, self.end)
        return tuple(dot(axis, line) for axis in geometry.frame(self.frame))

    def rate(self, geometry: Geometry) -> Vector:
        return tuple(geometry.calculus.rate(c) for c in self.value(geometry))

    def works(self, geometry: Geometry, force: Vector) -> Iterator[Work]:
        push = self.fixed(geometry, self.put(geometry, force))
        yield from components(geometry, push, geometry.line(self.name, self.start, self.end))
        for couple in self._couple(geometry, push):
            yield from works_of_couple(geometry, couple)

    def fixed(self, geometry: Geometry, force: Vector) -> Vector:
        axes = zip(*geometry.frame(self.frame), strict=True)
        return tuple(sp.Add(*(f * c for f, c in zip(force, axis, strict=False))) for axis in axes)

    def actions(self, geometry: Geometry, term: LoadTerm) -> Iterator[Action]:
        push = self.fixed(geometry, self.put(geometry, term.total))
        yield PointForce(self.end, push)
        yield PointForce(self.start, tuple(-c for c in push))
        yield from self._couple(geometry, push)

    def _couple(self, geometry: Geometry, push: Vector) -> Iterator[Couple]:
        """Yield the couple on the link of the axes that balances the forces on the points."""
        if self.frame:
            line = geometry.line(self.name, self.start, self.end)
            moment = (cross_in_plane(push, line),) if len(line) == 2 else cross(push, line)
            yield Couple(self.frame, moment)

    def leaves_plane(self, plane: CoordinatePlane, force: Vector, within: Vector) -> str:
        return "acts on axes in space"
