"""Elastic links as the user writes them: section, elastic, crank and stations."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from symgen.scene.table import Bare, Name, SpatialVector, Table, Value, absent

#: Two values; their number is checked by the reader, which has the better message.
Ends = Annotated[list[Value], Field(json_schema_extra={"minItems": 2, "maxItems": 2})]


class SectionTable(Table):
    """The section of a rod: a rectangle, a circle, or its area and second moment of area.

    A list of two values is a taper: at the first point and at the second, linear between them.
    """

    width: Value | Ends | None = absent("Of a rectangle, across the plane of the bending.")
    thickness: Value | Ends | None = absent("Of a rectangle, in the plane of the bending.")
    diameter: Value | Ends | None = absent("Of a circle.")
    area: Value | Ends | None = absent("Of any other section.")
    second_moment: Value | Ends | None = absent("Of the area, about the neutral axis.")
    fibre: Value | Ends | None = absent("From the neutral axis to the outer fibre.")
    width_along: SpatialVector | None = absent("Direction of the width of a rectangle, in space.")


class Damping(Table):
    """Damping of the bending and stretching of a link, relative to its own axes."""

    ratio: Value | None = absent(
        "Of the critical damping of each mode of the link alone, with free ends; modes of the linkage have "
        "lower ratios: [modal_damping] prescribes these."
    )
    mass: Value | None = absent("Times its mass matrix [1/s].")
    stiffness: Value | None = absent("Times its stiffness matrix [s].")


class Shear(Table):
    """Shear of the section, for elements that have it."""

    modulus: Value | None = absent("Shear modulus.")
    poisson: Value | None = absent("Poisson's ratio, instead of the shear modulus.")
    factor: Value | None = absent("Shear factor; 5/6 of a rectangle and 9/10 of a circle if absent.")


class Reduction(Bare):
    """Which degrees of freedom of a link are kept."""

    BARE, OF = "kind", (str,)
    kind: Literal["guyan", "craig-bampton"] = Field(
        description="guyan: those of its two ends; craig-bampton: and some modes with held ends."
    )
    modes: int | None = absent("How many modes (craig-bampton).")


class ElasticTable(Table):
    """A link that bends and stretches, by finite elements."""

    E: Value = Field(description="Young's modulus.")
    element: str = Field("beam8", description="The finite element: beam8, cubic, timoshenko, ...")
    elements: int | None = absent("How many of them; so many that their error is small if absent.")
    axial: bool = Field(True, description="Whether it stretches; otherwise it keeps its length.")
    geometric_stiffness: bool = Field(True, description="Whether tension stiffens it and pressure softens.")
    damping: Damping = Field(default=Damping())
    shear: Shear | None = None
    reduction: Reduction | None = None
    yield_stress: Value | None = absent("Stress beyond which a result warns.")


class CrankTable(Table):
    """How the input of a linkage with elastic links turns, but for its elastic motion."""

    link: Name = Field(description="Its first point is on the ground.")
    mode: Literal["held", "free", "motor"] = Field(
        "held", description="Whether its shaft turns exactly so, runs freely, or is driven by a motor."
    )
    speed: Value | None = absent("Constant; absent if the angle depends on the time.")
    angle: Value | None = absent("Its direction at t = 0, or at the time t; as drawn at t = 0 if absent.")
    torque: Value | None = absent(
        "Of the motor. May use the time t, states, and the crank's this.angle and this.rate."
    )
    flywheel: Value | None = absent("Moment of inertia on its shaft.")


class Weld(Table):
    """Elastic links whose sections at a point have the same rotation; at a ground point they have none."""

    point: Name
    links: list[Name] = Field(description="One or more at a ground point, else two or more.")


class JointTable(Table):
    """A joint at an end of an elastic link in space, which is a ball joint otherwise."""

    point: Name
    links: list[Name] = Field(
        min_length=1, max_length=2, description="An elastic link, and the other one; without, the ground."
    )
    kind: Literal["revolute", "universal"] = Field(
        description="universal: the axis is fixed in the second link, the other one is across the first."
    )
    axis: SpatialVector = Field(description="Direction of the axis at the start.")


class ModalDampingTable(Table):
    """Damping of the modes of the assembled structure at rest, in the pose in which the crank starts."""

    ratio: Value | list[Value] = Field(
        description="Of the critical damping: of every mode, or a list for the first modes."
    )


class StationTable(Table):
    """A position on an elastic link for the output of strains and stresses."""

    link: Name
    at: Value = Field(description="Where along it: 0 at its first point, 1 at its second.")
    fibre: Value | None = absent(
        "Distance from the neutral axis, positive to the right of the link; the outer fibre there if absent."
    )
    name: Name | None = absent("Name in the results; link and percent of its length by default.")
