"""A beam element in large displacements and rotations, by Hamilton's principle with the axes of its chord.

The nodes have a position and a rotation each. The rotations ``beta`` of the ends against the chord, the line
between the nodes, are those of a beam with cubic deflection; they stay small as elements are divided, however
far the link rotates and bends. The axial strain is the mean of u' + w'^2/2 over the element, the bending
energy that of the cubic element, with the shear of Timoshenko. Inertia and gravity are those of the curve
that is Hermite's cubic through the nodes, with unit tangents in the directions of their rotations: every
rigid motion has its exact kinetic energy. Sections rotate linearly from one node to the other.

Source: M. A. Crisfield, A consistent co-rotational formulation for non-linear, three-dimensional
beam-elements, Computer Methods in Applied Mechanics and Engineering 81 (1990), in the plane; the mean axial
strain and the masses are derived here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from symgen.elements import ELEMENTS
from symgen.elements.element import LENGTH
from symgen.mechanics.elastic.beam_matrices import ElementSection, beam_matrices
from symgen.mechanics.elastic.hamilton import AXIAL, BENDING
from symgen.symbolic.names import Names
from symgen.symbolic.quantity import Quantity, quantity

_NODES = {1: "first", 2: "second"}
_COORDINATES = (("x", "m", "x position"), ("y", "m", "y position"), ("theta", "rad", "rotation"))


def _of_nodes(prefix: str, over: str, kind: str) -> tuple[Quantity, ...]:
    return tuple(
        quantity(f"{prefix}{name}{k}", f"{unit}{over}", f"{kind}{about} of the {node} node")
        for k, node in _NODES.items()
        for name, unit, about in _COORDINATES
    )


PLACES = _of_nodes("", "", "")
RATES = _of_nodes("v_", "/s", "rate of the ")
SECOND_RATES = _of_nodes("a_", "/s^2", "second rate of the ")
DENSITY = quantity("mu", "kg/m", "mean mass per length")
ROTARY = quantity("J", "kg*m", "mean rotary inertia per length")
SHEARING = quantity("Phi", "1", "12 E I/(k G A L^2); zero without shear")
DAMPING = quantity("tau", "s", "stress by the rate of a strain over that by the strain")
GRAVITY = tuple(quantity(f"g_{c}", "m/s^2", f"{c} component of gravity") for c in "xy")
PROPERTIES = (LENGTH, DENSITY, ROTARY, AXIAL, BENDING, SHEARING, DAMPING, *GRAVITY)

_Q, _V, _A = ([x.symbol for x in group] for group in (PLACES, RATES, SECOND_RATES))


@dataclass(frozen=True, slots=True)
class Corotational:
    """The element: forces (6, 1), their slopes (6, 6), energies, strain, end rotations and bending moments.

    ``residual`` is inertia and internal force less gravity; ``mass``, ``damping`` and ``stiffness`` are its
    slopes by second rates, rates and places. The bending moment is linear between the nodes.
    """

    residual: sp.ImmutableMatrix
    mass: sp.ImmutableMatrix
    damping: sp.ImmutableMatrix
    stiffness: sp.ImmutableMatrix
    energies: Mapping[str, sp.Expr]
    strains: Mapping[str, sp.Expr]


def corotational(names: Names) -> Corotational:
    """Return the element over ``PLACES``, their rates, and ``PROPERTIES``; intermediates go to ``names``."""
    length, bending = LENGTH.symbol, BENDING.symbol
    (x1, y1, t1, x2, y2, t2), zero = _Q, sp.Integer(0)
    dx, dy = x2 - x1, y2 - y1
    chord = names.scalar("chord", sp.sqrt(dx**2 + dy**2), "m", "distance of the nodes")
    beta = [
        names.scalar(
            f"beta{k}",
            sp.atan2(dx * sp.sin(t) - dy * sp.cos(t), dx * sp.cos(t) + dy * sp.sin(t)),
            "rad",
            f"rotation of the {_NODES[k]} node against the chord",
        )
        for k, t in ((1, t1), (2, t2))
    ]
    cosine, sine = (
        [names.scalar(f"{name}{k}", of(t), "1", f"{name} of rotation {k}") for k, t in ((1, t1), (2, t2))]
        for name, of in (("cosine", sp.cos), ("sine", sp.sin))
    )
    # The chord rotates by (dx d(dy) - dy d(dx))/chord^2.
    turning = [dy / chord**2, -dx / chord**2, zero, -dy / chord**2, dx / chord**2, zero]
    stretching = [-dx / chord, -dy / chord, zero, dx / chord, dy / chord, zero]
    known: dict[sp.Symbol, Sequence[sp.Expr]] = {chord: stretching}
    for c, d, t in zip(cosine, sine, (t1, t2), strict=True):
        known[c] = [-d * int(x == t) for x in _Q]
        known[d] = [c * int(x == t) for x in _Q]
    for b, t in zip(beta, (t1, t2), strict=True):
        known[b] = [sp.Integer(int(x == t)) - r for x, r in zip(_Q, turning, strict=True)]

    def slopes(expression: sp.Expr) -> list[sp.Expr]:
        """Return the partial derivatives by the places of the nodes, through the intermediates."""
        through = [(sp.diff(expression, s), of) for s, of in known.items() if expression.has(s)]
        return [sp.diff(expression, x) + sp.Add(*(d * of[k] for d, of in through)) for k, x in enumerate(_Q)]

    b1, b2 = beta
    axial = chord / length - 1 + (2 * b1**2 - b1 * b2 + 2 * b2**2) / 30
    strained = (
        (axial, AXIAL.symbol * length),
        (b2 - b1, bending / length),
        (b1 + b2, 3 * bending / (length * (1 + SHEARING.symbol))),
    )
    of_bending = sp.Add(*(k * s**2 for s, k in strained[1:])) / 2
    internal, dissipated = [zero] * len(_Q), zero
    for strain, stiffness in strained:
        of = slopes(strain)
        rate = sp.Add(*(d * v for d, v in zip(of, _V, strict=True)))
        force = stiffness * (strain + DAMPING.symbol * rate)
        internal = [f + d * force for f, d in zip(internal, of, strict=True)]
        dissipated += DAMPING.symbol * stiffness * rate**2
    mass, v = _mass(cosine, sine), sp.Matrix(_V)
    kinetic = (v.T * mass * v)[0] / 2
    momenta = mass * v
    # Lagrange's equation of the kinetic energy v^T M v/2.
    inertia = [
        sp.Add(*(m * a for m, a in zip(mass.row(k), _A, strict=True)))
        + sp.Add(*(d * u for d, u in zip(slopes(momentum), _V, strict=True)))
        - slope
        for k, (momentum, slope) in enumerate(zip(momenta, slopes(kinetic), strict=True))
    ]
    lifted = zip((x1 + x2, y1 + y2), (cosine[0] - cosine[1], sine[0] - sine[1]), GRAVITY, strict=True)
    potential = (
        -DENSITY.symbol
        * length
        * sp.Add(*(g.symbol * (ends / 2 + length * tangents / 12) for ends, tangents, g in lifted))
    )
    residual = [i + f + p for i, f, p in zip(inertia, internal, slopes(potential), strict=True)]
    return Corotational(
        residual=sp.ImmutableMatrix(residual),
        mass=sp.ImmutableMatrix(mass),
        damping=sp.ImmutableMatrix([[sp.diff(e, u) for u in _V] for e in residual]),
        stiffness=sp.ImmutableMatrix([slopes(e) for e in residual]),
        energies={
            "kinetic": kinetic,
            "strain": sp.Add(*(k * s**2 for s, k in strained)) / 2,
            "gravity": potential,
            "dissipated": dissipated,
        },
        strains={
            "axial": axial,
            "beta1": b1,
            "beta2": b2,
            "moment1": -sp.diff(of_bending, b1),
            "moment2": sp.diff(of_bending, b2),
        },
    )


def _mass(cosine: Sequence[sp.Expr], sine: Sequence[sp.Expr]) -> sp.Matrix:
    """Return the mass matrix of Hermite's cubic, whose shape functions are those of the cubic element."""
    none = (sp.Integer(0),)
    cubic = beam_matrices(ELEMENTS["cubic"], ElementSection((DENSITY.symbol,), none, none, none, none)).mass
    rotary = ROTARY.symbol * LENGTH.symbol
    mass = sp.zeros(6, 6)
    normals = [sp.Matrix([-s, c]) for c, s in zip(cosine, sine, strict=True)]
    for i in range(2):
        for j in range(2):
            row, column = 3 * i, 3 * j
            mass[row : row + 2, column : column + 2] = cubic[row + 1, column + 1] * sp.eye(2)
            mass[row : row + 2, column + 2] = cubic[row + 1, column + 2] * normals[j]
            mass[row + 2, column : column + 2] = cubic[row + 2, column + 1] * normals[i].T
            between = sp.Integer(1) if i == j else cosine[0] * cosine[1] + sine[0] * sine[1]
            mass[row + 2, column + 2] = cubic[row + 2, column + 2] * between + rotary / (3 if i == j else 6)
    return mass
