"""Masses, springs, forces and torques of a scene."""

from __future__ import annotations

from collections.abc import Iterator

from symgen.errors import SceneError
from symgen.scene import units
from symgen.scene.linkage import (
    AngularSpring,
    AppliedForce,
    AppliedTorque,
    DistributedForce,
    LinearSpring,
    LineForce,
    PlacedMass,
)
from symgen.scene.reading import Reader


def masses(read: Reader) -> Iterator[PlacedMass]:
    """Yield the point masses."""
    for i, mass in enumerate(read.scene.masses):
        point = read.known_point(mass.point, f"masses.{i}.point")
        yield PlacedMass(point.name, read.not_negative(mass.mass, units.MASS, f"masses.{i}.mass"))


def springs(read: Reader) -> Iterator[LinearSpring]:
    """Yield the springs between points."""
    scene = read.scene
    for i, spring in enumerate(scene.springs):
        where = f"springs.{i}"
        start, end = (read.known_point(p, f"{where}.between") for p in spring.between)
        led = scene.start.angles or scene.driven or any(k.length is not None for k in scene.links.values())
        length = read.not_negative(spring.length, units.LENGTH, f"{where}.length")
        damping = read.not_negative(spring.damping or 0, units.DAMPING, f"{where}.damping")
        directed = length != 0 or damping != 0
        if start.name == end.name or (start.at == end.at and directed and not led):
            raise SceneError(
                "a spring needs two different points: at one place it has no direction",
                where=f"{where}.between",
            )
        yield LinearSpring(
            name=f"spring_{i}",
            start=start.name,
            end=end.name,
            stiffness=read.not_negative(spring.stiffness, units.STIFFNESS, f"{where}.stiffness"),
            length=length,
            damping=damping,
        )


def actuators(read: Reader) -> Iterator[LineForce]:
    """Yield the forces along lines between points."""
    for i, actuator in enumerate(read.scene.actuators):
        where, name = f"actuators.{i}", f"actuator_{i}"
        start, end = (read.known_point(p, f"{where}.between").name for p in actuator.between)
        if start == end:
            raise SceneError("an actuator needs two different points", where=f"{where}.between")
        names = read.with_state(name, {"length": units.LENGTH, "rate": units.VELOCITY})
        yield LineForce(name, start, end, read.value(actuator.force, units.FORCE, f"{where}.force", names))


def torsion_springs(read: Reader) -> Iterator[AngularSpring]:
    """Yield the torsion springs between links."""
    for i, spring in enumerate(read.scene.torsion_springs):
        where = f"torsion_springs.{i}"
        _couple(read, spring.link, spring.against, where)
        angle = read.value(spring.angle, units.NUMBER, f"{where}.angle")
        damping = read.not_negative(spring.damping or 0, units.ANGULAR_DAMPING, f"{where}.damping")
        pair = [k for k in (spring.link, spring.against) if k is not None]
        rods = len(pair) == 2 and not any(map(read.is_spatial_body, pair))
        if read.dimension == 3 and not rods:
            raise SceneError(
                "in space a torsion spring joins two rods, not a body or the ground",
                where=where,
                hint="Put it between two rods: link and against.",
            )
        if read.dimension == 3 and (angle != 0 or damping != 0):
            raise SceneError(
                "in space a torsion spring bends two rods that are slack in line: it takes link, against and "
                "stiffness, and no angle or damping",
                where=where,
                hint="Its energy is stiffness*(1 - cos(angle between the rods)), regular at every angle.",
            )
        yield AngularSpring(
            name=f"torsion_spring_{i}",
            link=spring.link,
            against=spring.against or "",
            stiffness=read.not_negative(spring.stiffness, units.TORQUE, f"{where}.stiffness"),
            angle=angle,
            damping=damping,
        )


def forces(read: Reader) -> Iterator[AppliedForce]:
    """Yield the forces on points."""
    for i, force in enumerate(read.scene.forces):
        point = read.known_point(force.point, f"forces.{i}.point")
        vector = read.vector(force.force, units.FORCE, f"forces.{i}.force", read.with_state())
        yield AppliedForce(point.name, vector)


def distributed(read: Reader) -> Iterator[DistributedForce]:
    """Yield the distributed forces on links."""
    for i, load in enumerate(read.scene.distributed_forces):
        where, names = f"distributed_forces.{i}", read.with_state()
        read.known_link(load.link, f"{where}.link")
        if read.dimension != 2:
            raise SceneError(
                "forces are distributed along links in the plane, not in space",
                where=where,
                hint='Write [[forces]] on points of the link: P = { on = "link", fraction = 0.5 }.',
            )
        read.moving_link(load.link, f"{where}.link")
        start = read.vector(load.force, units.STIFFNESS, f"{where}.force", names)
        end = start if load.end is None else read.vector(load.end, units.STIFFNESS, f"{where}.end", names)
        yield DistributedForce(load.link, start, end, load.axes == "link")


def torques(read: Reader) -> Iterator[AppliedTorque]:
    """Yield the torques on links."""
    for i, torque in enumerate(read.scene.torques):
        where, name = f"torques.{i}", f"torque_{i}"
        _couple(read, torque.link, torque.against, where)
        if read.dimension == 3:
            if not isinstance(torque.torque, list):
                raise SceneError(
                    "expected the three components of a torque in space", where=f"{where}.torque"
                )
            vector = read.vector(torque.torque, units.TORQUE, f"{where}.torque", read.with_state())
        elif isinstance(torque.torque, list):
            raise SceneError("expected one torque, counter-clockwise, in the plane", where=f"{where}.torque")
        else:
            names = read.with_state(name, {"angle": units.NUMBER, "rate": units.ANGULAR_RATE})
            vector = (read.value(torque.torque, units.TORQUE, f"{where}.torque", names),)
        yield AppliedTorque(name, torque.link, vector, torque.against or "")


def _couple(read: Reader, link: str, against: str | None, where: str) -> None:
    """Check that a couple acts on a link that can turn, against another one."""
    read.moving_link(link, f"{where}.link")
    if against is not None:
        read.moving_link(against, f"{where}.against")
        if against == link:
            raise SceneError("a torque of a link against itself does nothing", where=f"{where}.against")
