"""Points and links of a scene: where they are drawn, lengths, masses and moments of inertia."""

from __future__ import annotations

from collections.abc import Iterator

import sympy as sp

from symgen.errors import SceneError
from symgen.scene import units
from symgen.scene.elastic import sections
from symgen.scene.elastic.reading import has_rotary_inertia
from symgen.scene.reading import Reader
from symgen.scene.rods.linkage import TIME, CarriedPoint, PlacedPoint, RigidLink, Vector
from symgen.scene.rods.run_parameters import LENGTH, compose
from symgen.scene.schema import Link, PointTable

_ZERO = sp.Integer(0)


def points(read: Reader) -> None:
    """Place every point of the scene where it is drawn, those on a link after the ends of that link."""
    for name in read.scene.points:
        _place(read, name, ())
    read.points = {name: read.points[name] for name in read.scene.points}


def _place(read: Reader, name: str, waiting: tuple[str, ...]) -> None:
    """Place a point, and before it those that it needs; ``waiting`` are the points that need this one."""
    if name in read.points or name not in read.scene.points:
        return
    point, where = read.scene.points[name], f"points.{name}"
    if name in waiting:
        ring = " on ".join((*waiting[waiting.index(name) :], name))
        raise SceneError(f"these points are placed by each other: {ring}", where=where)
    if point.at is not None and point.on is None and point.fraction is None and point.offset is None:
        read.points[name] = _drawn(read, name, point, point.at)
        return
    if point.at is not None or point.on is None or point.fraction is None:
        raise SceneError(
            "expected either at, or on and fraction, with or without offset",
            where=where,
            hint='Write at = ["1 m", "0 m"], or on = "link" and fraction = 0.5 for a point of a link.',
        )
    if point.ground or point.motion is not None:
        raise SceneError("a point on a link moves with the link: it is no ground point", where=where)
    read.known_link(point.on, f"{where}.on")
    link = read.scene.links[point.on]
    for end in link.points[:2]:
        _place(read, end, (*waiting, name))
    first, second = (read.known_point(p, f"links.{point.on}.points").at for p in link.points[:2])
    drawn = tuple(b - a for a, b in zip(first, second, strict=True))
    along, across = _on_line(read, name, _length(read, point.on, drawn))
    at = tuple(a + along * d for a, d in zip(first, drawn, strict=True))
    if across != 0:
        at = at[0] - across * drawn[1], at[1] + across * drawn[0]
    read.points[name] = PlacedPoint(name, at, False, at)


def _length(read: Reader, name: str, drawn: Vector) -> sp.Expr:
    """Return the length of a link [m]: that of the scene, or the drawn distance."""
    text, where = read.scene.links[name].length, f"links.{name}.length"
    if text is None:
        return sp.sqrt(sp.Add(*(c**2 for c in drawn)))
    length = read.positive(text, units.LENGTH, where, read.with_time)
    read.moving(length, units.LENGTH, where)
    return length


def _on_line(read: Reader, name: str, length: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Return the place of a point along the line of its link and to the left of it, over the length [m]."""
    point, where = read.scene.points[name], f"points.{name}"
    along = read.value(point.fraction or 0, units.NUMBER, f"{where}.fraction")
    if point.offset is None:
        return along, _ZERO
    offset, where = read.value(point.offset, units.LENGTH, f"{where}.offset"), f"{where}.offset"
    if offset == 0 or read.number(length) == 0:  # links of zero length are refused when they are read
        return along, _ZERO
    if read.dimension == 3:
        raise SceneError(
            f"a line in space has no left side, to which {name} could be set off",
            where=where,
            hint="Write at = [x, y, z], and name it among the link's points: the link is a body then.",
        )
    if TIME.symbol in length.free_symbols:
        raise SceneError(
            f"the length of {point.on} depends on the time: points off its line would stretch with it",
            where=where,
            hint="Put the point on another link.",
        )
    return along, offset / length


def on_link(read: Reader, link: str) -> Iterator[str]:
    """Yield the points that are placed on a link."""
    for name in read.placed_on.get(link, ()):
        if read.scene.points[name].fraction is not None:
            if name in read.scene.links[link].points:
                raise SceneError(f"{name} is one of the base points of {link}", where=f"points.{name}.on")
            yield name


def _drawn(read: Reader, name: str, point: PointTable, place: list[str | int | float]) -> PlacedPoint:
    """Return a point where it is drawn, with the motion of a ground point."""
    where = f"points.{name}"
    at = read.vector(place, units.LENGTH, f"{where}.at")
    if point.motion is None:
        return PlacedPoint(name, at, point.ground, at)
    if not point.ground:
        raise SceneError("only a ground point has a motion of its own", where=f"{where}.motion")
    moved = read.vector(point.motion, units.LENGTH, f"{where}.motion", read.with_time)
    for i, component in enumerate(moved):
        read.moving(component, units.LENGTH, f"{where}.motion.{i}")
    return PlacedPoint(name, at, True, tuple(a + b for a, b in zip(at, moved, strict=True)))


def points_of_body(read: Reader, link: Link, where: str) -> list[PlacedPoint]:
    """Return the points a link names, each once."""
    named = [read.known_point(p, f"{where}.points") for p in link.points]
    if len({p.name for p in named}) < len(named):
        raise SceneError(
            "a link names each of its points once; with one point twice it has zero length",
            where=f"{where}.points",
        )
    return named


_OF_MASS = ("mass", "centre", "offset", "inertia")


def link(read: Reader, name: str, link: Link) -> RigidLink:
    """Return a link with its length, mass and inertia, and the further points that it carries."""
    where = f"links.{name}"
    named = points_of_body(read, link, where)
    start, end, *others = named
    drawn = tuple(b - a for a, b in zip(start.at, end.at, strict=True))
    squared = sp.Add(*(c**2 for c in drawn))
    if link.length is None and read.number(squared) == 0:
        raise SceneError(
            f"the rod has zero length: {start.name} and {end.name} are the same place",
            where=f"{where}.points",
            hint="Move one of the points, or join the other links at one point and leave this rod out.",
        )
    length = _length(read, name, drawn)
    if link.length is not None:
        at_start = {TIME.symbol: _ZERO}
        places = ([c.xreplace(at_start) for c in (p.motion if p.ground else p.at)] for p in (start, end))
        if read.number(sp.Add(*((b - a) ** 2 for a, b in zip(*places, strict=True)))) == 0:
            raise SceneError(
                f"{start.name} and {end.name} are drawn at the same place: the link has no direction there",
                where=f"{where}.points",
                hint="Draw them apart: from the drawing the linkage is led to the length of the link.",
            )
        if start.ground and end.ground:
            raise SceneError(
                "the length of a link between two ground points is their distance",
                where=f"{where}.length",
            )
    if (others or isinstance(link.centre, list)) and link.length is not None:
        raise SceneError(
            "a body with more than two points, or a centre off its line, takes its length from the drawing",
            where=f"{where}.length",
            hint=f'Name two points, and place the others on it: P = {{ on = "{name}", fraction = 0.5, '
            'offset = "1 cm" }. They keep their offsets when the length changes.',
        )
    carried = [CarriedPoint(p.name, *in_frame(drawn, squared, start.at, p.at)) for p in others]
    carried += [CarriedPoint(p, *_on_line(read, p, length)) for p in on_link(read, name)]
    mass, centre, offset, inertia = of_mass = body(read, link, length, drawn, start.at, bool(others), where)
    if TIME.symbol not in length.free_symbols:

        def mirrored(read: Reader) -> dict[str, sp.Expr]:
            again = body(read, link, LENGTH, drawn, start.at, bool(others), where)
            return dict(zip(_OF_MASS, again, strict=True))

        compose(read, length, where, dict(zip(_OF_MASS, of_mass, strict=True)), mirrored)
        for point in carried[len(others) :]:
            _keep_place(read, point, length)
    moving = start.ground and end.ground and (start.motion, end.motion) != (start.at, end.at)
    # Elements of an elastic link have its inertia.
    if moving and mass != 0 and link.elastic is None:
        raise SceneError(
            "the motion of a link between ground points that move is prescribed, and reactions do not "
            "include its inertia",
            where=f"{where}.mass",
            hint="Leave its mass out, or free one of its points and drive the link: then its weight and "
            "inertia are in the reactions.",
        )
    if TIME.symbol in length.free_symbols and mass != 0:
        raise SceneError(
            "a length that depends on the time is for a massless link",
            where=f"{where}.length",
            hint='Write mass = "0 kg", and put the mass on points or on other links.',
        )
    return RigidLink(
        name, start.name, end.name, length, mass, centre, offset, inertia, link.length is None, tuple(carried)
    )


def _keep_place(read: Reader, point: CarriedPoint, length: sp.Expr) -> None:
    def mirrored(read: Reader) -> dict[str, sp.Expr]:
        return dict(zip(("along", "across"), _on_line(read, point.name, LENGTH), strict=True))

    values = {"along": point.along, "across": point.across}
    compose(read, length, f"points.{point.name}", values, mirrored)


def in_frame(drawn: Vector, squared: sp.Expr, start: Vector, place: Vector) -> Vector:
    """Return a place in a body's frame: along d and along d turned left, d as the unit."""
    x, y = (p - s for p, s in zip(place, start, strict=True))
    return (x * drawn[0] + y * drawn[1]) / squared, (y * drawn[0] - x * drawn[1]) / squared


def body(
    read: Reader, link: Link, length: sp.Expr, drawn: Vector, start: Vector, several: bool, where: str
) -> tuple[sp.Expr, sp.Expr, sp.Expr, sp.Expr]:
    """Return mass, centre along and off the line, and inertia about the centre."""
    if sections.is_line(link):
        bent = read.dimension == 3 and link.elastic is not None
        along = sections.line(read, link, length, where, in_space=bent)
        rotary = has_rotary_inertia(link.elastic, f"{where}.elastic")
        mass, centre, inertia = sections.rigid(along, length, rotary)
        return mass, centre, _ZERO, inertia
    mass = link_mass(read, link, length, several, where)
    if several and mass != 0 and not isinstance(link.centre, list):
        raise SceneError(
            "a link of three or more points needs the position of its centre of mass"
            + ("" if link.centre is None else f", got the fraction {link.centre!r}"),
            where=f"{where}.centre",
            hint='Write centre = ["0.2 m", "0.1 m"], as drawn. A rod is named by its two ends, with further '
            'points on it: P = { on = "link", fraction = 0.5 }.',
        )
    centre, offset = length / 2, _ZERO
    if isinstance(link.centre, list):
        squared = sp.Add(*(c**2 for c in drawn))
        place = read.vector(link.centre, units.LENGTH, f"{where}.centre")
        along, across = in_frame(drawn, squared, start, place)
        centre, offset = along * length, across * length
    elif link.centre is not None:
        try:
            centre = read.value(link.centre, units.NUMBER, f"{where}.centre") * length
        except SceneError as error:
            _, got, text = error.problem.partition(", got ")
            if "a plain number" not in error.problem:
                raise
            raise SceneError(
                f"expected a fraction of the length, or a position as drawn{got}{text}",
                where=error.where,
                hint='Write centre = 0.4, or centre = ["0.2 m", "0.1 m"].',
            ) from None
    if isinstance(link.inertia, list):
        raise SceneError(
            "a rod, or a body in the plane, has one moment of inertia",
            where=f"{where}.inertia",
            hint='Write inertia = "0.02 kg*m^2".',
        )
    if link.inertia is not None:
        return mass, centre, offset, read.not_negative(link.inertia, units.INERTIA, f"{where}.inertia")
    if mass != 0 and isinstance(link.centre, list):
        raise SceneError(
            "a body that is not a rod needs its moment of inertia about the centre of mass",
            where=where,
            hint='Write inertia = "0.02 kg*m^2".',
        )
    return mass, centre, offset, mass * length**2 / 12


def link_mass(read: Reader, link: Link, length: sp.Expr, several: bool, where: str) -> sp.Expr:
    """Return the mass of a link; zero for a rail, a length that depends on the time, and in kinematics."""
    if several and link.mass_per_length is not None:
        raise SceneError("only a rod has a mass per length", where=f"{where}.mass_per_length")
    match link.mass, link.mass_per_length:
        case None, None:
            ground = all(read.known_point(p, where).ground for p in link.points)
            without = TIME.symbol in length.free_symbols or read.scene.analysis.kind == "kinematics"
            if ground or without:
                return _ZERO
            raise SceneError(
                "this link has no mass",
                where=where,
                hint='Give it mass = "1 kg" or mass_per_length = "1 kg/m"; "0 kg" for a massless rod.',
            )
        case (str() | int() | float()) as mass, None:
            return read.not_negative(mass, units.MASS, f"{where}.mass")
        case None, (str() | int() | float()) as density:
            return read.not_negative(density, units.MASS_PER_LENGTH, f"{where}.mass_per_length") * length
    raise SceneError("give mass or mass_per_length, not both", where=f"{where}.mass")
