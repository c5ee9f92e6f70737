"""Masses, springs, forces and torques of a scene."""

from __future__ import annotations

from collections.abc import Iterator

from symgen.errors import SceneError
from symgen.scene import units
from symgen.scene.linkage import AppliedForce, AppliedTorque, LinearSpring, PlacedMass
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
        led = scene.start.angles or scene.drivers or any(k.length is not None for k in scene.links.values())
        if start.name == end.name or (start.at == end.at and not led):
            raise SceneError(
                "a spring needs two different points: at one place it has no direction",
                where=f"{where}.between",
            )
        yield LinearSpring(
            name=f"spring_{i}",
            start=start.name,
            end=end.name,
            stiffness=read.not_negative(spring.stiffness, units.STIFFNESS, f"{where}.stiffness"),
            length=read.not_negative(spring.length, units.LENGTH, f"{where}.length"),
            damping=read.not_negative(spring.damping or 0, units.DAMPING, f"{where}.damping"),
        )


def forces(read: Reader) -> Iterator[AppliedForce]:
    """Yield the forces on points."""
    for i, force in enumerate(read.scene.forces):
        point = read.known_point(force.point, f"forces.{i}.point")
        vector = read.vector(force.force, units.FORCE, f"forces.{i}.force", read.with_time)
        yield AppliedForce(point.name, vector)


def torques(read: Reader) -> Iterator[AppliedTorque]:
    """Yield the torques on links."""
    for i, torque in enumerate(read.scene.torques):
        where = f"torques.{i}"
        read.turning_link(torque.link, f"{where}.link")
        if torque.against is not None:
            read.turning_link(torque.against, f"{where}.against")
            if torque.against == torque.link:
                raise SceneError("a torque of a link against itself does nothing", where=f"{where}.against")
        value = read.value(torque.torque, units.TORQUE, f"{where}.torque", read.with_time)
        yield AppliedTorque(torque.link, value, torque.against or "")
