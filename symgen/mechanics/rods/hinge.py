"""A revolute joint between a rod and the ground in space, and the drive that rotates the rod about it.

With the unit vector a along the axis, the vector d along the rod and d0 its drawn value, the joint keeps
a.d = a.d0. The frame u = (d0 - (a.d0) a)/rho, w = a x u, where rho is the length of the numerator, is fixed
in the ground: a rod at the angle phi from the drawing has d.u = rho cos phi and d.w = rho sin phi.
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from symgen.mechanics.rods.particles import Vector
from symgen.symbolic.vectors import cross, dot


@dataclass(frozen=True, slots=True)
class HingeFrame:
    """Axes of a revolute joint, fixed in the ground, and the arm rho of its rod [m].

    ``axis``, ``across`` and ``third`` are a, u and w; ``along`` is a.d0 [m].
    """

    axis: Vector
    across: Vector
    third: Vector
    along: sp.Expr
    arm: sp.Expr

    def error(self, d: Vector) -> sp.Expr:
        """Return a.d - a.d0 [m] of the vector along the rod."""
        return dot(self.axis, d) - self.along

    def components(self, d: Vector) -> tuple[sp.Expr, sp.Expr]:
        """Return the components of the vector along the rod by u and w [m]."""
        return dot(self.across, d), dot(self.third, d)

    def tangent(self, angle: sp.Expr) -> Vector:
        """Return the unit vector w cos phi - u sin phi, in which an end of the rod moves."""
        return _sum((sp.cos(angle), self.third), (-sp.sin(angle), self.across))

    def slope(self, vector: Vector) -> Vector:
        """Return the derivative by the angle of a vector fixed in the rod, a x vector."""
        return cross(self.axis, vector)

    def rotated(self, angle: sp.Expr) -> tuple[Vector, Vector, Vector]:
        """Return the frame a, u, w fixed in the rod, at an angle."""
        across = _sum((sp.cos(angle), self.across), (sp.sin(angle), self.third))
        return self.axis, across, self.tangent(angle)


def hinge_frame(axis: Vector, drawn: Vector) -> HingeFrame:
    """Return the frame of an axis, of any length but zero, and a rod that is not along it."""
    size = sp.sqrt(dot(axis, axis))
    a = tuple(c / size for c in axis)
    along = dot(a, drawn)
    radial = _sum((sp.Integer(1), drawn), (-along, a))
    arm = sp.sqrt(dot(radial, radial))
    across = tuple(c / arm for c in radial)
    return HingeFrame(a, across, cross(a, across), along, arm)


def _sum(*terms: tuple[sp.Expr, Vector]) -> Vector:
    return tuple(sp.Add(*(factor * v[k] for factor, v in terms)) for k in range(3))
