"""Start of a motion: the drawn pose, and the conditions for the start."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import sympy as sp

from symgen.loads.measure import Gradient
from symgen.models.rods.drives import angle_drive
from symgen.models.rods.drives.motion import gap
from symgen.models.rods.matrix import named, sparse
from symgen.scene.rods.linkage import TIME
from symgen.scene.rods.rotations import Driver
from symgen.symbolic.calculus import ONE, ZERO
from symgen.symbolic.constants import rounded
from symgen.symbolic.system import Export, NamedMatrix
from symgen.symbolic.vectors import cross, dot

if TYPE_CHECKING:
    from symgen.models.rods.linkage import RodsModel


def start_exports(model: RodsModel) -> tuple[list[NamedMatrix], list[Export]]:
    """Return the matrices and kernels of the start.

    ``drawn`` always; ``assembly`` when the constraints or the start's angles may differ from the drawing: its
    argument u[0] runs from 0, the drawing, to 1, the start, and moves the linkage there on its own branch;
    ``start_velocity`` when rates or velocities are prescribed: rows K u = k; ``mass_matrix`` when the
    velocities may be nonzero, with ``start_momentum`` where the ground moves.
    """
    matrices, exports = assembly_exports(model)
    start = model.linkage.start
    if start.rates or start.velocities or model.linkage.states:
        matrices += _velocity(model)
        about = "rows K u = k of the start's velocities"
        exports.append(Export("start_velocity", about, ("start_rates", "start_jacobian")))
    if start.rates or start.velocities or model.linkage.states or _driven(model):
        exports.append(Export("mass_matrix", "mass matrix", ("mass_matrix",)))
        if any(model.start_momentum):
            names = [x.name for x in model.coordinates]
            about = "momentum of the free points by the velocity of the ground alone"
            matrices.append(named(model, "start_momentum", model.start_momentum, "kg*m/s", about, rows=names))
            exports.append(Export("start_momentum", about, ("start_momentum",)))
    return matrices, exports


def assembly_exports(model: RodsModel) -> tuple[list[NamedMatrix], list[Export]]:
    """Return the matrices and kernels of the pose at the start: ``drawn`` and ``assembly``."""
    linkage = model.linkage
    drawn = [*(c for p in model.moving for c in linkage.point(p).at), *(ZERO for _ in linkage.states)]
    names = [x.name for x in model.coordinates]
    matrices = [named(model, "drawn", drawn, "m", "coordinates as drawn", rows=names)]
    exports = [Export("drawn", "coordinates as drawn", ("drawn",))]
    start = linkage.start
    bound = any((linkage.guides, linkage.drivers, linkage.motions, model.shared))
    bound = bound or not all(k.as_drawn for k in model.rods)
    if start.angles or bound or (model.constraints and _displaced(model)):
        matrices += _assembly(model)
        about = "residual and Jacobian of the start's positions; u[0] goes from 0 (drawn) to 1 (start)"
        exports.append(Export("assembly", about, ("assembly_residual", "assembly_jacobian")))
        metric = metric_of(model)
        matrices += metric
        exports += [Export("metric", m.description, (m.name,)) for m in metric]
    return matrices, exports


def metric_of(model: RodsModel) -> list[NamedMatrix]:
    """Return the metric of small motions where it is not the identity: where points have no coordinates.

    It is the square of small motions of all points, and the mean of bodies in space, and does not depend on
    the points that place the others.
    """
    if not (model.carrier or model.linkage.bodies):
        return []
    states = (q.symbol for s in model.linkage.states for q in model.q[s.name])
    rows: dict[sp.Symbol, Gradient] = {q: {q: ONE} for q in states}

    def add(weight: sp.Expr, first: str, second: str) -> None:
        for c, d in zip(model.position(first), model.position(second), strict=True):
            for x, slope_x in model.calculus.gradient(c).items():
                for y, slope_y in model.calculus.gradient(d).items():
                    row = rows.setdefault(x, {})
                    row[y] = row.get(y, ZERO) + weight * slope_x * slope_y

    of_bodies = {p for body in model.linkage.bodies for p in body.base}
    for point in model.linkage.points:
        if not (point.hidden and point.name in of_bodies):
            add(ONE, point.name, point.name)
    for body in model.linkage.bodies:
        for i, first in enumerate(body.base):
            for k, second in enumerate(body.base):
                add(body.masses[i][k] / body.mass, first, second)
    of_coordinates = [rows.get(x.symbol, {}) for x in model.coordinates]
    about, names = "metric of small motions", [x.name for x in model.coordinates]
    return [sparse(model, "metric", of_coordinates, "1", about, rows=names, symmetric=True)]


def _displaced(model: RodsModel) -> bool:
    """Return whether some ground point differs from its drawn position at the start."""
    return any(c.xreplace({TIME.symbol: ZERO}) != 0 for p in model.ground for c in model.shift(p))


def _driven(model: RodsModel) -> bool:
    """Return whether the constraints or the ground depend on time."""
    t = TIME.symbol
    moving = any(t in c.free_symbols for p in model.ground for c in model.linkage.point(p).motion)
    return moving or any(t in c.expression.free_symbols for c in model.constraints)


def _assembly(model: RodsModel) -> list[NamedMatrix]:
    """Move every constraint from its drawn value to zero, and every angle to its value at the start."""
    s = model.u[model.free[0]][0].symbol
    _ = model.along, model.constraints  # their definitions must be known in the drawn pose
    drawn, constants = _as_drawn(model), model.linkage.constants
    angles = [angle_drive(model, Driver(link, angle)) for link, angle in model.linkage.start.angles]
    angles += model.angle_drives
    driven = {d.row for d in angles} | {m.name for m in model.linkage.motions if m.links}
    residuals, rows = [], []
    for constraint in model.constraints:
        if constraint.name not in driven:
            error = constraint.expression / constraint.scale
            residuals.append(error - (1 - s) * error.xreplace(drawn))
            rows.append(constraint.name)
    for angled in angles:
        (x, y), angle = angled.components, angled.value
        drawn_x, drawn_y = _direction(*(_written(c.xreplace(drawn).xreplace(constants)) for c in (x, y)))
        c, d = sp.cos(angle), sp.sin(angle)
        turn = _angle(c * drawn_x + d * drawn_y, d * drawn_x - c * drawn_y)
        now = _angle(drawn_x, drawn_y) + s * turn
        residuals.append(y * sp.cos(now) - x * sp.sin(now))
        rows.append(f"{' against '.join(angled.driver.links)} angle")
    for motion in (m for m in model.linkage.motions if m.links):
        off, size = gap(model.loads, motion)
        drawn_off = _written(off.xreplace(drawn).xreplace(constants))
        residuals.append(size * sp.sin(off - (1 - s) * _angle(sp.cos(drawn_off), sp.sin(drawn_off))))
        rows.append(motion.name)
    for part in _floating(model):
        for axis, places in zip(model.axes, zip(*map(model.position, part), strict=True), strict=True):
            mean = sp.Add(*places) / len(part)
            residuals.append(mean - mean.xreplace(drawn))
            rows.append(f"the place of the part of {part[0]} along {axis}")
    gradients = [model.calculus.gradient(r) for r in residuals]
    about = "derivative of the assembly residual"
    return [
        named(model, "assembly_residual", residuals, "m", "error at the start", rows=rows),
        sparse(model, "assembly_jacobian", gradients, "1", about, rows=rows),
    ]


def _written(value: sp.Expr) -> sp.Expr:
    """Return a number as a fraction of 60 digits: SymPy takes minutes for functions of roots and sines."""
    return value if value.free_symbols else sp.Rational(str(rounded(value, 60)))


def _direction(x: sp.Expr, y: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Return a vector in the plane; along an axis, the unit vector."""
    size = abs(x + y) if ZERO in (x, y) and (x + y).is_Rational else ONE
    return x / size, y / size


def _angle(x: sp.Expr, y: sp.Expr) -> sp.Expr:
    """Return the angle of a vector [rad]; it is evaluated only along the axes: SymPy takes long."""
    return sp.atan2(y, x, evaluate=ZERO in (x, y))


def _floating(model: RodsModel) -> Iterator[list[str]]:
    """Yield the points of every part without constraint to the ground.

    Together they stay where they are drawn: of one of them this would depend on the order of the scene.
    """
    owner = {x.symbol: point for point, group in model.q.items() for x in group}
    tied = {point: {point} for point in model.q}
    for constraint in model.constraints:
        together = set[str]().union(*(tied[owner[q]] for q in model.calculus.gradient(constraint.expression)))
        tied.update(dict.fromkeys(together, together))
    parts: dict[frozenset[str], list[str]] = {}
    for point in model.linkage.points:
        if not point.hidden:
            part = set[str]().union(*(tied[p] for p in model.supports(point.name)))
            parts.setdefault(frozenset(part), []).append(point.name)
    yield from (points for part, points in parts.items() if not part.intersection(model.ground))


def _as_drawn(model: RodsModel) -> dict[sp.Symbol, sp.Expr]:
    """Return the value of every coordinate and shared subexpression in the drawn pose.

    Ground points are at their start positions.
    """
    values: dict[sp.Symbol, sp.Expr] = {TIME.symbol: ZERO}
    values |= {q.symbol: ZERO for s in model.linkage.states for q in model.q[s.name]}
    for point in (*model.moving, *model.ground):
        group = model.q[point]
        place = model.linkage.point(point)
        there = (c.xreplace(values) for c in place.motion) if point in model.ground else place.at
        values.update(zip(model.symbols(group), there, strict=True))
    for definition in model.calculus.definitions:
        values[definition.quantity.symbol] = definition.expression.xreplace(values)
    return values


def _velocity(model: RodsModel) -> list[NamedMatrix]:
    rows: list[str] = []
    targets: list[sp.Expr] = []
    gradients: list[dict[sp.Symbol, sp.Expr]] = []
    for name, rate in model.linkage.start.rates:
        if len(rate) == 1:
            length = model.linkage.link(name).length
            turning, _ = model.turning(name)
            rows.append(f"{name} rate")
            targets.append(rate[0] * length)
            gradients.append({q: slope * length for q, slope in turning.items()})
            continue
        body = model.linkage.body(name)
        for edge in model.loads.edges(body) if body else [model.along[name]]:
            rows.extend(f"{name} rate {axis}" for axis in model.axes)
            targets.extend(cross(rate, edge))
            gradients.extend(model.calculus.gradient(c) for c in edge)
        if not body:  # a line has no spin of its own: such a part of its rate cannot be met
            edge, hinge = model.along[name], model.hinges.get(name)
            spin = dot(rate, edge) - (dot(rate, hinge.axis) * dot(hinge.axis, edge) if hinge else 0)
            rows.append(f"{name} rate {'off its axis' if hinge else 'along it'}")
            targets.append(spin)
            gradients.append({})
    for name, velocity in model.linkage.start.velocities:
        rows.extend(f"{name} velocity {axis}" for axis in model.axes)
        targets.extend(velocity)
        gradients.extend(model.calculus.gradient(c) for c in model.position(name))
    for state in model.linkage.states:
        rows.append(f"{state.name} state")
        targets.append(state.start)
        gradients.append({model.q[state.name][0].symbol: ONE})
    ground = [pair for p in model.ground for pair in zip(model.q[p], model.u[p], strict=True)]
    for i, row in enumerate(gradients):
        targets[i] -= sp.Add(*(row[q.symbol] * u.symbol for q, u in ground if q.symbol in row))
    about = "their derivative by the velocities, K"
    return [
        named(model, "start_rates", targets, "m/s", "prescribed initial velocities, k", rows=rows),
        sparse(model, "start_jacobian", gradients, "1", about, rows=rows),
    ]
