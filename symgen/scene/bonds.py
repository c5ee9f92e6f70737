"""Guides, drivers and the start of a scene."""

from __future__ import annotations

from collections.abc import Iterator

from symgen.errors import SceneError
from symgen.scene import units
from symgen.scene.linkage import Driver, Guide, StartConditions
from symgen.scene.reading import Reader


def guides(read: Reader) -> Iterator[Guide]:
    """Yield the guides."""
    for i, guide in enumerate(read.scene.guides):
        where = f"guides.{i}"
        read.known_link(guide.along, f"{where}.along")
        points = tuple(read.known_point(p, f"{where}.points").name for p in guide.points)
        if len(set(points)) < len(points):
            raise SceneError("a guide names each of its points once", where=f"{where}.points")
        for point in points:
            if point in read.scene.links[guide.along].points:
                raise SceneError(f"{point} belongs to {guide.along} already", where=f"{where}.points")
        yield Guide(f"guide_{i}", points, guide.along)


def drivers(read: Reader) -> Iterator[Driver]:
    """Yield the drivers: one at most for each link."""
    seen: set[str] = set()
    for i, driver in enumerate(read.scene.drivers):
        where = f"drivers.{i}"
        read.turning_link(driver.link, f"{where}.link")
        if driver.link in seen:
            raise SceneError(f"the link {driver.link} is driven twice", where=f"{where}.link")
        seen.add(driver.link)
        angle = read.value(driver.angle, units.NUMBER, f"{where}.angle", read.with_time)
        read.moving(angle, f"{where}.angle")
        yield Driver(driver.link, angle)


def start(read: Reader) -> StartConditions:
    """Return what the start of the motion is asked to be."""
    start = read.scene.start
    for table in ("angles", "rates"):
        for name in getattr(start, table):
            where = f"start.{table}.{name}"
            read.turning_link(name, where)
            if any(name == driver.link for driver in read.scene.drivers):
                raise SceneError("the driver of this link already says where it starts", where=where)
    for name in start.velocities:
        if read.known_point(name, f"start.velocities.{name}").ground:
            raise SceneError(f"the ground point {name} does not move", where=f"start.velocities.{name}")
    return StartConditions(
        angles=tuple((n, read.value(v, units.NUMBER, f"start.angles.{n}")) for n, v in start.angles.items()),
        rates=tuple(
            (n, read.value(v, units.ANGULAR_RATE, f"start.rates.{n}")) for n, v in start.rates.items()
        ),
        velocities=tuple(
            (n, read.vector(v, units.VELOCITY, f"start.velocities.{n}")) for n, v in start.velocities.items()
        ),
    )
