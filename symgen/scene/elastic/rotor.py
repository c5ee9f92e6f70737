"""Elastic links in space that rotate as a whole about a fixed axis: the values of a scene."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from symgen.errors import SceneError
from symgen.scene import units
from symgen.scene.elastic.schema import Rotor
from symgen.scene.elastic.spatial_section import section_in_space
from symgen.scene.limit import Limit
from symgen.scene.reading import Reader, check_count, shown_units
from symgen.scene.rods.bodies import points
from symgen.scene.rods.held import Parameter
from symgen.scene.schema import Link, Scene
from symgen.scene.units import Shown

#: Tables that the scene of a rotor may have, and keys of its links, their elasticity and their sections.
_TABLES = {
    "symgen", "title", "about", "units", "parameters", "points", "links", "masses", "welds", "rotor",
}  # fmt: skip
_LINK = {"points", "density", "mass", "mass_per_length", "section", "elastic"}
_ELASTIC = {"E", "elements", "shear"}
_ELEMENTS, _MOST_ELEMENTS = 4, 100


@dataclass(frozen=True, slots=True)
class RotorLink:
    """An elastic link: its points, those at which it is welded, number of elements, and its numbers.

    ``width`` is the direction of the y axis of the section. ``section`` are mu, J_y, J_z, EA, EI_y, EI_z and
    GJ, as :mod:`symgen.mechanics.elastic.spatial` has them.
    """

    link: str
    start: str
    end: str
    elements: int
    welds: tuple[str, ...]
    width: tuple[sp.Expr, ...]
    section: tuple[sp.Expr, ...]


@dataclass(frozen=True, slots=True)
class RotorMass:
    """A mass [kg] at a point, and its moments of inertia [kg m^2] about the axes of the drawing."""

    point: str
    mass: sp.Expr
    inertia: tuple[sp.Expr, ...]


@dataclass(frozen=True, slots=True)
class RotorScene:
    """A resolved scene: places [m], links, masses, axis, speed [rad/s] and a point of the axis.

    ``limits`` are values over tunable parameters whose sign is checked again at other values of these.
    """

    method: ClassVar[str] = "rotor"
    name: str
    file: str
    title: str
    units: Shown
    parameters: tuple[Parameter, ...]
    places: dict[str, tuple[sp.Expr, ...]]
    free: tuple[str, ...]
    links: tuple[RotorLink, ...]
    masses: tuple[RotorMass, ...]
    axis: tuple[sp.Expr, ...]
    speed: sp.Expr
    through: tuple[sp.Expr, ...]
    limits: tuple[Limit, ...]


def resolved_rotor(scene: Scene) -> RotorScene:
    """Return the rotor of a scene.

    Raises
    ------
    SceneError
        For a table or key that a rotor does not have, a wrong unit, an unknown name, or an unphysical value.
    """
    for key in sorted(scene.model_fields_set - _TABLES):
        if getattr(scene, key):
            raise SceneError(
                f"a scene with a rotor has no {key}",
                where=key,
                hint="It has points, links, masses and welds, and the loads of its rotation alone.",
            )
    for key in ("points", "links"):
        if key not in scene.model_fields_set:
            raise SceneError("this key is missing", where=key, hint="A rotor has points and links.")
    read = Reader(scene)
    if read.dimension != 3:
        raise SceneError("expected points with three coordinates: a rotor is in space", where="points")
    points(read)
    for name, point in scene.points.items():
        if point.motion is not None:
            raise SceneError(
                "the ground of a rotor rotates and has no other motion", where=f"points.{name}.motion"
            )
    table: Rotor = getattr(scene, "rotor")  # noqa: B009  (a table that the method adds)
    axis = read.direction(table.axis, "rotor.axis")
    through = (sp.Integer(0),) * 3
    if table.through is not None:
        through = read.known_point(table.through, "rotor.through").at
    welds = dict(_welds(read)) | dict(_turned(read))
    links = tuple(_link(read, name, link, welds) for name, link in scene.links.items())
    used = {p for link in links for p in (link.start, link.end)}
    for name, placed in read.points.items():
        if name not in used and not placed.ground:
            raise SceneError(f"the point {name} is on no link", where=f"points.{name}")
    free = tuple(name for name, placed in read.points.items() if not placed.ground)
    return RotorScene(
        name=scene.name,
        file=scene.file,
        title=scene.title or scene.name,
        units=shown_units(scene.units),
        parameters=tuple(read.parameters),
        places={name: placed.at for name, placed in read.points.items()},
        free=free,
        links=links,
        masses=tuple(_masses(read)),
        axis=axis,
        speed=read.value(table.speed, units.ANGULAR_RATE, "rotor.speed"),
        through=through,
        limits=tuple(read.limits),
    )


def _welds(read: Reader) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield the points of welds with the links welded there."""
    for i, weld in enumerate(read.scene.welds):
        where = f"welds.{i}"
        read.known_point(weld.point, f"{where}.point")
        if sum(other.point == weld.point for other in read.scene.welds) > 1:
            raise SceneError(f"{weld.point} has two welds", where=f"{where}.point", hint="Write them as one.")
        for name in weld.links:
            read.known_link(name, f"{where}.links")
            if weld.point not in read.scene.links[name].points:
                raise SceneError(f"{weld.point} is no end of {name}", where=f"{where}.point")
        yield weld.point, tuple(weld.links)


def _ending_at(read: Reader, point: str) -> tuple[str, ...]:
    return tuple(name for name, link in read.scene.links.items() if point in link.points[:2])


def _turned(read: Reader) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield the points at which a mass with inertia rotates with the one link that ends there."""
    welded = {weld.point for weld in read.scene.welds}
    for i, mass in enumerate(read.scene.masses):
        if mass.inertia is None or mass.point in welded:
            continue
        links = _ending_at(read, mass.point)
        if len(links) != 1:
            raise SceneError(
                f"a mass with inertia rotates with the links at {mass.point}, and these rotate apart",
                where=f"masses.{i}.inertia",
                hint="Weld the links there.",
            )
        yield mass.point, links


def _masses(read: Reader) -> Iterator[RotorMass]:
    for i, mass in enumerate(read.scene.masses):
        where = f"masses.{i}"
        point = read.known_point(mass.point, f"{where}.point").name
        inertia: tuple[sp.Expr, ...] = (sp.Integer(0),) * 3
        if mass.inertia is not None and not isinstance(mass.inertia, list):
            raise SceneError(
                "a mass on a rotor has three moments of inertia",
                where=f"{where}.inertia",
                hint="Write inertia = [x, y, z], about the axes of the drawing.",
            )
        if mass.inertia is not None:
            inertia = tuple(
                read.not_negative(text, units.INERTIA, f"{where}.inertia.{k}")
                for k, text in enumerate(mass.inertia)
            )
            sizes = sorted(read.number(x) for x in inertia)
            if sizes[2] > (sizes[0] + sizes[1]) * (1 + 1e-9):
                raise SceneError(
                    "no body has a moment of inertia above the sum of the other two", where=f"{where}.inertia"
                )
        yield RotorMass(point, read.not_negative(mass.mass, units.MASS, f"{where}.mass"), inertia)


def _link(read: Reader, name: str, link: Link, welds: dict[str, tuple[str, ...]]) -> RotorLink:
    where = f"links.{name}"
    elastic = link.elastic
    if elastic is None:
        raise SceneError(
            "every link of a rotor is elastic",
            where=where,
            hint="Write elastic = { E, shear }, or make its points ground, which is rigid.",
        )
    for keys, keys_present, place in (
        (_LINK, link.model_fields_set, where),
        (_ELASTIC, elastic.model_fields_set, f"{where}.elastic"),
    ):
        for key in sorted(keys_present - keys):
            raise SceneError(
                f"a link of a rotor has no {key}",
                where=f"{place}.{key}",
                hint=f"It has {', '.join(sorted(keys))}.",
            )
    ends = [read.known_point(p, f"{where}.points").at for p in link.points[:2]]
    length = sp.sqrt(sp.Add(*((b - a) ** 2 for a, b in zip(*ends, strict=True))))
    if read.number(length) == 0:
        raise SceneError("this link has no length: its two points are at one place", where=f"{where}.points")
    elements = _ELEMENTS if elastic.elements is None else elastic.elements
    check_count(elements, 1, _MOST_ELEMENTS, f"{where}.elastic.elements")
    width, of_section = section_in_space(read, name, elastic, length, where)
    welded = tuple(p for p in link.points[:2] if name in welds.get(p, ()))
    return RotorLink(name, link.points[0], link.points[1], elements, welded, width, of_section)
