"""The drive of the direction of a link in the plane, from that of another link, on which it reacts."""

from __future__ import annotations

import sympy as sp

from symgen.mechanics.rods.drive import along_and_left, by_other
from symgen.models.rods.drives.drive import AngleDrive, of_driver
from symgen.models.rods.points import Points
from symgen.scene.rods.rotations import Driver
from symgen.symbolic.vectors import dot


def relative_drive(model: Points, driver: Driver) -> AngleDrive:
    """Return the drive of the angle from the vector along the other link.

    The length of a link between ground points follows their motion.
    """
    link, other = driver.link, driver.against
    arm, d, length = model.along[link], model.along[other], model.linkage.link(link).length
    reach = sp.sqrt(dot(d, d)) if other in model.idle else model.linkage.link(other).length
    x, y = along_and_left(d, reach)
    about = f"driven angle of {link} from {other}"
    return AngleDrive(
        **of_driver(driver, f" from {other}, counter-clockwise", about, "relative_angle"),
        arm=arm,
        x=x,
        y=y,
        lever=length,
        slopes={other: by_other(driver.angle, arm, reach)},
        torques={link: -length, other: length},
    )
