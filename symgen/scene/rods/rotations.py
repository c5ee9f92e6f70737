"""Constraints on rotations of links: drives, revolute joints in space, gears in the plane; and motions.

Tables of the scene, and records.
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp
from pydantic import Field

from symgen.scene.table import Name, Table, Value, absent


class GearTable(Table):
    """Gears fixed to two links in the plane, which mesh as drawn."""

    links: list[Name] = Field(min_length=2, max_length=2)
    teeth: list[int] = Field(min_length=2, max_length=2, description="Numbers of teeth, in the same order.")
    internal: bool = Field(False, description="The teeth of the second one are inside: both turn alike.")
    carrier: Name | None = absent("The link that carries the axes of both; the ground if absent.")


class DriverTable(Table):
    """A link whose direction is prescribed, from its first point to its second; in space its rotation."""

    link: Name
    against: Name | None = absent(
        "The link from which the angle is taken, and on which the reaction acts; the ground if absent. In "
        "space both are bodies that share two points, the axis."
    )
    angle: Value = Field(description="May use the time t.")


class MotionTable(Table):
    """A prescribed motion of a quantity of the linkage, which drives of unknown effort "?" keep."""

    of: str = Field(
        description="A length or an angle of the state such as A.position.x or, in the plane, rocker.angle, "
        "or an expression of them."
    )
    value: Value = Field(description="May use the time t.")


@dataclass(frozen=True, slots=True)
class Hinge:
    """A revolute joint at a ground point of a link in space; ``axis`` is its direction, of any length.

    With ``against`` it is between two bodies, about the line through two points that they share, as drawn.
    """

    link: str
    point: str
    axis: tuple[sp.Expr, ...]
    against: str = ""


@dataclass(frozen=True, slots=True)
class GearPair:
    """Gears fixed to two links in the plane, which mesh as drawn.

    ``teeth`` are their numbers, the second one negative for internal teeth, without common factors.
    ``carrier`` is the link that carries both axes, "" the ground.
    """

    name: str
    links: tuple[str, str]
    teeth: tuple[int, int]
    carrier: str


@dataclass(frozen=True, slots=True)
class Driver:
    """A link whose direction [rad] is prescribed by the time t; in space its rotation from the drawing.

    With ``against`` it is the direction from that of another link, on which the reaction acts.
    """

    link: str
    angle: sp.Expr
    against: str = ""

    @property
    def links(self) -> tuple[str, ...]:
        """The driven link, and the one from which its angle is."""
        return tuple(filter(None, (self.link, self.against)))

    @property
    def row(self) -> str:
        """Name of its constraint."""
        return f"{self.link}_drive"

    @property
    def output(self) -> str:
        """Name of the output that is the prescribed angle."""
        return f"{self.link}.{'relative_angle' if self.against else 'angle'}"


@dataclass(frozen=True, slots=True)
class PrescribedMotion:
    """A length [m] or an angle [rad] ``of`` the state that is ``value``, a function of the time t.

    ``name`` is that of its constraint, ``output`` that of the prescribed quantity in results, ``text`` the
    quantity as written. ``links`` are those whose angles are in it.
    """

    name: str
    output: str
    text: str
    of: sp.Expr
    value: sp.Expr
    links: tuple[str, ...]
