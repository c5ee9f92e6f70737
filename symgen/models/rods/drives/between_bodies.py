"""The drive of a body in space from another one, about the line through two points that they share."""

from __future__ import annotations

import sympy as sp

from symgen.mechanics.rods.hinge import hinge_frame
from symgen.mechanics.rods.particles import Vector
from symgen.models.rods.drives.about_axis import at_ends
from symgen.models.rods.drives.drive import AngleDrive, of_driver
from symgen.models.rods.points import Points
from symgen.scene.rods.linkage import SpatialBody
from symgen.scene.rods.rotations import Driver
from symgen.symbolic.vectors import dot


def bodies_drive(model: Points, driver: Driver) -> AngleDrive:
    """Return the drive whose arm is fixed in the driven body, and its angle's reference in the other one."""
    link, other = driver.link, driver.against
    body, carrier = (next(b for b in model.linkage.bodies if b.name == name) for name in driver.links)
    hinge = next(hinge for hinge in model.linkage.hinges if hinge.link == link)
    end = model.farthest(body.base, hinge.point, hinge.axis)
    frame = hinge_frame(hinge.axis, model.drawn_from(hinge.point, end))
    ends = _fixed(model, body, tuple(frame.arm * c for c in frame.across))
    x, y = (at_ends(_fixed(model, carrier, v), model.position) for v in (frame.across, frame.third))
    about = f"driven angle of {link} from {other}"
    arm = at_ends(ends, model.position)
    return AngleDrive(
        **of_driver(driver, f" from {other} about its axis", about, "relative_angle"),
        arm=arm,
        x=x,
        y=y,
        lever=frame.arm,
        slopes={other: arm},
        ends={link: ends, other: _fixed(model, carrier, frame.tangent(driver.angle))},
    )


def _fixed(model: Points, body: SpatialBody, drawn: Vector) -> dict[str, sp.Expr]:
    """Return the parts with which base points count in a vector that is fixed in a body, as drawn."""
    first, *others = body.base
    edges = [model.drawn_from(first, p) for p in others]
    parts = [sp.Add(*(w * dot(e, drawn) for w, e in zip(row, edges, strict=True))) for row in body.inverse]
    return {first: -sp.Add(*parts)} | dict(zip(others, parts, strict=True))
