"""Reading the values of a loop: names of variables, and expressions that hold them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import sympy as sp

from symgen.errors import SceneError
from symgen.scene import units
from symgen.scene.expressions import Names, parse_any, parse_value, tonne_hint
from symgen.scene.faults import at
from symgen.scene.loop.schema import SpatialLoop
from symgen.scene.names import check_word
from symgen.scene.reading import NAME, Values
from symgen.scene.rods.linkage import TIME
from symgen.scene.schema import Scene
from symgen.scene.units import Dimension
from symgen.symbolic.quantity import Quantity, quantity

ZERO = sp.Integer(0)
#: Entry of a row whose variable follows from closure, and of a drive that is unknown.
UNKNOWN = "?"


@dataclass(frozen=True, slots=True)
class NamedVariable:
    """An input or a free variable named in the scene; see :class:`~symgen.scene.loop.loop.JointVariable`."""

    name: str
    dimension: Dimension
    role: Literal["input", "free"]
    motion: sp.Expr = ZERO
    start: sp.Expr = ZERO
    start_rate: sp.Expr = ZERO

    @property
    def symbol(self) -> sp.Symbol:
        """What stands for it in expressions."""
        return sp.Symbol(self.name, real=True)


@dataclass(frozen=True, slots=True)
class PlacedVariable:
    """A variable at its position in the table; ``named`` is None if it follows from closure."""

    name: str
    row: int
    entry: str
    dimension: Dimension
    named: NamedVariable | None


class LoopReader(Values):
    """Reads a scene with a loop; ``named`` are its inputs and free variables, in order."""

    def __init__(self, scene: Scene, loop: SpatialLoop) -> None:
        super().__init__(scene)
        self.loop = loop
        self.named: dict[str, NamedVariable] = {}
        self.read_signals()
        self._read_inputs()
        self._read_free()
        if not self.named:
            raise SceneError(
                "expected at least one input or free variable of the loop, got none",
                where="loop.inputs",
                hint='Prescribe a motion, as in inputs = { theta1 = "speed*t" }, or name a free variable.',
            )

    def _read_inputs(self) -> None:
        names = dict(self.with_time)
        for name, text in self.loop.inputs.items():
            where = f"loop.inputs.{name}"
            self._check_name(name, where)
            dim = self._dimension(text, where, names)
            motion = self.value(text, dim, where, names)
            self.moving(motion, dim, where)
            if not self.named and not motion.has(TIME.symbol):
                raise SceneError(
                    f"expected a first input that depends on the time, got {text!r}",
                    where=where,
                    hint='It leads the loop through its range: give it by the time t, as in "speed*t".',
                )
            names[name] = motion, dim
            self.named[name] = NamedVariable(name, dim, "input", motion=motion)

    def _read_free(self) -> None:
        for name, table in self.loop.free.items():
            where = f"loop.free.{name}"
            if name in self.named:
                raise SceneError(
                    f"{name} is an input, whose motion is prescribed, and cannot be free as well", where=where
                )
            self._check_name(name, where)
            dim = self._dimension(table.at, f"{where}.at", self.names)
            self.named[name] = NamedVariable(
                name,
                dim,
                "free",
                start=self.folded(self.value(table.at, dim, f"{where}.at"), f"{where}.at"),
                start_rate=self.folded(
                    self.value(table.rate, rate_of(dim), f"{where}.rate"), f"{where}.rate"
                ),
            )

    def folded(self, expression: sp.Expr, where: str) -> sp.Expr:
        """Return a value of which the model keeps the number alone: it may hold no tunable parameter."""
        tunable = sorted(s.name for s in expression.free_symbols if s in self.defaults)
        if tunable:
            raise SceneError(
                f"expected a constant value, got one that depends on the tunable parameter {tunable[0]}",
                where=where,
                hint=f"It is folded: make {tunable[0]} not tunable, or give a plain value.",
            )
        return expression

    @property
    def free(self) -> list[NamedVariable]:
        """The free variables."""
        return [v for v in self.named.values() if v.role == "free"]

    def _check_name(self, name: str, where: str) -> None:
        check_word(name, where)
        scene = self.scene
        for noun, table in (
            ("a parameter", scene.parameters),
            ("an input", scene.inputs),
            ("a state", scene.states),
        ):
            if name in table:
                raise SceneError(
                    f"{name!r} is {noun} already", where=where, hint="Choose another name for the variable."
                )

    def _dimension(self, text: str | int | float, where: str, names: Names) -> Dimension:
        """Return whether a value is an angle or a length: nothing else is a joint variable."""
        with at(where):
            _, dim = parse_any(text, names)
            if dim not in (units.NUMBER, units.LENGTH):
                raise SceneError(
                    f"expected an angle or a length, got {text!r}, {units.describe(dim)}",
                    hint=tonne_hint(text),
                )
        return dim

    @property
    def with_named(self) -> Names:
        """Names for entries of rows: parameters, inputs and free variables."""
        return {**self.names, **{v.name: (v.symbol, v.dimension) for v in self.named.values()}}

    def with_variables(self, places: Iterable[PlacedVariable]) -> Names:
        """Names for drives and loads: time, inputs, states, variables, and rates as ``NAME.rate``."""
        names = {**self.with_time, **self.signals}
        for name, written in self.scene.states.items():
            with at(f"states.{name}.start"):
                names[name] = sp.Symbol(name, real=True), parse_any(written.start, self.names)[1]
        for place in places:
            value, rate, _ = symbols(place.name, place.dimension, place.entry)
            names[place.name] = value.symbol, place.dimension
            names[f"{place.name}.rate"] = rate.symbol, rate_of(place.dimension)
        return names

    def entry(
        self, text: str | int | float, dim: Dimension, where: str
    ) -> tuple[sp.Expr, NamedVariable | None]:
        """Return an entry of a row, and the variable it holds; it must be linear in it."""
        with at(where):
            expression = parse_value(text, self.with_named, dim)
            self.keep(expression, str(text), where, self.with_named, NAME.findall(str(text)))
            variables = [v for v in self.named.values() if v.symbol in expression.free_symbols]
            if not variables:
                self.number(expression)
                return expression, None
            if len(variables) > 1:
                both = " and ".join(v.name for v in variables[:2])
                raise SceneError(
                    f"an entry holds one variable, got {text!r} with {both}",
                    hint="Make an input of the sum, and name that.",
                )
            slope = sp.diff(expression, variables[0].symbol)
            if variables[0].symbol in slope.free_symbols:
                raise SceneError(
                    f"an entry is linear in its variable, got {text!r}",
                    hint="Make an input of the expression, and name that.",
                )
            self.number(expression.xreplace({variables[0].symbol: ZERO}))
            if self.number(slope) == 0:
                raise SceneError(f"{variables[0].name} has no effect in {text!r}")
        return expression, variables[0]


def rate_of(dim: Dimension) -> Dimension:
    """Return the dimension of the rate of a variable."""
    return dim.times(units.ANGULAR_RATE)


def symbols(name: str, dim: Dimension, about: str) -> tuple[Quantity, Quantity, Quantity]:
    """Return the quantities of a variable, its rate and its acceleration."""
    unit = "m" if dim == units.LENGTH else "rad"
    return (
        quantity(name, unit, about),
        quantity(f"{name}_rate", f"{unit}/s", f"rate of {name}"),
        quantity(f"{name}_acceleration", f"{unit}/s^2", f"acceleration of {name}"),
    )
