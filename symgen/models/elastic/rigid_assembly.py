"""Forces of a loop of rigid links by elements, assembled as in Chapter IV of the thesis, for inspection."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import sympy as sp

from symgen.mechanics.elastic import rigid_elements
from symgen.mechanics.elastic.rigid_elements import NODAL
from symgen.mechanics.rods.particles import Vector
from symgen.mechanics.sources import RIGID_ASSEMBLY
from symgen.models.elastic.rigid_element import PER_MOMENT, REFERENCE, ROWS
from symgen.models.rods.linkage import RodsModel
from symgen.models.rods.matrix import named
from symgen.models.rods.system import definitions, groups
from symgen.scene.rods.linkage import Linkage, RigidLink
from symgen.symbolic.calculus import ZERO
from symgen.symbolic.system import NamedMatrix, System
from symgen.symbolic.vectors import cross_in_plane

_WIDTH = len(NODAL)


@dataclass(frozen=True, slots=True)
class _Element:
    """One of the parts of a link, with its places over the length of the link, and nodes, along the loop."""

    link: RigidLink
    number: int
    of_link: int
    places: tuple[sp.Expr, sp.Expr]
    nodes: tuple[str, str]

    @property
    def label(self) -> str:
        """Name of the element in rows and columns."""
        return f"{self.link.name}_{self.number}"

    @property
    def centre(self) -> tuple[sp.Expr, sp.Expr]:
        """Centre of mass along the link and to its left, over its length."""
        if self.of_link > 1:
            return sp.Add(*self.places) / 2, ZERO
        return self.link.centre / self.link.length, self.link.offset / self.link.length


def rigid_assembly_system(linkage: Linkage) -> System | None:
    """Return the assembled equations [D](F) = (E) of rigid links by elements, Eqs. (4.11)-(4.16).

    Elastic links are divided as in the scene, if their mass is even; others, such as tapered ones or with
    rotary inertia, are one element, as descriptions say. Masses at joints belong to the element before. There
    is none for linkages other than one loop of links that are hinged at their ends, have masses there alone,
    and move under gravity and drives on the ground.
    """
    elements = _elements(linkage)
    nodes = [e.nodes[0] for e in elements] + [e.nodes[1] for e in elements[-1:]]
    driven = {driver.link for driver in linkage.drivers}
    inputs = {node for e, node in _ends(elements) if e.link.name in driven}
    joints = {p.name for p in linkage.points}
    zero = [f"M at {node}" for node in nodes if node in joints - inputs]
    if not elements or len(zero) != _WIDTH:
        return None
    model = RodsModel(linkage)
    matrices = tuple(_matrices(model, elements, [f"{f} at {node}" for node in nodes for f in NODAL], zero))
    return System(
        f"{linkage.name}_rigid_assembly",
        f"{linkage.title}: forces by rigid elements",
        groups(model),
        matrices,
        (),
        definitions(model),
        references=(REFERENCE,),
        sources=RIGID_ASSEMBLY,
    )


def _ends(elements: Sequence[_Element]) -> Iterator[tuple[_Element, str]]:
    """Yield the first and the last element with their nodes on the ground."""
    if elements:
        yield elements[0], elements[0].nodes[0]
        yield elements[-1], elements[-1].nodes[1]


def _elements(linkage: Linkage) -> list[_Element]:
    """Return the elements from the driven link to the other end of the loop; none if there is no loop."""
    others = linkage.bodies, linkage.guides, linkage.gears, linkage.loads, linkage.welded_angles
    carried = [c.name for k in linkage.links for c in k.carried]
    loaded = {m.point for m in linkage.masses} & {*carried} or len({*carried}) < len(carried)
    between = any(len(driver.links) > 1 for driver in linkage.drivers)
    if any(others) or linkage.dimension != 2 or loaded or between:
        return []
    ground = {p.name for p in linkage.points if p.ground}
    rest = {k.name: k for k in linkage.links if not ground >= {*k.base}}
    driven = [rest[d.link] for d in linkage.drivers if d.link in rest]
    link = next((k for k in driven if ground & {*k.base}), None)
    counts = _counts(linkage)
    elements: list[_Element] = []
    node = next(p for p in link.base if p in ground) if link else ""
    while link:
        del rest[link.name]
        n = counts.get(link.name, 1) if _is_even(link) else 1
        places = [sp.Rational(i, n) for i in range(n + 1)]
        names = [link.start, *(f"{link.name}@{float(x):.6g}" for x in places[1:-1]), link.end]
        if node == link.end:
            places, names = places[::-1], names[::-1]
        pairs = zip(pairwise(places), pairwise(names), strict=True)
        elements += [_Element(link, i, n, *of) for i, of in enumerate(pairs, 1)]
        node = names[-1]
        following = [k for k in rest.values() if node in k.base]
        link = following[0] if len(following) == 1 and node not in ground else None
    return [] if rest or node not in ground else elements


def _counts(linkage: Linkage) -> dict[str, int]:
    """Return the number of elements of each elastic link in the scene."""
    return {beam.link: beam.elements or 1 for beam in linkage.elastic}


def _undivided(linkage: Linkage) -> str:
    """Return what to say of links with several elements that are one here; empty if there are none."""
    names = [name for name, n in _counts(linkage).items() if n > 1 and not _is_even(linkage.link(name))]
    return f"; {', '.join(names)}: one element each, as their mass is not an even line" if names else ""


def _is_even(link: RigidLink) -> bool:
    even = link.length / 2, link.mass * link.length**2 / 12, ZERO
    return all(
        sp.expand(x - y) == 0 for x, y in zip((link.centre, link.inertia, link.offset), even, strict=True)
    )


def _matrices(
    model: RodsModel, elements: Sequence[_Element], forces: Sequence[str], zero: Sequence[str]
) -> Iterator[NamedMatrix]:
    rows = [f"{e.label}.{row}" for e in elements for row in ROWS]
    of_elements = [f"{e.label}.{f} at {node}" for e in elements for node in "ik" for f in NODAL]
    blocks, right = zip(*(_balance(model, e) for e in elements), strict=True)
    diagonal = sp.ImmutableMatrix(sp.diag(*blocks))
    places = [forces.index(f"{f} at {node}") for e in elements for node in e.nodes for f in NODAL]
    shared = sp.ImmutableMatrix(len(places), len(forces), lambda i, j: int(places[i] == j))
    kept = [f for f in forces if f not in zero]
    whole = (diagonal * shared).extract([*range(len(rows))], [forces.index(f) for f in kept])
    unit = ", ".join([*"11m"] * len(elements)) + PER_MOMENT
    undivided = _undivided(model.linkage)
    about = "the matrices [d] of all elements, along the diagonal; i, k: their nodes in the order of the loop"
    about += undivided
    yield named(model, "rigid_elements", [*diagonal], unit, about, rows=rows, columns=of_elements)
    about = "[a]: forces and moments at the nodes of the elements by those of the nodes that they share"
    yield NamedMatrix("rigid_assembly", shared, "1", about, tuple(of_elements), tuple(forces))
    about = "numbers of the moments that are zero, at joints without a drive: columns of [a], from 1"
    numbers = sp.ImmutableMatrix([forces.index(f) + 1 for f in zero])
    yield NamedMatrix("rigid_boundary", numbers, "1", about, tuple(zero))
    about = (
        "[D] of [D](F) = (E), without the moments that are zero; columns are (F): a force at a node acts on "
        "the element before it, its negative on the one behind; a moment the other way round"
        f"{undivided}"
    )
    yield named(model, "rigid_matrix", [*whole], unit, about, rows=rows, columns=kept)
    about = "(E) of [D](F) = (E): inertia less gravity; masses at joints belong to the element before"
    units = ", ".join(["N", "N", "N*m"] * len(elements))
    yield named(model, "rigid_load", [x for e in right for x in e], units, about, rows=rows)


def _balance(model: RodsModel, element: _Element) -> tuple[sp.ImmutableMatrix, Vector]:
    """Return [d] of an element and its part of (E)."""
    link, gravity = element.link, model.linkage.gravity
    d, size = model.along[link.name], abs(element.places[1] - element.places[0])
    start, end = (model.acceleration(p) for p in link.base)
    origin = (ZERO, ZERO)
    first, last = (rigid_elements.between(origin, d, x, ZERO) for x in element.places)
    centre = rigid_elements.between(origin, d, *element.centre)
    relative = tuple(b - a for a, b in zip(start, end, strict=True))
    turning = cross_in_plane(d, relative) / link.length**2
    acceleration = rigid_elements.between(start, end, *element.centre)
    own = rigid_elements.inertia(size * link.mass, size**3 * link.inertia, acceleration, turning, gravity)
    carried = sp.Add(*(m.mass for m in model.linkage.masses if m.point == element.nodes[1]))
    there = rigid_elements.between(start, end, element.places[1], ZERO)
    force = tuple(carried * (a - g) for a, g in zip(there, gravity, strict=True))
    added = rigid_elements.on_centre(force, last, centre)
    return (
        rigid_elements.nodal_matrix(first, last, centre),
        tuple(a + b for a, b in zip(own, added, strict=True)),
    )
