"""The start of a motion: where it is drawn, and the conditions it must be brought to meet."""

from __future__ import annotations

from typing import TYPE_CHECKING

import sympy as sp

from symgen.errors import SceneError
from symgen.mechanics.particles import dot
from symgen.scene.linkage import TIME, Rod
from symgen.symbolic.calculus import ZERO
from symgen.symbolic.system import Export, NamedMatrix

if TYPE_CHECKING:
    from symgen.models.rods import RodsModel


def start_exports(model: RodsModel) -> tuple[list[NamedMatrix], list[Export]]:
    """Return the matrices and kernels of the start.

    ``drawn`` always; ``assembly`` when lengths or angles differ from the drawing: its argument t runs from
    0, the drawing, to 1, the start, so that the linkage is led there on its own branch; ``start_velocity``
    when rates or velocities are given: rows K u = k.
    """
    linkage = model.linkage
    drawn = [c for p in model.moving for c in linkage.point(p).at]
    names = [x.name for p in model.moving for x in model.q[p]]
    matrices = [model.matrix("drawn", drawn, "m", "coordinates as drawn", rows=names)]
    exports = [Export("drawn", "coordinates as drawn", ("drawn",))]
    start = linkage.start
    if start.angles or not all(r.as_drawn for r in model.rods):
        matrices += _assembly(model, names)
        exports.append(
            Export(
                "assembly",
                "residual and Jacobian of the start's positions; t goes from 0 (drawn) to 1 (start)",
                ("assembly_residual", "assembly_jacobian"),
            )
        )
    if start.rates or start.velocities:
        matrices += _velocity(model, names)
        exports += [
            Export(
                "start_velocity", "rows K u = k of the start's velocities", ("start_rates", "start_jacobian")
            ),
            Export("mass_matrix", "mass matrix", ("mass_matrix",)),
        ]
    return matrices, exports


def _drawn_along(model: RodsModel, rod: Rod) -> list[sp.Expr]:
    start, end = (model.linkage.point(p).at for p in (rod.start, rod.end))
    return [b - a for a, b in zip(start, end, strict=True)]


def _assembly(model: RodsModel, names: list[str]) -> list[NamedMatrix]:
    s = TIME.symbol
    residuals, rows = [], []
    for rod in model.rods:
        drawn = _drawn_along(model, rod)
        length = sp.sqrt(dot(tuple(drawn), tuple(drawn)))
        length += s * (rod.length - length)
        along = model.along[rod.name]
        residuals.append((dot(along, along) - length**2) / (2 * rod.length))
        rows.append(rod.name)
    for name, angle in model.linkage.start.angles:
        rod = _moving_rod(model, name, "angles")
        dx, dy = _drawn_along(model, rod)
        drawn_angle = sp.atan2(dy, dx)
        turn = sp.atan2(sp.sin(angle - drawn_angle), sp.cos(angle - drawn_angle))
        now = drawn_angle + s * turn
        x, y = model.along[name]
        residuals.append(y * sp.cos(now) - x * sp.sin(now))
        rows.append(f"{name} angle")
    gradients = [model.calculus.gradient(r) for r in residuals]
    coordinates = [x.symbol for p in model.moving for x in model.q[p]]
    return [
        model.matrix("assembly_residual", residuals, "m", "what is missing at the start", rows=rows),
        model.matrix(
            "assembly_jacobian",
            [g.get(q, ZERO) for g in gradients for q in coordinates],
            "1",
            "derivative of the assembly residual",
            rows=rows,
            columns=names,
        ),
    ]


def _velocity(model: RodsModel, names: list[str]) -> list[NamedMatrix]:
    rows: list[str] = []
    wanted: list[sp.Expr] = []
    gradients: list[dict[sp.Symbol, sp.Expr]] = []
    for name, rate in model.linkage.start.rates:
        rod = _moving_rod(model, name, "rates")
        dx, dy = model.along[name]
        gx, gy = (model.calculus.gradient(c) for c in (dx, dy))
        rows.append(f"{name} rate")
        wanted.append(rate * rod.length)
        gradients.append(
            {q: (dx * gy.get(q, ZERO) - dy * gx.get(q, ZERO)) / rod.length for q in {**gx, **gy}}
        )
    for name, velocity in model.linkage.start.velocities:
        rows.extend(f"{name} velocity {axis}" for axis in model.axes)
        wanted.extend(velocity)
        gradients.extend({q: sp.Integer(1)} for q in model.symbols(model.q[name]))
    coordinates = [x.symbol for p in model.moving for x in model.q[p]]
    return [
        model.matrix("start_rates", wanted, "m/s", "velocities asked for at the start, k", rows=rows),
        model.matrix(
            "start_jacobian",
            [g.get(q, ZERO) for g in gradients for q in coordinates],
            "1",
            "their derivative by the velocities, K",
            rows=rows,
            columns=names,
        ),
    ]


def _moving_rod(model: RodsModel, name: str, table: str) -> Rod:
    rod = model.rod(name)
    if rod is None:
        raise SceneError(
            f"{name} lies between two ground points and cannot turn", where=f"start.{table}.{name}"
        )
    return rod
