"""Events of a scene: instants that a run locates."""

from __future__ import annotations

from collections.abc import Iterator

import sympy as sp

from symgen.errors import SceneError
from symgen.scene.expressions import Names, parse_any
from symgen.scene.faults import at
from symgen.scene.reading import NAME, Reader
from symgen.scene.rods.linkage import TIME, Event, state_of
from symgen.symbolic.quantity import AXES

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
