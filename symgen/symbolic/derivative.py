"""Matrices differentiated with respect to one argument, through the shared terms, which keep their names."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import sympy as sp

from symgen.errors import DerivationError, nearest
from symgen.symbolic.calculus import partial
from symgen.symbolic.quantity import quantity
from symgen.symbolic.system import NO_SOURCE, Definition, NamedMatrix, System


def derivative(system: System, matrices: Iterable[NamedMatrix], name: str) -> System:
    """Return a System of the partial derivatives of matrices with respect to one argument.

    Parameters
    ----------
    system
        System of the matrices.
    matrices
        Matrices to differentiate; ``M`` gives ``M_by_NAME``.
    name
        A tunable parameter, or another argument of the kernels.

    Raises
    ------
    DerivationError
        When there is no such argument.
    """
    known = {x.name: x for x in system.symbols()}
    if name not in known:
        raise DerivationError(
            f"{system.name} has no argument {name!r} to differentiate by. {nearest(name, known)}\n"
            "  Arguments are its parameters, letters and state: symgen show lists them."
        )
    by = known[name]
    slopes: dict[sp.Symbol, sp.Expr] = {by.symbol: sp.Integer(1)}
    for constant in system.constants:
        slope = _through(constant.expression, slopes)
        if slope != 0:
            slopes[constant.quantity.symbol] = slope
    derivatives: list[Definition] = []
    for definition in system.definitions:
        symbol = definition.quantity
        slope = _through(definition.expression, slopes)
        if not (slope.is_Atom or (-slope).is_Atom):
            unit, about = _per(symbol.unit, by.unit), f"derivative by {name}: {symbol.description}"
            named = quantity(f"{symbol.name}_by_{name}", unit, about)
            derivatives.append(Definition(named, slope))
            slope = named.symbol
        if slope != 0:
            slopes[symbol.symbol] = slope
    by_name = tuple(
        replace(
            m,
            name=f"{m.name}_by_{name}",
            matrix=m.matrix.applyfunc(lambda e: _through(e, slopes)),
            left=None,
            unit=_per(m.unit, by.unit),
            description=f"derivative by {name} of: {m.description}",
            source=NO_SOURCE if m.source else "",
        )
        for m in matrices
    )
    definitions = (*system.definitions, *derivatives)
    return replace(
        system, matrices=by_name, exports=(), definitions=definitions, saddle_point=None, residual=""
    )


def _through(expression: sp.Expr, slopes: dict[sp.Symbol, sp.Expr]) -> sp.Expr:
    """Return the derivative of an expression by the chain rule."""
    there = sorted(expression.free_symbols & slopes.keys(), key=lambda s: str(s.name))
    return sp.Add(*(partial(expression, s) * slopes[s] for s in there))


def _per(unit: str, by: str) -> str:
    """Return the quotient of two units; of a list of units, the list; factors behind a semicolon stay."""
    if by == "1":
        return unit
    below = f"({by})" if set(by) & set("*/") else by
    units, *factors = unit.partition(";")
    return ", ".join(f"{u}/{below}" for u in units.split(", ")) + "".join(factors)
