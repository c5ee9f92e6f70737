"""A beam element in space in large displacements and rotations, with directors, by Hamilton's principle.

A node has a position r and three orthonormal directors: d1 along the beam, d2 and d3 along the principal axes
of its section. Their components are the unknowns, and six products of directors per node are constraints. The
centre line is Hermite's cubic through the nodes with the unit tangents d1, the fibres of a section are at
y d2 + z d3, and directors are interpolated linearly: the mass matrix is constant, and every rigid motion has
its exact kinetic energy.

With c the vector from the first node to the second, the rotation of a node against it has the sine c d2/L in
one plane and c d3/L in the other, up to stretch; the relative twist of the nodes has the sine
(d3 d2' - d2 d3')/2. Angles are sines to the third degree, p + p^3/6. The strains are those of the planar
element in large rotation: mean axial strain with the deflection, here with Green's strain of the line between
the nodes, and cubic bending in both planes; and the twist. They are invariant under rigid rotations.

Sources: M. A. Crisfield, Computer Methods in Applied Mechanics and Engineering 81 (1990), for the local
strains; P. Betsch, P. Steinmann, Frame-indifferent beam finite elements based upon the geometrically exact
beam theory, International Journal for Numerical Methods in Engineering 54 (2002), for directors as unknowns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from symgen.elements import ELEMENTS
from symgen.elements.element import LENGTH
from symgen.mechanics.elastic.beam_matrices import Section, beam_matrices
from symgen.mechanics.elastic.spatial import AXIAL, BENDING_Y, BENDING_Z, JY, JZ, MU, TORSION
from symgen.symbolic.names import Names
from symgen.symbolic.quantity import AXES, Quantity, quantity

_NODES = {1: "first", 2: "second"}
_VECTORS = (("r", "m", "position"), *((f"d{k}", "1", f"director {k}") for k in (1, 2, 3)))


def _of_nodes(prefix: str, over: str, about: str) -> tuple[Quantity, ...]:
    return tuple(
        quantity(f"{prefix}{name}_{axis}{k}", f"{unit}{over}", f"{about}{what} {axis} of the {node} node")
        for k, node in _NODES.items()
        for name, unit, what in _VECTORS
        for axis in AXES
    )


PLACES = _of_nodes("", "", "")
RATES = _of_nodes("v_", "/s", "rate of the ")
SECOND_RATES = _of_nodes("a_", "/s^2", "second rate of the ")
DAMPING = quantity("tau", "s", "stress by the rate of a strain over that by the strain")
GRAVITY = tuple(quantity(f"g_{axis}", "m/s^2", f"{axis} component of gravity") for axis in AXES)
SECTION = (LENGTH, MU, JY, JZ, AXIAL, BENDING_Y, BENDING_Z, TORSION, DAMPING, *GRAVITY)
#: Strains: mean axial strain; difference and sum of the end rotations about z and about y; twist.
STRAINS = ("axial", "bent_z", "sheared_z", "bent_y", "sheared_y", "twist")

_Q, _V, _A = ([x.symbol for x in group] for group in (PLACES, RATES, SECOND_RATES))


@dataclass(frozen=True, slots=True)
class DirectorBeam:
    """The element: residual (24, 1) with its slopes (24, 24), energies (3, 1), strains (6, 1).

    ``residual`` is inertia and internal force less gravity; ``mass``, ``damping`` and ``stiffness`` are its
    slopes by second rates, rates and places.
    """

    residual: sp.ImmutableMatrix
    mass: sp.ImmutableMatrix
    damping: sp.ImmutableMatrix
    stiffness: sp.ImmutableMatrix
    energies: sp.ImmutableMatrix
    strains: sp.ImmutableMatrix


def director_beam(names: Names) -> DirectorBeam:
    """Return the element over ``PLACES``, their rates, and ``SECTION``; intermediates go to ``names``."""
    length = LENGTH.symbol
    first, second = (_vectors(_Q[12 * k : 12 * k + 12]) for k in range(2))
    chord = [b - a for a, b in zip(first[0], second[0], strict=True)]
    # Invariants of degree two in the places, whose second slopes are constant.
    formulas = {
        "stretch": (_dot(chord, chord) / length**2 - 1) / 2,
        **{
            f"sine{k}{node}": _dot(chord, of[k]) / length
            for k in (2, 3)
            for node, of in ((1, first), (2, second))
        },
        "sine_twist": (_dot(second[2], first[3]) - _dot(second[3], first[2])) / 2,
    }
    invariants = [names.scalar(name, e, "1", f"invariant {name}") for name, e in formulas.items()]
    slopes = [[sp.diff(e, x) for x in _Q] for e in formulas.values()]
    curved = [sp.hessian(e, _Q) for e in formulas.values()]
    rates = [
        names.scalar(f"{name}_rate", _dot(row, _V), "1/s", f"rate of invariant {name}")
        for name, row in zip(formulas, slopes, strict=True)
    ]
    stretch, z1, z2, y1, y2, twist = invariants
    angle = [p + p**3 / 6 for p in (z1, z2, y1, y2, twist)]
    bowed = sp.Add(*((2 * a**2 - a * b + 2 * b**2) / 30 for a, b in ((z1, z2), (y1, y2))))
    bending = {"z": BENDING_Z.symbol, "y": BENDING_Y.symbol}
    strained = [(stretch + bowed, AXIAL.symbol * length)]
    for (_, stiffness), (a, b) in zip(bending.items(), (angle[:2], angle[2:4]), strict=True):
        strained += [(b - a, stiffness / length), (a + b, 3 * stiffness / length)]
    strained.append((angle[4], TORSION.symbol / length))
    forces = [sp.Integer(0)] * len(invariants)
    for strain, stiffness in strained:
        of = [sp.diff(strain, g) for g in invariants]
        rate = sp.Add(*(d * g for d, g in zip(of, rates, strict=True)))
        stress = stiffness * (strain + DAMPING.symbol * rate)
        forces = [f + d * stress for f, d in zip(forces, of, strict=True)]
    mass = _mass()
    gravity = [g.symbol for g in GRAVITY]
    weight = [MU.symbol * length * g / 2 for g in gravity]
    leant = [MU.symbol * length**2 * g / 12 for g in gravity]
    loads = [*weight, *leant, *[0] * 6, *weight, *(-x for x in leant), *[0] * 6]
    forced = [
        names.scalar(f"force{k}", f, "N*m", f"derivative of the energy by invariant {k}")
        for k, f in enumerate(forces)
    ]
    internal = [sp.Add(*(f * row[k] for f, row in zip(forced, slopes, strict=True))) for k in range(len(_Q))]
    inertia = mass * sp.Matrix(_A)
    by_rates, by_invariants = (
        [
            [
                names.scalar(f"{word}{i}_{j}", sp.diff(f, g), unit, f"slope {i} {j} of {word} forces")
                for j, g in enumerate(of)
            ]
            for i, f in enumerate(forces)
        ]
        for word, unit, of in (("damped", "N*m*s", rates), ("stiff", "N*m", invariants))
    )
    # The rate of an invariant depends on places too; its slope there is that of the second degree.
    turned = [[_dot(row, _V) for row in h.tolist()] for h in curved]
    damping, stiffness = sp.zeros(len(_Q), len(_Q)), sp.zeros(len(_Q), len(_Q))
    for i, row in enumerate(slopes):
        for j, other in enumerate(slopes):
            for a, x in enumerate(row):
                for b, y in enumerate(other):
                    if x == 0:
                        continue
                    if y != 0:
                        damping[a, b] += by_rates[i][j] * x * y
                        stiffness[a, b] += by_invariants[i][j] * x * y
                    if turned[j][b] != 0:
                        stiffness[a, b] += by_rates[i][j] * x * turned[j][b]
        stiffness += forced[i] * curved[i]
    kinetic = (sp.Matrix([_V]) * mass * sp.Matrix(_V))[0] / 2
    potential = -sp.Add(*(f * x for f, x in zip(loads, _Q, strict=True)))
    energy = sp.Add(*(k * s**2 for s, k in strained)) / 2
    return DirectorBeam(
        residual=sp.ImmutableMatrix([m + f - w for m, f, w in zip(inertia, internal, loads, strict=True)]),
        mass=sp.ImmutableMatrix(mass),
        damping=sp.ImmutableMatrix(damping),
        stiffness=sp.ImmutableMatrix(stiffness),
        energies=sp.ImmutableMatrix([kinetic, energy, potential]),
        strains=sp.ImmutableMatrix([s for s, _ in strained]),
    )


def _vectors(symbols: Sequence[sp.Symbol]) -> list[list[sp.Symbol]]:
    return [list(symbols[3 * k : 3 * k + 3]) for k in range(4)]


def _dot(a: Sequence[sp.Expr], b: Sequence[sp.Expr]) -> sp.Expr:
    return sp.Add(*(x * y for x, y in zip(a, b, strict=True)))


def _mass() -> sp.Matrix:
    """Return the mass matrix: Hermite's cubic in r and d1, and fibres on linear d2 and d3."""
    none = (sp.Integer(0),)
    own = beam_matrices(ELEMENTS["cubic"], Section((MU.symbol,), none, none, none, none)).mass
    made = sp.zeros(24, 24)
    # Transverse displacement and slope at both nodes, of the cubic element.
    centre = {0: 1, 1: 2, 4: 4, 5: 5}
    for a, i in centre.items():
        for b, j in centre.items():
            made[3 * a : 3 * a + 3, 3 * b : 3 * b + 3] = own[i, j] * sp.eye(3)
    for vector, inertia in ((2, JZ.symbol), (3, JY.symbol)):
        for a in range(2):
            for b in range(2):
                at, to = 3 * (4 * a + vector), 3 * (4 * b + vector)
                part = inertia * LENGTH.symbol / (3 if a == b else 6)
                made[at : at + 3, to : to + 3] = part * sp.eye(3)
    return made
