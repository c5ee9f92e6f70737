"""Numbers in place of symbols, as if they had been there from the start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp


class Substitution:
    """Replaces symbols by values; every subexpression is treated once."""

    def __init__(self, values: Mapping[sp.Symbol, sp.Expr]) -> None:
        #: Replaced expressions, to which callers may add.
        self.values: dict[sp.Basic, sp.Expr] = dict(values)

    def __call__(self, expression: sp.Expr) -> sp.Expr:
        """Return an expression with the values."""
        if not expression.args:
            return self.values.get(expression, expression)
        if expression not in self.values:
            parts = [self(part) for part in expression.args]
            same = all(a == b for a, b in zip(expression.args, parts, strict=True))
            self.values[expression] = expression if same else _made(expression, parts)
        return self.values[expression]


def _made(expression: sp.Expr, parts: Sequence[sp.Expr]) -> sp.Expr:
    """Return an expression of new parts, a number in a product multiplied into a sum x + number.

    SymPy does that where both meet alone. Products with the same sum then share it.
    """
    made = expression.func(*parts)
    if not made.is_Mul:
        return made
    number, *others = made.args
    sums = [f for f in others if f.is_Add and len(f.args) == 2 and f.args[0].is_number]
    if len(others) < 2 or len(sums) != 1 or not number.is_Rational or abs(number) == 1:
        return made
    multiplied = sp.Add(*(abs(number) * term for term in sums[0].args))
    return sp.Mul(sp.sign(number), *(multiplied if f is sums[0] else f for f in others))
