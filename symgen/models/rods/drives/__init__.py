"""Drives of a linkage: one file for each kind, and its line here."""

from __future__ import annotations

from symgen.models.rods.drives.about_axis import axis_drive
from symgen.models.rods.drives.between_bodies import bodies_drive
from symgen.models.rods.drives.between_links import relative_drive
from symgen.models.rods.drives.direction import direction_drive
from symgen.models.rods.drives.drive import AngleDrive, Drive
from symgen.models.rods.drives.length import length_drives
from symgen.models.rods.drives.motion import motion_drives
from symgen.models.rods.drives.place import place_drives
from symgen.models.rods.points import Points
from symgen.scene.rods.rotations import Driver

#: Kinds of drives of angles, by the number of axes and whether they are against another link.
ANGLES = {
    (2, False): direction_drive,
    (2, True): relative_drive,
    (3, False): axis_drive,
    (3, True): bodies_drive,
}


def angle_drive(model: Points, driver: Driver) -> AngleDrive:
    """Return the drive of the angle of a link."""
    return ANGLES[len(model.axes), bool(driver.against)](model, driver)


def other_drives(model: Points) -> tuple[Drive, ...]:
    """Return the drives of lengths and of the ground, and what motions prescribe."""
    return (*length_drives(model), *place_drives(model), *motion_drives(model))
