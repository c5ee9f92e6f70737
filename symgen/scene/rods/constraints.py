"""Guides, revolute joints with the ground, gears, drivers and the start of a scene."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import gcd

from symgen.errors import SceneError
from symgen.scene import units
from symgen.scene.elastic.schema import JointTable, Weld
from symgen.scene.reading import Reader
from symgen.scene.rods.linkage import Guide, StartConditions, Vector
from symgen.scene.rods.rotations import Driver, GearPair, Hinge
from symgen.scene.schema import Scene


def guides(read: Reader) -> Iterator[Guide]:
    """Yield the guides."""
    for i, guide in enumerate(read.scene.guides):
        where = f"guides.{i}"
        read.known_link(guide.along, f"{where}.along")
        points = tuple(read.known_point(p, f"{where}.points").name for p in guide.points)
        if len(set(points)) < len(points):
            raise SceneError("a guide names each of its points once", where=f"{where}.points")
        if read.is_spatial_body(guide.along):
            raise SceneError(
                f"{guide.along} is a body: a guide runs along a rod",
                where=f"{where}.along",
                hint='Name a rod of mass = "0 kg" between two points of the body.',
            )
        for point in points:
            if point in read.scene.links[guide.along].points or read.scene.points[point].on == guide.along:
                raise SceneError(f"{point} belongs to {guide.along} already", where=f"{where}.points")
        yield Guide(f"guide_{i}", points, guide.along)


def drivers(read: Reader) -> Iterator[Driver]:
    """Yield the drivers: one at most for each link."""
    driven: dict[str, str] = {}
    for i, driver in enumerate(read.scene.drivers):
        where, other = f"drivers.{i}", driver.against or ""
        if not (other and read.dimension == 3):
            _check_driven(read, driver.link, f"{where}.link")
        if driver.link in driven:
            raise SceneError(
                f"the link {driver.link} is driven twice",
                where=f"{where}.link",
                hint="Of two links that a drive is between, either may be the driven one: exchange link and "
                "against."
                if other or driven[driver.link]
                else "",
            )
        if other:
            _check_against(read, driver.link, other, f"{where}.against")
        driven[driver.link] = other
        _check_no_circle(driven, driver.link, f"{where}.against")
        angle = read.value(driver.angle, units.NUMBER, f"{where}.angle", read.with_time)
        read.moving(angle, units.NUMBER, f"{where}.angle")
        yield Driver(driver.link, angle, other)


def _check_against(read: Reader, name: str, other: str, where: str) -> None:
    """Check that a link may be driven against another one."""
    read.known_link(other, where)
    if other == name:
        raise SceneError("expected another link than the driven one", where=where)
    if read.has_elastic_links:
        raise SceneError(
            "drives between two links are for linkages of rigid links",
            where=where,
            hint="Drive the links against the ground, or leave elastic out.",
        )
    if read.dimension == 3:
        _shared_axis(read, name, other, where)


def _shared_axis(read: Reader, name: str, other: str, where: str) -> list[str]:
    """Return the two points that two bodies in space share, about whose line one is driven."""
    shared = [p for p in read.scene.links[name].points if p in read.scene.links[other].points]
    if not (read.is_spatial_body(name) and read.is_spatial_body(other)) or len(shared) != 2:
        raise SceneError(
            f"expected two bodies that share two points, the axis of the drive, got {name} and {other} with "
            + (f"the points {', '.join(shared)} in common" if shared else "no point in common"),
            where=where,
            hint="Between other links in space, prescribe the length of a massless link by t.",
        )
    return shared


def _check_no_circle(driven: Mapping[str, str], name: str, where: str) -> None:
    """Check that the drives do not prescribe the angle of a link from itself."""
    circle = [name]
    while other := driven.get(circle[-1], ""):
        if other == name:
            raise SceneError(
                f"the drives of {', '.join(circle)} prescribe each other in a circle: the sum of their "
                "angles is zero",
                where=where,
                hint="Leave one of them out, or drive it against the ground.",
            )
        circle.append(other)


def gears(read: Reader) -> Iterator[GearPair]:
    """Yield the pairs of gears; the second one of a pair on a carrier may be fixed to the ground."""
    for i, table in enumerate(read.scene.gears):
        where = f"gears.{i}"
        if read.dimension != 2:
            raise SceneError("gears are in the plane", where=where, hint="Give points two coordinates.")
        carrier = [table.carrier] if table.carrier is not None else []
        for key, names in (("links", table.links), ("carrier", carrier)):
            for name in names:
                may_stand = carrier and key == "links" and name == table.links[1]
                (read.known_link if may_stand else read.moving_link)(name, f"{where}.{key}")
                if read.is_elastic(name):
                    raise SceneError(f"{name} is elastic and has no one angle", where=f"{where}.{key}")
        if len({*table.links, *carrier}) < 2 + len(carrier):
            raise SceneError("expected different links", where=f"{where}.{'carrier' if carrier else 'links'}")
        first, second = table.teeth
        if min(table.teeth) < 1:
            raise SceneError(
                f"expected numbers of teeth of at least 1, got {table.teeth}", where=f"{where}.teeth"
            )
        common = gcd(first, second)
        teeth = first // common, (-second if table.internal else second) // common
        yield GearPair(f"gears_{i}", (table.links[0], table.links[1]), teeth, table.carrier or "")


def is_hinge(scene: Scene, joint: JointTable | Weld) -> bool:
    """Return whether a joint is revolute, between one rigid link and the ground."""
    rigid = [name for name in joint.links if name in scene.links and scene.links[name].elastic is None]
    return isinstance(joint, JointTable) and joint.kind == "revolute" and len(rigid) == len(joint.links) == 1


def hinges(read: Reader, driven: Sequence[Driver]) -> Iterator[Hinge]:
    """Yield the revolute joints between links in space and the ground: one at most for each link.

    A driven body on two ground points has one about the line from the first to the second; one that is driven
    against another body, about the line through the points that they share.
    """
    seen: set[str] = set()
    for i, joint in enumerate(read.scene.joints):
        where, name = f"joints.{i}", joint.links[0]
        read.known_point(joint.point, f"{where}.point")
        for other in joint.links:
            read.known_link(other, f"{where}.links")
        if read.dimension == 2 or not is_hinge(read.scene, joint):
            continue
        read.moving_link(name, f"{where}.links")
        link = read.scene.links[name]
        if not read.known_point(joint.point, f"{where}.point").ground or joint.point not in link.points:
            raise SceneError(
                f"expected a ground point of {name}, got {joint.point}: the revolute joint of a rigid link "
                "alone is with the ground",
                where=f"{where}.point",
            )
        if link.length is not None or (read.is_spatial_body(name) and read.has_elastic_links):
            raise SceneError(
                f"expected a rod of two points with its drawn length, got {name}",
                where=f"{where}.links",
                hint="A body rotates about an axis if two of its points are ground points.",
            )
        if name in seen:
            raise SceneError(f"{name} has two revolute joints with the ground", where=where)
        seen.add(name)
        if read.is_spatial_body(name):
            yield Hinge(name, joint.point, read.direction(joint.axis, f"{where}.axis"))
            continue
        axis = read.vector(joint.axis, units.NUMBER, f"{where}.axis")
        if read.is_along(name, axis):
            raise SceneError(
                f"expected an axis across {name}, got one along it, or zero", where=f"{where}.axis"
            )
        yield Hinge(name, joint.point, axis)
    for driver in driven if read.dimension == 3 else ():
        ends = [p.name for p in read.ground_points(driver.link)] if read.is_spatial_body(driver.link) else []
        if driver.against:
            ends = _shared_axis(read, driver.link, driver.against, "drivers")
        if driver.against or (driver.link not in seen and len(ends) > 1):
            start, end = (read.points[p] for p in ends[:2])
            axis = tuple(b - a for a, b in zip(start.at, end.at, strict=True))
            yield Hinge(driver.link, start.name, axis, driver.against)


def _check_driven(read: Reader, name: str, where: str) -> None:
    """Check that a link has one angle: its direction in the plane, or its rotation about an axis in space."""
    if read.dimension == 2:
        read.turning_link(name, where)
        return
    read.known_link(name, where)
    body = read.is_spatial_body(name)
    if body and read.has_elastic_links:
        raise SceneError(
            f"{name} is a body: with elastic links in space, drives rotate rods",
            where=where,
            hint=f"Drive a massless rod from the axis of {name} to one of its points.",
        )
    hinged = any(is_hinge(read.scene, joint) and joint.links == [name] for joint in read.scene.joints)
    if not hinged and not (body and len(read.ground_points(name)) > 1):
        raise SceneError(
            f"{name} has no revolute joint with the ground, about whose axis it could be driven",
            where=where,
            hint=f'Write [[joints]] with point, links = ["{name}"], kind = "revolute" and axis.',
        )


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
    if start.equilibrium:
        _check_rest(read.scene)
    return StartConditions(
        angles=tuple((n, read.value(v, units.NUMBER, f"start.angles.{n}")) for n, v in start.angles.items()),
        rates=tuple((n, _rate(read, v, f"start.rates.{n}")) for n, v in start.rates.items()),
        velocities=tuple(
            (n, read.vector(v, units.VELOCITY, f"start.velocities.{n}")) for n, v in start.velocities.items()
        ),
        equilibrium=start.equilibrium,
    )


def _check_rest(scene: Scene) -> None:
    """Raise SceneError for a scene whose runs do not start in an equilibrium of its rigid links."""
    moved = [f"start.{table}.{n}" for table in ("rates", "velocities") for n in getattr(scene.start, table)]
    if moved:
        raise SceneError(
            "a start in equilibrium is at rest", where=moved[0], hint="Leave it out, or start.equilibrium."
        )
    where = "start.equilibrium"
    if any(link.elastic for link in scene.links.values()):
        raise SceneError(
            "runs of elastic links do not start in an equilibrium that is found from the drawing",
            where=where,
            hint='Leave it out: simulate(initial="quasi-static"), --initial quasi-static, starts them with '
            "the shape under their loads.",
        )
    if scene.analysis.kind == "kinematics":
        raise SceneError(
            "kinematics has no loads, so no equilibrium", where=where, hint="Leave out analysis.kind."
        )


def _rate(read: Reader, rate: str | int | float | list[str | int | float], where: str) -> Vector:
    """Return an angular velocity: one component in the plane, three in space."""
    if read.dimension == 2 and not isinstance(rate, list):
        return (read.value(rate, units.ANGULAR_RATE, where),)
    if read.dimension == 3 and isinstance(rate, list):
        return read.vector(rate, units.ANGULAR_RATE, where)
    expected = "one angular velocity in the plane" if read.dimension == 2 else "three components in space"
    raise SceneError(f"expected {expected}, got {rate!r}", where=where)
