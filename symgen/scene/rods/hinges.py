"""Revolute joints between links in space and the ground."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp


@dataclass(frozen=True, slots=True)
class Hinge:
    """A revolute joint at a ground point of a link in space; ``axis`` is its direction, of any length."""

    link: str
    point: str
    axis: tuple[sp.Expr, ...]
