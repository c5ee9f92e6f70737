"""Systems of the analyses beyond the equations of motion; derived only when an analysis is requested.

Kinematics needs the right-hand side of J a = gamma and the values of the drives. Equilibrium and small
oscillations need the equations linearised about a state at rest,

    M dq'' + C dq' + K dq + J^T dlambda = 0,   J dq = 0,   with
    K = -d(f - J^T lambda)/dq   and   C = -d f/du,

where lambda is held constant: K contains the geometric stiffness of the constraint forces and that of loads.
Couples by the forces in joints vanish at rest, where C has them by these forces.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import sympy as sp

from symgen.mechanics.sources import NONE, Sources
from symgen.models.couples import couples_by_forces
from symgen.models.general.equations import equations_of
from symgen.models.rods.constraints import Constraint
from symgen.models.rods.drives.motion import gap
from symgen.models.rods.linkage import REFERENCE, Gradient, RodsModel
from symgen.models.rods.matrix import named
from symgen.models.rods.start import metric_of
from symgen.models.rods.system import (
    POINTS,
    constraints,
    definitions,
    groups,
    places,
    slope_unit,
    with_ground,
)
from symgen.scene.rods.linkage import Linkage
from symgen.symbolic.calculus import ONE, ZERO, chained, partial
from symgen.symbolic.names import Names
from symgen.symbolic.quantity import Quantity
from symgen.symbolic.system import Definition, Export, NamedMatrix, System


def kinematics_system(linkage: Linkage) -> System:
    """Return the System of a kinematic analysis: ``acceleration_rhs``, ``rotations`` of links, ``drives``.

    Each drive is a matrix of one entry: ``LINK.angle`` [rad], ``LINK.length`` [m] or, for moving ground,
    ``POINT.x`` [m], as a function of time.
    """
    model = equations_of(linkage)
    matrices, exports = driven_motion(model)
    matrices += constraints(model) if model.constraints else ()
    matrices += [m for m in places(model) if m.name in POINTS.matrices]
    return analysis_of(model, "kinematics", matrices, [POINTS, *exports])


def driven_motion(model: RodsModel) -> tuple[list[NamedMatrix], list[Export]]:
    """Return the matrices that follow a driven linkage, besides those of ``constraints``, and the kernels."""
    matrices, exports = [named(model, d.name, [d.value], d.unit, d.about) for d in model.drives], []
    if matrices:
        about = "prescribed angles, lengths and places"
        exports.append(Export("drives", about, tuple(m.name for m in matrices)))
    driven = ((d.value, *d.components) for d in model.angle_drives)
    along = [sp.cos(angle) * x + sp.sin(angle) * y for angle, x, y in driven]
    of_motions = (gap(model.loads, motion) for motion in model.linkage.motions if motion.links)
    along += [size * sp.cos(off) for off, size in of_motions]
    if along:
        about = "components of driven links along their prescribed directions: negative half a turn off"
        matrices.append(named(model, "along_drives", along, "m", about))
        exports.append(Export("along_drives", about, ("along_drives",)))
    if model.constraints:
        matrices.append(constraint_slopes(model))
        about = "constraints, their scale, their rate, and the nonzero entries of their Jacobian"
        of_closure = ("constraints", "constraint_scale", "velocity_constraints", "constraint_slopes")
        exports.append(Export("closure", about, of_closure))
        about = "right-hand side gamma of J a = gamma"
        exports.append(Export("acceleration_rhs", about, ("acceleration_rhs",)))
    if rotations := _rotations(model):
        matrices += rotations
        about = "rates of links in the plane"
        exports.append(Export("rotations", about, tuple(m.name for m in rotations)))
    return matrices, exports


def _rotations(model: RodsModel) -> list[NamedMatrix]:
    """Return angular velocities and accelerations of links in the plane that do not join ground points."""
    links = [k.name for k in model.linkage.links if not {k.start, k.end} <= set(model.ground)]
    if len(model.axes) == 3 or not links:
        return []
    rates = [model.turning(link)[1] for link in links]
    second = [model.turning_acceleration(link) for link in links]
    return [
        named(model, "angular_velocities", rates, "rad/s", "angular velocities of links", rows=links),
        named(model, "angular_accelerations", second, "rad/s^2", "angular accelerations", rows=links),
    ]


def constraint_slopes(model: RodsModel) -> NamedMatrix:
    """Return the nonzero entries of the constraint Jacobian, each called by its row and its column."""
    entries = {
        f"{c.name} {s.name}": row[s]
        for c, row in zip(model.constraints, model.jacobian, strict=True)
        for s in (x.symbol for x in model.coordinates)
        if row.get(s, ZERO) != 0
    }
    about = "nonzero entries of the constraint Jacobian"
    unit = slope_unit(model)
    return named(model, "constraint_slopes", list(entries.values()), unit, about, rows=list(entries))


def statics_system(linkage: Linkage) -> System:
    """Return the System of equilibrium and small oscillations.

    Its kernels: ``force`` (f), ``mass_matrix`` (M), ``stiffness`` (K, which reads the multipliers from
    ``work``), ``damping`` (C). A matrix is the list of its nonzero entries, each called by its row and its
    column, ``A_x B_y``; a zero matrix is omitted. ``metric`` is the whole metric of small motions, unless it
    is the identity.
    """
    model = equations_of(linkage)
    names = [x.name for x in model.coordinates]
    force = [model.force.get(x.symbol, ZERO) for x in model.coordinates]
    matrices = [named(model, "force", force, "N", "applied forces, f", rows=names)]
    matrices += [*linearised(model, model.constraints), *metric_of(model)]
    return analysis_of(
        model, "statics", matrices, [Export(m.name, m.description, (m.name,)) for m in matrices]
    )


def linearised(
    model: RodsModel,
    bound: Sequence[Constraint],
    more: Mapping[str, Sequence[tuple[str, sp.Expr]]] | None = None,
) -> Iterator[NamedMatrix]:
    """Yield ``mass_matrix``, ``stiffness`` (of loads and of the constraints ``bound``) and ``damping``.

    Each is the list of its nonzero entries; a zero matrix is omitted. ``more`` are further entries by the
    names of the matrices, each after its label.
    """
    q = [x.symbol for x in model.coordinates]
    rates = [x.symbol for p in model.free for x in model.u[p]]
    couples = couples_by_forces(model)
    at_rest = dict.fromkeys([*model.acceleration_of.values(), *(x.couple for x in couples)], ZERO)
    by_rates, by_coordinates = slopes_by(model, rates), model.calculus.gradient
    coordinate_of = dict(zip(rates, q, strict=True))
    of_bound = [
        (model.multipliers[c.name].symbol, gradient)
        for c, gradient in zip(model.constraints, model.jacobian, strict=True)
        if c in bound
    ]
    pulls = {s: [(factor, by[s]) for factor, by in of_bound if s in by] for s in q}
    stiffness = {
        s: chained((f, by_coordinates(e)) for f, e in [(-ONE, model.force.get(s, ZERO)), *pulls[s]])
        for s in q
    }
    of_couples = [(x.couple, x.size.xreplace(at_rest), by_rates(x.factor)) for x in couples]
    damping = {
        s: chained(
            (-ONE, {coordinate_of[u]: slope for u, slope in slopes.items()})
            for slopes in (
                by_rates(f),
                *(chained([(partial(f, c) * size, by)]) for c, size, by in of_couples),
            )
        )
        for s, f in zip(q, model.applied, strict=True)
    }
    for name, rows, unit, about in (
        ("mass_matrix", model.mass_rows, "kg", "mass matrix, M"),
        ("stiffness", stiffness, "N/m", "stiffness K = -d(f - J^T lambda)/dq"),
        ("damping", damping, "N*s/m", "damping C = -df/du"),
    ):
        entries = {(a, b): rows[a][b] for a in q if a in rows for b in q if rows[a].get(b, ZERO) != 0}
        named_entries = [(f"{a.name} {b.name}", e) for (a, b), e in entries.items()]
        named_entries += (more or {}).get(name, ())
        if named_entries:
            yield named(
                model,
                name,
                [e for _, e in named_entries],
                unit,
                about,
                rows=[label for label, _ in named_entries],
            )


def analysis_of(
    model: RodsModel,
    kind: str,
    matrices: Sequence[NamedMatrix],
    exports: Sequence[Export],
    names: Names | None = None,
    sources: Sources = NONE,
    behind: Sequence[Quantity] = (),
) -> System:
    """Return a System of further kernels of a linkage, over the arguments of its equations of motion.

    ``names`` are further intermediates, over those of the model, ``behind`` numbers behind those of ``work``.
    """
    *others, work = groups(model)
    named_definitions = names.definitions if names else ()
    return System(
        name=f"{model.linkage.name}_{kind}",
        title=f"{model.linkage.title}: {kind}",
        groups=(*others, replace(work, quantities=(*work.quantities, *behind))),
        matrices=tuple(matrices),
        exports=tuple(exports),
        definitions=(*definitions(model), *with_ground(model, named_definitions)),
        references=(REFERENCE,),
        sources=sources,
    )


def slopes_by(
    model: RodsModel, arguments: Sequence[sp.Symbol], through: Sequence[Definition] | None = None
) -> Callable[[sp.Expr], Gradient]:
    """Return a function that gives the nonzero partial derivatives of an expression by arguments of kernels.

    The expression must have been derived before: it may use only definitions that the model has by now.
    ``through`` are these with changes, such as the motion of the ground substituted; those of the model
    itself when absent.
    """
    known: dict[sp.Symbol, Gradient] = {x: {x: ONE} for x in arguments}

    def gradient(expression: sp.Expr) -> Gradient:
        inside = sorted(expression.free_symbols & known.keys(), key=lambda s: str(s.name))
        return chained((partial(expression, s), known[s]) for s in inside)

    _ = (
        model.force,
        model.jacobian,
        model.acceleration_rhs,
    )  # definitions added for them are needed below
    for definition in model.calculus.definitions if through is None else through:
        slopes = gradient(definition.expression)
        if slopes:
            known[definition.quantity.symbol] = slopes
    return gradient
