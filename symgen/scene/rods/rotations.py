"""Constraints on rotations of links: drives, revolute joints in space, gears in the plane."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp


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
