"""Rigid bodies in space: the four points that carry each of them, and derived weights.

Any point of a rigid body is the sum of four of its points, not in one plane, with constant weights that
add to one. So the kinetic energy is a constant quadratic form of the four velocities: with T = [1; r_b] of
the four as drawn and P the second moments of [1; r] by mass, its matrix is T^-1 P T^-T.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations

import sympy as sp

from symgen.errors import SceneError
from symgen.scene import units
from symgen.scene.inertia import FLAT, check_real, inertia_matrix, spread
from symgen.scene.reading import Reader
from symgen.scene.rods import bodies
from symgen.scene.rods.constraints import is_hinge
from symgen.scene.rods.linkage import Bar, PlacedPoint, RigidLink, SpatialBody, Vector, WeightedPoint
from symgen.scene.schema import Link
from symgen.symbolic.constants import rounded
from symgen.symbolic.vectors import cross, dot

_DIGITS = 40
#: Shares of a body's size: how far a point must be out of the span of the others to be a base point.
_SHARED, _ONE_LINK = 1e-3, 0.3
#: Square of the sine of the angle between an axis and the line of ground points on it, up to rounding.
_OFF_AXIS = 1e-12

Pairs = set[frozenset[str]]
Floats = list[float]


def spatial_bodies(read: Reader, links: Sequence[RigidLink]) -> tuple[SpatialBody, ...]:
    """Return the bodies in space of a scene, and add their hidden points to those of the reader."""
    if not any(map(read.is_spatial_body, read.scene.links)):
        return ()
    named = {
        name: [*bodies.points_of_body(read, link, f"links.{name}"), *_on_axis(read, name)]
        for name, link in read.scene.links.items()
        if read.is_spatial_body(name)
    }
    rigid: Pairs = set()
    for link in links:
        if link.as_drawn:
            rigid |= _pairs([link.start, link.end, *(p.name for p in link.carried)])
    rigid |= _pairs([p.name for p in read.points.values() if p.ground])
    bodies_in_space = []
    for name, points in named.items():
        bodies_in_space.append(_body(read, name, read.scene.links[name], points, rigid))
    return tuple(bodies_in_space)


def _on_axis(read: Reader, name: str) -> Iterator[PlacedPoint]:
    """Yield a second ground point, hidden, on the axis of a body's revolute joint, where it has none."""
    joints = [
        (i, k) for i, k in enumerate(read.scene.joints) if is_hinge(read.scene, k) and k.links == [name]
    ]
    grounded = read.ground_points(name)
    for i, joint in joints[:1] if not read.has_elastic_links else ():
        start = next((p for p in grounded if p.name == joint.point), None)
        if start is None:
            return  # refused where joints are read
        axis = read.direction(joint.axis, f"joints.{i}.axis")
        for other in grounded:
            arm = tuple(b - a for a, b in zip(start.at, other.at, strict=True))
            if read.number(
                dot(cross(arm, axis), cross(arm, axis)) / dot(axis, axis)
            ) > _OFF_AXIS * read.number(dot(arm, arm)):
                raise SceneError(
                    f"{other.name} is a ground point of {name}, and not on the axis of its revolute joint",
                    where=f"joints.{i}.axis",
                    hint=f"Move it to the axis through {joint.point}, or make it no ground point.",
                )
        if len(grounded) == 1:
            points = (read.points[p].at for p in read.scene.links[name].points)
            reach = max(
                math.dist([read.number(c) for c in at], [read.number(c) for c in start.at]) for at in points
            )
            size = sp.Rational(f"{reach:.3g}") / sp.sqrt(dot(axis, axis))
            at, motion = (
                tuple(c + size * a for c, a in zip(x, axis, strict=True)) for x in (start.at, start.motion)
            )
            read.points[f"{name}_base1"] = PlacedPoint(f"{name}_base1", at, True, motion, hidden=True)
            yield read.points[f"{name}_base1"]


def _body(read: Reader, name: str, link: Link, points: Sequence[PlacedPoint], rigid: Pairs) -> SpatialBody:
    where = f"links.{name}"
    for key in ("length", "mass_per_length", "density", "section", "elastic"):
        if getattr(link, key) is not None:
            raise SceneError("only a rod has this", where=f"{where}.{key}")
    if not isinstance(link.centre, list) or not isinstance(link.inertia, list) or link.mass is None:
        raise SceneError(
            "a body in space needs mass, centre = [x, y, z] and inertia = [xx, yy, zz]",
            where=where,
            hint="Give the moments of inertia about the centre, in the axes of the drawing.",
        )
    mass = read.positive(link.mass, units.MASS, f"{where}.mass")
    centre = _exact(read.vector(link.centre, units.LENGTH, f"{where}.centre"), f"{where}.centre")
    second = _spread(read, link.inertia, f"{where}.inertia")
    base = _base(read, name, points, centre, _radius(read, mass, second))
    places = {p.name: _exact(p.at, f"points.{p.name}.at") for p in (*points, *base)}
    _same_motion(base, where)
    columns = sp.Matrix([[1, 1, 1, 1], *zip(*(places[p.name] for p in base), strict=True)])
    inverse = columns.inv()

    def weights(place: Vector) -> Vector:
        return tuple(_short(x) for x in inverse * sp.Matrix([1, *place]))

    of_centre = weights(centre)
    edges = columns[1:, 1:] - columns[1:, :1] * sp.ones(1, 3)
    out = inverse[:, 1:]
    masses = tuple(
        tuple(
            _short(mass * of_centre[a] * of_centre[b] + (out[a, :] * second * out[b, :].T)[0])
            for b in range(4)
        )
        for a in range(4)
    )
    names = [p.name for p in base]
    bars = tuple(
        Bar(a, b, sp.sqrt(sum((x - y) ** 2 for x, y in zip(places[a], places[b], strict=True))))
        for a, b in combinations(names, 2)
        if frozenset((a, b)) not in rigid
    )
    carried = [WeightedPoint(p.name, weights(places[p.name])) for p in points if p.name not in names]
    carried += [
        WeightedPoint(p, weights(_exact(read.points[p].at, f"points.{p}.fraction")))
        for p in bodies.on_link(read, name)
    ]
    rigid |= _pairs([*names, *(p.name for p in carried)])
    gram = (edges.T * edges).inv()
    return SpatialBody(
        name,
        tuple(names),
        bars,
        mass,
        of_centre,
        masses,
        tuple(tuple(_short(gram[i, k]) for k in range(3)) for i in range(3)),
        tuple(carried),
    )


def _pairs(names: Sequence[str]) -> Pairs:
    return {frozenset(pair) for pair in combinations(names, 2)}


def _exact(place: Vector, where: str) -> Vector:
    """Return coordinates as rational numbers."""
    if any(c.free_symbols for c in place):
        raise SceneError(
            "the shape of a body in space cannot hold tunable parameters; its mass and inertia may",
            where=where,
        )
    return tuple(sp.Rational(str(rounded(c, _DIGITS))) for c in place)


def _short(value: sp.Expr) -> sp.Expr:
    """Round a rational number with more digits than anything needs."""
    if value.is_Rational and max(abs(int(value.p)), int(value.q)) > 10 ** (2 * _DIGITS):
        return sp.Rational(str(value.evalf(_DIGITS)))
    return value


def _spread(read: Reader, moments: Sequence[str | int | float], where: str) -> sp.Matrix:
    """Return the second moments of the mass about its centre [kg m^2], of a body that is not flat."""
    matrix = inertia_matrix(read, moments, where)
    least, largest = check_real(read, matrix, where)
    if least <= FLAT * largest:
        raise SceneError(
            "this body has no thickness: its largest principal moment of inertia is the sum of the others",
            where=where,
            hint="Add the thickness to the moments (a rod is a link with two points and one moment).",
        )
    return spread(matrix)


def _radius(read: Reader, mass: sp.Expr, spread: sp.Matrix) -> float:
    """Return the radius of gyration about the centre [m]."""
    return math.sqrt(sum(read.number(spread[i, i]) for i in range(3)) / read.number(mass))


def _base(
    read: Reader, name: str, points: Sequence[PlacedPoint], centre: Vector, radius: float
) -> list[PlacedPoint]:
    """Choose four base points, well spread: points of the body, hidden ones where those do not suffice.

    Ground points and points that other links share come first, since a base point shares without a row.
    """

    def shared(p: PlacedPoint) -> bool:
        return any(p.name in k.points for other, k in read.scene.links.items() if other != name)

    ranked = sorted(points, key=lambda p: (not p.ground, not shared(p)))
    places = {p.name: [read.number(c) for c in p.at] for p in points}
    first = ranked[0]
    start = places[first.name]
    arms = {p.name: [a - b for a, b in zip(places[p.name], start, strict=True)] for p in points}
    middle = [float(c) - s for c, s in zip(centre, start, strict=True)]
    size = max(radius, *(math.hypot(*arm) for arm in arms.values()))
    chosen: list[PlacedPoint] = [first]
    normals: list[Floats] = []
    for p in ranked[1:]:
        out = _out_of(arms[p.name], normals)
        if len(chosen) < 4 and math.hypot(*out) > size * (_SHARED if p.ground or shared(p) else _ONE_LINK):
            chosen.append(p)
            normals.append(_unit(out))
    reach = math.hypot(radius, *middle)
    while len(chosen) < 4:
        towards = _out_of(middle, normals)
        if math.hypot(*towards) < _ONE_LINK * reach:
            axes = [_out_of([float(i == k) for i in range(3)], normals) for k in range(3)]
            towards = max(axes, key=lambda a: math.hypot(*a))
        normal = _unit(towards)
        place = tuple(sp.Rational(f"{s + reach * n:.12g}") for s, n in zip(start, normal, strict=True))
        hidden = PlacedPoint(f"{name}_base{len(chosen)}", place, False, place, hidden=True)
        read.points[hidden.name] = hidden
        chosen.append(hidden)
        normals.append(normal)
    return chosen


def _out_of(arm: Floats, normals: Sequence[Floats]) -> Floats:
    """Return the part of a vector across these orthonormal ones."""
    for normal in normals:
        along = sum(a * n for a, n in zip(arm, normal, strict=True))
        arm = [a - along * n for a, n in zip(arm, normal, strict=True)]
    return arm


def _unit(vector: Floats) -> Floats:
    length = math.hypot(*vector)
    return [c / length for c in vector]


def _same_motion(base: Sequence[PlacedPoint], where: str) -> None:
    """Check that the ground points of a body move alike."""
    moves = [[m - a for m, a in zip(p.motion, p.at, strict=True)] for p in base if p.ground]
    if any(move != moves[0] for move in moves[1:]):
        raise SceneError("the ground points of this body move apart", where=f"{where}.points")
