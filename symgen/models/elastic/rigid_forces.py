"""Inputs of the forces by rigid elements of a planar linkage: mass properties, loads, guides, drives.

Row names with two items have the form ``LINK POINT``. The accelerations come from the kinematics.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress

import sympy as sp

from symgen.elements import ELEMENTS
from symgen.errors import SceneError
from symgen.loads.measure import PointForce
from symgen.mechanics.rods.gear import turns
from symgen.models.rods.linkage import REFERENCE, RodsModel
from symgen.models.rods.matrix import named
from symgen.models.rods.outputs import mesh_torque
from symgen.models.rods.system import definitions, groups
from symgen.scene.elastic.links import AREA_POWER, INERTIA_POWER
from symgen.scene.rods.linkage import Linkage, RigidLink
from symgen.symbolic.calculus import ZERO
from symgen.symbolic.system import Export, NamedMatrix, System

_MASS_UNITS = ("kg/m", "kg/m^2", "kg/m^3")
_ROTARY_UNITS = ("kg*m", "kg", "kg/m", "kg/m^2", "kg/m^3")


def rigid_forces_system(linkage: Linkage) -> System:
    """Return the System of the loads on rigid links, one kernel for each matrix that has rows.

    ``link_masses`` (mass [kg], centre along and across over the length [1], moment of inertia about it
    [kg m^2], a column for each link that moves), ``sections`` (mass and rotary inertia along links whose
    section is given, coefficients by power of the distance from the first point), ``carried`` (places of the
    further points of links, along and across over the length), ``point_masses``, ``point_loads``,
    ``gravity``, ``couples`` and ``driven_angles`` (each by link and the point at which it acts), ``guides``
    (unit normals, by link and guided point); ``balance`` (f - M a) and, where the multipliers of the
    constraints determine all forces, ``joint_forces`` by them.

    Raises
    ------
    SceneError
        For a linkage in space, or with distributed forces.
    """
    if linkage.dimension != 2:
        raise SceneError(
            f"{linkage.name} is in space: forces by elements are for linkages in the plane",
            hint="LINK.POINT.force among the outputs of the scene gives the joint forces of a run.",
        )
    if linkage.welded_angles:
        raise SceneError(
            f"{linkage.name} has welds: forces by elements are for hinges",
            hint="A run of the elastic links has LINK.POINT.force and LINK.POINT.couple.",
        )
    model = RodsModel(linkage)
    matrices = tuple(m for m in _matrices(model) if m.matrix.rows)
    return System(
        name=f"{linkage.name}_forces",
        title=f"{linkage.title}: forces",
        groups=groups(model),
        matrices=matrices,
        exports=tuple(Export(m.name, m.description, (m.name,)) for m in matrices),
        definitions=definitions(model),
        references=(REFERENCE,),
    )


def _matrices(model: RodsModel) -> Iterator[NamedMatrix]:
    yield from _inertias(model)
    yield from _loads(model)
    yield from _constraints(model)
    about = "applied forces minus mass times acceleration, f - M a"
    yield named(model, "balance", model.balance, "N", about, rows=[x.name for x in model.coordinates])
    with suppress(SceneError):  # the elements tell which forces are not determined
        rows, forces = zip(*_by_multipliers(model), strict=True)
        about = "forces on links at their points, forces of guides, torques of drives"
        yield named(model, "joint_forces", forces, "N, N*m", about, rows=rows)


def _by_multipliers(model: RodsModel) -> Iterator[tuple[str, sp.Expr]]:
    """Yield kind, link, point and axis of each component of a force, and the component."""
    for rod in model.rods:
        for point in (*rod.base, *(c.name for c in rod.carried)):
            for axis, force in zip(model.axes, model.joint_forces.on(rod.name, point), strict=True):
                yield f"force {rod.name} {point} {axis}", force
    for guide in model.guides:
        push = model.multipliers[guide.constraint.name].symbol * model.linkage.link(guide.link).length
        yield f"guide {guide.link} {guide.point} -", -push
    for label, torque, _ in _torques(model):
        yield f"{label} -", torque


def _inertias(model: RodsModel) -> Iterator[NamedMatrix]:
    rods, linkage = model.rods, model.linkage
    rows = (
        [k.mass for k in rods],
        [k.centre / k.length for k in rods],
        [k.offset / k.length for k in rods],
        [k.inertia for k in rods],
    )
    yield named(
        model, "link_masses", [x for row in rows for x in row], "kg, 1, 1, kg*m^2",
        "mass, centre of mass over the length, moment of inertia about it",
        rows=("mass", "along", "across", "inertia"), columns=[k.name for k in rods],
    )  # fmt: skip
    sections = [e for e in linkage.elastic if model.rod(e.link)]
    if sections:
        columns = [
            # as in the rigid motion: rotary inertia only where the link's elements have it
            _padded(e.section.mass, AREA_POWER)
            + _padded(e.section.rotary if ELEMENTS[e.element].rotary else (), INERTIA_POWER)
            for e in sections
        ]
        yield named(
            model, "sections", [c[i] for i in range(len(columns[0])) for c in columns],
            ", ".join((*_MASS_UNITS, *_ROTARY_UNITS)), "mass and rotary inertia along links, by power of x",
            rows=[*(f"m{i}" for i in range(AREA_POWER + 1)), *(f"j{i}" for i in range(INERTIA_POWER + 1))],
            columns=[e.link for e in sections],
        )  # fmt: skip
    masses = dict.fromkeys(model.points, ZERO)
    for m in linkage.masses:
        masses[m.point] += m.mass
    yield named(model, "point_masses", list(masses.values()), "kg", "point masses", rows=list(masses))
    yield named(model, "gravity", linkage.gravity, "m/s^2", "acceleration of free fall", rows=model.axes)


def _padded(coefficients: Sequence[sp.Expr], power: int) -> tuple[sp.Expr, ...]:
    return (*coefficients, *[ZERO] * (power + 1 - len(coefficients)))


def _loads(model: RodsModel) -> Iterator[NamedMatrix]:
    points = model.points
    still = (ZERO,) * len(model.axes)
    sums = [zip(still, *model.loads.on_point(p), strict=True) for p in points]
    on_points = [sp.Add(*components) for sum_ in sums for components in sum_]
    about = "forces, springs and actuators on points"
    yield named(model, "point_loads", on_points, "N", about, rows=points, columns=model.axes)
    on_links = [
        (f"{k.name} {_where(model, k, other)}", torque[0])
        for k in model.rods
        for other, torque in model.loads.couples(k.name)
    ]
    rows, values = [row for row, _ in on_links], [value for _, value in on_links]
    yield named(
        model, "couples", values, "N*m", "couples on links, with the points at which they act", rows=rows
    )
    _check_along_links(model)


def _check_along_links(model: RodsModel) -> None:
    """Raise SceneError for a load with forces on links themselves, not on points."""
    for table, i, load in model.linkage.placed_loads:
        actions = (x for other, term in model.loads.terms if other is load for x in model.loads.actions(term))
        if any(isinstance(x, PointForce) and x.link for x in actions):
            raise SceneError(
                f"forces by elements know forces on points and couples, and no {load.plural}",
                where=f"{table}.{i}",
                file=model.linkage.file,
                hint="LINK.POINT.force among the outputs of the scene gives the joint forces of a run.",
            )


def _constraints(model: RodsModel) -> Iterator[NamedMatrix]:
    carried = [(k.name, c) for k in model.rods for c in k.carried]
    yield named(
        model, "carried", [x for _, c in carried for x in (c.along, c.across)], "1",
        "places of further points of links, over the length",
        rows=[f"{link} {c.name}" for link, c in carried], columns=("along", "across"),
    )  # fmt: skip
    guides = list(model.guides)
    yield named(
        model, "guides", [c / model.linkage.link(row.link).length for row in guides for c in row.by_point],
        "1", "normals of the lines of links on which points stay, to their left",
        rows=[f"{row.link} {row.point}" for row in guides], columns=model.axes,
    )  # fmt: skip
    torques = list(_torques(model))
    acting = dict.fromkeys(place for _, _, shares in torques for place in shares)
    yield named(
        model, "torques", [shares.get(place, ZERO) for place in acting for _, _, shares in torques],
        "1", "torques of drives and gears on links at points, over that on their first link",
        rows=[" ".join(place) for place in acting], columns=[label for label, _, _ in torques],
    )  # fmt: skip
    drives = model.angle_drives
    yield named(
        model, "driven_angles", [d.value for d in drives], "rad",
        "prescribed directions of links, from those of others if named", rows=[d.name for d in drives],
    )  # fmt: skip


def _torques(model: RodsModel) -> Iterator[tuple[str, sp.Expr, dict[tuple[str, str], sp.Expr]]]:
    """Yield kind, first link and name of an unknown torque, its value, and its shares on links at points."""
    for drive in model.angle_drives:
        on, links = drive.torques, [*drive.torques]
        pairs = zip(links, [*links[1:], *links[:-1]] if links[1:] else [""], strict=True)
        shares = {
            (k, _where(model, model.linkage.link(k), other)): on[k] / on[drive.owner] for k, other in pairs
        }
        yield f"torque {drive.owner} {drive.owner}.torque", model.effort(drive), shares
    for i, pair in enumerate(model.linkage.gears):
        factors, first = turns(pair.links, pair.teeth, pair.carrier), pair.links[0]
        places = {k: _where(model, model.linkage.link(k), "") for k in factors}
        shares = {(k, places[k]): sp.Rational(factors[k], factors[first]) for k in factors}
        yield f"gear {first} gears.{i}", mesh_torque(model, pair), shares


def _where(model: RodsModel, link: RigidLink, other: str) -> str:
    """Return the point at which a couple between two links, or a link and the ground, acts on the first.

    It is the first that they share, else the first of the link.
    """
    there = [*link.base, *(c.name for c in link.carried)]
    if other and other not in model.idle:
        against = model.linkage.link(other)
        shared = {*against.base, *(c.name for c in against.carried)}
    else:
        shared = {p for p in there if model.is_fixed(p)}
    return next((p for p in there if p in shared), link.start)
