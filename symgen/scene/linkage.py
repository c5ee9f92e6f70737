"""What a scene resolves to: points and rods with exact values in SI units, every one checked."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property

import sympy as sp

from symgen.errors import SceneError, nearest
from symgen.scene import units
from symgen.scene.expressions import FUNCTIONS, Names, parse_any, parse_value
from symgen.scene.schema import Link, Scene
from symgen.scene.units import Dimension
from symgen.symbolic.quantity import Quantity, quantity

TIME = quantity("t", "s", "time")
_RESERVED = {"t", "pi", *FUNCTIONS}
_DIGITS = 30


@dataclass(frozen=True, slots=True)
class Parameter:
    """A tunable parameter: it stays an argument of the kernels. ``default`` is its value in the scene."""

    quantity: Quantity
    default: sp.Expr


@dataclass(frozen=True, slots=True)
class PlacedPoint:
    """A point where it is drawn [m]."""

    name: str
    at: tuple[sp.Expr, ...]
    ground: bool


@dataclass(frozen=True, slots=True)
class Rod:
    """A rigid rod: ends, length [m], mass [kg], centre of mass from its start [m], inertia about it [kg m^2]."""

    name: str
    start: str
    end: str
    length: sp.Expr
    mass: sp.Expr
    centre: sp.Expr
    inertia: sp.Expr
    as_drawn: bool


@dataclass(frozen=True, slots=True)
class PlacedMass:
    """A point mass [kg] at a point."""

    point: str
    mass: sp.Expr


@dataclass(frozen=True, slots=True)
class LinearSpring:
    """A spring between two points: stiffness [N/m], slack length [m], damping [N s/m]."""

    name: str
    start: str
    end: str
    stiffness: sp.Expr
    length: sp.Expr
    damping: sp.Expr


@dataclass(frozen=True, slots=True)
class AppliedForce:
    """A force [N] on a point, components fixed in space; may depend on the time t."""

    name: str
    point: str
    force: tuple[sp.Expr, ...]


@dataclass(frozen=True, slots=True)
class StartConditions:
    """Directions [rad] and rates [rad/s] of rods, and velocities [m/s] of points, that the start must have."""

    angles: tuple[tuple[str, sp.Expr], ...]
    rates: tuple[tuple[str, sp.Expr], ...]
    velocities: tuple[tuple[str, tuple[sp.Expr, ...]], ...]


@dataclass(frozen=True)
class Linkage:
    """A linkage of rods, resolved: exact expressions over the tunable parameters and time, in SI units."""

    name: str
    file: str
    title: str
    dimension: int
    parameters: tuple[Parameter, ...]
    points: tuple[PlacedPoint, ...]
    rods: tuple[Rod, ...]
    gravity: tuple[sp.Expr, ...]
    masses: tuple[PlacedMass, ...]
    springs: tuple[LinearSpring, ...]
    forces: tuple[AppliedForce, ...]
    start: StartConditions
    t_end: sp.Expr
    outputs: tuple[str, ...] | None

    @cached_property
    def defaults(self) -> Mapping[sp.Symbol, sp.Expr]:
        """Value of every tunable parameter in the scene."""
        return {p.quantity.symbol: p.default for p in self.parameters}

    def point(self, name: str) -> PlacedPoint:
        """Return the point called ``name``."""
        return next(p for p in self.points if p.name == name)


def resolve(scene: Scene) -> Linkage:
    """Return the linkage a scene describes.

    Raises
    ------
    SceneError
        For a wrong unit, an unknown name, a value that is not physical; with file, table and key.
    """
    try:
        return _Resolver(scene).linkage()
    except SceneError as error:
        raise error.located(file=scene.file) from None


@contextmanager
def _at(where: str) -> Iterator[None]:
    try:
        yield
    except SceneError as error:
        raise error.located(where=where) from None


class _Resolver:
    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.names: dict[str, tuple[sp.Expr, Dimension]] = {}
        self.parameters: list[Parameter] = []
        self.defaults: dict[sp.Symbol, sp.Expr] = {}

    def linkage(self) -> Linkage:
        scene = self.scene
        self._read_parameters()
        dims = {len(point.at) for point in scene.points.values()}
        if len(dims) > 1:
            raise SceneError(
                "expected all points with two coordinates (plane) or all with three (space)", where="points"
            )
        self.dimension = dims.pop()
        self.points = tuple(
            PlacedPoint(name, self.vector(p.at, units.LENGTH, f"points.{name}.at"), p.ground)
            for name, p in scene.points.items()
        )
        rods = tuple(self.rod(name, link) for name, link in scene.links.items())
        gravity = (sp.Integer(0),) * self.dimension
        if scene.gravity:
            gravity = self.vector(scene.gravity.acceleration, units.ACCELERATION, "gravity.acceleration")
        linkage = Linkage(
            name=scene.name,
            file=scene.file,
            title=scene.title or scene.name,
            dimension=self.dimension,
            parameters=tuple(self.parameters),
            points=self.points,
            rods=rods,
            gravity=gravity,
            masses=tuple(self.masses()),
            springs=tuple(self.springs()),
            forces=tuple(self.forces()),
            start=self.start(),
            t_end=self.positive(scene.analysis.t_end, units.TIME, "analysis.t_end"),
            outputs=None if scene.analysis.outputs is None else tuple(scene.analysis.outputs),
        )
        self._check_every_point_used(linkage)
        return linkage

    def _read_parameters(self) -> None:
        for name, parameter in self.scene.parameters.items():
            where = f"parameters.{name}"
            if name in _RESERVED:
                raise SceneError(f"{name!r} already has a meaning in expressions", where=where)
            with _at(f"{where}.value"):
                value, dim = parse_any(parameter.value, self.names)
            if not parameter.tunable:
                self.names[name] = value, dim
                continue
            q = quantity(name, dim.unit, parameter.about or f"parameter {name}")
            self.names[name] = q.symbol, dim
            self.defaults[q.symbol] = value.xreplace(self.defaults)
            self.parameters.append(Parameter(q, self.defaults[q.symbol]))

    def value(
        self, text: str | int | float, dim: Dimension, where: str, names: Names | None = None
    ) -> sp.Expr:
        with _at(where):
            return parse_value(text, self.names if names is None else names, dim)

    def number(self, expression: sp.Expr) -> float:
        """Value at the scene's own parameters, for checks."""
        value = expression.xreplace(self.defaults)
        return float(value if value.is_Rational else value.evalf(_DIGITS))

    def positive(self, text: str | int | float, dim: Dimension, where: str) -> sp.Expr:
        expression = self.value(text, dim, where)
        if not self.number(expression) > 0:
            raise SceneError(f"expected {units.describe(dim)} above zero, got {text!r}", where=where)
        return expression

    def not_negative(self, text: str | int | float, dim: Dimension, where: str) -> sp.Expr:
        expression = self.value(text, dim, where)
        if self.number(expression) < 0:
            raise SceneError(f"expected {units.describe(dim)} of at least zero, got {text!r}", where=where)
        return expression

    def vector(
        self, texts: list[str | int | float], dim: Dimension, where: str, names: Names | None = None
    ) -> tuple[sp.Expr, ...]:
        if len(texts) != self.dimension:
            raise SceneError(
                f"expected {self.dimension} components like the points have, got {len(texts)}", where=where
            )
        return tuple(self.value(text, dim, f"{where}.{i}", names) for i, text in enumerate(texts))

    def known_point(self, name: str, where: str) -> PlacedPoint:
        for point in self.points:
            if point.name == name:
                return point
        hint = nearest(name, [p.name for p in self.points])
        raise SceneError(f"there is no point called {name!r}", where=where, hint=hint)

    def known_link(self, name: str, where: str) -> None:
        if name not in self.scene.links:
            hint = nearest(name, self.scene.links)
            raise SceneError(f"there is no link called {name!r}", where=where, hint=hint)

    def rod(self, name: str, link: Link) -> Rod:
        where = f"links.{name}"
        start, end = (self.known_point(p, f"{where}.points") for p in link.points)
        squared = sp.Add(*((b - a) ** 2 for a, b in zip(start.at, end.at, strict=True)))
        if start.name == end.name or (link.length is None and self.number(squared) == 0):
            raise SceneError(
                f"the rod has zero length: {start.name} and {end.name} are the same place",
                where=f"{where}.points",
                hint="Move one of the points, or join the other links at one point and leave this rod out.",
            )
        length = (
            sp.sqrt(squared)
            if link.length is None
            else self.positive(link.length, units.LENGTH, f"{where}.length")
        )
        mass = self.rod_mass(link, length, where)
        centre, inertia = length / 2, mass * length**2 / 12
        if link.centre is not None:
            centre = self.value(link.centre, units.NUMBER, f"{where}.centre") * length
        if link.inertia is not None:
            inertia = self.not_negative(link.inertia, units.INERTIA, f"{where}.inertia")
        return Rod(name, start.name, end.name, length, mass, centre, inertia, link.length is None)

    def rod_mass(self, link: Link, length: sp.Expr, where: str) -> sp.Expr:
        match link.mass, link.mass_per_length:
            case None, None:
                raise SceneError(
                    "this rod has no mass",
                    where=where,
                    hint='Give it mass = "1 kg" or mass_per_length = "1 kg/m"; "0 kg" for a massless rod.',
                )
            case mass, None:
                return self.not_negative(mass, units.MASS, f"{where}.mass")
            case None, density:
                return self.not_negative(density, units.MASS_PER_LENGTH, f"{where}.mass_per_length") * length
        raise SceneError("give mass or mass_per_length, not both", where=f"{where}.mass")

    def masses(self) -> Iterator[PlacedMass]:
        for i, mass in enumerate(self.scene.masses):
            point = self.known_point(mass.point, f"masses.{i}.point")
            yield PlacedMass(point.name, self.not_negative(mass.mass, units.MASS, f"masses.{i}.mass"))

    def springs(self) -> Iterator[LinearSpring]:
        for i, spring in enumerate(self.scene.springs):
            where = f"springs.{i}"
            start, end = (self.known_point(p, f"{where}.between").name for p in spring.between)
            if start == end:
                raise SceneError("a spring needs two different points", where=f"{where}.between")
            yield LinearSpring(
                name=f"spring{i}",
                start=start,
                end=end,
                stiffness=self.not_negative(spring.stiffness, units.STIFFNESS, f"{where}.stiffness"),
                length=self.not_negative(spring.length, units.LENGTH, f"{where}.length"),
                damping=self.not_negative(spring.damping or 0, units.DAMPING, f"{where}.damping"),
            )

    def forces(self) -> Iterator[AppliedForce]:
        names = {**self.names, "t": (TIME.symbol, units.TIME)}
        for i, force in enumerate(self.scene.forces):
            point = self.known_point(force.point, f"forces.{i}.point")
            vector = self.vector(force.force, units.FORCE, f"forces.{i}.force", names)
            yield AppliedForce(f"force{i}", point.name, vector)

    def start(self) -> StartConditions:
        start = self.scene.start
        for table in ("angles", "rates"):
            for name in getattr(start, table):
                where = f"start.{table}.{name}"
                self.known_link(name, where)
                if self.dimension != 2:
                    raise SceneError(
                        "a link has one angle only in the plane",
                        where=where,
                        hint="Give velocities of points.",
                    )
        for name in start.velocities:
            if self.known_point(name, f"start.velocities.{name}").ground:
                raise SceneError(f"the ground point {name} does not move", where=f"start.velocities.{name}")
        return StartConditions(
            angles=tuple(
                (n, self.value(v, units.NUMBER, f"start.angles.{n}")) for n, v in start.angles.items()
            ),
            rates=tuple(
                (n, self.value(v, units.ANGULAR_RATE, f"start.rates.{n}")) for n, v in start.rates.items()
            ),
            velocities=tuple(
                (n, self.vector(v, units.VELOCITY, f"start.velocities.{n}"))
                for n, v in start.velocities.items()
            ),
        )

    def _check_every_point_used(self, linkage: Linkage) -> None:
        used = {p for rod in linkage.rods for p in (rod.start, rod.end)} | {m.point for m in linkage.masses}
        for point in linkage.points:
            if point.name not in used and not point.ground:
                raise SceneError(
                    f"the point {point.name} is on no link and carries no mass: nothing says how it moves",
                    where=f"points.{point.name}",
                    hint="Name it in a link's points, make it ground, or remove it.",
                )
        if all(point.ground for point in linkage.points):
            raise SceneError("every point is ground: nothing can move", where="points")
