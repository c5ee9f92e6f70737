"""Elements along the links of an assembly, their unknowns, and their constants in letters."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import sympy as sp

from symgen.elements import ELEMENTS
from symgen.elements.element import LENGTH, Element
from symgen.mechanics.elastic.along import PlaceOnElement, fibre_strain, of_force, with_lump
from symgen.mechanics.elastic.beam_matrices import Before, ElementSection, beam_matrices, profile_constants
from symgen.models.elastic.element import PROPERTIES
from symgen.models.elastic.links import loads_along, lumps
from symgen.scene.elastic.links import ElasticLink
from symgen.scene.rods.linkage import Linkage
from symgen.symbolic.system import System

Constants = dict[str, sp.ImmutableMatrix]


@dataclass(frozen=True, slots=True)
class MeshElement:
    """One element of a link: fractions of the length where it begins and ends, its unknowns among the link's.

    ``basis`` gives the unknowns of the element by those, where a link keeps its length.
    """

    start: sp.Expr
    stop: sp.Expr
    at: tuple[int, ...]
    basis: sp.ImmutableMatrix | None = None

    def by_unknowns(self, constants: Mapping[str, sp.ImmutableMatrix]) -> dict[str, sp.ImmutableMatrix]:
        """Return constants over the unknowns ``at``."""
        if self.basis is None:
            return dict(constants)
        left = self.basis.T
        return {name: left * m * (self.basis if m.cols > 1 else 1) for name, m in constants.items()}


@dataclass(frozen=True, slots=True)
class Mesh:
    """Elements of a link and the unknowns of the linkage.

    Attributes
    ----------
    link
        The link.
    parts
        Its elements.
    dofs, unknowns
        Names of its unknowns, and of those of the linkage that they are.
    joints
        Places of (u, w) at joints, which are displacements in fixed axes.
    lumps, profiles
        For each mass and each force along it the element that has it; -1 for one that is spread.
    stations
        For each station on it the elements that meet there.
    label
        Its name in those of shared terms.
    """

    link: str
    parts: tuple[MeshElement, ...]
    dofs: tuple[str, ...]
    unknowns: tuple[str, ...]
    joints: tuple[tuple[int, int], ...]
    lumps: tuple[int, ...]
    profiles: tuple[int, ...]
    stations: tuple[tuple[int, ...], ...] = ()
    label: str = ""

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of its elements in those of shared terms."""
        several = len(self.parts) > 1
        return tuple(f"{self.label}_{k}" for k, _ in enumerate(self.parts, 1)) if several else (self.label,)

    def labelled(self, others: Container[str]) -> Mesh:
        """Return the mesh with a label that leaves shared terms apart from other labels."""
        mesh = replace(self, label=self.label or self.link)
        if any(name in others for name in (mesh.label, *mesh.labels)):
            return replace(self, label=f"{mesh.label}_").labelled(others)
        return mesh


@dataclass(frozen=True, slots=True)
class ElasticStructure:
    """Meshes of all links, names of the held and of all other unknowns, and dependent ones by constraints.

    ``pivots`` are pairs of a constraint and the unknown that depends by it.
    """

    meshes: tuple[Mesh, ...]
    held: frozenset[str]
    others: tuple[str, ...]
    shaft: str
    pivots: tuple[tuple[str, str], ...]


def of_elements(linkage: Linkage, mesh: Mesh, motion: System) -> Iterator[tuple[Constants, list[Constants]]]:
    """Yield the constants of every element of a link, and those of every force along it on the element."""
    masses = [
        (*lump, owner)
        for (_, *lump), owner in zip(
            (x for x in lumps(linkage) if x[0] == mesh.link), mesh.lumps, strict=True
        )
    ]
    shapes = _shapes(motion, linkage, mesh)
    length, mass = linkage.link(mesh.link).length, _beam(linkage, mesh.link).section.mass
    for k, part in enumerate(mesh.parts):
        start = length * part.start
        lumped = [(at, m) for at, m, _, owner in masses if owner < k]
        before = Before(
            start,
            sp.Add(*(c * start ** (i + 1) / (i + 1) for i, c in enumerate(mass)), *(m for _, m in lumped)),
            sp.Add(
                *(c * start ** (i + 2) / (i + 2) for i, c in enumerate(mass)), *(m * at for at, m in lumped)
            ),
        )
        forces = _profiles(linkage, mesh, k, before, shapes)
        constants = part.by_unknowns(_constants(linkage, mesh, k, before, masses))
        yield constants, [part.by_unknowns(force) for force in forces]


def _beam(linkage: Linkage, name: str) -> ElasticLink:
    return next(b for b in linkage.elastic if b.link == name)


@lru_cache(maxsize=8)
def _element_in_letters(
    element: Element,
) -> tuple[Mapping[str, sp.ImmutableMatrix], Mapping[str, list[sp.Symbol]], Before]:
    """Return the constants of an element over generic coefficients by powers of xi, and these."""
    letters = {of: [sp.Symbol(f"{of}_{k}") for k in range(count)] for of, _, count, _, _ in PROPERTIES}
    before = Before(*sp.symbols("distance before moment"))
    section = ElementSection(**{of: tuple(symbols) for of, symbols in letters.items()})
    return beam_matrices(element, section, before).constants, letters, before


def _constants(
    linkage: Linkage, mesh: Mesh, number: int, before: Before, masses: Sequence[tuple[sp.Expr, ...]]
) -> Constants:
    """Return the constants of an element with the masses along it."""
    beam, part = _beam(linkage, mesh.link), mesh.parts[number]
    element, length = ELEMENTS[beam.element], linkage.link(mesh.link).length
    own = length * (part.stop - part.start)
    constants, letters, generic = _element_in_letters(element)
    known: dict[sp.Symbol, sp.Expr] = {LENGTH.symbol: own}
    known |= dict(
        zip(
            (generic.distance, generic.mass, generic.moment),
            (before.distance, before.mass, before.moment),
            strict=True,
        )
    )
    for of, *_ in PROPERTIES:
        shifted = _shifted(getattr(beam.section, of), before.distance)
        for k, symbol in enumerate(letters[of]):
            known[symbol] = shifted[k] * own**k if k < len(shifted) else sp.Integer(0)
    found = {name: sp.ImmutableMatrix(m.xreplace(known)) for name, m in constants.items()}
    for at, mass, inertia, owner in masses:
        if owner == number:
            xi = _exact(linkage.number(at / linkage.link(mesh.link).length), part)
            more = with_lump(element, found, PlaceOnElement(xi, at), mass, inertia)
            found = {name: m.xreplace({LENGTH.symbol: own}) for name, m in more.items()}
    size = len(element.dofs)
    if not beam.geometric_stiffness:
        found |= {f"geometric{k}": sp.ImmutableMatrix(sp.zeros(size)) for k in range(3)}
    damping = beam.mass_damping * found["mass"] + beam.stiffness_damping * found["stiffness"]
    return found | {"damping": sp.ImmutableMatrix(damping)}


def _exact(fraction: float, part: MeshElement) -> sp.Rational:
    """Return xi of a fraction of the link on an element."""
    first, last = float(part.start), float(part.stop)
    xi = (fraction - first) / (last - first)
    return sp.Rational(round(xi)) if abs(xi - round(xi)) < 1e-9 else sp.Rational(min(max(xi, 0.0), 1.0))


def _shifted(polynomial: Sequence[sp.Expr], by: sp.Expr) -> list[sp.Expr]:
    """Return the coefficients by power of p(x + by), for those of p(x)."""
    n = len(polynomial)
    return [
        sum((sp.binomial(k, j) * polynomial[k] * by ** (k - j) for k in range(j, n)), sp.Integer(0))
        for j in range(n)
    ]


def _profiles(
    linkage: Linkage, mesh: Mesh, number: int, before: Before, shapes: Sequence[Sequence[sp.Expr]]
) -> list[Constants]:
    """Return the constants of every force along a link on one of its elements."""
    beam, part = _beam(linkage, mesh.link), mesh.parts[number]
    element, length = ELEMENTS[beam.element], linkage.link(mesh.link).length
    found: list[Constants] = []
    for (at, even, slope, follows, _), owner in zip(shapes, mesh.profiles, strict=True):
        if owner < 0:
            constants = profile_constants(element, before.distance, even, slope, bool(follows))
        elif owner > number:
            constants = Constants()
        elif owner < number:
            constants = {
                "geometric_force": of_force(element, PlaceOnElement(sp.Integer(0), at), False)[
                    "geometric_force"
                ]
            }
        else:
            xi = _exact(linkage.number(at / linkage.link(mesh.link).length), part)
            constants = of_force(element, PlaceOnElement(xi, at), bool(follows))
        if not beam.geometric_stiffness:
            constants.pop("geometric_force", None)
        found.append(
            {
                name: m.xreplace({LENGTH.symbol: length * (part.stop - part.start)})
                for name, m in constants.items()
            }
        )
    return found


def strains(
    linkage: Linkage, mesh: Mesh
) -> Iterator[tuple[str, list[tuple[MeshElement, sp.ImmutableMatrix]]]]:
    """Yield the stations of a link, each with the strain there by the unknowns of the elements that meet.

    Where two of them meet, it is the mean of both.
    """
    stations = [x for x in linkage.stations if x.link == mesh.link]
    beam, length = _beam(linkage, mesh.link), linkage.link(mesh.link).length
    for station, owners in zip(stations, mesh.stations, strict=True):
        at = station.at * linkage.link(mesh.link).length
        outer = sp.Add(*(c * at**k for k, c in enumerate(beam.section.fibre)))
        fibre = outer if station.fibre is None else station.fibre
        rows = []
        for part in (mesh.parts[k] for k in owners):
            place = PlaceOnElement(_exact(linkage.number(station.at), part), at)
            row = fibre_strain(ELEMENTS[beam.element], place, fibre)
            row = row.xreplace({LENGTH.symbol: length * (part.stop - part.start)}) / len(owners)
            rows.append((part, sp.ImmutableMatrix(row if part.basis is None else row * part.basis)))
        yield station.name, rows


def _shapes(motion: System, linkage: Linkage, mesh: Mesh) -> list[list[sp.Expr]]:
    links = [link for link, _ in loads_along(linkage)]
    return [
        row
        for link, row in zip(links, motion["profiles"].matrix.tolist() if links else (), strict=True)
        if link == mesh.link
    ]
