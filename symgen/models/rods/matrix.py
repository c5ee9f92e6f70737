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
    filled: dict[int, dict[int, sp.Expr]] = {}
    for place, e in enumerate(entries):
        if (value := model.in_place(e)) != 0:
            filled.setdefault(place // width, {})[place % width] = value
    matrix = _filled(filled, len(entries) // width, width)
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
        replaced = {j: model.in_place(e) for j, e in within}
        nonzero = {j: e for j, e in replaced.items() if e != 0}
        if nonzero:
            filled[i] = nonzero
    matrix = _filled(filled, len(entries), len(columns))
    names = tuple(x.name for x in model.coordinates)
    return NamedMatrix(name, matrix, unit, description, tuple(rows), names, symmetric)


def _filled(entries: dict[int, dict[int, sp.Expr]], rows: int, columns: int) -> sp.ImmutableMatrix:
    """Return a matrix of its nonzero entries by row: SymPy's constructor looks for a domain of all."""
    return sp.ImmutableMatrix._fromrep(DomainMatrix(entries, (rows, columns), sp.EXRAW))
