"""Letters of the sections of elastic links in the plane, for their assembled equations."""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from symgen.scene.elastic.links import Crank, ElasticLink, Section, Station
from symgen.scene.rods.letters import added, in_letters
from symgen.scene.rods.linkage import Linkage, RigidLink
from symgen.symbolic.names import Letter, Letters

#: Letters of the properties of a section: coefficients by power of the distance from the first point.
_SECTION = {
    "mass": Letter("mu", "kg/m", "mass per length"),
    "rotary": Letter("J", "kg*m", "rotary inertia per length"),
    "axial": Letter("EA", "N", "axial stiffness"),
    "bending": Letter("EI", "N*m^2", "bending stiffness"),
    "shear": Letter("kGA", "N", "shear stiffness"),
    "fibre": Letter("h", "m", "distance of the outer fibre from the neutral axis"),
}
_MATERIAL = {
    "modulus": Letter("E", "Pa", "modulus of elasticity of link {link}"),
    "mass_damping": Letter("alpha", "1/s", "mass-proportional damping of link {link}"),
    "stiffness_damping": Letter("beta", "s", "stiffness-proportional damping of link {link}"),
}
_CRANK = {"flywheel": Letter("J", "kg*m^2", "moment of inertia of the flywheel of crank {link}")}
_STATION = {"fibre": Letter("h", "m", "distance of the fibre from the neutral axis at station {station}")}


def elastic_in_letters(linkage: Linkage) -> tuple[Linkage, Letters]:
    """Return a linkage with elastic links in the plane in letters, those of its sections included.

    The mass of an elastic link follows from its mass per length.
    """
    written, letters = in_letters(linkage)
    elastic = tuple(_elastic(letters, beam) for beam in linkage.elastic)
    masses: dict[sp.Expr, sp.Expr] = {}
    for before, after in zip(linkage.elastic, elastic, strict=True):
        link, of = linkage.link(before.link), written.link(before.link)
        if link.mass.is_number and sp.Abs(link.mass - _mass(before, link)) <= 1e-14 * link.mass:
            masses[of.mass] = _mass(after, of)
    for letter in masses:
        letters.forget(letter)
    crank = written.crank and _crank(letters, written.crank)
    written = replace(
        written,
        links=tuple(_with_masses(link, masses) for link in written.links),
        elastic=elastic,
        crank=crank,
        stations=tuple(_station(letters, station) for station in linkage.stations),
    )
    return replace(written, parameters=(*linkage.parameters, *added(letters))), letters


def _mass(beam: ElasticLink, link: RigidLink) -> sp.Expr:
    """Return the mass of a link by its mass per length."""
    return sp.Add(*(c * link.length ** (k + 1) / (k + 1) for k, c in enumerate(beam.section.mass)))


def _with_masses(link: RigidLink, masses: dict[sp.Expr, sp.Expr]) -> RigidLink:
    fields = ("mass", "centre", "inertia")
    return replace(link, **{name: getattr(link, name).xreplace(masses) for name in fields})


def _elastic(letters: Letters, beam: ElasticLink) -> ElasticLink:
    name = beam.link
    section = {
        of: tuple(
            letters.scalar(
                f"{letter}{k or ''}_{name}",
                value,
                f"{unit}/m^{k}" if k else unit,
                f"{meaning} of {name}" + (f": factor of x^{k}" if k else ""),
            )
            for k, value in enumerate(getattr(beam.section, of))
        )
        for of, (letter, unit, meaning) in _SECTION.items()
    }
    return replace(
        beam,
        section=Section(**section),
        **letters.record(beam, _MATERIAL, name, f"links.{name}.elastic", link=name),
    )


def _crank(letters: Letters, crank: Crank) -> Crank:
    return replace(crank, **letters.record(crank, _CRANK, "flywheel", "crank", link=crank.link))


def _station(letters: Letters, station: Station) -> Station:
    if station.fibre is None:
        return station
    return replace(
        station, **letters.record(station, _STATION, station.name, "stations", station=station.name)
    )
