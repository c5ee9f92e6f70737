"""The drive of a link in space about an axis that is fixed in the ground."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import sympy as sp

from symgen.errors import SceneError
from symgen.mechanics.rods.hinge import HingeFrame, hinge_frame
from symgen.mechanics.rods.particles import Vector
from symgen.models.rods.drives.drive import AngleDrive, of_driver
from symgen.models.rods.points import Points
from symgen.scene.rods.linkage import SpatialBody
from symgen.scene.rods.rotations import Driver
from symgen.symbolic.vectors import dot


def axis_drive(model: Points, driver: Driver) -> AngleDrive:
    """Return the drive of a rod about its revolute joint, or of a body about two of its ground points.

    The arm of a body runs to a base point from its foot on the axis: the force of the drive is then a couple
    about the axis alone.
    """
    link, body = driver.link, model.linkage.body(driver.link)
    if body is None:
        return AngleDrive(**_about_ground(driver, model.hinges[link]), arm=model.along[link])
    ends = _from_foot(model, body)
    axis = next(hinge.axis for hinge in model.linkage.hinges if hinge.link == link)
    frame = hinge_frame(axis, at_ends(ends, lambda p: model.linkage.point(p).at))
    return AngleDrive(**_about_ground(driver, frame), arm=at_ends(ends, model.position), ends={link: ends})


def _about_ground(driver: Driver, frame: HingeFrame) -> dict[str, Any]:
    about = f"rotation of {driver.link} about its joint, from the drawing"
    of_frame = {"x": frame.across, "y": frame.third, "lever": frame.arm}
    return of_driver(driver, " about its axis", about, "angle") | of_frame


def _from_foot(model: Points, body: SpatialBody) -> dict[str, sp.Expr]:
    """Return the parts with which base points count in the arm of a body."""
    grounded = [p for p in body.base if p in model.ground]
    if len(grounded) < 2:
        raise SceneError(
            f"the ground points of {body.name} are too near each other for an axis",
            where=f"links.{body.name}.points",
            hint="Move them apart, or write [[joints]] with one of them and the direction of the axis.",
        )
    first, second = grounded[:2]
    axis = model.drawn_from(first, second)
    end = model.farthest([p for p in body.base if p not in grounded], first, axis)
    along = dot(model.drawn_from(first, end), axis) / dot(axis, axis)
    return {first: along - 1, second: -along, end: sp.Integer(1)}


def at_ends(ends: Mapping[str, sp.Expr], place: Callable[[str], Vector]) -> Vector:
    """Return the sum of the places of base points, each times its part."""
    places = [(part, place(point)) for point, part in ends.items()]
    return tuple(sp.Add(*(part * there[i] for part, there in places)) for i in range(3))
