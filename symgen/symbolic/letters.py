"""Letters for the constants of a scene: fields of its records name theirs, and equations keep them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import chain, count
from typing import Any, NamedTuple

import sympy as sp

from symgen.symbolic.constants import vanishes
from symgen.symbolic.quantity import AXES, quantity
from symgen.symbolic.system import Definition, System

_ONE = sp.Integer(1)


class Letter(NamedTuple):
    """The letter of a field, with unit and meaning: constants are called ``LETTER_OWNER``."""

    letter: str
    unit: str
    meaning: str


class Letters:
    """Collector of the letters of a scene with their values.

    Zero stays, so that its terms vanish, and so does a one without unit. So do symbols, and expressions of
    the time or the state.

    Parameters
    ----------
    taken
        Names of other quantities.
    owners
        Names with which names of derived quantities begin, such as those of points and links.
    known
        The parameters of the scene.
    """

    def __init__(self, taken: Collection[str], owners: Collection[str], known: Collection[sp.Symbol]) -> None:
        self._taken, self._owners, self._known = set(taken), set(owners), set(known)
        self.constants: list[Definition] = []
        #: Names of the constants that are zero.
        self.zero: list[str] = []

    def scalar(self, name: str, value: sp.Expr, unit: str, meaning: str) -> sp.Expr:
        """Return the letter of a value, or the value where it stays."""
        if value.is_number and vanishes(value):
            self.zero.append(name)
            return sp.S.Zero
        if (
            value.is_Symbol
            or (-value).is_Symbol
            or not value.free_symbols <= self._known
            or (unit == "1" and value in (_ONE, -_ONE))
        ):
            return value
        name = self._free(name)
        self._taken.add(name)
        new = quantity(name, unit, meaning)
        self.constants.append(Definition(new, value))
        return new.symbol

    def _free(self, name: str) -> str:
        """Return the name, numbered where the scene has another quantity or an owner called so."""
        letter, _, owner = name.partition("_")
        numbered = (f"{letter}{i}_{owner}" if owner else f"{name}_{i}" for i in count(2))
        fits = (x for x in chain([name], numbered) if x not in self._taken)
        return next(x for x in fits if x.partition("_")[0] not in self._owners)

    def vector(
        self, name: str, values: Collection[sp.Expr], unit: str, meaning: str, axes: Sequence[str] = AXES
    ) -> tuple[sp.Expr, ...]:
        """Return the letters of components: ``name_x`` and so on."""
        return tuple(
            self.scalar(f"{name}_{axis}", value, unit, f"{axis} component of the {meaning}")
            for axis, value in zip(axes, values, strict=False)
        )

    def record(self, record: Any, fields: Mapping[str, Letter], owner: str, named: str) -> dict[str, Any]:
        """Return fields of a record as letters ``LETTER_OWNER``, of what is ``named`` so."""
        changed: dict[str, Any] = {}
        for name, (letter, unit, meaning) in fields.items():
            value = getattr(record, name)
            new = self.vector if isinstance(value, tuple) else self.scalar
            changed[name] = new(f"{letter}_{owner}", value, unit, f"{meaning} of {named}")
        return changed

    def kept(self, system: System) -> System:
        """Return a system whose letters are its constants, not its arguments."""
        names = {c.quantity.name for c in self.constants}
        if not any(x.name in names for g in system.groups for x in g.quantities):
            return system
        groups = tuple(
            replace(g, quantities=tuple(x for x in g.quantities if x.name not in names))
            for g in system.groups
        )
        return replace(system, groups=groups, constants=tuple(self.constants), absent=tuple(self.zero))

    def forget(self, letter: sp.Expr) -> None:
        """Omit a letter whose value follows from others."""
        self.constants = [c for c in self.constants if c.quantity.symbol != letter]
