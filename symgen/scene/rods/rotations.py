"""Constraints on rotations of links: revolute joints with the ground in space, gears in the plane."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp


@dataclass(frozen=True, slots=True)
class Hinge:
    """A revolute joint at a ground point of a link in space; ``axis`` is its direction, of any length."""

    link: str
    point: str
    axis: tuple[sp.Expr, ...]


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
