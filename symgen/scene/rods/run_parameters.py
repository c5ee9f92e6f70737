"""Parameters of a resolved scene, and what runs hold during a step or move."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

import sympy as sp

from symgen.errors import SceneError
from symgen.scene.expressions import Names, OfTime, parse_any
from symgen.scene.tables.points import Tabulated
from symgen.scene.units import Dimension
from symgen.symbolic.constants import with_pi
from symgen.symbolic.quantity import Quantity
from symgen.symbolic.system import Definition

#: In composed values: the length of their link, and its modulus where no constant of the scene is in it.
LENGTH, MODULUS = (sp.Symbol(f"{word} of the link", real=True) for word in ("length", "modulus"))


@dataclass(frozen=True, slots=True)
class Parameter:
    """A tunable parameter: it stays an argument of the kernels. ``default`` is its value in the scene.

    ``input``: it is an external signal, which may change during a motion. ``fixed``: it is the letter of a
    constant, and ``default`` the value, over the others, that replaces it in the kernels.
    """

    quantity: Quantity
    default: sp.Expr
    input: bool = False
    fixed: bool = False


def defaults(parameters: Sequence[Parameter]) -> dict[sp.Symbol, sp.Expr]:
    """Return the value of every parameter in the scene."""
    tunable = {p.quantity.symbol: p.default for p in parameters if not p.fixed}
    return tunable | {p.quantity.symbol: p.default.xreplace(tunable) for p in parameters if p.fixed}


@dataclass(frozen=True, slots=True)
class Text:
    """A value of a scene as written, with the names in it, and what it is without names of constants."""

    value: sp.Expr
    text: str
    names: Names


@dataclass(frozen=True, slots=True)
class Written:
    """The parameters of a scene that are constants, and the values that are written with them, by place.

    ``composed`` are values of several places, such as the mass of a section, next to their forms.
    """

    constants: dict[str, Definition] = field(default_factory=dict)
    texts: dict[str, Text] = field(default_factory=dict)
    composed: dict[str, tuple[sp.Expr, sp.Expr]] = field(default_factory=dict)

    def form(self, where: str, value: sp.Expr) -> sp.Expr | None:
        """Return a value as it is written at a place; None where it holds no constant, or is another."""
        known, form = self.composed.get(where, (None, None))
        if known is not None and value in (known, with_pi(known)):
            return form
        text = self.texts.get(where)
        if text is None or value not in (text.value, with_pi(text.value)):
            return None
        names = dict(text.names)
        for name, constant in self.constants.items():
            if name in names:
                names[name] = constant.quantity.symbol, names[name][1]
        try:
            for name, of in names.items():
                if isinstance(of, OfTime):
                    names[name] = OfTime(*parse_any(of.text, names), of.text)
            return parse_any(text.text, names)[0]
        except SceneError:  # such as the exponent of a power, which is a number
            return None

    @property
    def symbols(self) -> Mapping[sp.Symbol, Definition]:
        """The constants by symbol."""
        return {c.quantity.symbol: c for c in self.constants.values()}


class Reads(Protocol):
    """What reads the values of a scene."""

    names: dict[str, tuple[sp.Expr, Dimension] | Tabulated | OfTime]
    defaults: dict[sp.Symbol, sp.Expr]
    parsed: dict[Any, sp.Expr]
    mirror: Any
    written: Written
    limits: list[Any]


Reading = TypeVar("Reading", bound=Reads)


def compose(
    read: Reading,
    length: sp.Expr,
    where: str,
    values: Mapping[str, sp.Expr],
    forms: Callable[[Reading], Mapping[str, sp.Expr]],
) -> None:
    """Keep values below a place as ``forms`` reads them where the constants of the scene are symbols."""
    written, table = read.written, ".".join(where.split(".")[:2]) + "."
    if not any(place.startswith(table) for place in written.texts):
        return
    if read.mirror is None:
        read.mirror = _mirror(read)
    mirror = copy(read.mirror)
    mirror.defaults = {**mirror.defaults, LENGTH: length.xreplace(read.defaults)}
    mirror.written, mirror.limits = Written(), []
    try:
        found = forms(mirror)
    except SceneError:  # such as the exponent of a power, which is a number
        return
    constants = {c.quantity.symbol for c in written.constants.values()}
    for key, form in found.items():
        if form.free_symbols & constants:
            written.composed[f"{where}.{key}"] = values[key], form


def _mirror(read: Reading) -> Reading:
    """Return a reader in whose names the constants of the scene are symbols."""
    mirror, constants = copy(read), read.written.constants
    mirror.names = read.names | {n: (c.quantity.symbol, read.names[n][1]) for n, c in constants.items()}
    numbers = {c.quantity.symbol: c.expression.xreplace(read.defaults) for c in constants.values()}
    mirror.defaults, mirror.parsed = {**read.defaults, **numbers, MODULUS: sp.S.One}, {}
    return mirror


@dataclass(frozen=True, slots=True)
class Switch:
    """A jump or a kink of a load where ``gap``, of the time t and the state, passes zero.

    ``branch`` is held by a run during a step; ``text`` is the jump as written, with its location. A
    ``smooth`` one is the middle of a pulse, where the load neither jumps nor has a kink. With ``pieces`` the
    branch is that of a table: zeros are its knots.
    """

    gap: sp.Expr
    branch: Quantity
    text: str
    smooth: bool = False
    pieces: bool = False


@dataclass(frozen=True, slots=True)
class FirstOrder:
    """A state x whose rate is ``rate``, of the time t and the state.

    ``units`` are those of x, its rate and its integral.

    It is the rate of a coordinate of its own, its integral, of mass 1 under the force ``rate``: nothing
    depends on the integral.
    """

    name: str
    units: tuple[str, str, str]
    start: sp.Expr
    rate: sp.Expr
    about: str

    @property
    def integral(self) -> str:
        """Name of the coordinate."""
        return f"{self.name}_integral"


@dataclass(frozen=True, slots=True)
class Winding:
    """An angle in a load: of a link beyond ``free`` [rad], from ``against`` or the x axis (empty).

    ``reference`` is the angle from which it is taken the nearer way round; runs move it along.
    """

    link: str
    against: str
    free: sp.Expr
    reference: Quantity
