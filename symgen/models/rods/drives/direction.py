"""The drive of the direction of a link in the plane, from the axis x."""

from __future__ import annotations

from symgen.models.rods.drives.drive import AngleDrive, of_driver
from symgen.models.rods.points import Points
from symgen.scene.rods.rotations import Driver
from symgen.symbolic.calculus import ONE, ZERO


def direction_drive(model: Points, driver: Driver) -> AngleDrive:
    """Return the drive whose arm is the vector along the link."""
    length = model.linkage.link(driver.link).length
    return AngleDrive(
        **of_driver(driver, ", counter-clockwise", f"driven angle of {driver.link}"),
        arm=model.along[driver.link],
        x=(ONE, ZERO),
        y=(ZERO, ONE),
        lever=length,
        torques={driver.link: -length},
    )
