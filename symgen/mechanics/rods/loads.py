"""Potentials of loads on points, and the named vectors and distances of loads."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from symgen.mechanics.rods.particles import Vector
from symgen.symbolic.calculus import Calculus
from symgen.symbolic.vectors import dot


def weight_potential(mass: sp.Expr, gravity: Vector, position: Vector) -> sp.Expr:
    """Return the potential [J] of a mass [kg] at a position [m] in uniform gravity [m/s^2]."""
    return -mass * dot(gravity, position)


def vector_between(calculus: Calculus, name: str, start: Vector, end: Vector, axes: Sequence[str]) -> Vector:
    """Name and return the components of the vector [m] from one position to another."""
    return tuple(
        calculus.define(f"{name}_d{axis}", b - a, "m", f"{axis} component from start to end of {name}")
        for axis, a, b in zip(axes, start, end, strict=True)
    )


def distance(calculus: Calculus, name: str, along: Vector) -> sp.Expr:
    """Name and return the length [m] of a vector."""
    return calculus.define(f"{name}_length", sp.sqrt(dot(along, along)), "m", f"length of {name}")
