"""Points off the line of an elastic link: each on a massless rigid lug, welded to the section at its foot."""

from __future__ import annotations

from dataclasses import dataclass, field

import sympy as sp

from symgen.errors import SceneError
from symgen.scene import units
from symgen.scene.elastic.schema import Weld
from symgen.scene.reading import Reader
from symgen.scene.rods.linkage import PlacedPoint, RigidLink
from symgen.scene.schema import Link, PointTable
from symgen.scene.units import is_quantity
from symgen.symbolic.constants import vanishes

#: Names of a lug and of its foot, the point of the elastic link to which it is welded, after its point.
LUG, FOOT = "{}_lug", "{}_foot"
#: The table of a point that has been placed.
_FREE = PointTable.model_construct()


@dataclass(slots=True)
class _Feet:
    """The points of one elastic link by their fractions of its length, and its lugs by their feet."""

    at: dict[sp.Expr, str]
    lugs: dict[str, str] = field(default_factory=dict)


def with_lugs(read: Reader) -> None:
    """Put every point off the line of an elastic link in the scene of a reader on a lug.

    Such points have an ``offset``, or are further points of the link. Points at one fraction of the length
    are on one lug. A foot is a point of the link that is there already, or a new one. The reader has placed
    all points.

    Raises
    ------
    SceneError
        For a point off the line at an end on the ground, where a weld would clamp the link.
    """
    scene = read.scene
    points, links, welds = dict(scene.points), dict(scene.links), list(scene.welds)
    for link, table in scene.links.items():
        if table.elastic is None or read.dimension == 3:
            continue
        feet = _Feet({sp.S.Zero: table.points[0], sp.S.One: table.points[1]})
        off: list[tuple[str, sp.Expr, str | None]] = []
        for name in [*read.placed_on.get(link, ()), *(table.points[2:] if table.length is None else ())]:
            along, across, text = _place(read, name, link)
            if across.is_number and vanishes(across):
                feet.at.setdefault(along, name)
                points[name] = _on(link, along)
            else:
                off.append((name, along, text))
        if table.length is None:
            links[link] = table.model_copy(update={"points": table.points[:2]})
        for name, along, text in off:
            check_fraction(read, link, along, f"points.{name}")
            foot = feet.at.setdefault(along, FOOT.format(name))
            _check_foot(read, name, foot, link)
            if foot not in points:
                points[foot] = _on(link, along)
                read.points[foot] = _between(read, table, foot, along)
            points[name] = _FREE
            if foot in feet.lugs:
                shared = links[feet.lugs[foot]]
                links[feet.lugs[foot]] = shared.model_copy(update={"points": [*shared.points, name]})
                continue
            feet.lugs[foot] = LUG.format(name)
            length = None if table.length is None or text is None else _distance(text)
            rod = {"points": [foot, name], "mass": "0 kg", "length": length}
            links[LUG.format(name)] = Link.model_validate(rod)
        for foot, lug in feet.lugs.items():
            _weld(welds, foot, [lug, link])
    read.take(scene.model_copy(update={"points": points, "links": links, "welds": welds}))


def is_lug(link: RigidLink) -> bool:
    """Return whether a link is the rigid joint of a point off the line of an elastic link."""
    return link.name == LUG.format(link.end)


def _place(read: Reader, name: str, link: str) -> tuple[sp.Expr, sp.Expr, str | None]:
    """Return fraction of the length of a link and distance from its line of a point, and its offset."""
    point, where = read.scene.points[name], f"points.{name}"
    if point.on == link:
        across = read.value(point.offset or 0, units.LENGTH, f"{where}.offset")
        along = read.value(point.fraction or 0, units.NUMBER, f"{where}.fraction")
        return along, across, None if point.offset is None else str(point.offset)
    (x0, y0), (x1, y1), (x, y) = (
        read.known_point(p, f"links.{link}.points").at for p in (*read.scene.links[link].points[:2], name)
    )
    dx, dy, px, py = x1 - x0, y1 - y0, x - x0, y - y0
    squared = dx**2 + dy**2
    return (px * dx + py * dy) / squared, (py * dx - px * dy) / squared, None


def _on(link: str, along: sp.Expr) -> PointTable:
    """Return the table of a point on the line of a link."""
    return PointTable.model_validate({"on": link, "fraction": str(along)})


def check_fraction(read: Reader, link: str | None, fraction: sp.Expr, where: str) -> None:
    """Check that a point of an elastic link is off its axis, between its ends."""
    if not 0 <= read.number(fraction) <= 1:
        raise SceneError(
            f"a point of the elastic link {link} lies between its ends: expected a fraction from 0 to 1, "
            f"got {read.number(fraction):g}",
            where=where,
        )


def _check_foot(read: Reader, name: str, foot: str, link: str) -> None:
    if foot in read.points and read.points[foot].ground:
        raise SceneError(
            f"{name} is rigidly joined to the section of {link} at {foot}, on the ground",
            where=f"points.{name}",
            hint="Place it at another fraction of the length, or on the ground.",
        )


def _between(read: Reader, table: Link, name: str, along: sp.Expr) -> PlacedPoint:
    """Return a foot, on the drawn line of its link."""
    first, second = (read.points[p].at for p in table.points[:2])
    at = tuple(a + along * (b - a) for a, b in zip(first, second, strict=True))
    return PlacedPoint(name, at, False, at, hidden=True)


def _distance(offset: str) -> str:
    """Return the size of an offset as a value of the scene."""
    return offset.strip().lstrip("-") if is_quantity(offset) else f"abs({offset})"


def _weld(welds: list[Weld], point: str, links: list[str]) -> None:
    """Add a weld, to that at its point if there is one."""
    for k, weld in enumerate(welds):
        if weld.point == point:
            more = [name for name in links if name not in weld.links]
            welds[k] = weld.model_copy(update={"links": [*weld.links, *more]})
            return
    welds.append(Weld(point=point, links=links))
