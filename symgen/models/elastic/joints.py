"""Rigid components of a linkage with elastic links, linearised about the rigid motion: ``joints_system``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import sympy as sp

from symgen.loads.torque import AppliedTorque
from symgen.mechanics.directors.beam import FIBRES, SECTION
from symgen.mechanics.sources import JOINTS, THESIS_LINKS, named_joints
from symgen.models.elastic.couples import entries, welded_to_bodies, with_bodies
from symgen.models.elastic.links import profiles_of
from symgen.models.rods.constraints import Constraint
from symgen.models.rods.linearised import analysis_of, linearised
from symgen.models.rods.linkage import RodsModel
from symgen.models.rods.matrix import named
from symgen.models.rods.outputs import OF_THE_WHOLE
from symgen.scene.elastic.links import ElasticLink
from symgen.scene.rods.linkage import Linkage, RigidLink, state_symbol
from symgen.symbolic.calculus import ZERO, partial
from symgen.symbolic.quantity import AXES, quantity
from symgen.symbolic.system import Export, NamedMatrix, System

#: Columns of ``sections``: those that the elements of links in space read, then others.
IN_SPACE = (
    *(q.name for q in (*SECTION, *FIBRES)),
    *(f"width_{axis}" for axis in AXES),
)
#: Angle and rate of the shaft of an elastic crank, behind the other numbers in ``work``.
SHAFT = (
    quantity("shaft__angle", "rad", "angle of the shaft of the crank"),
    quantity("shaft__rate", "rad/s", "rate of the shaft of the crank"),
)
#: Columns of axes fixed in driven links.
_FRAME = tuple(f"{vector}_{axis}" for vector in ("axis", "across", "third") for axis in AXES)


def joints_system(linkage: Linkage) -> System:
    """Return the System of all rigid components, linearised about the rigid motion.

    Its kernel ``joints`` gives mass, stiffness and damping by the displacements of the joints as lists of
    entries, the ``load`` f - M a of the rigid motion, and the rows of the constraints that elastic links
    leave, ``jacobian``, with first and second rate along the motion. First-order states whose rates depend on
    the shaft of an elastic crank have these from the kernel ``states``, by ``SHAFT``, and none in ``load``.
    """
    model = RodsModel(_without_beams(linkage))
    bound = _bound(model, linkage)
    coordinates = [x.symbol for x in model.coordinates]
    more = entries(model, linkage)
    names, about = (
        [s.name for s in coordinates],
        "force less inertia in the rigid motion, couples on sections",
    )
    names, load = [*names, *(at for at, _ in more["load"])], [*model.balance, *(e for _, e in more["load"])]
    matrices = [named(model, "load", load, "N or N*m" if more["load"] else "N", about, rows=names)]
    # The axial force of an elastic link is in its elements.
    elastic = {b.link for b in linkage.elastic}
    matrices += linearised(model, [c for c in bound if c.link not in elastic], more)
    rows = _rows(model, linkage, bound)
    if rows:
        matrices += _jacobians(model, rows, names)
    about = "the linkage without its elastic links, linearised about the rigid motion"
    exports = [Export("joints", about, tuple(m.name for m in matrices))]
    energies = {"kinetic_energy": model.kinetic_energy, "potential_energy": model.potential_energy}
    matrices += [named(model, name, [e], "J", f"{name.replace('_', ' ')}") for name, e in energies.items()]
    powers = list(_powers(model, linkage))
    of_energies = (*energies, *(m.name for m in powers))
    exports.append(
        Export("energy", "energies and powers of the linkage without its elastic links", of_energies)
    )
    matrices += powers
    rows_in_space = [_in_space(linkage, b) for b in linkage.elastic if b.in_space]
    if rows_in_space:
        about = "lengths and sections of elastic links in space, and gravity"
        entries_of = [e for row in rows_in_space for e in row]
        labels = [b.link for b in linkage.elastic]
        matrices.append(named(model, "sections", entries_of, "SI", about, rows=labels, columns=IN_SPACE))
        stations = [station.at for station in linkage.stations]
        labels = [station.name for station in linkage.stations]
        matrices.append(named(model, "stations", stations, "1", "fractions of links", rows=labels))
        between = [(c.name, c.along) for b in linkage.elastic for c in linkage.link(b.link).carried]
        constants = ["sections", "stations"]
        if between:
            labels, fractions = [name for name, _ in between], [at for _, at in between]
            matrices.append(named(model, "fractions", fractions, "1", "points on links", rows=labels))
            constants.append("fractions")
        axes = [e for joint in linkage.joints for e in joint.axis]
        if axes:
            labels = [f"{joint.kind}_{k}" for k, joint in enumerate(linkage.joints)]
            matrices.append(named(model, "axes", axes, "1", "axes of joints", rows=labels, columns=AXES))
            constants.append("axes")
        exports.append(Export("constants", about, tuple(constants)))
        of_drives, more_exports = _drives(model, linkage)
        matrices, exports = [*matrices, *of_drives], [*exports, *more_exports]
    of_thesis = tuple(link.name for link in linkage.links) == THESIS_LINKS
    sources = named_joints(rows) if of_thesis else JOINTS
    of_states = list(_states(model, linkage))
    if of_states:
        exports.append(Export("states", of_states[0].description, tuple(m.name for m in of_states)))
    behind = SHAFT if of_states else ()
    return analysis_of(
        model, "elastic_joints", [*matrices, *of_states], exports, sources=sources, behind=behind
    )


def shaking_system(linkage: Linkage) -> System:
    """Return the System of the force and moment on the ground of all but the elastic links."""
    model = RodsModel(_without_beams(linkage))
    names = ("shaking_force", "shaking_moment")
    matrices = [named(model, name, *OF_THE_WHOLE[name](model)) for name in names]
    about = "force and moment on the ground of the linkage without its elastic links"
    return analysis_of(model, "shaking", matrices, [Export("shaking", about, names)])


def _powers(model: RodsModel, linkage: Linkage) -> Iterator[NamedMatrix]:
    """Yield the power of a motor in the plane; in space that of loads, and of inertia at moving ground."""
    if linkage.dimension == 2:
        if motor := _motor(linkage):
            works = (
                work
                for term in motor.terms(linkage.dimension)
                for work in term.on.works(model.loads, model.loads.with_state(term.force))
            )
            power = sp.Add(*(force * rate for force, _, rate in works))
            yield named(model, "motor_power", [power], "W", "power of the motor on a rigid crank")
        return
    # Multipliers do work on the prescribed rates of their constraints, which are not all among these.
    power = model.power.xreplace({x.symbol: ZERO for x in model.multipliers.values()})
    if power != 0:
        about = "power of the loads without potential, and of inertia and loads at the moving ground"
        yield named(model, "power", [power], "W", about)


def _drives(model: RodsModel, linkage: Linkage) -> tuple[list[NamedMatrix], list[Export]]:
    """Return axes fixed in driven links, their slopes by the angles, speeds and torques of drives."""
    drives = model.angle_drives
    if not drives:
        return [], []
    names, axes, slopes = [d.owner for d in drives], list[sp.Expr](), list[sp.Expr]()
    for drive in drives:
        frame = model.hinges[drive.owner]
        for vector in frame.rotated(drive.value):
            axes += vector
            slopes += frame.slope(vector)
    speeds, torques = [d.rate for d in drives], [model.effort(d) for d in drives]
    matrices = [
        named(model, "driven_axes", axes, "1", "axes fixed in driven links", rows=names, columns=_FRAME),
        named(
            model, "driven_slopes", slopes, "1", "slopes of these by the angles", rows=names, columns=_FRAME
        ),
        named(model, "drive_speeds", speeds, "rad/s", "angular velocities of driven links", rows=names),
        named(model, "drive_torques", torques, "N*m", "torques of drives", rows=names),
    ]
    exports = [
        Export("driven", "axes fixed in driven links", ("driven_axes", "driven_slopes", "drive_speeds")),
        Export("drives", "torques of drives without those on axes of their links", ("drive_torques",)),
    ]
    return matrices, exports


def _in_space(linkage: Linkage, beam: ElasticLink) -> list[sp.Expr]:
    """Return a row of ``IN_SPACE``."""
    section = beam.in_space
    if section is None:
        return []
    properties = (linkage.link(beam.link).length, *section.values, beam.stiffness_damping, *linkage.gravity)
    return [*properties, *section.fibres, beam.modulus, section.is_round, *section.width]


def _states(model: RodsModel, linkage: Linkage) -> Iterator[NamedMatrix]:
    """Yield the rates of states by the shaft of an elastic crank, and their slopes by themselves, if any."""
    if not (by_shaft := _by_shaft(linkage)):
        return
    slopes = {name: partial(rate, state_symbol(f"{name}.state")) for name, rate in by_shaft.items()}
    for matrix, of, about in (
        ("state_rates", by_shaft, "rates of first-order states by the shaft of an elastic crank"),
        ("state_slopes", slopes, "slopes of these rates by their own states"),
    ):
        yield named(model, matrix, model.loads.with_state([*of.values()]), "SI", about, rows=[*of])


def _by_shaft(linkage: Linkage) -> dict[str, sp.Expr]:
    """Return the rates of states that depend on the angle or the rate of an elastic crank, by its shaft."""
    crank = linkage.crank
    if crank is None or crank.link not in {b.link for b in linkage.elastic}:
        return {}
    words = (state_symbol(f"{crank.link}.{word}") for word in ("angle", "rate"))
    shaft = dict(zip(words, (q.symbol for q in SHAFT), strict=True))
    return {s.name: s.rate.xreplace(shaft) for s in linkage.states if s.rate.free_symbols & shaft.keys()}


def _without_beams(linkage: Linkage) -> Linkage:
    """Return the linkage with its elastic links massless, and the motor on a crank that is rigid.

    States by the shaft of an elastic crank have no rates.
    """
    beams = {b.link for b in linkage.elastic}
    carried = {c.name for b in beams for c in linkage.link(b).carried if not c.joined}
    loads = [x for x in linkage.loads if not any(any(profiles_of(linkage, b, x)) for b in beams)]
    loads = [x for x in (load.off_sections() for load in loads) if x]
    motor, by_shaft = _motor(linkage), _by_shaft(linkage)
    loads += [motor] if motor else []

    def left(link: RigidLink) -> RigidLink:
        return replace(link, mass=ZERO, inertia=ZERO) if link.name in beams else link

    return replace(
        linkage,
        links=tuple(left(k) for k in linkage.links),
        masses=tuple(m for m in linkage.masses if m.point not in carried),
        loads=tuple(loads),
        states=tuple(replace(s, rate=ZERO) if s.name in by_shaft else s for s in linkage.states),
    )


def _motor(linkage: Linkage) -> AppliedTorque | None:
    """Return the torque of the motor on a rigid crank, if any."""
    crank = linkage.crank
    if not crank or crank.mode != "motor" or crank.link in {b.link for b in linkage.elastic}:
        return None
    return AppliedTorque("motor", crank.link, (crank.torque,))


def _bound(model: RodsModel, linkage: Linkage) -> list[Constraint]:
    """Return the constraints of the elastic motion: lengths of rigid links, guides, a held crank."""
    stretching = {b.link for b in linkage.elastic if b.axial}
    beams, crank = {b.link for b in linkage.elastic}, linkage.crank
    free = {f"{crank.link}_drive"} if crank and (crank.mode != "held" or crank.link in beams) else set()
    free |= {row.constraint.name for row in model.welded_angles}
    rows = (c for c in model.constraints if c.carrier not in beams and c.link not in stretching)
    return [c for c in rows if c.name not in free]


def _rows(
    model: RodsModel, linkage: Linkage, bound: Sequence[Constraint]
) -> dict[str, dict[sp.Symbol, sp.Expr]]:
    """Return the rows that hold the elastic motion by name: constraints, and welds to rigid links."""
    rows = {
        c.name: {s: slope / c.scale for s, slope in gradient.items()}
        for c, gradient in zip(model.constraints, model.jacobian, strict=True)
        if c in bound
    }
    return rows | {angle.name: with_bodies(model, angle) for angle in welded_to_bodies(linkage)}


def _jacobians(
    model: RodsModel,
    rows: Mapping[str, Mapping[sp.Symbol, sp.Expr]],
    columns: Sequence[str],
) -> Iterator[NamedMatrix]:
    """Yield the Jacobian of the rows, by coordinates and rotations, with first and second rate."""
    rates: tuple[tuple[str, str, Callable[[sp.Expr], sp.Expr]], ...] = (
        ("jacobian", "1, m" if len(columns) > len(model.coordinates) else "1", lambda e: e),
        ("jacobian_rate", "1/s", model.calculus.rate),
        ("jacobian_second_rate", "1/s^2", model.second_rate),
    )
    for name, unit, of in rates:
        by_name = [{s.name: of(e) for s, e in row.items()} for row in rows.values()]
        filled = [row.get(column, ZERO) for row in by_name for column in columns]
        about = f"{name.replace('_', ' ')} of the constraints over their scale"
        if name == "jacobian":
            about += "; times the column of displacements it is zero"
        yield named(model, name, filled, unit, about, rows=list(rows), columns=columns)
