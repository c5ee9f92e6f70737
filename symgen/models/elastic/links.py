"""Elastic links in a linkage: inputs from the rigid motion.

The elastic motion is small and relative to the rigid motion of the rods method. Its inputs are the motion of
every elastic link and the force on its first point (``motion_system``), and the equations of all rigid
components, linearised about the rigid motion (:mod:`symgen.models.elastic.joints`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import sympy as sp

from symgen.elements import ELEMENTS
from symgen.loads.load import Load
from symgen.loads.measure import ProfilePart
from symgen.mechanics.elastic.energies import ENERGIES as OF_LINK
from symgen.mechanics.elastic.energies import LIFT, WORK, energy_weights, rate, rigid_energies
from symgen.mechanics.elastic.hamilton import GX, GY, PX, PY, VX, VY
from symgen.mechanics.elastic.moving_frame import local, moving_frame
from symgen.mechanics.elastic.shaft import ROTATION, TERMS, powers, rigid_crank, shaft
from symgen.mechanics.elastic.turning_axes import COSINE, SINE
from symgen.mechanics.elastic.weights import turning_ends, weights
from symgen.models.elastic.couples import apart
from symgen.models.rods.linearised import analysis_of
from symgen.models.rods.linkage import RodsModel
from symgen.models.rods.matrix import named
from symgen.scene.elastic.joints import places_along
from symgen.scene.elastic.links import AREA_POWER, INERTIA_POWER, Crank, ElasticLink
from symgen.scene.rods.linkage import CarriedPoint, Linkage, Vector, state_symbol
from symgen.symbolic.calculus import ZERO
from symgen.symbolic.names import Names
from symgen.symbolic.system import Export, NamedMatrix, System

#: Weights of the constants of a link, in its own axes and for ends on fixed axes, but for those that are one.
_WEIGHTS = tuple(sorted((w for w in (*weights(), *turning_ends()) if w.value != 1), key=lambda w: w.name))
#: Columns of ``links``: the direction, the weights of the inertia of the elastic motion, and the others.
MOTION = (
    "cosine",
    "sine",
    *(w.name for w in _WEIGHTS if w.inertial),
    *(w.name for w in _WEIGHTS if not w.inertial and not w.applied),
)
#: Columns of ``loads``.
APPLIED = tuple(w.name for w in _WEIGHTS if w.applied)
#: Those of them that a joint force does not have: it changes the axial force alone.
_OF_LOADS = tuple(w.name for w in _WEIGHTS if w.applied and w.constant != "geometric_force")
#: Columns of ``energies``: factors of the constants of a link in its energies with their rates, and in the
#: virtual work of its inertia and weight; ``rigid`` those of its rigid motion.
ENERGIES = tuple(
    f"{name}{ending}"
    for of, endings in ((OF_LINK, ("", "_rate")), (WORK, ("",)))
    for name in (
        *(w.name for w in energy_weights() if w.energy in of),
        *(f"{energy}_rigid" for energy in of if energy != "strain"),
    )
    for ending in endings
)
#: Columns of ``profiles``: see :class:`symgen.runtime.beams.data.Profile`.
_PROFILE = ("at", "even", "slope", "follows", "mass")
#: Matrices of a rigid crank.
CRANK = ("rotation", "arm")
#: Columns of ``properties``: see :class:`symgen.runtime.beams.links.Properties`.
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
    """Return the System of the inputs of elastic links from the rigid motion.

    ``links``: a row for every elastic link, with its direction and the weights of its constant matrices and
    load vectors. ``loads``: weights of the forces along elastic links. ``shaft``: terms of flywheel and motor
    on an elastic crank. ``energies``: factors in the energies of every elastic link, of flywheel and motor.
    ``crank_rotation``: of a rigid crank. ``constants``: sections, stations, masses along links, profiles of
    forces, crank.
    """
    model, names = RodsModel(linkage), Names()
    of_links = [k.link for k in linkage.elastic]
    moving = {k.link: _motion(model, k, names) for k in linkage.elastic}
    properties = [_properties(linkage, k) for k in linkage.elastic]
    matrices = [
        _table(model, "links", [_row(MOTION, m) for m in moving.values()], "1, SI", MOTION, of_links),
        _table(model, "properties", properties, "SI", PROPERTIES, of_links),
    ]
    constants, along = ["properties"], list(loads_along(linkage))
    crank = linkage.crank
    if crank:
        matrices.append(
            _table(model, "crank", [[crank.angle, crank.speed]], "rad, rad/s", ("angle", "speed"))
        )
        constants.append("crank")
    damping = linkage.modal_damping
    for name, rows, unit, columns in (
        ("modal_damping", [[ratio] for ratio in damping.ratios] if damping else [], "1", ("ratio",)),
        ("stations", _stations(linkage), "1, m", ("at", "fibre")),
        ("lumps", [lump for _, *lump in lumps(linkage)], "m, kg, kg*m^2", ("at", "mass", "inertia")),
        ("profiles", [_shape(model, *x) for x in along], "m, 1, 1/m, 1, kg", _PROFILE),
    ):
        if rows:
            matrices.append(_table(model, name, rows, unit, columns))
            constants.append(name)
    exports = [
        Export("links", "motion of the elastic links and force on their first points", ("links",)),
        Export("constants", "sections, stations, masses along links and the crank", tuple(constants)),
    ]
    if along:
        loads = []
        for link, acting in along:
            cosine, sine = (moving[link][q.symbol] for q in (COSINE, SINE))
            if isinstance(acting, CarriedPoint):
                # Links joined there share its displacements: their force changes the axial force alone.
                force, omitted = _from_others(model, link, acting.name), _OF_LOADS
            else:
                force, omitted = _on_fixed_axes(model, acting), ()
            lump = local(force, cosine, sine)
            row = _row(APPLIED, dict(zip((PX.symbol, PY.symbol), lump, strict=True)))
            loads.append([ZERO if w in omitted else x for w, x in zip(APPLIED, row, strict=True)])
        matrices.append(_table(model, "loads", loads, "N or N/m", APPLIED))
        exports.append(Export("loads", "forces along elastic links", ("loads",)))
    energies = [_energies(linkage, k, moving[k.link]) for k in linkage.elastic]
    matrices.append(_table(model, "energies", energies, "1, SI", ENERGIES, of_links))
    of_energies = ["energies"]
    if crank and crank.mode == "motor" and crank.link in moving:
        matrices += _shaft(model, crank, moving[crank.link])
        exports.append(Export("shaft", "flywheel and motor on the shaft of an elastic crank", ("shaft",)))
        of_energies.append("shaft_energy")
    exports.append(Export("energies", "factors of the energies of elastic links", tuple(of_energies)))
    if crank and crank.link not in moving:
        matrices += _rigid_crank(model, crank)
        exports.append(Export("crank_rotation", "rotation and torque of a rigid crank", CRANK))
    return analysis_of(model, "elastic_motion", matrices, exports, names)


def lumps(linkage: Linkage) -> Iterator[tuple[str, sp.Expr, sp.Expr, sp.Expr]]:
    """Yield lumped masses on elastic links: link, distance from its first point, mass, moment of inertia.

    The masses of joints are those of points, not of links.
    """
    for mass in linkage.masses:
        for link in (linkage.link(beam.link) for beam in linkage.elastic):
            is_lumped = any(c.name == mass.point and not c.joined for c in link.carried)
            if is_lumped or (mass.link == link.name and mass.inertia != 0):
                at = link.along(mass.point) * link.length
                yield link.name, at, mass.mass if is_lumped else ZERO, mass.inertia


def loads_along(linkage: Linkage) -> Iterator[tuple[str, ProfilePart | CarriedPoint]]:
    """Yield the forces along elastic links, each after its link, and the joints between the ends of the link.

    The links are in their order, and the joints of each in the order of their places.
    """
    for beam in linkage.elastic:
        for _, _, load in linkage.placed_loads:
            yield from ((beam.link, profile) for profile in profiles_of(linkage, beam.link, load))
        joints = [c for c in linkage.link(beam.link).carried if c.joined]
        yield from ((beam.link, c) for c in sorted(joints, key=lambda c: linkage.number(c.along)))


def _shape(model: RodsModel, name: str, acting: ProfilePart | CarriedPoint) -> Sequence[sp.Expr]:
    if isinstance(acting, CarriedPoint):
        link = model.linkage.link(name)
        return acting.along * link.length, ZERO, ZERO, ZERO, dict(model.joint_masses(link)).get(acting, ZERO)
    return *acting.shape, sp.Integer(bool(acting.on.follows)), ZERO


def profiles_of(linkage: Linkage, name: str, load: Load) -> Iterator[ProfilePart]:
    """Yield the forces of a load along an elastic link."""
    link = linkage.link(name)
    for term in load.terms(linkage.dimension):
        yield from term.on.along(name, link.length, places_along(link, term.on), term.total)


def _from_others(model: RodsModel, link: str, point: str) -> Vector:
    """Return the force on an elastic link at a joint without that of loads along it, which rotate with it."""
    forces = [model.joint_forces.on(link, point)]
    for _, _, load in model.linkage.placed_loads:
        for profile in profiles_of(model.linkage, link, load):
            if profile.on.points == (("point", point),):
                forces.append(tuple(-c for c in _on_fixed_axes(model, profile)))
    return tuple(sp.Add(*components) for components in zip(*forces, strict=True))


def _on_fixed_axes(model: RodsModel, profile: ProfilePart) -> Vector:
    """Return a force along an elastic link, in its rigid motion."""
    force = profile.on.put(model.loads, model.loads.with_state(profile.force))
    return profile.on.fixed(model.loads, force)


#: Description of each table.
_ABOUT = {
    "links": "directions of elastic links, and weights of their constant matrices and load vectors",
    "properties": "sections, material and damping of the elastic links",
    "crank": "direction at the start and speed of the crank",
    "modal_damping": "damping ratios of the modes of the structure",
    "stations": "stations of strain outputs: fraction of the length, fibre",
    "lumps": "masses on elastic links: distance from the first point, mass, moment of inertia",
    "profiles": "forces along links: places, or factors of 1 and x; 1 where they follow; mass at joints",
    "loads": "weights of the loads and geometric stiffness by forces along elastic links",
    CRANK[0]: "rotation of a rigid crank by the displacement of its end",
    CRANK[1]: "displacement of the end of a rigid crank by its rotation",
    "energies": "factors of the constants of elastic links in their energies, energies of their rigid motion",
    "shaft_energy": "factors in the energy of the flywheel, in its rate, and in the power of the motor",
    "shaft": "terms of the shaft of an elastic crank: mass, damping, stiffness and load of its rotation",
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


def _motion(model: RodsModel, beam: ElasticLink, names: Names) -> dict[sp.Symbol, sp.Expr]:
    """Return the axes of an elastic link and the quantities of its rigid motion, by symbol."""
    link = model.linkage.link(beam.link)
    d, v, a = (
        tuple(b - a for a, b in zip(of(link.start), of(link.end), strict=True))
        for of in (model.position, model.velocity, model.acceleration)
    )
    felt = zip(model.acceleration(link.start), model.linkage.gravity, strict=True)
    force = _from_others(model, link.name, link.start)
    frame = moving_frame(names, link.name, (d, v, a), tuple(a - g for a, g in felt), force)
    gravity, cosine, sine = model.linkage.gravity, frame[COSINE.symbol], frame[SINE.symbol]
    for of, vector in (((VX, VY), model.velocity(link.start)), ((GX, GY), gravity)):
        components = zip(of, local(vector, cosine, sine), strict=True)
        for q, e in components:
            frame[q.symbol] = names.scalar(
                f"{link.name}_{q.name}", e, q.unit, f"{q.description}, {link.name}"
            )
    place = model.position(link.start)
    frame[LIFT.symbol] = sp.Add(*(g * x for g, x in zip(gravity, place, strict=True)))
    return frame


def _energies(linkage: Linkage, beam: ElasticLink, motion: Mapping[sp.Symbol, sp.Expr]) -> list[sp.Expr]:
    """Return a row of ``ENERGIES``."""
    hidden, shown = apart(linkage, motion)
    masses = [tuple(map(hidden, lump)) for link, *lump in lumps(linkage) if link == beam.link]
    turned = beam.section.rotary if ELEMENTS[beam.element].rotary else ()
    mass, rotary = ([*map(hidden, of)] for of in (beam.section.mass, turned))
    rigid = rigid_energies(mass, rotary, hidden(linkage.link(beam.link).length), masses)
    values = {w.name: w.value for w in energy_weights()} | rigid
    values |= {f"{name}_rate": rate(value) for name, value in values.items()}
    return [shown(sp.sympify(values[column]).xreplace(motion)) for column in ENERGIES]


def _row(columns: Sequence[str], motion: Mapping[sp.Symbol, sp.Expr]) -> list[sp.Expr]:
    values = {w.name: w.value for w in _WEIGHTS} | {"cosine": COSINE.symbol, "sine": SINE.symbol}
    return [values[column].xreplace(motion) for column in columns]


def _properties(linkage: Linkage, beam: ElasticLink) -> list[sp.Expr]:
    s = beam.section
    polynomials = (
        (s.mass, AREA_POWER), (s.rotary, INERTIA_POWER), (s.axial, AREA_POWER), (s.bending, INERTIA_POWER),
        (s.shear, AREA_POWER), (s.fibre, 1),
    )  # fmt: skip
    properties = [linkage.link(beam.link).length]
    for coefficients, power in polynomials:
        properties += [*coefficients, *(ZERO for _ in range(power + 1 - len(coefficients)))]
    limit = ZERO if beam.yield_stress is None else beam.yield_stress
    return [*properties, beam.modulus, beam.mass_damping, beam.stiffness_damping, beam.damping_ratio, limit]


def _stations(linkage: Linkage) -> list[list[sp.Expr]]:
    rows = []
    for station in linkage.stations:
        beam = next(b for b in linkage.elastic if b.link == station.link)
        x = station.at * linkage.link(station.link).length
        outer = sp.Add(*(c * x**k for k, c in enumerate(beam.section.fibre)))
        rows.append([station.at, outer if station.fibre is None else station.fibre])
    return rows


def _shaft(model: RodsModel, crank: Crank, motion: Mapping[sp.Symbol, sp.Expr]) -> Iterator[NamedMatrix]:
    """Yield the terms of flywheel and motor on an elastic crank, and the factors of their energy."""
    angle, rate_of = (state_symbol(f"{crank.link}.{word}") for word in ("angle", "angular_velocity"))
    hidden, shown = apart(model.linkage, (*motion, *ROTATION))
    acting = hidden(crank.flywheel), hidden(crank.torque), angle, rate_of
    terms, energy = shaft(*acting), [e for part in powers(*acting).values() for e in part]
    row, factors = (model.loads.with_state([shown(e.xreplace(motion)) for e in of]) for of in (terms, energy))
    yield _table(model, "shaft", [row], "kg*m^2, N*m*s/rad, N*m/rad, N*m", TERMS)
    yield _table(model, "shaft_energy", [[e] for e in factors], "J, W", ("factor",))


def _rigid_crank(model: RodsModel, crank: Crank) -> Iterator[NamedMatrix]:
    link = model.linkage.link(crank.link)
    x, y = (b - a for a, b in zip(*map(model.position, (link.start, link.end)), strict=True))
    for name, unit, row in zip(CRANK, ("1/m", "m"), rigid_crank((x, y)), strict=True):
        yield _table(model, name, [row], unit, ("x", "y"))
