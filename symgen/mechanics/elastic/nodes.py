"""Bodies, forces and directions at the nodes of elements in large rotation.

The centre line of an element is Hermite's cubic through its nodes, with unit tangents in the directions of
their rotations (:mod:`symgen.mechanics.elastic.corotational`): a force along it acts on positions and
rotations of the nodes by its virtual work. Links between two nodes that stand for a whole link are straight.
"""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from symgen.elements import ELEMENTS
from symgen.elements.element import LENGTH, PLACE, shape_functions
from symgen.mechanics.elastic.corotational import GRAVITY, PLACES, RATES, SECOND_RATES
from symgen.mechanics.elastic.hamilton import PX, PY
from symgen.mechanics.elastic.turning_axes import COSINE, SINE
from symgen.symbolic.quantity import quantity

MASS = quantity("m", "kg", "mass of a body at the first node")
INERTIA = quantity("I", "kg*m^2", "moment of inertia of the body")
START = quantity("x_0", "m", "distance of the first node from the first point of the link")
EVEN = quantity("p_0", "1", "factor of a force per length along the link")
SLOPE = quantity("p_1", "1/m", "factor of x in it")
END = quantity("n", "1", "share of a force at the first node")
ARM = quantity("b", "m", "share of the force at the tangent there")
PROPERTIES = (LENGTH, *GRAVITY, START, EVEN, SLOPE, MASS, INERTIA)
ACTING = (END, ARM, COSINE, SINE, PX, PY)

_STATE = tuple(x.symbol for x in (*PLACES, *RATES))
_CHANGES = tuple(x.symbol for x in (*RATES, *SECOND_RATES))
(_X1, _Y1, _T1, _X2, _Y2, _T2), (_VX, _VY, _VT, *_) = (tuple(x.symbol for x in of) for of in (PLACES, RATES))


def _rate(expression: sp.Expr) -> sp.Expr:
    """Return the rate along the motion of the nodes."""
    return sp.Add(*(sp.diff(expression, x) * v for x, v in zip(_STATE, _CHANGES, strict=True)))


def _direction(angle: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    return sp.cos(angle), sp.sin(angle)


def body() -> tuple[list[sp.Expr], list[list[sp.Expr]], list[sp.Expr]]:
    """Return inertia less gravity of a body at the first node, its slopes by second rates, and its energies.

    They are Lagrange's equations by the state, which nothing depends on but the motion of the first node. The
    energies are those of an element: kinetic, of strain, of gravity, and the power dissipated.
    """
    mass = MASS.symbol
    kinetic = (mass * (_VX**2 + _VY**2) + INERTIA.symbol * _VT**2) / 2
    potential = -mass * (GRAVITY[0].symbol * _X1 + GRAVITY[1].symbol * _Y1)
    residual = [
        _rate(sp.diff(kinetic, v.symbol)) + sp.diff(potential, x.symbol)
        for x, v in zip(PLACES, RATES, strict=True)
    ]
    slopes = [[sp.diff(e, a.symbol) for a in SECOND_RATES] for e in residual]
    return residual, slopes, [kinetic, sp.S.Zero, potential, sp.S.Zero]


def shares() -> list[sp.Expr]:
    """Return the shares of a force spread over an element: end and tangent of its first node, of its second.

    The factor of the force per length is p_0 + p_1 x, with x from the first point of the link.
    """
    xi, length = PLACE.symbol, LENGTH.symbol
    profile = EVEN.symbol + SLOPE.symbol * (START.symbol + length * xi)
    element = ELEMENTS["cubic"]
    shapes = dict(zip(element.dofs, shape_functions(element).transverse, strict=True))
    return [
        sp.integrate(sp.expand(profile * shapes[dof] * length), (xi, 0, 1))
        for dof in ("w1", "theta1", "w2", "theta2")
    ]


def force() -> list[sp.Expr]:
    """Return the forces on x, y and theta of the first node by a force in the axes of the rigid link."""
    c, s = COSINE.symbol, SINE.symbol
    fixed = c * PX.symbol - s * PY.symbol, s * PX.symbol + c * PY.symbol
    reached = (
        END.symbol * place + ARM.symbol * tangent
        for place, tangent in zip((_X1, _Y1), _direction(_T1), strict=True)
    )
    work = sp.Add(*(f * r for f, r in zip(fixed, reached, strict=True)))
    return [sp.diff(work, x) for x in (_X1, _Y1, _T1)]


def follower() -> list[sp.Expr]:
    """Return the forces on two nodes by a force per length in the axes of each section between them.

    It is (p_0 + p_1 x) times the force along the tangent of the centre line and to its left.
    """
    xi, length = PLACE.symbol, LENGTH.symbol
    profile = EVEN.symbol + SLOPE.symbol * (START.symbol + length * xi)
    element = ELEMENTS["cubic"]
    shapes = dict(zip(element.dofs, shape_functions(element).transverse, strict=True))
    line = [shapes[dof] for dof in ("w1", "theta1", "w2", "theta2")]
    vectors = (_X1, _Y1), _direction(_T1), (_X2, _Y2), _direction(_T2)
    turned = [(PX.symbol * x - PY.symbol * y, PX.symbol * y + PY.symbol * x) for x, y in vectors]
    forces = []
    for a in line:
        weights = [sp.integrate(sp.expand(profile * a * sp.diff(b, xi)), (xi, 0, 1)) for b in line]
        forces.append(
            [sp.Add(*(w * t[axis] for w, t in zip(weights, turned, strict=True))) for axis in (0, 1)]
        )
    on_first, on_tangent, on_second, on_second_tangent = forces
    couples = [
        force[1] * sp.cos(angle) - force[0] * sp.sin(angle)
        for force, angle in ((on_tangent, _T1), (on_second_tangent, _T2))
    ]
    return [*on_first, couples[0], *on_second, couples[1]]


def far_end() -> list[sp.Expr]:
    """Return place, velocity and acceleration of the far end of a straight link.

    It has the direction of the first node, and starts there; a negative length points backwards.
    """
    place = [p + LENGTH.symbol * e for p, e in zip((_X1, _Y1), _direction(_T1), strict=True)]
    velocity = [_rate(e) for e in place]
    return [*place, *velocity, *map(_rate, velocity)]


def chord() -> Sequence[sp.Expr]:
    """Return the direction of the line from the first node to the second, and its rate."""
    direction = sp.atan2(_Y2 - _Y1, _X2 - _X1)
    return direction, _rate(direction)


def weld() -> tuple[list[sp.Expr], list[sp.Expr], list[list[sp.Expr]]]:
    """Return the constraint of a section that is welded to a rigid link: error and rate, slopes, curvature.

    The section has the rotation of the first node. The line from the first place to the second, of the
    length of the link, is that of the link, and makes a fixed angle with the section, by its cosine and sine.
    The error is the sine of the difference of both angles; slopes and their slopes are by the state.
    """
    (c, s), (x, y) = (COSINE.symbol, SINE.symbol), _direction(_T1)
    along = c * x - s * y, s * x + c * y
    error = (along[0] * (_Y2 - _Y1) - along[1] * (_X2 - _X1)) / LENGTH.symbol
    places = _STATE[: len(PLACES)]
    slopes = [sp.diff(error, x) for x in places]
    return [error, _rate(error)], slopes, [[sp.diff(e, x) for x in places] for e in slopes]
