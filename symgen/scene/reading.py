"""Reading the values of a scene: parameters, units, dimensions, names of points and links."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from functools import cached_property
from typing import Any

import sympy as sp

from symgen.errors import SceneError, nearest
from symgen.scene import units
from symgen.scene.expressions import Names, OfTime, parse_any, parse_value
from symgen.scene.faults import at
from symgen.scene.limit import Limit
from symgen.scene.names import is_reserved
from symgen.scene.rods.linkage import TIME, PlacedPoint, number, state_symbol
from symgen.scene.rods.run_parameters import Parameter, Text, Written
from symgen.scene.schema import Scene
from symgen.scene.tables.knots import check_rate
from symgen.scene.tables.points import Tabulated, tabulated
from symgen.scene.units import Dimension, is_quantity
from symgen.symbolic.calculus import partial
from symgen.symbolic.constants import vanishes
from symgen.symbolic.quantity import AXES, quantity
from symgen.symbolic.system import Definition
from symgen.symbolic.vectors import cross

#: Names in an expression, as far as they matter here.
NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)
#: Sine of the angle between directions that counts as zero.
_ALONG = 1e-6


class Values:
    """Reads values of one scene: every fault is a SceneError that names table and key.

    ``dimension`` is 2 in the plane and 3 in space.
    """

    dimension = 3

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.names: dict[str, tuple[sp.Expr, Dimension] | Tabulated | OfTime] = {}
        self.parameters: list[Parameter] = []
        self.defaults: dict[sp.Symbol, sp.Expr] = {}
        self.written = Written()
        #: Parameters that are angles, or rates of angles.
        self._angles: dict[str, tuple[sp.Expr, Dimension]] = {}
        #: Values over tunable parameters whose sign is checked again at other values of these.
        self.limits: list[Limit] = []
        #: Values in the names of the scene, by text and dimension: several links have the same section.
        self.parsed: dict[tuple[str | int | float, Dimension], sp.Expr] = {}
        #: Reads the same texts with symbols for the constants.
        self.mirror: Any = None
        #: External signals, after :meth:`read_signals`.
        self.signals: dict[str, tuple[sp.Expr, Dimension]] = {}
        self._read_parameters()
        self.names |= {f"{name}()": self._table(name) for name in scene.tables}
        for name, of in self.names.items():  # each behind those that it uses
            if isinstance(of, OfTime):
                with at(f"parameters.{name}.value"):
                    self.names[name] = OfTime(*parse_any(of.text, self.with_time), of.text)

    def _table(self, name: str) -> Tabulated:
        """Read a table, whose numbers may be constants of the scene."""

        def read(key: str, text: str | int | float) -> tuple[sp.Expr, Dimension]:
            with at(key):
                value, dim = parse_any(text, self.names)
                if value.free_symbols:
                    tunable = next(p for p in self.defaults if p in value.free_symbols)
                    raise SceneError(
                        f"expected a number, got {text!r} with the tunable parameter {tunable.name}",
                        hint="Multiply the table by the parameter where it is used.",
                    )
                return value, dim

        with at(f"tables.{name}"):
            return tabulated(name, self.scene.tables[name], read)

    def read_signals(self) -> None:
        """Read the table ``inputs``: external signals, the last of the parameters."""
        for name, written in self.scene.inputs.items():
            with at(f"inputs.{name}.value"):
                value, dim = parse_any(written.value, self.names)
                self.number(value)
            unit = self._unit(written.value, dim)
            q = quantity(name, unit, written.about.strip() or f"input {name}")
            self.signals[name] = q.symbol, dim
            self.defaults[q.symbol] = value.xreplace(self.defaults)
            self.parameters.append(Parameter(q, self.defaults[q.symbol], input=True))

    def _read_parameters(self) -> None:
        """Read every parameter after those it uses, wherever they are written."""
        for name in self.scene.parameters:
            self._read_parameter(name, ())
        order = list(self.scene.parameters)
        self.parameters.sort(key=lambda p: order.index(p.quantity.name))

    def _read_parameter(self, name: str, waiting: tuple[str, ...]) -> None:
        if name in self.names:
            return
        parameter, where = self.scene.parameters[name], f"parameters.{name}.value"
        if name in waiting:
            ring = " by ".join((*waiting[waiting.index(name) :], name))
            raise SceneError(f"these parameters are given by each other: {ring}", where=where)
        text = str(parameter.value)
        words = [] if is_quantity(text) else dict.fromkeys(NAME.findall(text))
        for used in filter(self.scene.parameters.__contains__, words):
            self._read_parameter(used, (*waiting, name))
        if "t" in words or any(isinstance(self.names.get(used), OfTime) for used in words):
            if parameter.tunable:
                raise SceneError(f"{name}, an expression of the time t, cannot be tunable", where=where)
            self.names[name] = OfTime(None, units.NUMBER, text)
            return
        with at(where):
            value, dim = parse_any(parameter.value, self.names)
            self.number(value)
        unit = self._unit(parameter.value, dim)
        q = quantity(name, unit, parameter.about.strip() or f"parameter {name}")
        if unit != dim.unit:
            self._angles[name] = q.symbol, dim
        if not parameter.tunable:
            self.names[name] = value, dim
            if not (value.is_number and vanishes(value)) and not is_reserved(name, self.scene):
                self.written.constants[name] = Definition(q, value)
            return
        self.names[name] = q.symbol, dim
        self.defaults[q.symbol] = value.xreplace(self.defaults)
        self.parameters.append(Parameter(q, self.defaults[q.symbol]))

    def _unit(self, value: str | int | float, dim: Dimension) -> str:
        """Return the SI unit of a parameter: with radians if written so, or a sum of such."""
        text = str(value)
        if is_quantity(text):
            return units.shown_unit(text)
        angular = units.OF_ANGLES.get(dim.unit)
        if angular is None or self._angles.keys().isdisjoint(NAME.findall(text)):
            return dim.unit
        form = parse_any(text, {**self.names, **self._angles})[0]
        doubled = form.xreplace({symbol: 2 * symbol for symbol, _ in self._angles.values()})
        return angular if sp.expand(doubled - 2 * form) == 0 else dim.unit

    def value(
        self, text: str | int | float, dim: Dimension, where: str, names: Names | None = None
    ) -> sp.Expr:
        """Return a value of this dimension, which must be finite at the scene's own parameters."""
        known = self.names if names is None else names
        used_names = [] if is_quantity(str(text)) else NAME.findall(str(text))
        with at(where):
            for used in used_names:
                if used in (*self.scene.inputs, *self.scene.states) and used not in known:
                    kind = "an input, and inputs" if used in self.scene.inputs else "a state, and states"
                    raise SceneError(
                        f"{used} is {kind} may occur in forces and torques alone",
                        hint="Make it a parameter, with tunable = true where it is to be varied.",
                    )
            expression = self.parsed.get((text, dim)) if names is None else None
            if expression is None:
                expression = parse_value(text, known, dim)
                if expression.free_symbols <= {*self.defaults, TIME.symbol}:
                    self.number(expression)
                if names is None:
                    self.parsed[text, dim] = expression
        self.keep(expression, str(text), where, known, used_names)
        return expression

    def keep(self, value: sp.Expr, text: str, where: str, names: Names, used: Collection[str]) -> None:
        """Keep a value as written, where it is written with constants of the scene."""
        if any(name in self.written.constants or isinstance(names.get(name), OfTime) for name in used):
            self.written.texts[where] = Text(value, text, names)

    def moving(self, expression: sp.Expr, dim: Dimension, where: str) -> None:
        """Check that a prescribed motion has a velocity and an acceleration."""
        unit = "rad" if dim == units.NUMBER else dim.unit
        end = self._end_of_run
        with at(where):
            check_rate(expression, TIME.symbol, self.defaults, unit, end)
        for _ in range(2):
            expression = partial(expression, TIME.symbol)
            with at(where):
                self.number(expression)

    @cached_property
    def _end_of_run(self) -> float:
        """End of the run that the scene gives [s]; infinite if it gives none."""
        analysis = self.scene.analysis
        if "t_end" not in analysis.model_fields_set:
            return math.inf
        return self.number(self.positive(analysis.t_end, units.TIME, "analysis.t_end"))

    @property
    def with_time(self) -> Names:
        """Names for values that may depend on the time."""
        return {**self.names, "t": (TIME.symbol, units.TIME)}

    def number(self, expression: sp.Expr) -> float:
        """Value at the scene's own parameters and t = 0, for checks."""
        return number(expression, self.defaults)

    def positive(
        self, text: str | int | float, dim: Dimension, where: str, names: Names | None = None
    ) -> sp.Expr:
        """Return a value that must be above zero."""
        return self._bounded(text, dim, where, names, strict=True)

    def not_negative(self, text: str | int | float, dim: Dimension, where: str) -> sp.Expr:
        """Return a value that must not be below zero."""
        return self._bounded(text, dim, where, None, strict=False)

    def _bounded(
        self, text: str | int | float, dim: Dimension, where: str, names: Names | None, *, strict: bool
    ) -> sp.Expr:
        expression = self.value(text, dim, where, names)
        value = self.number(expression)
        if value < 0 or (strict and value == 0):
            least = "above zero" if strict else "of at least zero"
            got = _got(text, value, dim)
            raise SceneError(f"expected {units.describe(dim)} {least}, got {got}", where=where)
        self.limit(expression, dim, where, strict=strict)
        return expression

    def limit(self, value: sp.Expr, dim: Dimension, where: str, *, strict: bool) -> None:
        """Check a value, of the start of the run, also at other values of the tunable parameters."""
        at_start = value.xreplace({TIME.symbol: sp.Integer(0)})
        if at_start.free_symbols:
            self.limits.append(Limit(where, at_start, dim.unit, strict))

    def direction(self, texts: list[str | int | float], where: str) -> tuple[sp.Expr, ...]:
        """Return a vector of plain numbers that is not zero."""
        vector = self.vector(texts, units.NUMBER, where)
        if all(self.number(c) == 0 for c in vector):
            raise SceneError("expected a direction, got zero", where=where)
        return vector

    def known(self, name: str, known: Collection[str], noun: str, where: str) -> None:
        """Check that a name is one of those that can stand here."""
        if name not in known:
            raise SceneError(f"there is no {noun} called {name!r}", where=where, hint=nearest(name, known))

    def vector(
        self, texts: list[str | int | float], dim: Dimension, where: str, names: Names | None = None
    ) -> tuple[sp.Expr, ...]:
        """Return a vector with as many components as there are dimensions."""
        if len(texts) != self.dimension:
            space = "the plane of the points" if self.dimension == 2 else "space"
            raise SceneError(
                f"expected {self.dimension} components in {space}, got {len(texts)}", where=where
            )
        return tuple(self.value(text, dim, f"{where}.{i}", names) for i, text in enumerate(texts))


class Reader(Values):
    """Reads a scene of points and links; ``points`` are those placed so far."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        dims = {len(point.at) for point in scene.points.values() if point.at is not None}
        if len(dims) > 1:
            raise SceneError(
                "expected all points with two coordinates (plane) or all with three (space)", where="points"
            )
        if not dims:
            raise SceneError(
                "expected at for at least one point, got none",
                where="points",
                hint='Write at = ["0 m", "0 m"] for some of them.',
            )
        self.dimension = dims.pop()
        self.points: dict[str, PlacedPoint] = {}
        self.take(scene)
        self.read_signals()
        #: First-order states by name: their symbols in expressions.
        self.states: dict[str, tuple[sp.Expr, Dimension]] = {}
        for name, written in scene.states.items():
            with at(f"states.{name}.start"):
                self.states[name] = state_symbol(f"{name}.state"), parse_any(written.start, self.names)[1]

    def take(self, scene: Scene) -> None:
        """Read further tables from this scene, which differs in points, links and welds alone."""
        self.scene = scene
        self.placed_on: dict[str, list[str]] = {}  # points by the link that they are placed on
        for name, point in scene.points.items():
            self.placed_on.setdefault(point.on or "", []).append(name)

    def with_state(self, body: str = "", words: Mapping[str, Dimension] | None = None) -> Names:
        """Names for loads: time, inputs, and the state as ``owner.word``; ``this.word`` of the load ``own``.

        A name of the state stands for a symbol that is called like it, with the load's own name for ``this``.
        """
        names = {**self.with_time, **self.signals, **self.states}
        for point in self.scene.points:
            for axis in AXES[: self.dimension]:
                names[f"{point}.{axis}"] = state_symbol(f"{point}.{axis}"), units.LENGTH
                names[f"{point}.v{axis}"] = state_symbol(f"{point}.v{axis}"), units.VELOCITY
        if self.dimension == 2:
            for link in self.scene.links:
                names[f"{link}.angle"] = state_symbol(f"{link}.angle"), units.NUMBER
                names[f"{link}.rate"] = state_symbol(f"{link}.rate"), units.ANGULAR_RATE
        for word, dim in (words or {}).items():
            names[f"this.{word}"] = state_symbol(f"{body}.{word}"), dim
        return names

    @property
    def drawing_is_a_guess(self) -> bool:
        """Whether the mechanism is assembled elsewhere than drawn: by lengths, angles or drives."""
        scene, links = self.scene, self.scene.links.values()
        return bool(scene.start.angles or scene.driven) or any(k.length is not None for k in links)

    def known_point(self, name: str, where: str) -> PlacedPoint:
        """Return the point of this name."""
        if name not in self.points:
            self.known(name, [p for p, point in self.points.items() if not point.hidden], "point", where)
        return self.points[name]

    def known_link(self, name: str, where: str) -> None:
        """Check that there is a link of this name."""
        self.known(name, self.scene.links, "link", where)

    def known_joint(self, point: str, link: str, joints: Collection[str], where: str) -> None:
        """Check that a point is among the joints of a link."""
        if point not in joints:
            shown = ", ".join(p for p in joints if not self.points[p].hidden)
            raise SceneError(
                f"{point} is no joint of {link}, whose joints are {shown}",
                where=where,
                hint=f"Name one of these joints, or links that have a joint at {point}.",
            )

    def drawn(self, link: str) -> tuple[sp.Expr, ...]:
        """Return the vector along a link as drawn [m]."""
        first, second = (self.points[p].at for p in self.scene.links[link].points[:2])
        return tuple(b - a for a, b in zip(first, second, strict=True))

    def is_along(self, link: str, vector: Sequence[sp.Expr]) -> bool:
        """Return whether a vector in space is along a link as drawn, or zero."""
        d, v = ([self.number(c) for c in of] for of in (self.drawn(link), vector))
        return math.hypot(*cross(d, v)) <= _ALONG * math.hypot(*d) * math.hypot(*v)

    def is_spatial_body(self, link: str) -> bool:
        """Return whether a link is a body in space, which two points cannot carry."""
        table = self.scene.links[link]
        written = isinstance(table.centre, list) or isinstance(table.inertia, list)
        return self.dimension == 3 and (len(table.points) > 2 or written)

    def is_elastic(self, link: str) -> bool:
        """Return whether a link is elastic."""
        return self.scene.links[link].elastic is not None

    @property
    def has_elastic_links(self) -> bool:
        """Whether some link is elastic."""
        return any(map(self.is_elastic, self.scene.links))

    def points_of(self, link: str) -> list[str]:
        """Return the points of a link."""
        return [*self.scene.links[link].points, *self.placed_on.get(link, ())]

    def ground_points(self, link: str) -> list[PlacedPoint]:
        """Return the ground points that a link names."""
        return [self.points[p] for p in self.scene.links[link].points if self.points[p].ground]

    def turning_link(self, name: str, where: str) -> None:
        """Check that a link is there, and has one angle."""
        self.known_link(name, where)
        if self.dimension != 2:
            raise SceneError(
                "a link has one angle only in the plane",
                where=where,
                hint="In space, ground points have a motion (points.NAME.motion), and the start is as drawn.",
            )
        self.moving_link(name, where)

    def moving_link(self, name: str, where: str) -> None:
        """Check that a link is there, and can turn."""
        self.known_link(name, where)
        link = self.scene.links[name]
        if not self.is_spatial_body(name) and all(self.known_point(p, where).ground for p in link.points[:2]):
            raise SceneError(
                f"{name} lies between two ground points and cannot turn",
                where=where,
                hint="Free one of its points. A load on it changes reactions alone: for these, write "
                "[[forces]] on its ground points, without link.",
            )


def check_count(value: int, least: int, most: int, where: str) -> None:
    """Check that a number of things is in a range."""
    if not least <= value <= most:
        raise SceneError(f"expected a whole number from {least} to {most}, got {value}", where=where)


def _got(text: str | int | float, value: float, dim: Dimension) -> str:
    """Return the written text, and its value unless the text shows it."""
    plain = not isinstance(text, str) or is_quantity(text)
    return repr(text) if plain else f"{text!r}, which is {value:g} {dim.unit}"
