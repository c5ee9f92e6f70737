"""Jacobian of the equations of motion with respect to the state, for implicit integrators.

With the residual R = [f - M a - J^T lambda; gamma - J a] at fixed a and lambda, the accelerations and
multipliers that solve the equations of motion change with the state as

    [M J^T; J 0] d[a; lambda]/dq = dR/dq   and   [M J^T; J 0] d[a; lambda]/du = dR/du,

with the same matrix on the left that the kernels 'factor' and 'solve' have.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import sympy as sp

from symgen.models.general.equations import equations_of
from symgen.models.rods.linearised import analysis_of, slopes_by, stiffness_row
from symgen.models.rods.linkage import Gradient, RodsModel
from symgen.models.rods.matrix import named
from symgen.symbolic.calculus import ONE, chained
from symgen.symbolic.system import Export, System

if TYPE_CHECKING:
    from symgen.scene.rods.linkage import Linkage


def tangent_system(linkage: Linkage) -> System:
    """Return the System of the Jacobian: one kernel, ``tangent``, which reads a and lambda from ``work``.

    Its matrices ``by_positions`` dR/dq and ``by_rates`` dR/du are lists of their nonzero entries, each called
    by the unknown of its row and the coordinate or rate of its column, ``A_a_x B_y``; one that is all zero is
    omitted.
    """
    model = equations_of(linkage)
    positions = [x.symbol for x in model.coordinates]
    rates = [x.symbol for p in model.free for x in model.u[p]]
    matrices = []
    for name, rows, columns, unit, about in (
        ("by_positions", _by_positions(model), positions, "N/m, m/s^2", "slope of the residual by q"),
        ("by_rates", _by_rates(model), rates, "N*s/m, m/s", "slope of the residual by u"),
    ):
        entries = {
            f"{row} {column.name}": slopes[column]
            for row, slopes in zip(_unknowns(model), rows, strict=True)
            for column in columns
            if column in slopes
        }
        if entries:
            matrices.append(named(model, name, list(entries.values()), unit, about, rows=list(entries)))
    about = "slope of f - M a - J^T lambda and of gamma - J a by the state, at the a and lambda in work"
    export = Export("tangent", about, tuple(m.name for m in matrices))
    return analysis_of(model, "tangent", matrices, [export])


def _unknowns(model: RodsModel) -> list[str]:
    accelerations = [x for p in model.free for x in model.a[p]]
    return [x.name for x in (*accelerations, *model.multipliers.values())]


def _by_positions(model: RodsModel) -> list[Gradient]:
    """Return the rows of dR/dq: minus the stiffness, then the slopes of gamma - J a."""
    gradient, acceleration_of = model.calculus.gradient, model.acceleration_of
    forces = []
    for x in model.coordinates:
        inertia = (
            (-acceleration_of[y], gradient(m))
            for y, m in model.mass_rows.get(x.symbol, {}).items()
            if not m.is_number
        )
        forces.append(chained([(-ONE, stiffness_row(model, x.symbol, model.constraints)), *inertia]))
    bound = []
    for gamma, row in zip(model.acceleration_rhs, model.jacobian, strict=True):
        moved = (
            (-acceleration_of[x.symbol], gradient(row[x.symbol]))
            for x in model.coordinates
            if x.symbol in row
        )
        bound.append(chained([(ONE, gradient(gamma)), *moved]))
    return [*forces, *bound]


def _by_rates(model: RodsModel) -> list[Gradient]:
    """Return the rows of dR/du: the slopes of f and of gamma."""
    rates: Sequence[sp.Symbol] = [x.symbol for p in model.free for x in model.u[p]]
    right = [*model.applied, *model.acceleration_rhs]
    by_rates = slopes_by(model, rates)
    return [by_rates(expression) for expression in right]
