"""Loads on points by virtual work: potentials, and the named geometry they need."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from symgen.mechanics.particles import Vector, dot
from symgen.symbolic.calculus import Calculus


def weight_potential(mass: sp.Expr, gravity: Vector, position: Vector) -> sp.Expr:
    """Return the potential [J] of a mass [kg] at a position [m] in uniform gravity [m/s^2]."""
    return -mass * dot(gravity, position)


def vector_between(calculus: Calculus, name: str, start: Vector, end: Vector, axes: Sequence[str]) -> Vector:
    """Name the components of the vector [m] from one position to another, and return them."""
    return tuple(
        calculus.define(f"{name}_d{axis}", b - a, "m", f"{axis} component from start to end of {name}")
        for axis, a, b in zip(axes, start, end, strict=True)
    )


def distance(calculus: Calculus, name: str, along: Vector) -> sp.Expr:
    """Name the length [m] of a vector, and return it."""
    return calculus.define(f"{name}_length", sp.sqrt(dot(along, along)), "m", f"length of {name}")


def spring_potential(stiffness: sp.Expr, slack: sp.Expr, length: sp.Expr) -> sp.Expr:
    """Return the energy [J] of a spring: stiffness [N/m], slack length [m], present length [m]."""
    return stiffness * (length - slack) ** 2 / 2
