"""Assembled equations of a scene with elastic links in the plane, divided and named as runs do."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import sympy as sp

from symgen.mechanics.rods.condensation import BASIS
from symgen.models.assembled.condensed import REDUCED
from symgen.models.assembled.mesh import ElasticStructure, Mesh, MeshElement
from symgen.models.assembled.system import CONSTANTS_SHOWN, MATRICES, assembled_system
from symgen.models.elastic.joints import joints_system
from symgen.models.elastic.links import motion_system
from symgen.pipeline.describe import elastic_info
from symgen.pipeline.user_model import supply_elements
from symgen.runtime.beams.data import Lump, Profile
from symgen.runtime.beams.elements import Segment, meshed, segment_at
from symgen.runtime.beams.layout import unknowns_of
from symgen.runtime.beams.links import Beam, beam
from symgen.runtime.elastic.mesh import properties_of
from symgen.scene.elastic.letters import elastic_in_letters
from symgen.scene.rods.linkage import Linkage
from symgen.symbolic.exact import Exact
from symgen.symbolic.system import Step, System
from symgen.toolchain.kernels import tools_for

#: Largest denominator of the fraction of a link at which a node lies.
_DENOMINATOR = 1000
_SMALL = 1e-9


def assembled_of(linkage: Linkage) -> System:
    """Return the assembled equations, in letters for the constants of the scene.

    A link whose elements runs choose has one between its joints and masses.
    """
    linkage, letters = elastic_in_letters(linkage)
    motion, joints = motion_system(linkage), joints_system(linkage)
    info = elastic_info(linkage)
    supply_elements(info.beams, tools_for("auto", "float64", None, "off", "none"))

    def table(name: str) -> np.ndarray:
        rows = motion[name].matrix if name in motion else sp.zeros(0, 1)
        return np.array([[linkage.number(e) for e in rows.row(i)] for i in range(rows.rows)])

    lumps, profiles, properties = table("lumps"), table("profiles"), table("properties")
    beams = []
    for plain, row in zip(info.beams, properties, strict=True):
        of_link = properties_of(row)
        masses = tuple(Lump(*x) for x, name in zip(lumps, info.lumps, strict=True) if name == plain.link)
        forces = tuple(
            Profile(*x) for x, name in zip(profiles, info.loads, strict=True) if name == plain.link
        )
        joined = [j for j, name in zip(info.joints, info.loads, strict=True) if name == plain.link]
        between = tuple((j, f.at / of_link.length) for j, f in zip(joined, forces, strict=True) if j)
        own = replace(plain, elements=plain.elements or 1, between=between, reduction="", modes=0)
        own = meshed(own, of_link.length, masses, forces)
        beams.append((beam(own, replace(of_link, ratio=0.0), masses, forces), forces))
    points = [p.name for p in linkage.points if not p.ground]
    free = [
        p
        for p in points
        if any(f"{p}_{axis}" in {q.name for q in motion.group("q").quantities} for axis in "xy")
    ]
    unknowns, of_links, shaft = unknowns_of(free, linkage.axes, info, [b for b, _ in beams])
    meshes, held = [], set[str]()
    for (divided, forces), places in zip(beams, of_links, strict=True):
        fractions = [linkage.number(x.at) for x in linkage.stations if x.link == divided.info.link]
        mesh = _mesh(divided, forces, places, unknowns, fractions)
        held |= {name for name, place in zip(mesh.unknowns, places, strict=True) if place < 0}
        meshes.append(mesh)
    structure = ElasticStructure(
        tuple(meshes),
        frozenset(held),
        tuple(unknowns),
        unknowns[shaft] if shaft >= 0 else "",
        _pivots(linkage, joints),
    )
    return letters.kept(assembled_system(linkage, structure, motion, joints))


def assembled_record(linkage: Linkage, system: System) -> Iterator[Step]:
    """Yield the steps of the derivation from elements to strains, of the system of :func:`assembled_of`."""
    first = next(b.link for b in linkage.elastic)

    def known(*names: str) -> tuple[str, ...]:
        return tuple(name for name in names if name in system)

    for title, about, source, names in (
        (
            "Elastic link: element",
            f"The collected terms integrated over the shape functions of an element, of link {first}; other "
            "links and elements differ by length and section.",
            "thesis, Eqs. (7.24)-(7.27), (F.1)-(F.8)",
            tuple(f"{first}.{name}" for name in CONSTANTS_SHOWN),
        ),
        (
            "Elastic linkage: assembly",
            "The equation of each element, M s'' - 2 omega A s' + K s = Q, in fixed axes at its joints, "
            "S = T s with the rates of T, and summed by Z; unknowns of the boundary vector are zero.",
            "thesis, Eqs. (7.28), (8.1), Fig. 22",
            known("assembly", "boundary", *MATRICES),
        ),
        (
            "Elastic linkage: condensation",
            "Constraints of inextensible and rigid links and guides leave independent unknowns p: S = R p. "
            "Free vibrations in a pose have constant R; in motion R has rates.",
            "thesis, Eqs. (E.21)-(E.29), (E.40)-(E.47), with rates",
            known(*(name for name, _ in BASIS), *REDUCED),
        ),
        (
            "Elastic linkage: strain and stress",
            "Unknowns of an element follow from those of the linkage by Z and T; its shapes give the strain "
            "h w'' + u', with h from the neutral axis, and the stress, E times it.",
            "thesis, Eqs. (8.3)-(8.8), h corrected",
            known("strain_recovery", "stress_recovery"),
        ),
    ):
        if names:
            yield Step(title, about, source, system, names)


def _mesh(
    plain: Beam,
    forces: Sequence[Profile],
    places: Sequence[int],
    unknowns: Sequence[str],
    at: Sequence[float],
) -> Mesh:
    """Return the mesh of a link with stations at fractions of its length."""
    info = plain.info
    joints = {
        k: f"{point}.{axis}"
        for pair, point in zip(plain.joints, info.points, strict=True)
        for k, axis in zip(pair, "xy", strict=True)
    }
    called = tuple(
        unknowns[place] if place >= 0 else joints.get(k, f"{info.link}.{dof}")
        for k, (dof, place) in enumerate(zip(plain.dofs, places, strict=True))
    )
    parts = tuple(
        MeshElement(_fraction(info.node(k)), _fraction(info.node(k + 1)), *_by_unknowns(plain, part))
        for k, part in enumerate(plain.segments)
    )

    def owners(at: float) -> tuple[int, ...]:
        found: Sequence[Segment] = segment_at(plain.segments, at)
        return tuple(k for k, part in enumerate(plain.segments) if any(part is x for x in found))

    return Mesh(
        info.link,
        parts,
        plain.dofs,
        called,
        plain.joints,
        tuple(owners(lump.at)[0] for lump in plain.lumps),
        tuple(owners(f.at)[0] if f.is_point else -1 for f in forces),
        tuple(owners(x * plain.properties.length) for x in at),
    )


def _by_unknowns(plain: Beam, part: Segment) -> tuple[tuple[int, ...], sp.ImmutableMatrix | None]:
    """Return the unknowns of a link that move an element, and its own by them unless they are the same."""
    if plain.expansion is None:
        return tuple(part.dofs), None
    rows = plain.expansion[list(part.dofs)]
    moved = np.any(rows != 0.0, axis=0)
    moved[[k for pair in plain.joints for k in pair]] = True
    at = np.flatnonzero(moved)
    entries = [[_fraction(x) for x in row] for row in rows[:, at].tolist()]
    return tuple(at.tolist()), sp.ImmutableMatrix(entries)


def _fraction(x: float) -> sp.Rational:
    """Return a fraction of a link as a short rational number where it is one."""
    short = sp.Rational(x).limit_denominator(_DENOMINATOR)
    return short if abs(float(short) - x) < 1e-15 else sp.Rational(x)


def _pivots(linkage: Linkage, joints: System) -> tuple[tuple[str, str], ...]:
    """Return constraints with the unknowns that depend by them, by complete pivoting in the drawn pose."""
    if "jacobian" not in joints:
        return ()
    drawn = {
        f"{p.name}_{axis}": x for p in linkage.points for axis, x in zip(linkage.axes, p.at, strict=True)
    }
    values = {group.name: [0.0] * len(group.quantities) for group in joints.groups}
    values["q"] = [linkage.number(drawn[q.name]) for q in joints.group("q").quantities]
    values["p"] = [linkage.number(q.symbol) for q in joints.group("p").quantities]
    named = joints["jacobian"]
    rest = np.array(Exact(joints).matrix("jacobian", values).tolist(), dtype=float)
    rest = rest.reshape(len(named.rows), len(named.columns))
    pivots = []
    for _ in named.rows:
        i, j = np.unravel_index(np.argmax(np.abs(rest)), rest.shape)
        if abs(rest[i, j]) < _SMALL:
            break
        point, _, axis = named.columns[j].rpartition("_")
        pivots.append((named.rows[i], f"{point}.{axis}"))
        rest = rest - np.outer(rest[:, j], rest[i]) / rest[i, j]
    return tuple(pivots)
