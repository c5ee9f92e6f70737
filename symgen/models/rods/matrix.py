"""Matrices of a linkage with the prescribed motion of the ground substituted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import sympy as sp

from symgen.symbolic.system import NamedMatrix

if TYPE_CHECKING:
    from symgen.models.rods.linkage import RodsModel


def named(
    model: RodsModel,
    name: str,
    entries: Sequence[sp.Expr],
    unit: str,
    description: str,
    *,
    rows: Sequence[str] = (),
    columns: Sequence[str] = (),
    symmetric: bool = False,
) -> NamedMatrix:
    """Return a NamedMatrix with the motion of the ground substituted; ``entries`` row by row."""
    width = max(1, len(columns))
    filled = [e if e.is_Number else e.xreplace(model.held) for e in entries]
    matrix = sp.ImmutableMatrix(len(entries) // width, width, filled)
    return NamedMatrix(name, matrix, unit, description, tuple(rows), tuple(columns), symmetric)
