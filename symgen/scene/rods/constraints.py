"""Guides, drivers and the start of a scene."""

from __future__ import annotations

from collections.abc import Iterator

from symgen.errors import SceneError
from symgen.scene import units
from symgen.scene.reading import Reader
from symgen.scene.rods.linkage import Driver, Guide, StartConditions, Vector


def guides(read: Reader) -> Iterator[Guide]:
    """Yield the guides."""
    for i, guide in enumerate(read.scene.guides):
        where = f"guides.{i}"
        read.known_link(guide.along, f"{where}.along")
        points = tuple(read.known_point(p, f"{where}.points").name for p in guide.points)
        if len(set(points)) < len(points):
            raise SceneError("a guide names each of its points once", where=f"{where}.points")
        if read.is_spatial_body(guide.along):
            raise SceneError(f"{guide.along} is a body: a guide runs along a rod", where=f"{where}.along")
        for point in points:
            if point in read.scene.links[guide.along].points or read.scene.points[point].on == guide.along:
                raise SceneError(f"{point} belongs to {guide.along} already", where=f"{where}.points")
        yield Guide(f"guide_{i}", points, guide.along)


def drivers(read: Reader) -> Iterator[Driver]:
    """Yield the drivers: one at most for each link."""
    driven: set[str] = set()
    for i, driver in enumerate(read.scene.drivers):
        where = f"drivers.{i}"
        read.turning_link(driver.link, f"{where}.link")
        if driver.link in driven:
            raise SceneError(f"the link {driver.link} is driven twice", where=f"{where}.link")
        driven.add(driver.link)
        angle = read.value(driver.angle, units.NUMBER, f"{where}.angle", read.with_time)
        read.moving(angle, f"{where}.angle")
        yield Driver(driver.link, angle)


def start(read: Reader) -> StartConditions:
    """Return the prescribed angles, rates and velocities of the start."""
    start = read.scene.start
    for table, names in (("angles", start.angles), ("rates", start.rates)):
        for name in names:
            where = f"start.{table}.{name}"
            if table == "angles":
                read.turning_link(name, where)
            else:
                read.moving_link(name, where)
            if name in read.scene.driven:
                raise SceneError("the driver of this link already prescribes its start", where=where)
    for name in start.velocities:
        if read.known_point(name, f"start.velocities.{name}").ground:
            raise SceneError(f"the ground point {name} does not move", where=f"start.velocities.{name}")
    return StartConditions(
        angles=tuple((n, read.value(v, units.NUMBER, f"start.angles.{n}")) for n, v in start.angles.items()),
        rates=tuple((n, _rate(read, v, f"start.rates.{n}")) for n, v in start.rates.items()),
        velocities=tuple(
            (n, read.vector(v, units.VELOCITY, f"start.velocities.{n}")) for n, v in start.velocities.items()
        ),
    )


def _rate(read: Reader, rate: str | int | float | list[str | int | float], where: str) -> Vector:
    """Return an angular velocity: one component in the plane, three in space."""
    if read.dimension == 2 and not isinstance(rate, list):
        return (read.value(rate, units.ANGULAR_RATE, where),)
    if read.dimension == 3 and isinstance(rate, list):
        return read.vector(rate, units.ANGULAR_RATE, where)
    expected = "one angular velocity in the plane" if read.dimension == 2 else "three components in space"
    raise SceneError(f"expected {expected}, got {rate!r}", where=where)
