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
from symgen.symbolic.vectors import cross, dot

_NODES = {1: "first", 2: "second"}
_VECTORS = (("r", "m", "position"), *((f"d{k}", "1", f"director {k}") for k in (1, 2, 3)))


def _of_nodes(prefix: str, over: str, about: str) -> tuple[Quantity, ...]:
    return tuple(
        quantity(f"{prefix}{name}_{axis}{k}", f"{unit}{over}", f"{about}{vector} {axis} of the {node} node")
        for k, node in _NODES.items()
        for name, unit, vector in _VECTORS
        for axis in AXES
    )


PLACES = _of_nodes("", "", "")
RATES = _of_nodes("v_", "/s", "rate of the ")
SECOND_RATES = _of_nodes("a_", "/s^2", "second rate of the ")
DAMPING = quantity("tau", "s", "stress by the rate of a strain over that by the strain")
GRAVITY = tuple(quantity(f"g_{axis}", "m/s^2", f"{axis} component of gravity") for axis in AXES)
SECTION = (LENGTH, MU, JY, JZ, AXIAL, BENDING_Y, BENDING_Z, TORSION, DAMPING, *GRAVITY)
FIBRES = (
    quantity("fibre_y", "m", "distance of the outer fibre along y"),
    quantity("fibre_z", "m", "distance of the outer fibre along z"),
    quantity("E", "Pa", "Young's modulus"),
    quantity("round", "1", "one for a round section, else zero"),
)
#: Where in the element its section is evaluated: 0 at the first node, 1 at the second.
FRACTION = quantity("x", "1", "fraction of the element")
#: Signs of y and z at four outer fibres: the corners of a rectangle; a circle has its fibres on the axes.
CORNERS, ON_AXES = ((1, 1), (-1, 1), (-1, -1), (1, -1)), ((1, 0), (0, 1), (-1, 0), (0, -1))
#: Strains of outer fibres by axial force and moments about y and z, torque, moments about y and z, greatest
#: stress, stresses of four fibres, place.
RESULTANTS = (
    *("axial_strain", "bending_strain_y", "bending_strain_z", "torque", "moment_y", "moment_z", "stress"),
    *(f"stress_{k}" for k in range(1, 1 + len(CORNERS))),
    *AXES,
)

_FORCES = {"axial_force": "N", "moment_about_y": "N*m", "moment_about_z": "N*m", "moment_about_x": "N*m"}

Vectors = list[list[sp.Expr]]
_Q, _V, _A = ([x.symbol for x in group] for group in (PLACES, RATES, SECOND_RATES))


@dataclass(frozen=True, slots=True)
class DirectorBeam:
    """The element: residual (24, 1) with its slopes (24, 24), energies (4, 1), ``RESULTANTS`` (14, 1).

    ``residual`` is inertia and internal force less gravity; ``mass``, ``damping`` and ``stiffness`` are its
    slopes by second rates, rates and places. ``energies`` ends with the power of damping.
    """

    residual: sp.ImmutableMatrix
    mass: sp.ImmutableMatrix
    damping: sp.ImmutableMatrix
    stiffness: sp.ImmutableMatrix
    energies: sp.ImmutableMatrix
    section: sp.ImmutableMatrix


def director_beam(names: Names) -> DirectorBeam:
    """Return the element over ``PLACES``, their rates, and ``SECTION``; intermediates go to ``names``."""
    length = LENGTH.symbol
    first, second = (_vectors(_Q[12 * k : 12 * k + 12]) for k in range(2))
    between = [b - a for a, b in zip(first[0], second[0], strict=True)]
    chord = names.vector("chord", [x / length for x in between], "1", "the line between the nodes over L")
    # The strains depend on the chord, and on d2 and d3 of both nodes, of which the others are free.
    strained_by = [*chord, *first[2], *first[3], *second[2], *second[3]]
    moving = [_vectors(_V[12 * k : 12 * k + 12]) for k in range(2)]
    of_chord = [(b - a) / length for a, b in zip(moving[0][0], moving[1][0], strict=True)]
    speeds = [
        *names.vector("chord_rate", of_chord, "1/s", "the rate of the chord over L"),
        *(x for of in moving for k in (2, 3) for x in of[k]),
    ]
    # Invariants of degree two, whose second slopes are constant.
    formulas = {
        "stretch": (dot(chord, chord) - 1) / 2,
        **{f"sine{k}{node}": dot(chord, of[k]) for k in (2, 3) for node, of in ((1, first), (2, second))},
        "sine_twist": (dot(second[2], first[3]) - dot(second[3], first[2])) / 2,
    }
    slopes = sp.Matrix([[sp.diff(e, x) for x in strained_by] for e in formulas.values()])
    curved = [sp.hessian(e, strained_by) for e in formulas.values()]
    invariants = [names.scalar(name, e, "1", f"invariant {name}") for name, e in formulas.items()]
    rates = [
        names.scalar(f"{name}_rate", dot(slopes.row(k), speeds), "1/s", f"rate of invariant {name}")
        for k, name in enumerate(formulas)
    ]
    strained = _strains(invariants)

    def matrix(word: str, unit: str, entries: Sequence[Sequence[sp.Expr]]) -> sp.Matrix:
        """Return a matrix of named entries, so that products with it are not expanded."""
        return sp.Matrix(
            [
                [
                    names.scalar(f"{word}{i}_{j}", e, unit, f"entry {i} {j} of {word}")
                    for j, e in enumerate(row)
                ]
                for i, row in enumerate(entries)
            ]
        )

    numbers = range(len(invariants))
    # Strains, stresses and their slopes by the invariants, without products of long expressions.
    by = matrix("by", "1", [[sp.diff(strain, g) for g in invariants] for strain, _ in strained])
    hessians = [
        matrix(f"hessian{k}_", "1", sp.hessian(strain, invariants).tolist())
        for k, (strain, _) in enumerate(strained)
    ]
    strain_rates = matrix("strain_rate", "1/s", (by * sp.Matrix(rates)).tolist())
    stresses = matrix(
        "stress",
        "N*m",
        [[k * (strain + DAMPING.symbol * v)] for (strain, k), v in zip(strained, strain_rates, strict=True)],
    )
    forced = matrix("force", "N*m", (by.T * stresses).tolist())
    dissipated = sp.Add(
        *(DAMPING.symbol * k * v**2 for (_, k), v in zip(strained, strain_rates, strict=True))
    )
    stiffened = matrix("stiffened", "N*m", [[k * x for x in by.row(i)] for i, (_, k) in enumerate(strained)])
    changed = matrix(
        "changed",
        "1",
        [
            [by[k, j] + DAMPING.symbol * dot(hessians[k].row(j), rates) for j in numbers]
            for k in range(len(strained))
        ],
    )
    damped = matrix("damped", "N*m*s", (DAMPING.symbol * by.T * stiffened).tolist())
    bent = sum((s * h for s, h in zip(stresses, hessians, strict=True)), sp.zeros(len(invariants)))
    stiff = matrix("stiff", "N*m", (stiffened.T * changed + bent).tolist())
    # The rate of an invariant depends on places too; its slope there is that of the second degree.
    turned = sp.Matrix([[dot(row, speeds) for row in h.tolist()] for h in curved])
    by_speeds = matrix("by_speeds", "N*m*s", (damped * slopes).tolist())
    by_places = matrix("by_places", "N*m", (stiff * slopes + damped * turned).tolist())
    damping = matrix("damping_", "N*m*s", (slopes.T * by_speeds).tolist())
    curvature = sum((f * h for f, h in zip(forced, curved, strict=True)), sp.zeros(*damping.shape))
    stiffness = matrix("stiffness_", "N*m", (slopes.T * by_places + curvature).tolist())
    # Rows are the slopes of ``strained_by`` by the places of the nodes.
    parts = sp.Matrix(
        [[sp.diff(x, q) for q in _Q] for x in (*(b / length for b in between), *strained_by[3:])]
    )
    mass = _mass()
    gravity = [g.symbol for g in GRAVITY]
    weight = [MU.symbol * length * g / 2 for g in gravity]
    leant = [MU.symbol * length**2 * g / 12 for g in gravity]
    loads = sp.Matrix([*weight, *leant, *[0] * 6, *weight, *(-x for x in leant), *[0] * 6])
    internal = matrix("internal", "N*m", (slopes.T * forced).tolist())
    residual = mass * sp.Matrix(_A) + parts.T * internal - loads
    kinetic = (sp.Matrix([_V]) * mass * sp.Matrix(_V))[0] / 2
    energy = sp.Add(*(k * s**2 for s, k in strained)) / 2
    return DirectorBeam(
        residual=sp.ImmutableMatrix(residual),
        mass=sp.ImmutableMatrix(mass),
        damping=sp.ImmutableMatrix(parts.T * damping * parts),
        stiffness=sp.ImmutableMatrix(parts.T * stiffness * parts),
        energies=sp.ImmutableMatrix([kinetic, energy, -(loads.T * sp.Matrix(_Q))[0], dissipated]),
        section=sp.ImmutableMatrix(_section(names, residual, first, second)),
    )


def _strains(invariants: Sequence[sp.Expr]) -> list[tuple[sp.Expr, sp.Expr]]:
    """Return strains with the derivatives of their stresses by them.

    They are the mean axial strain; mean and slope of the curvatures in both planes, as difference and sum of
    the end rotations; the twist.
    """
    length = LENGTH.symbol
    stretch, z1, z2, y1, y2, twist = invariants
    (z1, y1), (z2, y2) = (
        [p * (1 - stretch + (z**2 + y**2) / 6) for p in (z, y)] for z, y in ((z1, y1), (z2, y2))
    )
    bowed = sp.Add(*((2 * a**2 - a * b + 2 * b**2) / 30 for a, b in ((z1, z2), (y1, y2))))
    bent = {BENDING_Z.symbol: (z2 - z1, z1 + z2, y1 - y2), BENDING_Y.symbol: (y2 - y1, y1 + y2, z2 - z1)}
    strained = [(stretch + bowed, AXIAL.symbol * length)]
    for stiffness, (mean, slope, other) in bent.items():
        strained += [
            (mean * (1 + twist**2 / 12), stiffness / length),
            (slope + twist * other / 3, 3 * stiffness / length),
        ]
    return [*strained, (twist + twist**3 / 6 + z1 * y2 - y1 * z2, TORSION.symbol / length)]


def _section(names: Names, residual: sp.Matrix, first: Vectors, second: Vectors) -> list[sp.Expr]:
    """Return ``RESULTANTS`` at a fraction x of the element.

    The nodal forces contain inertia, so that the resultants at a node are exact there to the order of the
    element. The couple of a section is the sum of its directors times the forces on them. Axial force and
    torque are linear between the nodes. Moments also have the part of weight and inertia per length q, linear
    from q1 to q2: with M_z'' = q_y and M_y'' = -q_z it is L^2 x (1 - x) ((2 - x) q1 + (1 + x) q2)/6.
    """
    ends = []
    for k, (sign, of) in enumerate(((-1, first), (1, second))):
        force, *on = ([sign * x for x in f] for f in _vectors(list(residual[12 * k : 12 * k + 12])))
        couple = [sp.Integer(0)] * 3
        for d, f in zip(of[1:], on, strict=True):
            couple = [c + x for c, x in zip(couple, cross(d, f), strict=True)]
        ends.append([dot(of[1], force), dot(of[2], couple), dot(of[3], couple), dot(of[1], couple)])
    x, length = FRACTION.symbol, LENGTH.symbol
    loads = [
        [MU.symbol * (g.symbol - a) for g, a in zip(GRAVITY, _A[k : k + 3], strict=True)] for k in (0, 12)
    ]
    along_y, along_z = (
        length**2 * x * (1 - x) / 6 * ((2 - x) * dot(loads[0], first[k]) + (1 + x) * dot(loads[1], second[k]))
        for k in (2, 3)
    )
    within = (sp.Integer(0), along_z, -along_y, sp.Integer(0))
    axial, about_y, about_z, torque = (
        names.scalar(name, (1 - x) * a + x * b + c, unit, f"{name} of the section".replace("_", " "))
        for (name, unit), a, b, c in zip(_FORCES.items(), *ends, within, strict=True)
    )
    fibre_y, fibre_z, modulus, is_round = (q.symbol for q in FIBRES)
    strains = [
        axial / AXIAL.symbol,
        about_y / BENDING_Y.symbol * fibre_z,
        about_z / BENDING_Z.symbol * fibre_y,
    ]
    stretch, y, z = strains
    bent = is_round * sp.sqrt(y**2 + z**2) + (1 - is_round) * (sp.Abs(y) + sp.Abs(z))
    # A moment about y stretches fibres at positive z, one about z those at negative y.
    fibres = [
        modulus
        * (stretch + sum(s * (b * y - a * z) for s, (a, b) in ((is_round, on), (1 - is_round, corner))))
        for on, corner in zip(ON_AXES, CORNERS, strict=True)
    ]
    shapes = (
        2 * x**3 - 3 * x**2 + 1,
        length * (x**3 - 2 * x**2 + x),
        3 * x**2 - 2 * x**3,
        length * (x**3 - x**2),
    )
    place = [dot(shapes, at) for at in zip(first[0], first[1], second[0], second[1], strict=True)]
    return [*strains, torque, about_y, about_z, modulus * (sp.Abs(stretch) + bent), *fibres, *place]


def _vectors(components: Sequence[sp.Expr]) -> Vectors:
    return [list(components[3 * k : 3 * k + 3]) for k in range(4)]


def _mass() -> sp.Matrix:
    """Return the mass matrix: Hermite's cubic in r and d1, and fibres on linear d2 and d3."""
    none = (sp.Integer(0),)
    cubic = beam_matrices(ELEMENTS["cubic"], Section((MU.symbol,), none, none, none, none)).mass
    mass = sp.zeros(24, 24)
    # Transverse displacement and slope at both nodes, of the cubic element.
    centre = {0: 1, 1: 2, 4: 4, 5: 5}
    for a, i in centre.items():
        for b, j in centre.items():
            mass[3 * a : 3 * a + 3, 3 * b : 3 * b + 3] = cubic[i, j] * sp.eye(3)
    for vector, inertia in ((2, JZ.symbol), (3, JY.symbol)):
        for a in range(2):
            for b in range(2):
                at, to = 3 * (4 * a + vector), 3 * (4 * b + vector)
                part = inertia * LENGTH.symbol / (3 if a == b else 6)
                mass[at : at + 3, to : to + 3] = part * sp.eye(3)
    return mass
