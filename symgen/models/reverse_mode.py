"""Gradients of weighted sums of expressions through named quantities: reverse mode."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from symgen.symbolic.calculus import partial
from symgen.symbolic.quantity import Quantity, quantity
from symgen.symbolic.system import Definition


class Gradients:
    """Gradients by ``given`` quantities, and ``definitions`` of the adjoints of those between."""

    def __init__(self, inputs: Sequence[Quantity], definitions: Sequence[Definition]) -> None:
        self._inputs, self._through = tuple(inputs), tuple(definitions)
        self.definitions: list[Definition] = []

    def of(self, name: str, expressions: Sequence[sp.Expr], weights: Sequence[sp.Expr]) -> dict[str, sp.Expr]:
        """Return the gradient of the sum of expressions times weights, by the name of each given quantity.

        ``name`` distinguishes the adjoints of this sum from those of others.
        """
        terms: dict[sp.Symbol, list[sp.Expr]] = {
            x.symbol: [] for x in (*self._inputs, *(d.quantity for d in self._through))
        }

        def add(expression: sp.Expr, weight: sp.Expr) -> None:
            for s in sorted(expression.free_symbols & terms.keys(), key=lambda s: str(s.name)):
                terms[s].append(partial(expression, s) * weight)

        for expression, weight in zip(map(sp.sympify, expressions), weights, strict=True):
            add(expression, weight)
        for definition in reversed(self._through):
            value = definition.quantity
            adjoint = sp.Add(*terms[value.symbol])
            if adjoint == 0:
                continue
            if not (adjoint.is_Atom or (-adjoint).is_Atom):
                adjoint_quantity = quantity(
                    f"{value.name}_adjoint_{name}", "SI", f"adjoint of {value.description}"
                )
                self.definitions.append(Definition(adjoint_quantity, adjoint))
                adjoint = adjoint_quantity.symbol
            add(definition.expression, adjoint)
        return {x.name: sp.Add(*terms[x.symbol]) for x in self._inputs}
