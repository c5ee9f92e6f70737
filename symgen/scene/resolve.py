"""From a checked scene to a linkage: every value read, every name looked up, every fault named."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import sympy as sp

from symgen.errors import SceneError, nearest
from symgen.scene import units
from symgen.scene.expressions import Names, parse_any, parse_value
from symgen.scene.linkage import (
    TIME,
    AppliedForce,
    AppliedTorque,
    CarriedPoint,
    Driver,
    Guide,
    LinearSpring,
    Linkage,
    Parameter,
    PlacedMass,
    PlacedPoint,
    RigidLink,
    StartConditions,
    Vector,
    number,
)
from symgen.scene.names import check_names
from symgen.scene.schema import Link, Point, Scene
from symgen.scene.units import Dimension
from symgen.symbolic.quantity import quantity

_ZERO = sp.Integer(0)


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
        check_names(scene)
        self._read_parameters()
        dims = {len(point.at) for point in scene.points.values()}
        if len(dims) > 1:
            raise SceneError(
                "expected all points with two coordinates (plane) or all with three (space)", where="points"
            )
        self.dimension = dims.pop()
        self.points = tuple(self.point(name, point) for name, point in scene.points.items())
        links = tuple(self.link(name, link) for name, link in scene.links.items())
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
            links=links,
            gravity=gravity,
            masses=tuple(self.masses()),
            springs=tuple(self.springs()),
            forces=tuple(self.forces()),
            torques=tuple(self.torques()),
            guides=tuple(self.guides()),
            drivers=tuple(self.drivers()),
            start=self.start(),
            t_end=self.positive(scene.analysis.t_end, units.TIME, "analysis.t_end"),
            assembly_tolerance=self.assembly_tolerance(),
            outputs=None if scene.analysis.outputs is None else tuple(scene.analysis.outputs),
        )
        self._check_every_point_used(linkage)
        return linkage

    def assembly_tolerance(self) -> sp.Expr:
        asked = self.scene.analysis.assembly_tolerance
        if asked is None:
            return sp.Integer(0)
        return self.positive(asked, units.LENGTH, "analysis.assembly_tolerance")

    def _read_parameters(self) -> None:
        for name, parameter in self.scene.parameters.items():
            where = f"parameters.{name}"
            with _at(f"{where}.value"):
                value, dim = parse_any(parameter.value, self.names)
                self.number(value)
            if not parameter.tunable:
                self.names[name] = value, dim
                continue
            q = quantity(name, dim.unit, parameter.about.strip() or f"parameter {name}")
            self.names[name] = q.symbol, dim
            self.defaults[q.symbol] = value.xreplace(self.defaults)
            self.parameters.append(Parameter(q, self.defaults[q.symbol]))

    def value(
        self, text: str | int | float, dim: Dimension, where: str, names: Names | None = None
    ) -> sp.Expr:
        with _at(where):
            expression = parse_value(text, self.names if names is None else names, dim)
            self.number(expression)
        return expression

    def moving(self, expression: sp.Expr, where: str) -> None:
        """Check that a prescribed motion has a velocity and an acceleration."""
        for _ in range(2):
            expression = sp.diff(expression, TIME.symbol)
            if expression.has(sp.sign, sp.Derivative, sp.re, sp.im):
                raise SceneError(
                    "a prescribed motion needs an acceleration at every time: it cannot use abs", where=where
                )
            with _at(where):
                self.number(expression)

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
        expression = self.value(text, dim, where, names)
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

    def point(self, name: str, point: Point) -> PlacedPoint:
        where = f"points.{name}"
        at = self.vector(point.at, units.LENGTH, f"{where}.at")
        if point.motion is None:
            return PlacedPoint(name, at, point.ground, at)
        if not point.ground:
            raise SceneError("only a ground point has a motion of its own", where=f"{where}.motion")
        moved = self.vector(point.motion, units.LENGTH, f"{where}.motion", self.with_time)
        for i, component in enumerate(moved):
            self.moving(component, f"{where}.motion.{i}")
        return PlacedPoint(name, at, True, tuple(a + b for a, b in zip(at, moved, strict=True)))

    def link(self, name: str, link: Link) -> RigidLink:
        where = f"links.{name}"
        points = [self.known_point(p, f"{where}.points") for p in link.points]
        if len({p.name for p in points}) < len(points):
            raise SceneError(
                "a link names each of its points once; with one point twice it has zero length",
                where=f"{where}.points",
            )
        start, end, *others = points
        drawn = tuple(b - a for a, b in zip(start.at, end.at, strict=True))
        squared = sp.Add(*(c**2 for c in drawn))
        if link.length is None and self.number(squared) == 0:
            raise SceneError(
                f"the rod has zero length: {start.name} and {end.name} are the same place",
                where=f"{where}.points",
                hint="Move one of the points, or join the other links at one point and leave this rod out.",
            )
        length = sp.sqrt(squared)
        if link.length is not None:
            length = self.positive(link.length, units.LENGTH, f"{where}.length", self.with_time)
            self.moving(length, f"{where}.length")
            if start.ground and end.ground:
                raise SceneError(
                    "the length of a link between two ground points is their distance",
                    where=f"{where}.length",
                )
        if (others or isinstance(link.centre, list)) and (self.dimension != 2 or link.length is not None):
            raise SceneError(
                "a body with more than two points, or a centre off its line, is for the plane, and takes its "
                "length from the drawing",
                where=where,
            )
        carried = tuple(CarriedPoint(p.name, *self.in_frame(drawn, squared, start.at, p.at)) for p in others)
        mass, centre, offset, inertia = self.body(link, length, drawn, start.at, bool(others), where)
        if TIME.symbol in length.free_symbols and mass != 0:
            raise SceneError(
                "a length that depends on the time is for a massless link",
                where=f"{where}.length",
                hint='Write mass = "0 kg", and put the mass on points or on other links.',
            )
        return RigidLink(
            name, start.name, end.name, length, mass, centre, offset, inertia, link.length is None, carried
        )

    @staticmethod
    def in_frame(drawn: Vector, squared: sp.Expr, start: Vector, place: Vector) -> Vector:
        """Return a place in a body's frame: along d and along d turned left, d as the unit."""
        x, y = (p - s for p, s in zip(place, start, strict=True))
        return (x * drawn[0] + y * drawn[1]) / squared, (y * drawn[0] - x * drawn[1]) / squared

    def body(
        self, link: Link, length: sp.Expr, drawn: Vector, start: Vector, several: bool, where: str
    ) -> tuple[sp.Expr, sp.Expr, sp.Expr, sp.Expr]:
        """Return mass, centre along and off the line, and inertia about the centre."""
        mass = self.link_mass(link, length, several, where)
        centre, offset = length / 2, _ZERO
        if isinstance(link.centre, list):
            squared = sp.Add(*(c**2 for c in drawn))
            place = self.vector(link.centre, units.LENGTH, f"{where}.centre")
            along, across = self.in_frame(drawn, squared, start, place)
            centre, offset = along * length, across * length
        elif link.centre is not None:
            centre = self.value(link.centre, units.NUMBER, f"{where}.centre") * length
        if link.inertia is not None:
            return mass, centre, offset, self.not_negative(link.inertia, units.INERTIA, f"{where}.inertia")
        if mass != 0 and (several or isinstance(link.centre, list)):
            raise SceneError(
                "a body that is not a rod needs its moment of inertia about the centre of mass",
                where=where,
                hint='Write inertia = "0.02 kg*m^2", and centre = [...] where it is.',
            )
        return mass, centre, offset, mass * length**2 / 12

    def link_mass(self, link: Link, length: sp.Expr, several: bool, where: str) -> sp.Expr:
        if several and link.mass_per_length is not None:
            raise SceneError("only a rod has a mass per length", where=f"{where}.mass_per_length")
        match link.mass, link.mass_per_length:
            case None, None:
                if all(self.known_point(p, where).ground for p in link.points):
                    return _ZERO
                raise SceneError(
                    "this link has no mass",
                    where=where,
                    hint='Give it mass = "1 kg" or mass_per_length = "1 kg/m"; "0 kg" for a massless rod.',
                )
            case (str() | int() | float()) as mass, None:
                return self.not_negative(mass, units.MASS, f"{where}.mass")
            case None, (str() | int() | float()) as density:
                return self.not_negative(density, units.MASS_PER_LENGTH, f"{where}.mass_per_length") * length
        raise SceneError("give mass or mass_per_length, not both", where=f"{where}.mass")

    def masses(self) -> Iterator[PlacedMass]:
        for i, mass in enumerate(self.scene.masses):
            point = self.known_point(mass.point, f"masses.{i}.point")
            yield PlacedMass(point.name, self.not_negative(mass.mass, units.MASS, f"masses.{i}.mass"))

    def springs(self) -> Iterator[LinearSpring]:
        scene = self.scene
        for i, spring in enumerate(scene.springs):
            where = f"springs.{i}"
            start, end = (self.known_point(p, f"{where}.between") for p in spring.between)
            led = (
                scene.start.angles or scene.drivers or any(k.length is not None for k in scene.links.values())
            )
            if start.name == end.name or (start.at == end.at and not led):
                raise SceneError(
                    "a spring needs two different points: at one place it has no direction",
                    where=f"{where}.between",
                )
            yield LinearSpring(
                name=f"spring_{i}",
                start=start.name,
                end=end.name,
                stiffness=self.not_negative(spring.stiffness, units.STIFFNESS, f"{where}.stiffness"),
                length=self.not_negative(spring.length, units.LENGTH, f"{where}.length"),
                damping=self.not_negative(spring.damping or 0, units.DAMPING, f"{where}.damping"),
            )

    def forces(self) -> Iterator[AppliedForce]:
        for i, force in enumerate(self.scene.forces):
            point = self.known_point(force.point, f"forces.{i}.point")
            vector = self.vector(force.force, units.FORCE, f"forces.{i}.force", self.with_time)
            yield AppliedForce(point.name, vector)

    def torques(self) -> Iterator[AppliedTorque]:
        for i, torque in enumerate(self.scene.torques):
            where = f"torques.{i}"
            self.turning_link(torque.link, f"{where}.link")
            if torque.against is not None:
                self.turning_link(torque.against, f"{where}.against")
                if torque.against == torque.link:
                    raise SceneError(
                        "a torque of a link against itself does nothing", where=f"{where}.against"
                    )
            value = self.value(torque.torque, units.TORQUE, f"{where}.torque", self.with_time)
            yield AppliedTorque(torque.link, value, torque.against or "")

    def guides(self) -> Iterator[Guide]:
        for i, guide in enumerate(self.scene.guides):
            where = f"guides.{i}"
            self.known_link(guide.along, f"{where}.along")
            points = tuple(self.known_point(p, f"{where}.points").name for p in guide.points)
            if len(set(points)) < len(points):
                raise SceneError("a guide names each of its points once", where=f"{where}.points")
            for point in points:
                if point in self.scene.links[guide.along].points:
                    raise SceneError(f"{point} belongs to {guide.along} already", where=f"{where}.points")
            yield Guide(f"guide_{i}", points, guide.along)

    def drivers(self) -> Iterator[Driver]:
        seen: set[str] = set()
        for i, driver in enumerate(self.scene.drivers):
            where = f"drivers.{i}"
            self.turning_link(driver.link, f"{where}.link")
            if driver.link in seen:
                raise SceneError(f"the link {driver.link} is driven twice", where=f"{where}.link")
            seen.add(driver.link)
            angle = self.value(driver.angle, units.NUMBER, f"{where}.angle", self.with_time)
            self.moving(angle, f"{where}.angle")
            yield Driver(driver.link, angle)

    def turning_link(self, name: str, where: str) -> None:
        """Check that a link is there, and has one angle."""
        self.known_link(name, where)
        if self.dimension != 2:
            raise SceneError("a link has one angle only in the plane", where=where)
        if all(self.known_point(p, where).ground for p in self.scene.links[name].points[:2]):
            raise SceneError(f"{name} lies between two ground points and cannot turn", where=where)

    def start(self) -> StartConditions:
        start = self.scene.start
        for table in ("angles", "rates"):
            for name in getattr(start, table):
                where = f"start.{table}.{name}"
                self.turning_link(name, where)
                if any(name == driver.link for driver in self.scene.drivers):
                    raise SceneError("the driver of this link already says where it starts", where=where)
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
        used = {p for link in self.scene.links.values() for p in link.points} | {
            m.point for m in linkage.masses
        }
        for point in linkage.points:
            if point.name not in used and not point.ground:
                raise SceneError(
                    f"the point {point.name} is on no link and carries no mass: nothing says how it moves",
                    where=f"points.{point.name}",
                    hint="Name it in a link's points, make it ground, or remove it.",
                )
        if all(point.ground for point in linkage.points):
            raise SceneError("every point is ground: nothing can move", where="points")
