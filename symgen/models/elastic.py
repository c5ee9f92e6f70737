"""Elastic links in a linkage: what the rigid motion gives them, and what the rest of the linkage adds.

The elastic motion is small, about the rigid motion of the rods method. Of that it needs the motion of every
elastic link and the force on its first point (``motion_system``), and the equations of all that is not
elastic, linearised about it (``joints_system``).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import sympy as sp

from symgen.models.constraints import Constraint
from symgen.models.linearised import analysis_of, linearised
from symgen.models.matrix import named
from symgen.models.rods import RodsModel
from symgen.scene.elastic import AREA_POWER, INERTIA_POWER, Crank, ElasticLink
from symgen.scene.linkage import AppliedTorque, Linkage, RigidLink, Vector, state_symbol
from symgen.symbolic.calculus import ONE, ZERO
from symgen.symbolic.system import Export, NamedMatrix, System

#: Columns of ``links``, and of ``properties``: see :class:`symgen.runtime.beams.Properties`.
MOTION = ("dx", "dy", "vx", "vy", "ax", "ay", "start_ax", "start_ay", "force_x", "force_y")
PROPERTIES = (
    "length",
    *(f"mass_{k}" for k in range(AREA_POWER + 1)),
    *(f"rotary_{k}" for k in range(INERTIA_POWER + 1)),
    *(f"axial_{k}" for k in range(AREA_POWER + 1)),
    *(f"bending_{k}" for k in range(INERTIA_POWER + 1)),
    *(f"shear_{k}" for k in range(AREA_POWER + 1)),
    "fibre_0",
    "fibre_1",
    "modulus",
    "mass_damping",
    "stiffness_damping",
    "damping_ratio",
    "yield_stress",
)


def motion_system(linkage: Linkage) -> System:
    """Return the System of what elastic links take from the rigid motion.

    ``links``: a row for every elastic link, with the vector from its first point to its second, the rate
    and second rate of that, the acceleration of its first point less gravity, and the force on it there.
    ``loads``: forces along elastic links, on fixed axes. ``torque``: of the motor, with its slopes by angle
    and angular velocity. ``constants``: sections, stations, masses along links, profiles of forces, crank.
    """
    model = RodsModel(linkage)
    of_links = [k.link for k in linkage.elastic]
    matrices = [
        _table(
            model, "links", [_motion(model, k) for k in linkage.elastic], "m, m/s, m/s^2, N", MOTION, of_links
        ),
        _table(
            model,
            "properties",
            [_properties(linkage, k) for k in linkage.elastic],
            "SI",
            PROPERTIES,
            of_links,
        ),
    ]
    constants, along = ["properties"], list(loads_along(linkage))
    crank = linkage.crank
    if crank:
        row = [crank.angle, crank.speed, crank.flywheel]
        matrices.append(_table(model, "crank", [row], "rad, rad/s, kg*m^2", ("angle", "speed", "flywheel")))
        constants.append("crank")
    for name, rows, unit, columns in (
        ("stations", _stations(linkage), "1, m", ("at", "fibre")),
        ("lumps", [[at, mass] for _, at, mass in lumps(linkage)], "m, kg", ("at", "mass")),
        ("profiles", [profile for _, profile, _, _ in along], "m, 1, 1/m", ("at", "even", "slope")),
    ):
        if rows:
            matrices.append(_table(model, name, rows, unit, columns))
            constants.append(name)
    exports = [
        Export("links", "motion of the elastic links and force on their first points", ("links",)),
        Export("constants", "sections, stations, masses along links and the crank", tuple(constants)),
    ]
    if along:
        loads = [model.loads.fixed(link, force, turning) for link, _, force, turning in along]
        matrices.append(_table(model, "loads", loads, "N or N/m", ("x", "y")))
        exports.append(Export("loads", "forces along elastic links", ("loads",)))
    if crank and crank.mode == "motor":
        matrices.append(_torque(model, crank))
        exports.append(Export("torque", "torque of the motor and its slopes", ("torque",)))
    return analysis_of(model, "elastic_motion", matrices, exports)


def joints_system(linkage: Linkage) -> System:
    """Return the System of all that is not elastic, linearised about the rigid motion.

    Its kernel ``joints`` gives mass, stiffness and damping by the displacements of the joints as lists of
    entries, the ``load`` f - M a of the rigid motion, and the rows of the constraints that elastic links
    leave, ``jacobian``, with first and second rate along the motion.
    """
    model = RodsModel(_without_beams(linkage))
    bound = _bound(model, linkage)
    coordinates = [x.symbol for x in model.coordinates]
    accelerations = {x.symbol: a.symbol for p in model.q for x, a in zip(model.q[p], model.a[p], strict=True)}
    load = [
        f
        - sp.Add(*(model.mass_entries.get((q, other), ZERO) * accelerations[other] for other in coordinates))
        for q, f in zip(coordinates, model.applied, strict=True)
    ]
    names = [s.name for s in coordinates]
    matrices = [named(model, "load", load, "N", "force less inertia in the rigid motion", rows=names)]
    matrices += linearised(model, [c for c in bound if not _is_elastic(linkage, c)])
    if bound:
        matrices += _rows(model, bound, accelerations)
    about = "the linkage without its elastic links, linearised about the rigid motion"
    return analysis_of(
        model, "elastic_joints", matrices, [Export("joints", about, tuple(m.name for m in matrices))]
    )


def lumps(linkage: Linkage) -> Iterator[tuple[str, sp.Expr, sp.Expr]]:
    """Yield the masses along elastic links: link, distance from its first point [m], mass [kg]."""
    for mass in linkage.masses:
        place = _on_beam(linkage, mass.point)
        if place:
            yield (*place, mass.mass)


def loads_along(linkage: Linkage) -> Iterator[tuple[str, Vector, Vector, bool]]:
    """Yield the forces along elastic links: link, profile, components, and whether these turn with the link.

    A profile is the place [m] of a force, zero, zero; or zero, and the factors of 1 and x of a force per
    length. The links are in their order.
    """
    for beam in linkage.elastic:
        for force in linkage.forces:
            place = _on_beam(linkage, force.point)
            if place and place[0] == beam.link:
                yield beam.link, (place[1], ZERO, ZERO), force.force, False
        for load in linkage.distributed:
            if load.link == beam.link:
                slope = 1 / linkage.link(beam.link).length
                if load.start == load.end:
                    yield beam.link, (ZERO, ONE, ZERO), load.start, load.turning
                else:
                    yield beam.link, (ZERO, ONE, -slope), load.start, load.turning
                    yield beam.link, (ZERO, ZERO, slope), load.end, load.turning


def _on_beam(linkage: Linkage, point: str) -> tuple[str, sp.Expr] | None:
    for beam in linkage.elastic:
        link = linkage.link(beam.link)
        for carried in link.carried:
            if carried.name == point:
                return link.name, carried.along * link.length
    return None


#: What each table is.
_ABOUT = {
    "links": "vectors along elastic links with two rates; at first points acceleration less gravity, force",
    "properties": "sections, material and damping of the elastic links",
    "crank": "direction at the start, speed and flywheel of the crank",
    "stations": "where strains are asked for: fraction of the length, fibre",
    "lumps": "masses along elastic links: distance from the first point, mass",
    "profiles": "where forces along elastic links act: distance from the first point, or factors of 1 and x",
    "loads": "forces along elastic links, on fixed axes",
    "torque": "torque of the motor, with its slopes by angle and angular velocity",
}


def _table(
    model: RodsModel,
    name: str,
    rows: Sequence[Sequence[sp.Expr]],
    unit: str,
    columns: Sequence[str],
    labels: Sequence[str] = (),
) -> NamedMatrix:
    entries = [sp.sympify(e) for row in rows for e in row]
    return named(model, name, entries, unit, _ABOUT[name], rows=labels, columns=columns)


def _motion(model: RodsModel, beam: ElasticLink) -> list[sp.Expr]:
    link = model.linkage.link(beam.link)
    force = model.joint_forces.on(link.name, link.start)
    found: list[sp.Expr] = []
    for of in (model.position, model.velocity, model.acceleration):
        found += [b - a for a, b in zip(of(link.start), of(link.end), strict=True)]
    felt = zip(model.acceleration(link.start), model.linkage.gravity, strict=True)
    return [*found, *(a - g for a, g in felt), *force]


def _properties(linkage: Linkage, beam: ElasticLink) -> list[sp.Expr]:
    s = beam.section
    polynomials = (
        (s.mass, AREA_POWER), (s.rotary, INERTIA_POWER), (s.axial, AREA_POWER), (s.bending, INERTIA_POWER),
        (s.shear, AREA_POWER), (s.fibre, 1),
    )  # fmt: skip
    found = [linkage.link(beam.link).length]
    for coefficients, power in polynomials:
        found += [*coefficients, *(ZERO for _ in range(power + 1 - len(coefficients)))]
    limit = ZERO if beam.yield_stress is None else beam.yield_stress
    return [*found, beam.modulus, beam.mass_damping, beam.stiffness_damping, beam.damping_ratio, limit]


def _stations(linkage: Linkage) -> list[list[sp.Expr]]:
    rows = []
    for station in linkage.stations:
        beam = next(b for b in linkage.elastic if b.link == station.link)
        x = station.at * linkage.link(station.link).length
        outer = sp.Add(*(c * x**k for k, c in enumerate(beam.section.fibre)))
        rows.append([station.at, outer if station.fibre is None else station.fibre])
    return rows


def _torque(model: RodsModel, crank: Crank) -> NamedMatrix:
    angle, rate = (state_symbol(f"{crank.link}.{word}") for word in ("angle", "angular_velocity"))
    row = [crank.torque, sp.diff(crank.torque, angle), sp.diff(crank.torque, rate)]
    return _table(
        model,
        "torque",
        [model.loads.with_state(row)],
        "N*m, N*m/rad, N*m*s/rad",
        ("torque", "by_angle", "by_rate"),
    )


def _without_beams(linkage: Linkage) -> Linkage:
    """Return the linkage with its elastic links massless, and the motor on a crank that is rigid."""
    beams = {b.link for b in linkage.elastic}
    carried = {c.name for b in beams for c in linkage.link(b).carried}
    crank, torques = linkage.crank, list(linkage.torques)
    if crank and crank.link not in beams and crank.mode == "motor":
        torques.append(AppliedTorque("motor", crank.link, (crank.torque,), ""))

    def left(link: RigidLink) -> RigidLink:
        return replace(link, mass=ZERO, inertia=ZERO) if link.name in beams else link

    return replace(
        linkage,
        links=tuple(left(k) for k in linkage.links),
        masses=tuple(m for m in linkage.masses if m.point not in carried),
        forces=tuple(f for f in linkage.forces if f.point not in carried),
        distributed=tuple(f for f in linkage.distributed if f.link not in beams),
        torques=tuple(torques),
    )


def _bound(model: RodsModel, linkage: Linkage) -> list[Constraint]:
    """Return the constraints that the elastic motion keeps: lengths of rigid links, guides, a held crank."""
    stretching = {b.link for b in linkage.elastic if b.axial}
    beams = {b.link for b in linkage.elastic}
    crank = linkage.crank
    free = {f"{crank.link}_drive"} if crank and (crank.mode != "held" or crank.link in beams) else set()
    return [c for c in model.constraints if c.link not in stretching and c.name not in free]


def _is_elastic(linkage: Linkage, constraint: Constraint) -> bool:
    """Tell whether it is the length of an elastic link, whose axial force its elements account for."""
    return any(b.link == constraint.link for b in linkage.elastic)


def _rows(
    model: RodsModel, bound: Sequence[Constraint], accelerations: dict[sp.Symbol, sp.Symbol]
) -> Iterator[NamedMatrix]:
    """Yield the Jacobian of the constraints by the free coordinates, with first and second rate."""
    calculus = model.calculus
    kept = [
        {s: slope / c.scale for s, slope in gradient.items()}
        for c, gradient in zip(model.constraints, model.jacobian, strict=True)
        if c in bound
    ]

    def second(expression: sp.Expr) -> sp.Expr:
        by = calculus.gradient(expression)
        return sp.Add(
            calculus.rate(calculus.rate(expression)), *(slope * accelerations[s] for s, slope in by.items())
        )

    rows, columns = [c.name for c in bound], [x.name for x in model.coordinates]
    for name, unit, of in (
        ("jacobian", "1", lambda e: e),
        ("jacobian_rate", "1/s", calculus.rate),
        ("jacobian_second_rate", "1/s^2", second),
    ):
        entries = [of(row.get(x.symbol, ZERO)) for row in kept for x in model.coordinates]
        about = f"{name.replace('_', ' ')} of the constraints over their scale"
        yield named(model, name, entries, unit, about, rows=rows, columns=columns)
