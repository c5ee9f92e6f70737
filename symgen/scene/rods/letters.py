"""A resolved scene with letters for its constants, of which its equations are derived; linkages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import sympy as sp

from symgen.loads.load import Load
from symgen.loads.of_links import Angle
from symgen.methods import method_of
from symgen.scene.rods.linkage import (
    TIME,
    Event,
    Linkage,
    PlacedPoint,
    RigidLink,
    SpatialBody,
    Vector,
)
from symgen.scene.rods.rotations import Driver
from symgen.scene.rods.run_parameters import LENGTH, Parameter, Written
from symgen.symbolic.calculus import partial
from symgen.symbolic.constants import vanishes
from symgen.symbolic.names import Letter, Letters
from symgen.symbolic.quantity import AXES
from symgen.symbolic.system import System

#: Letters of the fields that hold constants.
_OF_LINK = {
    "length": Letter("l", "m", "length of link {link}"),
    "mass": Letter("m", "kg", "mass of link {link}"),
    "centre": Letter("s", "m", "distance of the centre of mass of link {link} from {start}, along its line"),
    "offset": Letter("h", "m", "distance of the centre of mass of link {link} from its line, to the left"),
    "inertia": Letter("I", "kg*m^2", "moment of inertia of link {link} about its centre of mass"),
}
_OF_POINT = {
    "along": Letter("a", "1", "distance of {point} from {start} along link {link}, over its length"),
    "across": Letter("b", "1", "distance of {point} from link {link} to its left, over its length"),
}
_OF_MASS = {
    "mass": Letter("m", "kg", "mass at {point}"),
    "inertia": Letter("I", "kg*m^2", "moment of inertia at {point}"),
}


def in_letters(resolved: Any) -> tuple[Any, Letters]:
    """Return a resolved scene whose constants are letters, further parameters of it, and the letters.

    What the scene writes with its own parameters has these as letters. Zeros stay, and right angles between
    joint axes. A uniform link has its centre at l/2 and the moment of inertia m l^2/12. What only the start
    or a run needs stays in numbers.
    """
    method = method_of(resolved)
    return method.load("letters")(resolved) if method.letters else (resolved, Letters((), (), (), Written()))


def derived_in_letters(resolved: Any, derive: Callable[[Any], Any]) -> Any:
    """Return what ``derive`` derives from a scene in letters: a System, several by name, or steps.

    The letters are the constants of these systems, not their arguments.
    """
    known = vars(resolved)  # as of a cached property: further systems are derived of the same scene
    if "_in_letters" not in known:
        known["_in_letters"] = in_letters(resolved)
    written, letters = known["_in_letters"]
    derived = derive(written)
    if isinstance(derived, System):
        return letters.kept(derived)
    if isinstance(derived, Mapping):
        return {name: letters.kept(system) for name, system in derived.items()}
    return tuple(replace(step, system=letters.kept(step.system)) for step in derived)


def added(letters: Letters) -> tuple[Parameter, ...]:
    """Return letters as parameters of the scene."""
    values = {c.quantity.symbol: c.expression for c in letters.constants}
    every = (*letters.constants, *letters.definitions)
    return tuple(Parameter(c.quantity, c.expression.xreplace(values), fixed=True) for c in every)


def of_linkage(linkage: Linkage) -> tuple[Linkage, Letters]:
    """Return a linkage in letters."""
    states = (f"{p.name}_{word}{axis}" for p in linkage.points for word in ("", "v", "a") for axis in AXES)
    owners = [p.name for p in linkage.points]
    owners += [x.name for of in (linkage.links, linkage.bodies, linkage.loads) for x in of]
    taken = [*states, *(p.quantity.name for p in linkage.parameters)]
    taken += [x for s in linkage.states for x in (s.name, s.integral, f"{s.name}_rate")]
    letters = Letters(taken, owners, linkage.defaults, linkage.written)
    links = tuple(_link(letters, link) for link in linkage.links)
    bodies = tuple(_body(letters, body) for body in linkage.bodies)
    points = tuple(_ground(letters, p, linkage.axes) if p.ground else p for p in linkage.points)
    angles: dict[tuple[str, str, sp.Expr], sp.Expr] = {}
    loads = tuple(
        _load(letters, load, f"{table}.{i}", linkage.axes, angles) for table, i, load in linkage.placed_loads
    )
    masses = tuple(
        replace(m, **letters.record(m, _OF_MASS, f"at_{m.point}", f"masses.{i}", point=m.point))
        for i, m in enumerate(linkage.masses)
    )
    written = replace(
        linkage,
        points=points,
        links=links,
        bodies=bodies,
        gravity=gravity_of(letters, linkage.gravity, linkage.axes),
        masses=masses,
        loads=loads,
        drivers=tuple(_driver(letters, linkage, i) for i in range(len(linkage.drivers))),
        events=tuple(_event(letters, linkage, i) for i in range(len(linkage.events))),
        motions=tuple(
            replace(
                m, of=letters.form(f"motions.{i}.of", m.of), value=letters.form(f"motions.{i}.value", m.value)
            )
            for i, m in enumerate(linkage.motions)
        ),
        states=tuple(replace(s, rate=letters.form(f"states.{s.name}.rate", s.rate)) for s in linkage.states),
    )
    windings = tuple(
        replace(w, free=angles.get((w.link, w.against, w.free), w.free)) for w in linkage.windings
    )
    return replace(written, windings=windings, parameters=(*linkage.parameters, *added(letters))), letters


def _load(
    letters: Letters,
    load: Load,
    where: str,
    axes: tuple[str, ...],
    angles: dict[tuple[str, str, sp.Expr], sp.Expr],
) -> Load:
    """Return a load with letters; loads of one angle share its letter, as they share its revolutions."""
    load = load.with_written(lambda key, e: letters.form(f"{where}.{key}", e), axes)
    constants = letters.record(load, load.letters, load.name, where, load=load.name.replace("_", " "))
    written = replace(load, **constants)
    for number, letter in zip(load.measures(len(axes)), written.measures(len(axes)), strict=True):
        if isinstance(number, Angle) and isinstance(letter, Angle):
            shared = angles.setdefault((number.link, number.against, number.free), letter.free)
            if shared != letter.free:
                letters.forget(letter.free)
                constants = {k: shared if x == letter.free else x for k, x in constants.items()}
    return replace(load, **constants)


def _link(letters: Letters, link: RigidLink) -> RigidLink:
    words = {"link": link.name, "start": link.start}
    place = f"links.{link.name}"
    forms = {name: letters.form(f"{place}.{name}", getattr(link, name)) for name in _OF_LINK}
    uniform = _uniform(link.mass, link.length)
    implied = [x for x, value in uniform.items() if _equal(getattr(link, x), value) and not _zero(link.mass)]
    own = [x for x in forms if x not in implied]
    composed = [x for x in own if f"{place}.{x}" in letters.composed and forms[x] != getattr(link, x)]
    plain = {name: _OF_LINK[name] for name in own if name not in composed}
    constants = letters.record(link, plain, link.name, place, **words)
    length = constants["length"]
    for name in composed:
        letter, unit, meaning, _ = _OF_LINK[name]
        form = forms[name].xreplace({LENGTH: length})
        constants[name] = letters.defined(f"{letter}_{link.name}", form, unit, meaning.format(**words))
    if implied:
        of_letters = _uniform(constants["mass"], length)
        constants |= {name: of_letters[name] for name in implied}
    carried = []
    for p in link.carried:
        on_line = letters.record(
            p, _OF_POINT, f"{link.name}_{p.name}", f"points.{p.name}", point=p.name, **words
        )
        carried.append(
            replace(p, **{name: value.xreplace({LENGTH: length}) for name, value in on_line.items()})
        )
    return replace(link, **constants, carried=tuple(carried))


def _uniform(mass: sp.Expr, length: sp.Expr) -> dict[str, sp.Expr]:
    return {"centre": length / 2, "inertia": sp.Mul(sp.Rational(1, 12), mass, length**2)}


def _zero(value: sp.Expr) -> bool:
    return bool(value.is_number and vanishes(value))


def _equal(first: sp.Expr, second: sp.Expr) -> bool:
    return bool(first == second or _zero(first - second))


def _body(letters: Letters, body: SpatialBody) -> SpatialBody:
    """Return a body in space; the matrices of its base points are symmetric."""
    name, named = body.name, f"body {body.name}"
    bars = tuple(
        replace(
            b,
            length=letters.scalar(
                f"l_{b.start}_{b.end}_{name}", b.length, "m", f"distance from {b.start} to {b.end} on {name}"
            ),
        )
        for b in body.bars
    )
    weights = tuple(
        letters.scalar(f"w_{p}_{name}", w, "1", f"weight of {p} in the centre of mass of {named}")
        for p, w in zip(body.base, body.centre, strict=True)
    )
    carried = tuple(
        replace(
            c,
            weights=tuple(
                letters.scalar(
                    f"w_{c.name}_{p}_{name}", w, "1", f"weight of {p} in the place of {c.name} on {name}"
                )
                for p, w in zip(body.base, c.weights, strict=True)
            ),
        )
        for c in body.carried
    )
    mass = letters.scalar(f"m_{name}", body.mass, "kg", f"mass of {named}", f"links.{name}.mass")
    of_mass = tuple(tuple(x / body.mass for x in row) for row in body.masses) if mass != 0 else body.masses
    shares = _symmetric(letters, "r", of_mass, name, "1", "mass matrix of the base points, over the mass,")
    return replace(
        body,
        bars=bars,
        mass=mass,
        centre=weights,
        masses=tuple(tuple(mass * x for x in row) for row in shares),
        inverse=_symmetric(letters, "e", body.inverse, name, "1/m^2", "inverse of the products of edges"),
        carried=carried,
    )


def _symmetric(
    letters: Letters, letter: str, matrix: tuple[Vector, ...], name: str, unit: str, about: str
) -> tuple[Vector, ...]:
    known: dict[tuple[int, int], sp.Expr] = {}
    for i, row in enumerate(matrix):
        for j in range(i, len(row)):
            new = letters.scalar(
                f"{letter}{i}{j}_{name}", row[j], unit, f"entry {i}, {j} of the {about} of {name}"
            )
            known[i, j] = known[j, i] = new
    return tuple(tuple(known[i, j] for j in range(len(row))) for i, row in enumerate(matrix))


def _ground(letters: Letters, point: PlacedPoint, axes: tuple[str, ...]) -> PlacedPoint:
    """Return a ground point whose place is in letters; it is drawn in numbers."""
    motion = []
    for axis, drawn, c in zip(axes, point.at, point.motion, strict=True):
        where, moved = f"points.{point.name}", c - drawn
        place = letters.scalar(
            f"{axis}_{point.name}", drawn, "m", f"{axis} coordinate of ground point {point.name}",
            f"{where}.at.{AXES.index(axis)}",
        )  # fmt: skip
        motion.append(place + letters.form(f"{where}.motion.{AXES.index(axis)}", moved))
    return replace(point, motion=tuple(motion))


def gravity_of(letters: Letters, gravity: Vector, axes: tuple[str, ...]) -> Vector:
    """Return gravity as its size g along an axis, or by components."""
    there = [i for i, c in enumerate(gravity) if c != 0]
    places = [f"gravity.acceleration.{AXES.index(axis)}" for axis in axes]
    forms = tuple(letters.form(where, c) for where, c in zip(places, gravity, strict=True))
    if forms != gravity:
        return forms
    if len(there) == 1 and gravity[there[0]].is_number:
        value, sign = gravity[there[0]], 1 if gravity[there[0]].is_positive else -1
        size = sign * letters.scalar("g", sign * value, "m/s^2", "gravity")
        return tuple(size if i == there[0] else c for i, c in enumerate(gravity))
    return letters.vector("g", gravity, "m/s^2", "gravity", axes)


def _driver(letters: Letters, linkage: Linkage, number: int) -> Driver:
    driver, crank = linkage.drivers[number], linkage.crank
    of_crank = crank is not None and driver.link == crank.link
    units, name = ("rad", "rad/s"), driver.link
    places = ("crank.angle", "crank.speed") if of_crank else (f"drivers.{number}.angle", "")
    about = f"angle of link {' from '.join(driver.links)}"
    angle = motion_of(letters, driver.angle, name, units, about, *places)
    return replace(driver, angle=angle)


def _event(letters: Letters, linkage: Linkage, number: int) -> Event:
    """Return an event whose quantity and threshold are as the scene writes them."""
    event, texts = linkage.events[number], linkage.written.texts
    quantity, threshold = f"events.{number}.of", f"events.{number}.value"
    known = texts[threshold].value if threshold in texts else sp.S.Zero
    gap = event.gap
    if quantity in texts:
        gap += letters.form(quantity, texts[quantity].value) - texts[quantity].value
    return replace(event, gap=gap + known - letters.form(threshold, known))


def motion_of(
    letters: Letters,
    motion: sp.Expr,
    owner: str,
    units: tuple[str, str],
    named: str,
    where: str,
    rate_where: str = "",
) -> sp.Expr:
    """Return a motion as the scene writes it, or a uniform one by its value at the start and its rate.

    ``rate_where`` is the place of the rate, where the scene states it apart.
    """
    form = letters.form(where, motion)
    if form != motion:
        return form
    rate = partial(motion, TIME.symbol)
    if rate.free_symbols & {TIME.symbol}:
        return motion
    start = motion.xreplace({TIME.symbol: sp.S.Zero})
    first, second = ("phi", "omega") if units[0] == "rad" else ("x", "v")
    at_start = f"{named} at t = 0, prescribed"
    return letters.scalar(f"{first}0_{owner}", start, units[0], at_start, where) + (
        letters.scalar(f"{second}_{owner}", rate, units[1], f"rate of {named}, prescribed", rate_where)
        * TIME.symbol
    )
