"""A drive: the angle phi of a vector a of one link, from a vector x fixed in another one or the ground.

With the unit vectors x and y, a quarter turn on, the components of a by them are |a| cos phi and
|a| sin phi, and a.n = |a| sin(phi - angle) is zero for n = y cos(angle) - x sin(angle). The multiplier of
a.n = 0 times |a| is minus the torque of the drive on the link of a; its reaction acts on the other one.
"""

from __future__ import annotations

import sympy as sp

from symgen.mechanics.rods.particles import Vector


def across(angle: sp.Expr, x: Vector, y: Vector) -> Vector:
    """Return the unit vector n: the slope of a.n by a."""
    return tuple(sp.Add(sp.cos(angle) * b, -sp.sin(angle) * a) for a, b in zip(x, y, strict=True))


def along_and_left(b: Vector, length: sp.Expr) -> tuple[Vector, Vector]:
    """Return x and y along a link in the plane and to its left; b is the vector along it, of this length."""
    return (b[0] / length, b[1] / length), (-b[1] / length, b[0] / length)


def by_other(angle: sp.Expr, a: Vector, length: sp.Expr) -> Vector:
    """Return the slope of a.n by the vector b along the other link in the plane [1]."""
    c, s = sp.cos(angle), sp.sin(angle)
    return (-s * a[0] + c * a[1]) / length, (-c * a[0] - s * a[1]) / length
