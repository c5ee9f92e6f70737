"""Elastic links as many rigid rods with torsion springs between them: large rotation.

A link of length l becomes n rods. Where it is free to turn at both ends they are equal, h = l/n, and a rod
stands for the direction at its middle. Where its first end is clamped to a shaft, its first rod is half a rod
and stands for the direction of the shaft, so h = l/(n - 1/2). Either way h lies between the places of
neighbouring directions, their difference over h is the curvature at the joint between the rods, and the
spring there has the stiffness E I/h: a central difference, with an error that falls as h^2. The rods keep
their lengths: a link in segments does not stretch, and does not shear.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import sympy as sp

from symgen.errors import ModelError
from symgen.loads.load import Load
from symgen.loads.torque import AppliedTorque
from symgen.loads.torsion_spring import AngularSpring
from symgen.scene.elastic.links import ElasticLink, Polynomial
from symgen.scene.elastic.offsets import is_lug
from symgen.scene.rods.linkage import (
    CarriedPoint,
    Linkage,
    PlacedPoint,
    RigidLink,
    StartConditions,
    Vector,
    state_symbol,
)
from symgen.scene.rods.switches import with_switches
from symgen.scene.rods.windings import with_windings

_ZERO, _HALF = sp.Integer(0), sp.Rational(1, 2)
#: Digits of coordinates: beyond those of a double, so that differences are exact.
_DIGITS = 40
#: Fewer rods do not resolve the curvature at both ends; more take too long to derive and to compile.
_FEWEST, _MOST = 3, 200
#: Remedies for what rods do not have, by linear theory and by elements.
_OF_SMALL = "  By linear theory, of a crank at rest: symgen run --quasi-static, model.quasi_static()."
_SECTIONS = f"{_OF_SMALL} In large rotation: elements in place of segments, large_rotation(elements=4)."

Places = Mapping[str, Sequence[float]]


@dataclass(frozen=True, slots=True)
class Segments:
    """One elastic link in rods: their names, and ``nodes``, where they meet, as shares of the length."""

    link: RigidLink
    beam: ElasticLink
    rods: tuple[str, ...]
    points: tuple[str, ...]
    nodes: tuple[sp.Expr, ...]
    clamped: bool

    @property
    def spacing(self) -> sp.Expr:
        """Distance between neighbouring directions, as a share of the length."""
        return self.nodes[-1] - self.nodes[-2]


def segmented(linkage: Linkage, count: int, places: Places) -> Linkage:
    """Return the linkage with every elastic link in ``count`` rods with springs between them.

    The crank turns as it says: held, its first rod, or the rigid crank, has the prescribed direction; with a
    motor, it has its torque and the flywheel; free, nothing turns it. ``LINK__k.angle`` are recorded, for
    curvatures, ``LINK__k.tension`` for axial forces, and the positions of all points of the scene.

    Parameters
    ----------
    linkage
        One with elastic links.
    count
        Number of rods of each elastic link.
    places
        Where the points that have coordinates are in the rigid motion at t = 0 [m].

    Raises
    ------
    ModelError
        For a number of rods out of range.
    """
    if not _FEWEST <= count <= _MOST:
        raise ModelError(f"expected from {_FEWEST} to {_MOST} segments of an elastic link, got {count}")
    for beam in linkage.elastic:
        if beam.welds:
            lug = next((k for k in linkage.links if k.start in beam.welds and is_lug(k)), None)
            kind = (
                f"{lug.end}, off the line of {beam.link}, is welded to it"
                if lug
                else f"{beam.link} is welded"
            )
            raise ModelError(
                f"{linkage.name}: {kind}, and segments are joined by hinges alone\n"
                "  Use elements in place of segments: large_rotation(elements=4), --elements 4."
            )
    bent = [load for load in linkage.loads if any(m.section for m in load.measures(2))]
    for load in bent:
        if not isinstance(load, AppliedTorque) or load.uses_own_angle:
            (section,) = {m.section for m in load.measures(2)}
            raise ModelError(
                f"{linkage.name}: a couple at {section} depends on the rotation of the section, and rods "
                f"have no sections\n{_SECTIONS}"
            )
    following = {m.follows for k in linkage.loads for m in k.measures(2) if m.points}
    for beam in linkage.elastic:
        if beam.link in following:
            raise ModelError(
                f"{linkage.name}: a force follows a section of {beam.link}, and rods have no sections\n"
                + _OF_SMALL
            )
    parts = [_segments(linkage, beam, count) for beam in linkage.elastic]
    cut = {part.link.name for part in parts}
    crank = linkage.crank
    shaft = crank.link if crank else ""
    rigid = [k for k in linkage.links if k.name not in cut]
    links = [*rigid, *(rod for part in parts for rod in _rods(linkage, part))]
    names = {part.link.name: part.rods[0] for part in parts}
    owner = names.get(shaft, shaft)
    drivers = [replace(d, link=names.get(d.link, d.link)) for d in linkage.drivers]
    motor: list[AppliedTorque] = []
    if crank and crank.mode != "held":
        drivers = [d for d in drivers if d.link != owner]
    if crank and crank.mode == "motor":
        states = {state_symbol(f"{shaft}.{w}"): state_symbol(f"{owner}.{w}") for w in _OF_SHAFT}
        motor.append(AppliedTorque("motor__torque", owner, (crank.torque.xreplace(states),)))
    points = [replace(p, at=_at(places[p.name])) if p.name in places else p for p in linkage.points]
    known = {p.name: tuple(linkage.number(c) for c in p.motion) for p in linkage.points} | dict(places)
    points += [point for part in parts for point in _inner_points(part, known)]
    linkage_of_segments = replace(
        linkage,
        points=tuple(points),
        links=tuple(links),
        loads=(*_loads(linkage, parts), *motor),
        drivers=tuple(drivers),
        start=StartConditions((), (), ()),
        outputs=(
            *(f"{rod}.{word}" for part in parts for rod in part.rods for word in ("angle", "tension")),
            *(f"{point.name}.position" for point in linkage.points),
        ),
        elastic=(),
        crank=None,
        stations=(),
    )
    # Springs between rods of one link never turn by half a revolution.
    inner = (s for part in parts for s in _springs(part))
    return replace(with_windings(linkage_of_segments), loads=(*linkage_of_segments.loads, *inner))


def remade(linkage: Linkage, segments: int | None, places: Places) -> Linkage:
    """Return the linkage with elastic links in so many rods; if None, with rigid links and its motor."""
    if segments is None:
        return with_switches(with_windings(with_motor(linkage, places)))
    return with_switches(segmented(linkage, segments, places))


def with_motor(linkage: Linkage, places: Places) -> Linkage:
    """Return the linkage with all links rigid, its crank turned by its motor with the flywheel.

    ``places`` are as for :func:`segmented`.
    """
    crank = linkage.crank
    if crank is None:
        return linkage
    return replace(
        linkage,
        points=tuple(replace(p, at=_at(places[p.name])) if p.name in places else p for p in linkage.points),
        loads=(*linkage.loads, AppliedTorque("motor__torque", crank.link, (crank.torque,))),
        drivers=tuple(d for d in linkage.drivers if d.link != crank.link),
        start=StartConditions((), (), ()),
        outputs=(),
        elastic=(),
        crank=None,
        stations=(),
    )


_OF_SHAFT = ("angle", "angular_velocity")


def _segments(linkage: Linkage, beam: ElasticLink, count: int) -> Segments:
    link, crank = linkage.link(beam.link), linkage.crank
    clamped = crank is not None and crank.link == link.name and crank.mode != "free"
    spacing = 1 / (count - _HALF) if clamped else sp.Rational(1, count)
    first = spacing / 2 if clamped else spacing
    nodes = (_ZERO, *(first + i * spacing for i in range(count)))
    rods = tuple(f"{link.name}__{i}" for i in range(1, count + 1))
    inner = tuple(f"{link.name}__p{i}" for i in range(1, count))
    return Segments(link, beam, rods, (link.start, *inner, link.end), nodes, clamped)


def _moment(coefficients: Polynomial, length: sp.Expr, low: sp.Expr, high: sp.Expr, power: int) -> sp.Expr:
    """Return the integral of a polynomial in x times x^power between two shares of the length."""
    return sp.Add(
        *(
            c
            * length ** (k + power + 1)
            * (high ** (k + power + 1) - low ** (k + power + 1))
            / (k + power + 1)
            for k, c in enumerate(coefficients)
        )
    )


def _rods(linkage: Linkage, part: Segments) -> Iterator[RigidLink]:
    """Yield the rods, with their mass by the section and the points of the link that they carry."""
    length, section, crank = part.link.length, part.beam.section, linkage.crank
    for i, (low, high) in enumerate(pairwise(part.nodes)):
        mass, first, second = (_moment(section.mass, length, low, high, power) for power in range(3))
        inertia = second - first**2 / mass + _moment(section.rotary, length, low, high, 0)
        if i == 0 and part.clamped and crank:
            inertia += crank.flywheel
        last = i == len(part.rods) - 1
        for disc in linkage.masses:
            if disc.link == part.link.name and _within(linkage, part.link.along(disc.point), low, high, last):
                inertia += disc.inertia
        yield RigidLink(
            name=part.rods[i],
            start=part.points[i],
            end=part.points[i + 1],
            length=(high - low) * length,
            mass=mass,
            centre=first / mass - low * length,
            offset=_ZERO,
            inertia=inertia,
            as_drawn=False,
            carried=tuple(
                CarriedPoint(c.name, (c.along - low) / (high - low), _ZERO)
                for c in part.link.carried
                if _within(linkage, c.along, low, high, last)
            ),
        )


def _within(linkage: Linkage, at: sp.Expr, low: sp.Expr, high: sp.Expr, last: bool) -> bool:
    place = linkage.number(at)
    return linkage.number(low) <= place and (place < linkage.number(high) or last)


def _springs(part: Segments) -> Iterator[AngularSpring]:
    """Yield the springs between the rods, with the stiffness-proportional damping of the link."""
    length = part.link.length
    for before, after, node in zip(part.rods[:-1], part.rods[1:], part.nodes[1:-1], strict=True):
        bending = sp.Add(*(c * (node * length) ** k for k, c in enumerate(part.beam.section.bending)))
        stiffness = bending / (part.spacing * length)
        damping = part.beam.stiffness_damping * stiffness
        yield AngularSpring(f"{after}__spring", after, before, stiffness, _ZERO, damping)


def _loads(linkage: Linkage, parts: Sequence[Segments]) -> list[Load]:
    """Return the loads of the linkage, those on its elastic links as loads on their rods."""
    loads = [x for load in linkage.loads for x in _couples(linkage, parts, load)]
    for part in parts:
        loads = [x for load in loads for x in load.on_segments(part.link.name, part.rods, part.nodes)]
    return loads


def _couples(linkage: Linkage, parts: Sequence[Segments], load: Load) -> Iterator[Load]:
    """Yield a couple on a section as couples on the two rods whose directions are next to it; others as is.

    The direction of the section is interpolated between theirs, and the couple does the same work.
    """
    if not isinstance(load, AppliedTorque) or not load.section:
        yield load
        return
    of = {part.link.name: part for part in parts}
    for link, sign in ((load.link, 1), (load.against, -1)):
        if not link:
            continue
        part = of[link]
        first, last = part.nodes[1] - part.spacing / 2, len(part.rods) - 1
        place = (part.link.along(load.section) - first) / part.spacing
        k = min(max(int(linkage.number(place) // 1), 0), last)
        share = place - k if linkage.number(place) > 0 and k < last else _ZERO
        for rod, part_of_couple in ((k, 1 - share), (k + 1, share)):
            if part_of_couple != 0:
                torque = tuple(sign * part_of_couple * c for c in load.torque)
                yield AppliedTorque(f"{load.name}__{part.rods[rod]}", part.rods[rod], torque)


def _inner_points(part: Segments, places: Places) -> Iterator[PlacedPoint]:
    start, end = places[part.link.start], places[part.link.end]
    for name, node in zip(part.points[1:-1], part.nodes[1:-1], strict=True):
        share = float(node)
        at = _at([(1 - share) * a + share * b for a, b in zip(start, end, strict=True)])
        yield PlacedPoint(name, at, False, at)


def _at(place: Sequence[float]) -> Vector:
    return tuple(sp.Float(float(c), _DIGITS) for c in place)
