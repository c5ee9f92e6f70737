"""Named intermediate expressions, which keep a derivation from growing by expansion."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import sympy as sp

from symgen.errors import DerivationError
from symgen.symbolic.dual import DualVector
from symgen.symbolic.quantity import AXES, Quantity, quantity
from symgen.symbolic.system import Definition


class Names:
    """Collector of the intermediates of a derivation; equal expressions have one name.

    Parameters
    ----------
    taken
        Names of other quantities: an intermediate with the same name gets a suffix.
    """

    def __init__(self, taken: Iterable[str] = ()) -> None:
        self._taken = frozenset(taken)
        self._known: dict[sp.Expr, sp.Symbol] = {}
        self._definitions: dict[str, Definition] = {}

    @property
    def definitions(self) -> tuple[Definition, ...]:
        """All definitions, each after those it uses."""
        return tuple(self._definitions.values())

    def scalar(self, name: str, expression: sp.Expr, unit: str, meaning: str) -> sp.Expr:
        """Name an expression; numbers, symbols and their negatives are returned unchanged."""
        expression = sp.sympify(expression)
        if expression.is_number or expression.is_Atom or (-expression).is_Atom:
            return expression
        for known, sign in ((expression, 1), (-expression, -1)):
            if known in self._known:
                return sign * self._known[known]
        while name in self._taken:
            name += "_"
        if name in self._definitions:
            raise DerivationError(f"the name {name!r} is used twice: rename one of its quantities")
        new = quantity(name, unit, meaning)
        self._definitions[name] = Definition(new, expression)
        self._known[expression] = new.symbol
        return new.symbol

    def all(self, new: Sequence[Quantity], expressions: Sequence[sp.Expr]) -> list[sp.Expr]:
        """Name expressions by quantities."""
        pairs = zip(new, expressions, strict=True)
        return [self.scalar(x.name, e, x.unit, x.description) for x, e in pairs]

    def vector(
        self, name: str, expressions: Sequence[sp.Expr], unit: str, meaning: str
    ) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
        """Name the components of a vector in space: ``name_x`` and so on."""
        x, y, z = (
            self.scalar(f"{name}_{a}", e, unit, f"{a} component of {meaning}")
            for a, e in zip(AXES, expressions, strict=True)
        )
        return x, y, z

    def screw(
        self, name: str, vector: DualVector, kinds: tuple[tuple[str, str, str], tuple[str, str, str]], of: str
    ) -> DualVector:
        """Name the components of a dual vector; ``kinds`` gives letter, unit and meaning of each part."""
        real, dual = (
            self.vector(f"{letter}_{name}", part, unit, f"{meaning} {of}")
            for (letter, unit, meaning), part in zip(kinds, (vector.real, vector.dual), strict=True)
        )
        return DualVector(real, dual)
