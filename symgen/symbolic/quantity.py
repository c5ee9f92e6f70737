"""A symbol with unit and meaning; both are required for every symbol in the equations."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from symgen.errors import DerivationError

#: Names of the coordinate axes; the plane has the first two.
AXES = "xyz"


@dataclass(frozen=True, slots=True)
class Quantity:
    """A scalar symbol, or an array of symbols of the given shape, with SI unit and description.

    Raises
    ------
    DerivationError
        When the unit or the description is missing.
    """

    symbol: sp.Symbol
    unit: str
    description: str
    shape: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        for name in ("unit", "description"):
            if not getattr(self, name).strip():
                raise DerivationError(f"symbol {self.symbol} has no {name}: every symbol needs one")

    @property
    def name(self) -> str:
        """Name of the symbol."""
        return str(self.symbol.name)


def quantity(name: str, unit: str, description: str) -> Quantity:
    """Return a real scalar :class:`Quantity` named ``name``."""
    return Quantity(sp.Symbol(name, real=True), unit, description)
