"""System of a linkage: derived matrices with names and units, and the kernels to generate."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from symgen.errors import SceneError
from symgen.mechanics.sources import linkage_sources
from symgen.models.couples import EFFORTS, effort_forces, joint_couples
from symgen.models.limits import limits_of
from symgen.models.rods import outputs
from symgen.models.rods.elimination import is_open, order_of
from symgen.models.rods.linkage import REFERENCE, RodsModel
from symgen.models.rods.matrix import named, sparse
from symgen.models.rods.refinement import refinement
from symgen.models.rods.start import start_exports
from symgen.scene.rods.linkage import TIME, Linkage
from symgen.scene.rods.windings import turning
from symgen.symbolic.system import Definition, Export, Group, NamedMatrix, SaddlePoint, System

POINTS = Export("points", "position and velocity of all points", ("positions", "velocities"))

#: Names of dimensions of results.
_DIMENSIONS = ("time", "run", "sample", "axis")


def linkage_system(linkage: Linkage) -> System:
    """Return the System of a linkage.

    Raises
    ------
    SceneError
        For an output that the linkage does not have, a point without mass, or too many points.
    """
    model = RodsModel(linkage)
    model.check_size()
    model.check_masses()
    requested = outputs.requested_outputs(model)
    start, start_kernels = start_exports(model)
    couples = joint_couples(model)
    equations, exports = [*_equations(model), *couples], _exports(model)
    order, costs = order_of(
        model, *(m.matrix for m in equations if m.name in ("mass_matrix", "constraint_jacobian"))
    )
    residual, refining = refinement(model)
    points, end = _points(model), run_end(model)
    limits, kernel_of_limits = limits_of(linkage)
    # Zero-crossing functions of events and load switches, and angles: one column each.
    events = [*_events_of_scene(model), *switches_of(model), *windings_of(model), *_turns(model)]
    turning = _winding_rates(model)
    derived = {m.name for m in (*equations, *points)}
    own = {m.name for m in (*start, *residual, *events, *turning, *end, *limits)} | {
        *outputs.OF_THE_WHOLE,
        *_DIMENSIONS,
    }
    named = {s.name: f"states.{s.name}" for s in linkage.states}
    named |= {name: f"outputs.{i}.name" for i, name in enumerate(linkage.scene_outputs)}
    for name, where in named.items():
        if name in derived | own:
            raise SceneError(
                f"{name!r} is reserved for a quantity of the linkage",
                where=where,
                hint="Choose another name.",
            )
    return System(
        name=linkage.name,
        title=linkage.title,
        groups=groups(model),
        matrices=(
            *equations,
            *points,
            *(m for m in requested if m.name not in derived),
            *start,
            *residual,
            *events,
            *turning,
            *end,
            *limits,
        ),
        exports=(
            *exports,
            Export("outputs", "outputs of the scene", tuple(m.name for m in requested)),
            *start_kernels,
            *refining,
            *events_kernel(events),
            *(Export(m.name, m.description, (m.name,)) for m in turning),
            *run_end_kernel(end),
            *kernel_of_limits,
        ),
        definitions=definitions(model),
        saddle_point=SaddlePoint(
            "mass_matrix",
            "constraint_jacobian",
            "force",
            "acceleration_rhs",
            order,
            _rank_tolerance(linkage),
            is_open(model),
            costs,
            tuple(m.name for m in couples),
            EFFORTS if model.loads.efforts else "",
            tuple(m.name for m in linkage.motions),
        ),
        references=(REFERENCE,),
        sources=linkage_sources(model.sliding),
        left_out=(
            *(
                f"link {name}: both ends are ground, so it does not move"
                + "; its weight goes into the reactions" * (linkage.link(name).mass != 0)
                for name in model.idle
            ),
            *((f"motion across the plane {linkage.plane}",) if linkage.plane else ()),
        ),
    )


def groups(model: RodsModel) -> tuple[Group, ...]:
    """Return the argument arrays that every kernel of a linkage takes."""
    free = [a for p in model.free for a in model.a[p]]
    return (
        Group("t", "time", (TIME,)),
        Group("q", "coordinates of the free points", tuple(model.coordinates)),
        Group("u", "velocities of the free points", tuple(u for p in model.free for u in model.u[p])),
        Group("p", "tunable parameters", tuple(p.quantity for p in model.linkage.parameters), per_run=True),
        Group(
            "work",
            "accelerations and multipliers, as the kernel 'accelerations' wrote them",
            (
                *free,
                *model.multipliers.values(),
                *model.loads.of_joints.values(),
                *model.loads.efforts.values(),
            ),
        ),
    )


def definitions(model: RodsModel) -> tuple[Definition, ...]:
    """Return the shared subexpressions with the motion of the ground substituted."""
    return with_ground(model, model.calculus.definitions)


def with_ground(model: RodsModel, definitions: Iterable[Definition]) -> tuple[Definition, ...]:
    """Return subexpressions with the motion of the ground substituted."""
    return tuple(replace(d, expression=model.in_place(d.expression)) for d in definitions)


#: Exponent of the pivot that rounding may leave.
_ROUNDING = 13
#: The least margin between an assembly error and a lost singular value.
_MARGIN = 10


def _rank_tolerance(linkage: Linkage) -> str:
    """Return a power of ten above the pivots that rounding and the assembly error leave."""
    tolerance = float(linkage.number(linkage.assembly_tolerance))
    if not tolerance:
        return f"1e-{_ROUNDING}"
    drawn = [[float(linkage.number(c)) for c in p.at] for p in linkage.points if not p.hidden]
    mean = [sum(axis) / len(drawn) for axis in zip(*drawn, strict=True)]
    size = 2 * max(math.dist(p, mean) for p in drawn)
    return f"1e-{max(1, min(_ROUNDING, math.floor(-2 * math.log10(_MARGIN * tolerance / size))))}"


def _equations(model: RodsModel) -> list[NamedMatrix]:
    q = [x.symbol for x in model.coordinates]
    names = [s.name for s in q]
    energies = [
        named(model, "kinetic_energy", [model.kinetic_energy], "J", "kinetic energy"),
        named(model, "potential_energy", [model.potential_energy], "J", "potential of gravity and springs"),
    ]
    if model.power != 0:
        about = "power of the loads without potential, of drives and of the moving ground"
        energies.append(named(model, "power", [model.power], "W", about))
    forces, by_efforts = effort_forces(model)
    return [
        sparse(
            model,
            "mass_matrix",
            [model.mass_rows.get(a, {}) for a in q],
            "kg",
            "mass matrix of the free points, M",
            rows=names,
            symmetric=True,
        ),
        named(model, "force", forces, "N", "applied forces, f", rows=names),
        *by_efforts,
        *constraints(model),
        *energies,
    ]


def constraints(model: RodsModel) -> list[NamedMatrix]:
    """Return the constraints with their derivatives."""
    rows = [c.name for c in model.constraints]
    unit, rate_unit, rhs_unit = (_unit_of_constraints(model, i) for i in range(3))
    slopes = slope_unit(model)
    expressions, scales = [c.expression for c in model.constraints], [c.scale for c in model.constraints]
    about_scale = "divisor by which a constraint becomes an error in metres"
    about_rhs = "right-hand side gamma of J a = gamma"
    return [
        named(model, "constraints", expressions, unit, "constraints Phi", rows=rows),
        named(model, "constraint_scale", scales, "m, 1", about_scale, rows=rows),
        sparse(model, "constraint_jacobian", model.jacobian, slopes, "constraint Jacobian, J", rows=rows),
        named(model, "velocity_constraints", model.constraint_rates, rate_unit, "rate of Phi", rows=rows),
        named(model, "acceleration_rhs", model.acceleration_rhs, rhs_unit, about_rhs, rows=rows),
    ]


def slope_unit(model: RodsModel) -> str:
    """Return the unit of the constraint Jacobian; of linear and quadratic rows, both."""
    return _unit_of_constraints(model, 3)


#: Units of a constraint, of its rate, second rate and gradient.
_OF_CONSTRAINT = {"m^2": ("m^2", "m^2/s", "m^2/s^2", "m"), "m": ("m", "m/s", "m/s^2", "1")}


def _unit_of_constraints(model: RodsModel, which: int) -> str:
    units = {c.unit for c in model.constraints}
    both = ["m^2", "m"] if len(units) != 1 else units
    return ", ".join(_OF_CONSTRAINT.get(x, (x, "SI", "SI", "SI"))[which] for x in both)


def places(model: RodsModel) -> list[NamedMatrix]:
    """Return positions, velocities and accelerations of all points."""
    points = model.points
    return [
        named(
            model,
            name,
            [component for p in points for component in of_point(p)],
            unit,
            f"{name.replace('point_', '')} of all points",
            rows=points,
            columns=model.shown_axes,
        )
        for name, of_point, unit in (
            ("positions", model.shown_position, "m"),
            ("velocities", lambda p: model.shown(model.velocity(p)), "m/s"),
            ("point_accelerations", lambda p: model.shown(model.acceleration(p)), "m/s^2"),
        )
    ]


def _points(model: RodsModel) -> list[NamedMatrix]:
    positions = places(model)
    if model.loads.divided:
        rows, lengths = zip(*model.loads.divided, strict=True)
        about = "length of every spring and actuator whose force has a direction"
        positions.append(named(model, "line_lengths", lengths, "m", about, rows=rows))
    ground = [p for p in model.ground if not model.linkage.point(p).hidden]
    if ground:
        positions.append(
            named(
                model,
                "reactions",
                [component for p in ground for component in model.shown(model.reaction(p))],
                "N",
                "force of the ground on the linkage at each ground point",
                rows=ground,
                columns=model.shown_axes,
            )
        )
    return positions


def windings_of(model: RodsModel) -> list[NamedMatrix]:
    """Return the angles in loads and outputs that count revolutions, one matrix if there are any."""
    windings = model.linkage.windings
    if not windings:
        return []
    angles = [model.loads.angle(w.link, w.against, w.free) for w in windings]
    about = "angles in loads and outputs, continuous over revolutions"
    return [named(model, "windings", angles, "rad", about, rows=[w.reference.name for w in windings])]


def _winding_rates(model: RodsModel) -> list[NamedMatrix]:
    """Return the rates of angles in loads, which states of other solvers contain; of rigid links."""
    windings = model.linkage.windings
    if not windings or model.linkage.elastic:
        return []
    rates = [model.loads.turning(w.link, w.against)[1] for w in windings]
    rows = [w.reference.name for w in windings]
    return [named(model, "winding_rates", rates, "rad/s", "rates of angles in loads", rows=rows)]


def _turns(model: RodsModel) -> list[NamedMatrix]:
    links = turning(model.linkage)
    if not links:
        return []
    angles = [outputs.OF_LINKS["angle"](model, link)[0][0] for link in links]
    rates = [outputs.OF_LINKS["angular_velocity"](model, link)[0][0] for link in links]
    about = "angles of links whose revolutions are counted"
    return [
        named(model, "turns", angles, "rad", about, rows=links),
        named(model, "turn_rates", rates, "rad/s", f"rates of {about}", rows=links),
    ]


def switches_of(model: RodsModel) -> list[NamedMatrix]:
    """Return the switching expressions of loads and prescribed motions."""
    switches = model.linkage.switches
    if not switches:
        return []
    gaps = model.loads.with_state([s.gap for s in switches])
    about = "; ".join(s.text for s in switches)
    return [named(model, "switches", gaps, "1", about, rows=[s.branch.name for s in switches])]


def _events_of_scene(model: RodsModel) -> list[NamedMatrix]:
    events = model.linkage.events
    if not events:
        return []
    units = dict.fromkeys(e.unit for e in events)
    gaps = model.loads.with_state([e.gap for e in events])
    about = "; ".join(f"{e.name}: {e.about}" for e in events)
    unit = ", ".join(e.unit for e in events) if len(units) > 1 else events[0].unit
    return [named(model, "events", gaps, unit, about, rows=[e.name for e in events])]


def events_kernel(events: list[NamedMatrix]) -> list[Export]:
    """Return the kernel of what passes zero in a run, if anything does."""
    about = "what passes zero at each event, and at each switching point of a load; angles of loads and links"
    return [Export("events", about, tuple(m.name for m in events))] if events else []


def run_end(model: RodsModel) -> list[NamedMatrix]:
    """Return the end of the run where it depends on tunable parameters; else it is a number."""
    end = model.linkage.t_end
    return [named(model, "t_end", [end], "s", "end of the run")] if end.free_symbols else []


def run_end_kernel(end: list[NamedMatrix]) -> list[Export]:
    """Return the kernel of the end of the run."""
    return [Export("run_end", "end of the run by tunable parameters", ("t_end",))] if end else []


def _exports(model: RodsModel) -> list[Export]:
    energies = ("kinetic_energy", "potential_energy") + (("power",) if model.power != 0 else ())
    exports = [Export("energy", "kinetic and potential energy", energies), *kinematic_exports(model)]
    if model.loads.divided:
        about = "lengths of springs and actuators, by which their forces are divided"
        exports.append(Export("line_lengths", about, ("line_lengths",)))
    if model.loads.efforts:
        about = "forces by the efforts that keep prescribed motions"
        exports.append(Export(EFFORTS, about, (EFFORTS,)))
    if model.ground:
        exports.append(Export("reactions", "reactions at the ground points", ("reactions",)))
    return exports


def kinematic_exports(model: RodsModel) -> list[Export]:
    """Return the kernels of positions and of constraints."""
    exports = [
        POINTS,
        Export("point_accelerations", "acceleration of all points", ("point_accelerations",)),
    ]
    if model.constraints:
        exports += [
            Export("constraints", "constraints and their scale", ("constraints", "constraint_scale")),
            Export("velocity_constraints", "rate of the constraints", ("velocity_constraints",)),
            Export("constraint_jacobian", "constraint Jacobian", ("constraint_jacobian",)),
        ]
    return exports
