"""A symbol with unit and meaning, required for every symbol in the equations; components of outputs."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
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


def whole(name: str) -> sp.Symbol:
    """Return the letter of a whole vector ``(S)`` or matrix ``[M]`` in equations, which does not commute."""
    return sp.Symbol(name, commutative=False)


def bracketed(name: str, unit: str, description: str) -> Quantity:
    """Return a :class:`Quantity` for the letter of a whole vector or matrix."""
    return Quantity(whole(name), unit, description)


def symbols_of(expressions: Iterable[sp.Basic]) -> set[sp.Basic]:
    """Return the free symbols of expressions, each shared part of which is entered once."""
    found, seen, left = set[sp.Basic](), set[sp.Basic](), list(expressions)
    while left:
        part = left.pop()
        if part in seen:
            continue
        seen.add(part)
        if isinstance(part, sp.MatrixBase):
            left += part.values()
        elif type(part).free_symbols is sp.Basic.free_symbols:
            left += part.args
        else:
            found |= part.free_symbols
    return found


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


#: Powers of the unit of length that an unknown of elastic links lacks, by its word.
_PER_LENGTH = {"u": 0, "w": 0, "mid": 0, "x": 0, "y": 0, "theta": 1, "gamma": 1, "kappa": 2}
#: A unit and the power of metres at its end.
_METRES = re.compile(r"(.+)([*/])m(?:\^(\d))?")
Names = tuple[Sequence[str], Sequence[str]]


def own_unit(unit: str, names: Names, shape: tuple[int, int], at: Sequence[tuple[int, int]]) -> str:
    """Return the units of some entries of a matrix, where names of rows and columns, or number, tell them."""
    base, _, factors = unit.partition("; ")
    if factors and ", " in base:  # units of rows
        of_rows = base.split(", ")
        each = {times_lengths(of_rows[i], int(_power(names[1], j))) for i, j in at}
        bases = {of_rows[i] for i, _ in at}
        return each.pop() if len(each) == 1 else f"{bases.pop()}; {factors}" if len(bases) == 1 else unit
    if factors:
        powers = {_power(names[0], i) + _power(names[1], j) for i, j in at}
        power = powers.pop() if len(powers) == 1 else math.nan
        unknown = math.isnan(power) or (base[0] == "1" and "/m" not in base)
        return unit if unknown else times_lengths(base, int(power))
    units = unit.split(", ")
    places = _places(len(units), names, shape)
    return unit if places is None else ", ".join(dict.fromkeys(units[places(i, j)] for i, j in at))


def _places(count: int, names: Names, shape: tuple[int, int]) -> Callable[[int, int], int] | None:
    """Return which of the units an entry has; None where this does not follow."""
    (rows, columns), width = names, shape[1]
    kinds, across = ("".join(name[:1] for name in of) for of in names)
    if count == 1 or count == shape[0] * width:
        return lambda i, j: (i * width + j) * (count > 1)
    if count == 2 and tuple(columns) == ("theta", "S", "eta", "alpha", "a"):
        return lambda _, j: int(columns[j] in ("S", "a"))
    if count == 2 and across in ("ijkp", "xyzddd"):
        return lambda _, j: j // 3
    halves = len(rows) == 6 and len(set(kinds[:3])) == len(set(kinds[3:])) == 1
    if count == 2 and width == 1 and {*kinds} == {*"FT"}:
        return lambda i, _: int(kinds[i] == "T")
    if count == 2 and halves and width == 1:
        return lambda i, _: i // 3
    if count == 3 and halves and across == "wwwvvv":
        return lambda i, j: i // 3 + 1 - j // 3
    return None


def _power(names: Sequence[str], number: int) -> float:
    if not names:
        return 0
    _, dot, word = names[number].rpartition(".")
    word, at, _ = word.partition(" at ")
    if at:  # a force or a moment at a node
        return -float(word == "M")
    known = _PER_LENGTH.get(word.partition("@")[0].rstrip("0123456789"), math.nan)
    return known if dot or "@" in word or not math.isnan(known) else 0  # the name of a station


def times_lengths(base: str, power: int) -> str:
    """Return a unit times a power of metres."""
    if ends := _METRES.fullmatch(base):
        base, sign, exponent = ends.groups(default="1")
        power += int(exponent) * (1 if sign == "*" else -1)
    if base == "m":
        base, power = "1", power + 1
    if power <= 0:
        return base + (f"/m^{-power}" if power < -1 else "/m" if power else "")
    metres = "m" if power == 1 else f"m^{power}"
    return metres if base == "1" else f"{base}*{metres}"
