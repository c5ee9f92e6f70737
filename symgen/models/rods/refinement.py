"""Residual of the equations of motion, for scenes whose pivots differ so much that solutions are refined."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import sympy as sp

from symgen.models.rods.matrix import named
from symgen.symbolic.system import Export, NamedMatrix

if TYPE_CHECKING:
    from symgen.models.rods.linkage import RodsModel

#: Masses that differ by more than this, or lengths by more than its square root, lose digits.
SPREAD = 1e6


def refinement(
    model: RodsModel, masses: Sequence[float] | None = None
) -> tuple[list[NamedMatrix], list[Export]]:
    """Return matrix and kernel ``residual`` of [M J^T; J 0] [a; lambda] = [f; gamma], if they are needed.

    The masses and lengths are those of the scene: tunable parameters at their defaults. ``masses`` are those
    on the diagonal of a mass matrix that depends on the coordinates, at the start.
    """
    if not _spread(model, masses):
        return [], []
    about = "residual of the equations of motion for the accelerations and multipliers in work"
    rows = [x.name for x in model.coordinates] + [c.name for c in model.constraints]
    matrix = named(model, "residual", residual(model), "N, m^2/s^2", about, rows=rows)
    return [matrix], [Export("residual", about, ("residual",))]


def residual(model: RodsModel) -> list[sp.Expr]:
    """Return f - M a - J^T lambda, then gamma - J a, over the accelerations and multipliers in ``work``."""
    q = [x.symbol for x in model.coordinates]
    above = [f - sp.Add(*model.constraint_forces(s)) for s, f in zip(q, model.balance, strict=True)]
    rows = zip(model.acceleration_rhs, model.jacobian, strict=True)
    acceleration_of = model.acceleration_of
    return above + [
        gamma - sp.Add(*(row[s] * acceleration_of[s] for s in q if s in row)) for gamma, row in rows
    ]


def _spread(model: RodsModel, masses: Sequence[float] | None) -> bool:
    number, free = model.linkage.number, {x.symbol for x in model.coordinates}
    if masses is None:
        masses = [abs(number(e)) for (i, j), e in model.mass_entries.items() if i == j and i in free]
    lengths = [number(k.length) for k in model.rods]
    return _ratio(masses) > SPREAD or _ratio(lengths) > SPREAD**0.5


def _ratio(values: Sequence[float]) -> float:
    positive = [v for v in values if v > 0]
    return max(positive) / min(positive) if positive else 1.0
