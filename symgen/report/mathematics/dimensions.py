"""Units of entries by their dimension, where a matrix lists the units of all its entries."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from fractions import Fraction

import sympy as sp

from symgen.symbolic.quantity import Quantity
from symgen.symbolic.system import NamedMatrix

#: Powers of kg, m and s.
Dimension = tuple[Fraction, ...]
_NONE: Dimension = (Fraction(0),) * 3
_UNITS = {
    "1": (0, 0, 0), "rad": (0, 0, 0), "kg": (1, 0, 0), "m": (0, 1, 0), "s": (0, 0, 1), "N": (1, 1, -2),
    "J": (1, 2, -2), "W": (1, 2, -3), "Pa": (1, -1, -2),
}  # fmt: skip
_FACTOR = re.compile(r"([*/]?)(\w+)(?:\^(\d+))?")


def in_own_units(m: NamedMatrix, quantities: Iterable[Quantity]) -> NamedMatrix:
    """Return a matrix with those of its units that its entries have, by the units of their symbols.

    A list with one unit per row or entry stays, as do units of entries whose dimension is not known.
    """
    units = m.unit.split(", ")
    if len(units) in (1, m.matrix.rows, len(m.matrix)) or "; " in m.unit:
        return m
    known = {q.symbol: _of_unit(q.unit) for q in quantities}
    by_dimension = {_of_unit(unit): unit for unit in units}
    found = {by_dimension.get(_of(e, known)) for e in m.matrix if e != 0}
    if None in found or None in by_dimension or not found:
        return m
    return replace(m, unit=", ".join(unit for unit in units if unit in found))


def _of_unit(unit: str) -> Dimension | None:
    """Return the dimension of a unit such as ``kg*m^2/s``; None of others."""
    total = _NONE
    for sign, name, power in _FACTOR.findall(unit):
        if name not in _UNITS:
            return None
        exponent = int(power or 1) * (-1 if sign == "/" else 1)
        total = tuple(a + exponent * b for a, b in zip(total, _UNITS[name], strict=True))
    return total if _FACTOR.sub("", unit) == "" else None


def _of(e: sp.Basic, known: Mapping[sp.Basic, Dimension | None]) -> Dimension | None:
    """Return the dimension of an expression; None where that of a symbol is not known."""
    if e.is_Symbol:
        return known.get(e)
    if isinstance(e, sp.Add | sp.Max | sp.Min):
        return _of(next((x for x in e.args if not x.is_number), e.args[0]), known)
    if isinstance(e, sp.Abs):
        return _of(e.args[0], known)
    if isinstance(e, sp.Piecewise):
        return _of(next((x for x, _ in e.args if not x.is_number), sp.S.One), known)
    if e.is_Pow and e.exp.is_Rational:
        base, power = _of(e.base, known), Fraction(int(e.exp.p), int(e.exp.q))
        return base and tuple(power * x for x in base)
    if e.is_Mul:
        factors = [_of(x, known) for x in e.args]
        return None if None in factors else tuple(map(sum, zip(*factors, strict=True)))  # type: ignore[arg-type]
    return _NONE
