"""Named intermediate expressions, which keep derivations from growing, and letters of constants."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import chain, count
from typing import Any, NamedTuple, Protocol

import sympy as sp

from symgen.errors import DerivationError
from symgen.symbolic.constants import vanishes
from symgen.symbolic.dual import DualVector
from symgen.symbolic.quantity import AXES, Quantity, quantity, symbols_of
from symgen.symbolic.system import Definition, System

_ONE = sp.Integer(1)


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

    def relate(self, rate: DualVector, of: DualVector) -> None:
        """State that a dual vector is the rate of another along every motion; only names are marked."""
        for x, value in zip((*rate.real, *rate.dual), (*of.real, *of.dual), strict=True):
            sign, symbol = sp.sympify(x).as_coeff_Mul()
            if abs(sign) == 1 and (known := self._definitions.get(str(symbol))):
                self._definitions[known.quantity.name] = replace(known, rate_of=sign * value)


class Letter(NamedTuple):
    """The letter of a field, with unit and meaning: constants are called ``LETTER_OWNER``.

    Names in the meaning are in braces. ``key`` is that of the scene, where the field has another name.
    """

    letter: str
    unit: str
    meaning: str
    key: str = ""


class WrittenForms(Protocol):
    """Values as a scene writes them with its constants."""

    @property
    def symbols(self) -> Mapping[sp.Symbol, Definition]:
        """The constants by symbol."""

    @property
    def composed(self) -> Collection[str]:
        """Places of values that are composed of several."""

    def form(self, where: str, value: sp.Expr) -> sp.Expr | None:
        """Return a value as it is written at a place; None where it holds no constant."""


class Letters:
    """Collector of the letters of a scene with their values.

    Zero stays, so that its terms vanish, and so does a one without unit. What the scene writes with its own
    constants stays so. Symbols stay, and expressions of the time or the state.

    Parameters
    ----------
    taken
        Names of other quantities.
    owners
        Names with which names of derived quantities begin, such as those of points and links.
    known
        The parameters of the scene.
    written
        Its values as it writes them, and its constants.
    """

    def __init__(
        self,
        taken: Collection[str],
        owners: Collection[str],
        known: Collection[sp.Symbol],
        written: WrittenForms,
    ) -> None:
        self._taken, self._owners, self._known = set(taken), set(owners), set(known)
        self._written = written
        self._own = {s: c for s, c in written.symbols.items() if self._fits(c.quantity.name)}
        self._taken.update(c.quantity.name for c in self._own.values())
        self.constants: list[Definition] = []
        #: Letters that are defined by others.
        self.definitions: list[Definition] = []
        #: Names of the constants that are zero.
        self.zero: list[str] = []

    @property
    def composed(self) -> Collection[str]:
        """Places of values that the scene composes of several, with its own constants."""
        return self._written.composed

    def form(self, where: str, value: sp.Expr, *, products: bool = False) -> sp.Expr:
        """Return a value as it is written at a place, with the constants of the scene; only ``products``."""
        form = self._written.form(where, value)
        if form is not None and products and form.has(sp.Add):
            return value
        used = () if form is None else sorted(form.free_symbols & self._own.keys(), key=lambda s: str(s.name))
        if form is None or not used:
            return value
        others = form.free_symbols & (self._written.symbols.keys() - self._own.keys())
        known = {c.quantity.symbol for c in self.constants}
        self.constants += [self._own[s] for s in used if s not in known]
        values = self._written.symbols
        return form.xreplace({s: values[s].expression for s in others})

    def scalar(self, name: str, value: sp.Expr, unit: str, meaning: str, where: str = "") -> sp.Expr:
        """Return the letter of a value, written at a place of the scene, or the value where it stays."""
        if value.is_number and vanishes(value):
            self.zero.append(name)
            return sp.S.Zero
        if value.is_Symbol or (unit == "1" and value in (_ONE, -_ONE)):
            return value
        if not value.free_symbols <= self._known:
            return self.form(where, value)
        # A sum is a letter of its own: what it is divided by cancels then.
        form = value if (-value).is_Symbol else self.form(where, value, products=True)
        if form != value or (-value).is_Symbol:
            return form
        name = self._free(name)
        self._taken.add(name)
        new = quantity(name, unit, meaning)
        self.constants.append(Definition(new, value))
        return new.symbol

    def defined(self, name: str, form: sp.Expr, unit: str, meaning: str) -> sp.Expr:
        """Return a letter that is defined by those of the scene; symbols and numbers stay."""
        if form.is_Symbol or form.is_number:
            return form
        name = self._free(name)
        self._taken.add(name)
        new = quantity(name, unit, meaning)
        self.definitions.append(Definition(new, form))
        return new.symbol

    def _free(self, name: str) -> str:
        """Return the name, numbered where the scene has another quantity or an owner called so."""
        letter, _, owner = name.partition("_")
        numbered = (f"{letter}{i}_{owner}" if owner else f"{name}_{i}" for i in count(2))
        return next(x for x in chain([name], numbered) if self._fits(x))

    def _fits(self, name: str) -> bool:
        return name not in self._taken and ("_" not in name or name.partition("_")[0] not in self._owners)

    def vector(
        self,
        name: str,
        values: Collection[sp.Expr],
        unit: str,
        meaning: str,
        axes: Sequence[str] = AXES,
        where: str = "",
    ) -> tuple[sp.Expr, ...]:
        """Return the letters of components: ``name_x`` and so on; that of one component is ``name``."""
        if len(values) == 1:
            return tuple(self.scalar(name, value, unit, meaning, where) for value in values)
        return tuple(
            self.scalar(
                f"{name}_{axis}",
                value,
                unit,
                f"{axis} component of the {meaning}",
                f"{where}.{AXES.index(axis)}",
            )
            for axis, value in zip(axes, values, strict=False)
        )

    def record(
        self, record: Any, fields: Mapping[str, Letter], owner: str, where: str, **words: str
    ) -> dict[str, Any]:
        """Return fields of a record, in the table ``where``, as letters ``LETTER_OWNER``.

        ``words`` are names in their meaning.
        """
        changed: dict[str, Any] = {}
        for name, (letter, unit, meaning, key) in fields.items():
            value = getattr(record, name)
            new = self.vector if isinstance(value, tuple) else self.scalar
            changed[name] = new(
                f"{letter}_{owner}", value, unit, meaning.format(**words), where=f"{where}.{key or name}"
            )
        return changed

    def kept(self, system: System) -> System:
        """Return a system whose letters are its constants, not its arguments."""
        names = {c.quantity.name for c in (*self.constants, *self.definitions)}
        if not any(x.name in names for g in system.groups for x in g.quantities):
            return system
        groups = tuple(
            replace(g, quantities=tuple(x for x in g.quantities if x.name not in names))
            for g in system.groups
        )
        derived = (*(m.matrix for m in system.matrices), *(d.expression for d in system.definitions))
        needed = symbols_of(derived) if self.definitions else ()
        own = (d for d in self.definitions if d.quantity.symbol in needed)
        return system.with_constants(groups, (*own, *system.definitions), self.constants, self.zero)

    def forget(self, letter: sp.Expr) -> None:
        """Omit a letter whose value follows from others; the scene's own stay."""
        if letter not in self._own:
            self.constants = [c for c in self.constants if c.quantity.symbol != letter]
