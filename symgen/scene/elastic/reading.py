"""Elastic links and stations of a scene, and what may be joined to a link that bends."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING

import sympy as sp

from symgen.errors import SceneError, nearest
from symgen.loads.measure import Measure
from symgen.scene import units
from symgen.scene.elastic import sections
from symgen.scene.elastic.in_space import spatial_link
from symgen.scene.elastic.joints import carries
from symgen.scene.elastic.links import AREA_POWER, ElasticLink, ModalDamping, Polynomial, Section, Station
from symgen.scene.elastic.offsets import check_fraction
from symgen.scene.elastic.schema import ElasticTable
from symgen.scene.elastic.spatial_section import shear_modulus
from symgen.scene.reading import Reader, check_count
from symgen.scene.rods.linkage import TIME, Linkage, RigidLink
from symgen.scene.rods.run_parameters import LENGTH, MODULUS, compose
from symgen.scene.units import Dimension

if TYPE_CHECKING:
    from symgen.elements.element import Element

#: Polynomials along a link by their names.
Geometry = dict[str, Polynomial]
_ZERO = sp.Integer(0)
_MOST_ELEMENTS = 1000
#: By how much the outer fibre may be exceeded where both are computed.
_ROUNDED = 1e-9


def has_rotary_inertia(elastic: ElasticTable | None, where: str) -> bool:
    """Return whether the elements of a link have rotary inertia; False for a rigid link."""
    return elastic is not None and _element(elastic, where).rotary


def _element(elastic: ElasticTable, where: str) -> Element:
    # Rigid scenes do without the elements.
    from symgen.elements import ELEMENTS

    if elastic.element not in ELEMENTS:
        raise SceneError(
            f"there is no element {elastic.element!r}",
            where=f"{where}.element",
            hint=nearest(elastic.element, ELEMENTS),
        )
    return ELEMENTS[elastic.element]


def elastic_links(read: Reader, links: Sequence[RigidLink]) -> Iterator[ElasticLink]:
    """Yield the elastic links, each checked against the components joined to it."""
    for name, link in read.scene.links.items():
        moved = any(read.scene.points[p].motion for p in link.points[:2])
        if link.elastic is not None and moved and read.dimension == 2:
            read.moving_link(name, f"links.{name}.elastic")
    _check_neighbours(read)
    for rigid in links:
        elastic = read.scene.links[rigid.name].elastic
        if elastic is not None:
            link_of = _elastic_link if read.dimension == 2 else spatial_link
            yield link_of(read, rigid, elastic, f"links.{rigid.name}")


def _elastic_link(read: Reader, rigid: RigidLink, elastic: ElasticTable, place: str) -> ElasticLink:
    where = f"{place}.elastic"
    if TIME.symbol in rigid.length.free_symbols:
        raise SceneError("the length of an elastic link does not depend on the time", where=f"{place}.length")
    if elastic.elements is not None:
        check_count(elastic.elements, 1, _MOST_ELEMENTS, f"{where}.elements")
    modulus, section, geometry = _section(read, rigid, elastic, place, rigid.length)
    compose(
        read,
        rigid.length,
        f"{place}.section",
        _by_place(section, geometry),
        lambda mirror: _by_place(*_section(mirror, rigid, elastic, place, LENGTH)[1:]),
    )
    reduction, modes = _reduction(elastic, f"{where}.reduction")
    damping = elastic.damping

    def coefficient(key: str, dim: Dimension) -> sp.Expr:
        return read.not_negative(getattr(damping, key) or 0, dim, f"{where}.damping.{key}")

    return ElasticLink(
        link=rigid.name,
        element=elastic.element,
        elements=elastic.elements or 0,
        section=section,
        modulus=modulus,
        axial=elastic.axial,
        geometric_stiffness=elastic.geometric_stiffness,
        mass_damping=coefficient("mass", units.ANGULAR_RATE),
        stiffness_damping=coefficient("stiffness", units.TIME),
        damping_ratio=_ratio(read, coefficient("ratio", units.NUMBER), f"{where}.damping.ratio"),
        reduction=reduction,
        modes=modes,
        yield_stress=None
        if elastic.yield_stress is None
        else read.positive(elastic.yield_stress, units.PRESSURE, f"{where}.yield_stress"),
        welds=tuple(weld.point for weld in read.scene.welds if rigid.name in weld.links),
    )


def _section(
    read: Reader, rigid: RigidLink, elastic: ElasticTable, place: str, length: sp.Expr
) -> tuple[sp.Expr, Section, Geometry]:
    """Return modulus, section and its geometry; with the length LENGTH a number as modulus is MODULUS."""
    link, where = read.scene.links[rigid.name], f"{place}.elastic"
    along = sections.line(read, link, length, place)
    shape = along.shape
    modulus = read.positive(elastic.E, units.PRESSURE, f"{where}.E")
    if length is LENGTH and modulus.is_number:
        modulus = MODULUS
    section = Section(
        mass=along.mass,
        rotary=along.rotary,
        axial=tuple(modulus * c for c in shape.area),
        bending=tuple(modulus * c for c in shape.second_moment),
        shear=_shear(read, elastic, modulus, shape, where),
        fibre=shape.fibre,
    )
    density = () if link.density is None else (read.value(link.density, units.DENSITY, f"{place}.density"),)
    return modulus, section, {"area": shape.area, "second_moment": shape.second_moment, "density": density}


def _by_place(section: Section, geometry: Geometry) -> dict[str, sp.Expr]:
    """Return the coefficients of a section and of its geometry by the ends of their places."""
    every = {**{f.name: getattr(section, f.name) for f in fields(section)}, **geometry}
    return {f"{of}.{k}": c for of, polynomial in every.items() for k, c in enumerate(polynomial)}


def modal_damping(read: Reader) -> ModalDamping | None:
    """Return the damping of the modes of the structure; None where the scene has none.

    Raises
    ------
    SceneError
        When no link is elastic, or for a ratio that is no part of critical damping.
    """
    table = read.scene.modal_damping
    if table is None:
        return None
    where = "modal_damping.ratio"
    if all(link.elastic is None for link in read.scene.links.values()):
        raise SceneError(
            "no link is elastic, and [modal_damping] damps the modes of elastic links",
            where="modal_damping",
            hint="Make a link elastic, or leave the table out.",
        )
    values = table.ratio if isinstance(table.ratio, list) else [table.ratio]
    if not values:
        raise SceneError("expected one damping ratio or more, got an empty list", where=where)
    ratios = (_ratio(read, read.not_negative(ratio, units.NUMBER, where), where) for ratio in values)
    return ModalDamping(tuple(ratios), not isinstance(table.ratio, list))


def _ratio(read: Reader, ratio: sp.Expr, where: str) -> sp.Expr:
    if read.number(ratio) >= 1:
        raise SceneError(
            f"expected a damping ratio below 1, that of critical damping, got {read.number(ratio):g}",
            where=where,
            hint="Two percent is 0.02.",
        )
    return ratio


def _reduction(elastic: ElasticTable, where: str) -> tuple[str, int]:
    """Return kind of the reduction and number of modes; empty and zero without one."""
    reduction = elastic.reduction
    if reduction is None:
        return "", 0
    if not elastic.axial:
        raise SceneError(
            "a link that keeps its length is not reduced as well",
            where=where,
            hint="Leave out the reduction, or axial = false.",
        )
    if reduction.kind == "guyan":
        if reduction.modes is not None:
            raise SceneError(
                "a guyan reduction keeps no modes",
                where=f"{where}.modes",
                hint='Write kind = "craig-bampton", or leave modes out.',
            )
        return "guyan", 0
    if reduction.modes is None:
        raise SceneError(
            "a craig-bampton reduction needs the number of modes to keep",
            where=f"{where}.modes",
            hint='Write reduction = { kind = "craig-bampton", modes = 3 }.',
        )
    check_count(reduction.modes, 0, _MOST_ELEMENTS, f"{where}.modes")
    return "craig-bampton", reduction.modes


def _shear(
    read: Reader, elastic: ElasticTable, modulus: sp.Expr, shape: sections.SectionShape, where: str
) -> Polynomial:
    """Return the shear stiffness k G A along a link; zero where its elements do not shear."""
    shear = elastic.shear
    if _element(elastic, where).rotation is None:
        if shear is not None:
            raise SceneError(
                f"the element {elastic.element} does not shear",
                where=f"{where}.shear",
                hint='Leave it out, or write element = "timoshenko".',
            )
        return (_ZERO,) * (AREA_POWER + 1)
    if shear is None:
        raise SceneError(
            f"the element {elastic.element} needs the shear modulus of the material",
            where=f"{where}.shear",
            hint='Write shear = { poisson = 0.3 }, or shear = { modulus = "80 GPa" }.',
        )
    factor = shape.shear_factor
    if shear.factor is not None:
        factor = read.positive(shear.factor, units.NUMBER, f"{where}.shear.factor")
    if factor is None:
        raise SceneError(
            "a section by its area needs its shear factor",
            where=f"{where}.shear.factor",
            hint="It is 5/6 of a rectangle, 9/10 of a circle, and about 1/2 of a thin tube.",
        )
    stiffness = factor * shear_modulus(read, shear, modulus, f"{where}.shear")
    return tuple(stiffness * c for c in shape.area)


def _check_neighbours(read: Reader) -> None:
    """Refuse points beyond the ends of an elastic link, and guides and drives that run along or turn it."""
    scene = read.scene
    elastic = {name for name, link in scene.links.items() if link.elastic is not None}
    between = {name: point.on for name, point in scene.points.items() if point.on in elastic}
    for name, on in between.items():
        where = f"points.{name}.fraction"
        check_fraction(read, on, read.value(scene.points[name].fraction or 0, units.NUMBER, where), where)
    turned = [(f"guides.{i}.along", guide.along) for i, guide in enumerate(scene.guides)]
    turned += [(f"drivers.{i}.link", driver.link) for i, driver in enumerate(scene.drivers)]
    for where, link in turned:
        if link in elastic:
            key = where.rpartition(".")[2]
            raise SceneError(_NOT_ELASTIC.get(key, _NO_COUPLE).format(link), where=where, hint=_hint(where))


def check_loads(linkage: Linkage) -> None:
    """Refuse the loads that no elastic link carries: those that are no forces on its points or along it."""
    elastic = {beam.link: linkage.link(beam.link) for beam in linkage.elastic}
    for table, i, load in linkage.placed_loads if elastic else ():
        terms = list(load.terms(linkage.dimension))
        carried = [t for t in terms if any(carries(link, t) for link in elastic.values())]
        if carried and len(carried) < len(terms):
            raise SceneError(
                f"a {load.noun} acts on an elastic link and elsewhere: these take loads of their own alone",
                where=f"{table}.{i}",
                hint="Leave the elastic of the link out.",
            )
        for measure in (t.on for t in terms if t not in carried):
            bent = next((name for _, name in measure.links if name in elastic), "")
            if linkage.dimension == 3 and bent:
                raise SceneError(
                    f"in space a {load.noun} acts on rigid links, and {bent} is elastic",
                    where=f"{table}.{i}",
                    hint="Weld a small body with three points to the elastic link, and name it.",
                )
            if measure.section:
                _check_section(linkage, measure, f"{table}.{i}")
                continue
            for key, name in measure.links:
                if name in elastic and measure.follows:
                    (_, point), *_ = measure.points
                    raise SceneError(
                        f"the force rotates with the section of {name} at {point}, which is no point of it",
                        where=f"{table}.{i}.point",
                        hint='Place the point on the link: P = { on = "link", fraction = 0.5 }.',
                    )
                if name in elastic:
                    where = f"{table}.{i}.{key}"
                    raise SceneError(_NO_COUPLE.format(name), where=where, hint=_hint(where))


def _check_section(linkage: Linkage, measure: Measure, where: str) -> None:
    """Check that a couple acts on sections of elastic links, at a point of theirs where they are free."""
    beams, crank = {beam.link: beam for beam in linkage.elastic}, linkage.crank
    for key, name in measure.links:
        if not name:
            continue
        if name not in beams:
            raise SceneError(
                f"{name} is rigid; a couple at {measure.section} acts on elastic links, or the ground",
                where=f"{where}.{key}",
                hint="Give it elastic with a large E, or leave point out of a couple between rigid links.",
            )
        link = linkage.link(name)
        if measure.section not in (*link.base, *(c.name for c in link.carried)):
            raise SceneError(f"{measure.section} is no point of {name}", where=f"{where}.point")
        clamped = crank is not None and crank.mode == "held" and measure.section == link.start
        welded = measure.section in beams[name].welds and linkage.point(measure.section).ground
        if welded or (clamped and crank is not None and crank.link == name):
            raise SceneError(
                f"the section of {name} at {measure.section} does not rotate: it is clamped there",
                where=f"{where}.point",
                hint='Leave the couple out, remove the weld, or write mode = "free" in [crank].',
            )


_NOT_ELASTIC = {"along": "{} is elastic, and a guide runs along a straight link"}
_NO_COUPLE = "{} is elastic and has no one angle"


def _hint(where: str) -> str:
    if where.startswith("drivers"):
        return "Prescribe the input motion in [crank], in space by a rigid link that is welded to it."
    if where.startswith("guides"):
        return "Leave the elastic of this link out, or guide the other link."
    return "Name the point at whose section it acts, or a rigid link; a motor's torque belongs in [crank]."


def stations(read: Reader, links: Sequence[RigidLink], elastic: Sequence[ElasticLink]) -> Iterator[Station]:
    """Yield the stations: those of the scene, or the middle of every elastic link."""
    if not read.scene.stations:
        yield from (Station(link.link, link.link, sp.Rational(1, 2), None) for link in elastic)
    by_name = {link.link: link for link in elastic}
    length = {link.name: link.length for link in links}
    names: set[str] = set()
    for i, station in enumerate(read.scene.stations):
        where = f"stations.{i}"
        read.known_link(station.link, f"{where}.link")
        if station.link not in by_name:
            raise SceneError(
                f"the link {station.link} is not elastic: it has no strain",
                where=f"{where}.link",
                hint=nearest(station.link, by_name),
            )
        at = read.value(station.at, units.NUMBER, f"{where}.at")
        if not 0 <= (fraction := read.number(at)) <= 1:
            raise SceneError(
                f"expected a fraction of the link from 0 to 1, got {station.at!r}", where=f"{where}.at"
            )
        name = station.name or f"{station.link}_{100 * fraction:.6g}".replace(".", "_")
        others = {*read.scene.links, *read.scene.points} - {station.link}
        if name in names or name in others:
            owner = "a link or a point" if name in others else "another station"
            raise SceneError(
                f"{name!r} is {owner} already",
                where=f"{where}.name",
                hint="Give the station a name of its own.",
            )
        names.add(name)
        fibre = None
        if station.fibre is not None and read.dimension == 3:
            raise SceneError(
                "a station of an elastic link in space has no fibre",
                where=f"{where}.fibre",
                hint="Leave it out: stresses of four outer fibres are among its outputs.",
            )
        if station.fibre is not None:
            fibre = read.value(station.fibre, units.LENGTH, f"{where}.fibre")
            h0, h1 = by_name[station.link].section.fibre
            _check_fibre(read, fibre, h0 + h1 * at * length[station.link], f"{where}.fibre")
        yield Station(name, station.link, at, fibre)


def _check_fibre(read: Reader, fibre: sp.Expr, outer: sp.Expr, where: str) -> None:
    """Check that a fibre lies in the section."""
    if abs(read.number(fibre)) > read.number(outer) * (1 + _ROUNDED):
        raise SceneError(
            f"expected a fibre of the section, which ends {read.number(outer):g} m from the neutral axis, "
            f"got one at {read.number(fibre):g} m",
            where=where,
        )
