"""A symbol with unit and meaning, required for every symbol in the equations; components of outputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import sympy as sp

from symgen.errors import DerivationError, SceneError, no_component

#: Names of the coordinate axes; the plane has the first two.
AXES = "xyz"
#: Scalars of an output, their unit and its description.
Entries = tuple[Sequence[sp.Expr], str, str]


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


def parted(name: str) -> tuple[str, str]:
    """Return the name of an output and its component's letter, as of ``C.position.x``; empty for none."""
    owner, _, last = name.rpartition(".")
    return (owner, last) if owner and len(last) == 1 else (name, "")


def resolved(name: str, axes: Sequence[str], entries: Callable[[str], Entries]) -> Entries:
    """Return the entries of an output, or the one of a component; raise SceneError if there is none.

    ``entries`` returns those of a whole output or raises SceneError; vectors have a component per axis.
    """
    whole, part = parted(name)
    try:
        scalars, unit, about = entries(whole)
    except SceneError:
        if part in AXES:  # or empty
            raise
        return entries(name)  # raises
    if not part:
        return scalars, unit, about
    components = axes if len(scalars) > 1 else ()
    if part not in components:
        raise SceneError(no_component(whole, part, components))
    return [scalars[components.index(part)]], unit, f"{about}: component {part}"
