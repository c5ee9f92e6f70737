"""Gradients of weighted sums of expressions through named quantities: reverse mode."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from symgen.symbolic.calculus import partial
from symgen.symbolic.quantity import Quantity, quantity
from symgen.symbolic.system import Definition


class Gradients:
    """Gradients by ``given`` quantities, and ``definitions`` of the adjoints of those between."""

    def __init__(self, given: Sequence[Quantity], definitions: Sequence[Definition]) -> None:
        self._given, self._through = tuple(given), tuple(definitions)
        self.definitions: list[Definition] = []

    def of(self, name: str, expressions: Sequence[sp.Expr], weights: Sequence[sp.Expr]) -> dict[str, sp.Expr]:
        """Return the gradient of the sum of expressions times weights, by the name of each given quantity.

        ``name`` distinguishes the adjoints of this sum from those of others.
        """
        terms: dict[sp.Symbol, list[sp.Expr]] = {
            x.symbol: [] for x in (*self._given, *(d.quantity for d in self._through))
        }

        def add(expression: sp.Expr, weight: sp.Expr) -> None:
            for s in sorted(expression.free_symbols & terms.keys(), key=lambda s: str(s.name)):
                terms[s].append(partial(expression, s) * weight)

        for expression, weight in zip(map(sp.sympify, expressions), weights, strict=True):
            add(expression, weight)
        for definition in reversed(self._through):
            own = definition.quantity
            adjoint = sp.Add(*terms[own.symbol])
            if adjoint == 0:
                continue
            if not (adjoint.is_Atom or (-adjoint).is_Atom):
                made = quantity(f"{own.name}_adjoint_{name}", "SI", f"adjoint of {own.description}")
                self.definitions.append(Definition(made, adjoint))
                adjoint = made.symbol
            add(definition.expression, adjoint)
        return {x.name: sp.Add(*terms[x.symbol]) for x in self._given}
