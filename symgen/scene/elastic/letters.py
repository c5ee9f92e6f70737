"""Letters of the sections of elastic links in the plane, for their assembled equations."""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from symgen.scene.elastic.links import Crank, ElasticLink, Section, Station
from symgen.scene.rods.letters import added, in_letters
from symgen.scene.rods.linkage import Linkage, RigidLink
from symgen.scene.rods.run_parameters import LENGTH, MODULUS
from symgen.symbolic.names import Letter, Letters
from symgen.symbolic.quantity import times_lengths

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
    "modulus": Letter("E", "Pa", "modulus of elasticity of link {link}", "E"),
    "mass_damping": Letter("alpha", "1/s", "mass-proportional damping of link {link}", "damping.mass"),
    "stiffness_damping": Letter(
        "beta", "s", "stiffness-proportional damping of link {link}", "damping.stiffness"
    ),
}
#: The geometry that is a factor of each property, and its letters where the scene writes it in numbers.
_FACTOR = {
    "axial": "area", "shear": "area", "bending": "second_moment", "mass": "area", "rotary": "second_moment",
}  # fmt: skip
_GEOMETRY = {
    "area": ("axial", Letter("A", "m^2", "area of the section")),
    "second_moment": ("bending", Letter("I", "m^4", "second moment of area of the section")),
}
_CRANK = {"flywheel": Letter("J", "kg*m^2", "moment of inertia of the flywheel of crank {link}")}
_STATION = {"fibre": Letter("h", "m", "distance of the fibre from the neutral axis at station {station}")}


def elastic_in_letters(linkage: Linkage) -> tuple[Linkage, Letters]:
    """Return a linkage with elastic links in the plane in letters, those of its sections included.

    The mass of an elastic link follows from its mass per length.
    """
    written, letters = in_letters(linkage)
    elastic = tuple(_elastic(letters, beam, written.link(beam.link).length) for beam in linkage.elastic)
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
        stations=tuple(_station(letters, station, i) for i, station in enumerate(linkage.stations)),
    )
    return replace(written, parameters=(*linkage.parameters, *added(letters))), letters


def _mass(beam: ElasticLink, link: RigidLink) -> sp.Expr:
    """Return the mass of a link by its mass per length."""
    return sp.Add(*(c * link.length ** (k + 1) / (k + 1) for k, c in enumerate(beam.section.mass)))


def _with_masses(link: RigidLink, masses: dict[sp.Expr, sp.Expr]) -> RigidLink:
    fields = ("mass", "centre", "inertia")
    return replace(link, **{name: getattr(link, name).xreplace(masses) for name in fields})


def _elastic(letters: Letters, beam: ElasticLink, length: sp.Expr) -> ElasticLink:
    where = f"links.{beam.link}"
    material = letters.record(beam, _MATERIAL, beam.link, f"{where}.elastic", link=beam.link)
    read = _Sections(letters, beam, {LENGTH: length, MODULUS: material["modulus"]})
    section = {
        of: tuple(read.coefficient(of, k, value) for k, value in enumerate(getattr(beam.section, of)))
        for of in _SECTION
    }
    return replace(beam, section=Section(**section), **material)


class _Sections:
    """The section of a link in letters, which are defined by those of the scene where it has some.

    The geometry has letters then, too, where the scene writes it in numbers.
    """

    def __init__(self, letters: Letters, beam: ElasticLink, stands: dict[sp.Symbol, sp.Expr]) -> None:
        self._letters, self._beam, self._stands = letters, beam, stands
        self._known: dict[tuple[str, int], sp.Expr] = {}

    def coefficient(self, of: str, k: int, value: sp.Expr) -> sp.Expr:
        """Return the coefficient of x^k in a property, x from the first point."""
        written = self._form(of, k, value)
        if written == value:
            return self._letters.scalar(*self._named(k, _SECTION[of], value))
        if of in _FACTOR and (of not in ("mass", "rotary") or self._has_density):
            number = getattr(self._beam.section, _GEOMETRY[_FACTOR[of]][0])[k] / self._beam.modulus
            if number != 0 and self._form(_FACTOR[of], k, number) == number:
                written *= self._geometry(_FACTOR[of], k, number) / number
        return self._letters.defined(*self._named(k, _SECTION[of], written))

    @property
    def _has_density(self) -> bool:
        """Whether constants of the scene are in the density."""
        return f"links.{self._beam.link}.section.density.0" in self._letters.composed

    def _geometry(self, of: str, k: int, value: sp.Expr) -> sp.Expr:
        if (of, k) not in self._known:
            self._known[of, k] = self._letters.scalar(*self._named(k, _GEOMETRY[of][1], value))
        return self._known[of, k]

    def _form(self, of: str, k: int, value: sp.Expr) -> sp.Expr:
        form = self._letters.form(f"links.{self._beam.link}.section.{of}.{k}", value)
        return form.xreplace(self._stands)

    def _named(self, k: int, letter: Letter, value: sp.Expr) -> tuple[str, sp.Expr, str, str]:
        name = f"{letter.letter}{k or ''}_{self._beam.link}"
        power = f", coefficient of x^{k}" if k else ""
        return name, value, times_lengths(letter.unit, -k), f"{letter.meaning} of {self._beam.link}{power}"


def _crank(letters: Letters, crank: Crank) -> Crank:
    torque = letters.form("crank.torque", crank.torque)
    return replace(
        crank, torque=torque, **letters.record(crank, _CRANK, "flywheel", "crank", link=crank.link)
    )


def _station(letters: Letters, station: Station, number: int) -> Station:
    if station.fibre is None:
        return station
    return replace(
        station, **letters.record(station, _STATION, station.name, f"stations.{number}", station=station.name)
    )
