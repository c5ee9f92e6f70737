"""The ``loop`` table of a scene as written by the user: a spatial loop, one row per joint."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from symgen.scene.table import Moments, Name, SpatialVector, Table, Value, absent


class LoopRow(Table):
    """A joint, and the link from it to the next one: Z(theta + eps S) Y(eta) X(alpha + eps a).

    An entry is a constant, the name of an input or a free variable (or a linear expression of one), or
    "?" where it follows from closure; it may vary where the joint lets it.
    """

    joint: str = Field(description="Letter of the joint: R, P, C, H, S or U.")
    link: Name = Field(description="The link the row ends on; that of the last row is the ground.")
    theta: Value | None = absent("Rotation about k.")
    S: Value | None = absent("Way along k.")
    eta: Value | None = absent("Rotation about j, after theta.")
    alpha: Value | None = absent("Rotation about i, after eta: the twist of the link.")
    a: Value | None = absent("Way along i: the length of the link.")
    pitch: Value | None = absent("Of a helical joint: its way along k for each radian.")


class LoopLink(Table):
    """Mass properties of a link, in its frame: at its far joint, i outward along the link."""

    mass: Value
    centre: SpatialVector | None = absent("Centre of mass; the origin if absent.")
    inertia: Moments | None = absent("About the centre of mass: xx, yy, zz, and xy, xz, yz; zero if absent.")


class LinkLoad(Table):
    """A force at a point of a link, and a couple on it; they may use t and the state."""

    link: Name
    force: SpatialVector | None = None
    at: SpatialVector | None = absent("Where the force acts, in the link's frame; its origin if absent.")
    torque: SpatialVector | None = None
    frame: Literal["link", "ground"] = Field("link", description="Whose axes force and torque are given in.")


class FreeStart(Table):
    """Where an independent coordinate of the motion starts, and how fast."""

    at: Value
    rate: Value = 0


class SpatialLoop(Table):
    """A single closed loop of links, one row per joint."""

    rows: list[LoopRow] = Field(min_length=2)
    inputs: dict[Name, Value] = Field(
        default_factory=dict, description="Prescribed motions, by the time t and by the inputs before them."
    )
    range: Annotated[list[Value], Field(min_length=2, max_length=2)] | None = absent(
        "Range of the first input; one revolution by default."
    )
    free: dict[Name, FreeStart] = Field(
        default_factory=dict, description="Independent coordinates whose motion follows from the forces."
    )
    drives: dict[Name, Value] = Field(
        default_factory=dict,
        description='Torque or force of the drive at a variable, or "?" where it is to be found.',
    )
    start: dict[Name, Value] = Field(
        default_factory=dict,
        description='First guesses of variables that are "?"; zero if absent. The nearest closure is taken.',
    )
    links: dict[Name, LoopLink] = Field(default_factory=dict)
    loads: list[LinkLoad] = Field(default_factory=list)
