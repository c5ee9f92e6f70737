"""Balance of one rigid element of a link in the plane, under the forces at its two nodes.

Source: the thesis on kineto-elastodynamics, Chapter IV, Eqs. (4.1)-(4.10): a link is cut into elements, and
the internal force and moment at each cut are unknowns of both neighbours. An element is loaded by -F at its
first node and +F at its second, and by the moments +M and -M; so F is a tensile force on the part before a
cut, and M is positive where it stretches the fibres to the left of the link. Here the centre of mass may be
anywhere, and forces may act at further points of the element.
"""

from __future__ import annotations

import sympy as sp

from symgen.mechanics.rods.particles import Vector
from symgen.symbolic.vectors import cross_in_plane

#: The forces at a node: two components and a moment.
NODAL = ("Fx", "Fy", "M")


def on_centre(force: Vector, point: Vector, centre: Vector) -> Vector:
    """Return a force at a point as force and moment [N, N, N m] at the centre of mass."""
    return (*force, cross_in_plane(tuple(p - c for p, c in zip(point, centre, strict=True)), force))


def between(first: Vector, second: Vector, along: sp.Expr, across: sp.Expr) -> Vector:
    """Return the value of a vector field of a rigid body, given at two nodes, at a third place.

    The place is at parts of the distance of the nodes along it and to its left.
    """
    d = tuple(y - x for x, y in zip(first, second, strict=True))
    turned = (-d[1], d[0])
    return tuple(x + along * y + across * z for x, y, z in zip(first, d, turned, strict=True))


def nodal_matrix(start: Vector, end: Vector, centre: Vector) -> sp.ImmutableMatrix:
    """Return [d] of Eq. (4.10), 3 x 6: the resultant of (F1 F2 F3 | F4 F5 F6) at the centre of mass.

    Rows in N, N and N m; the entries of the third row at forces are levers [m].
    """
    first, second = (sp.symbols(f"F{k}:{k + 3}", real=True) for k in (1, 4))
    pushed = on_centre((-first[0], -first[1]), start, centre)
    pulled = on_centre((second[0], second[1]), end, centre)
    moment = first[2] - second[2]
    total = [a + b for a, b in zip(pushed, pulled, strict=True)]
    total[2] += moment
    return sp.ImmutableMatrix(sp.Matrix(total).jacobian([*first, *second]))


def point_matrix(point: Vector, centre: Vector) -> sp.ImmutableMatrix:
    """Return the 3 x 2 matrix of a force at any point of the element: its resultant at the centre of mass."""
    force = sp.symbols("Px Py", real=True)
    return sp.ImmutableMatrix(sp.Matrix(on_centre(force, point, centre)).jacobian(force))


def angular_acceleration(along: Vector, relative: Vector) -> sp.Expr:
    """Return the angular acceleration [rad/s^2] from d, start to end [m], and its second rate [m/s^2].

    For a rigid element the second rate is alpha (d rotated left) - omega^2 d, so d x d'' = alpha d.d.
    """
    return cross_in_plane(along, relative) / sp.Add(*(c**2 for c in along))


def inertia(
    mass: sp.Expr, moment: sp.Expr, acceleration: Vector, turning: sp.Expr, gravity: Vector
) -> Vector:
    """Return the right-hand side (e) of Eq. (4.10): m (a_G - g) and I alpha [N, N, N m]."""
    return (*(mass * (a - g) for a, g in zip(acceleration, gravity, strict=True)), moment * turning)
