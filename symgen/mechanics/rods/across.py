"""Vectors across a line in space."""

from __future__ import annotations

import sympy as sp

from symgen.mechanics.rods.particles import Vector
from symgen.symbolic.calculus import ZERO, Calculus
from symgen.symbolic.quantity import AXES
from symgen.symbolic.switch import Sign
from symgen.symbolic.vectors import cross


def named_vector(calculus: Calculus, name: str, vector: Vector, about: str) -> Vector:
    """Return a vector [m] by named components."""
    return tuple(
        calculus.define(f"{name}_{axis}", c, "m", f"{axis} component of {about}")
        for axis, c in zip(AXES, vector, strict=True)
    )


def vectors_across(
    calculus: Calculus, name: str, line: str, d: Vector, squared: sp.Expr, length: sp.Expr
) -> list[Vector]:
    """Return two vectors [m] across d, of this length: d x c and (d x c) x d / l.

    c is the axis x or z, whichever is more transverse to d: with a constant c, or one that follows d
    continuously, both vanish in some direction.
    """
    more = (d[0] - d[2]) * (d[0] + d[2]) / squared
    about = f"1 where {line} is along x more than along z, -1 where less"
    side = calculus.define(f"{name}_side", Sign(more), "1", about)
    # For a side of zero c is not along d either: its components x and z differ then.
    first = named_vector(
        calculus, f"{name}_across", cross(d, ((1 - side) / 2, ZERO, 1 + side)), f"a vector across {line}"
    )
    upright = tuple(x / length for x in cross(first, d))
    about = f"a vector across {line} and the other one"
    return [first, named_vector(calculus, f"{name}_upright", upright, about)]
