"""Quantities of the state: events, which are instants that a run locates, and prescribed motions."""

from __future__ import annotations

from collections.abc import Iterator

import sympy as sp

from symgen.errors import SceneError
from symgen.scene import units
from symgen.scene.expressions import Names, parse_any
from symgen.scene.faults import at
from symgen.scene.reading import NAME, Reader
from symgen.scene.rods.linkage import TIME, Event, state_of
from symgen.scene.rods.rotations import PrescribedMotion
from symgen.symbolic.quantity import AXES
from symgen.symbolic.switch import PiecewisePolynomial, Sign

_DIRECTIONS = {"rising": 1, "falling": -1, "both": 0}


def events(read: Reader) -> Iterator[Event]:
    """Yield the events: an expression of the state, less the value it passes."""
    names: set[str] = set()
    if read.scene.events and read.dimension == 2 and any(link.elastic for link in read.scene.links.values()):
        raise SceneError("a scene in the plane with elastic links has no events", where="events")
    of_state = _names(read) if read.scene.events else {}
    for i, event in enumerate(read.scene.events):
        where = f"events.{i}"
        if event.name in names:
            raise SceneError(f"two events are called {event.name!r}", where=f"{where}.name")
        names.add(event.name)
        with at(f"{where}.of"):
            gap, dimension = parse_any(event.of, of_state)
            if TIME.symbol not in gap.free_symbols and not state_of(gap):
                raise SceneError(
                    f"{event.of!r} is the same at all times",
                    hint="Write a quantity of the state, such as POINT.position.y or LINK.angle.",
                )
        read.keep(gap, event.of, f"{where}.of", of_state, NAME.findall(event.of))
        value = read.value(event.value, dimension, f"{where}.value")
        yield Event(
            event.name,
            gap - value,
            dimension.unit,
            _DIRECTIONS[event.direction],
            event.ends_run,
            f"{event.of} passes {event.value}",
        )


def motions(read: Reader) -> Iterator[PrescribedMotion]:
    """Yield the prescribed motions of quantities other than those of drives.

    Raises
    ------
    SceneError
        For a quantity that is no smooth function of places and angles, and for a scene with elastic links.
    """
    of_state, stated = _names(read) if read.scene.motions else {}, list[sp.Expr]()
    for i, motion in enumerate(read.scene.motions):
        where = f"motions.{i}"
        if read.has_elastic_links:
            raise SceneError(
                "a scene with elastic links has no motions of such quantities",
                where=where,
                hint='Prescribe the motion of the crank, or write angle = "..." under [[drivers]].',
            )
        with at(f"{where}.of"):
            quantity, dimension = parse_any(motion.of, of_state)
            owners = _places(quantity, motion.of)
            if dimension not in (units.LENGTH, units.NUMBER) or (dimension == units.LENGTH) == bool(owners):
                raise SceneError(
                    f"expected a length of places, or an angle of links, got {motion.of!r}",
                    hint="Write one such as A.position.x, or rocker.angle in the plane.",
                )
            if owners and not revolves(quantity):
                raise SceneError(
                    f"expected a sum or a difference of angles of links, got {motion.of!r}: a revolution of "
                    "a link must change it by a revolution",
                    hint="Prescribe the angle itself.",
                )
        if quantity in stated:
            raise SceneError(
                f"{motion.of} has a prescribed motion already, by motions.{stated.index(quantity)}",
                where=f"{where}.of",
                hint='Remove one of the two, and the effort "?" that is there for it.',
            )
        stated.append(quantity)
        read.keep(quantity, motion.of, f"{where}.of", of_state, NAME.findall(motion.of))
        value = read.value(motion.value, dimension, f"{where}.value", read.with_time)
        read.moving(value, dimension, f"{where}.value")
        yield PrescribedMotion(f"motion_{i}", _output(quantity, i), motion.of, quantity, value, owners)


def _places(quantity: sp.Expr, text: str) -> tuple[str, ...]:
    """Return the links whose angles are in a quantity, which is a smooth one of places and angles."""
    state = [str(s.name) for s in state_of(quantity)]
    if not state:
        raise SceneError(f"{text!r} does not depend on the state", hint="Write a place or an angle.")
    words = {name: name.rpartition(".")[2] for name in state}
    if moving := [name for name, word in words.items() if word not in (*AXES, "angle")]:
        raise SceneError(
            f"expected places and angles, got {moving[0]}",
            hint="Prescribe the place or the angle, whose rate follows.",
        )
    if TIME.symbol in quantity.free_symbols:
        raise SceneError(f"{text!r} depends on t", hint="Write functions of t in value.")
    if quantity.has(sp.Abs, Sign, PiecewisePolynomial):
        raise SceneError(
            f"{text!r} has kinks or jumps: accelerations are not finite there",
            hint="Write a smooth quantity.",
        )
    return tuple(name.rpartition(".")[0] for name, word in words.items() if word == "angle")


def _output(quantity: sp.Expr, number: int) -> str:
    """Return the name of a quantity in results: that of the output where it is one."""
    if not quantity.is_Symbol:
        return f"motions.{number}"
    owner, _, word = str(quantity.name).rpartition(".")
    return f"{owner}.{word}" if word == "angle" else f"{owner}.position.{word}"


def revolves(gap: sp.Expr) -> bool:
    """Return whether a gap changes by a revolution with the angle of a link: runs then continue it."""
    angles = [s for s in state_of(gap) if s.name.endswith(".angle")]
    return bool(angles) and all(abs(sp.diff(gap, s)) == 1 for s in angles)


def _names(read: Reader) -> Names:
    """Names of the state as loads have them, and as outputs call them."""
    names = dict(read.with_state())
    for point in read.scene.points:
        for axis in AXES[: read.dimension]:
            names[f"{point}.position.{axis}"] = names[f"{point}.{axis}"]
            names[f"{point}.velocity.{axis}"] = names[f"{point}.v{axis}"]
    if read.dimension == 2:
        for link in read.scene.links:
            names[f"{link}.angular_velocity"] = names[f"{link}.rate"]
    return names
