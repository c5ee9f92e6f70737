"""Matrices of a linkage with the prescribed motion of the ground substituted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import sympy as sp
from sympy.polys.matrices import DomainMatrix

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


def sparse(
    model: RodsModel,
    name: str,
    entries: Sequence[Mapping[sp.Symbol, sp.Expr]],
    unit: str,
    description: str,
    *,
    rows: Sequence[str],
    symmetric: bool = False,
) -> NamedMatrix:
    """Return a matrix over the coordinates, like :func:`named`; ``entries`` has the nonzero ones by row."""
    columns = {x.symbol: i for i, x in enumerate(model.coordinates)}
    filled: dict[int, dict[int, sp.Expr]] = {}
    for i, row in enumerate(entries):
        within = sorted((columns[q], e) for q, e in row.items() if q in columns)
        replaced = {j: e if e.is_Number else e.xreplace(model.held) for j, e in within}
        nonzero = {j: e for j, e in replaced.items() if e != 0}
        if nonzero:
            filled[i] = nonzero
    shape = len(entries), len(columns)
    matrix = DomainMatrix(filled, shape, sp.EXRAW).to_Matrix().as_immutable()
    names = tuple(x.name for x in model.coordinates)
    return NamedMatrix(name, matrix, unit, description, tuple(rows), names, symmetric)
