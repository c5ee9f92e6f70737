"""A beam element in space in large displacements and rotations, with directors, by Hamilton's principle.

A node has a position r and three orthonormal directors: d1 along the beam, d2 and d3 along the principal axes
of its section. Their components are the unknowns, and six products of directors per node are constraints. The
centre line is Hermite's cubic through the nodes with the unit tangents d1, the fibres of a section are at
y d2 + z d3, and directors are interpolated linearly: the mass matrix is constant, and every rigid motion has
its exact kinetic energy.

With c the vector from the first node to the second, the rotation of a node against it has the sine c d2/|c|
in one plane and c d3/|c| in the other; the relative twist of the nodes has the sine (d3 d2' - d2 d3')/2.
Angles are sines to the third degree. The strains are the mean axial strain with the deflection, here with
Green's strain of the line between the nodes; curvatures in both planes that are linear along the element,
in axes that turn with the section; and the twist, which with different bending stiffnesses changes along
the element. Energies have the fourth order in the length of the element, also in bending in both planes
with twist, and are invariant under rigid rotations.

Sources: M. A. Crisfield, Computer Methods in Applied Mechanics and Engineering 81 (1990), for the local
strains; P. Betsch, P. Steinmann, Frame-indifferent beam finite elements based upon the geometrically exact
beam theory, International Journal for Numerical Methods in Engineering 54 (2002), for directors as unknowns.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import sympy as sp

from symgen.elements import ELEMENTS
from symgen.elements.element import LENGTH
from symgen.mechanics.elastic.beam_matrices import ElementSection, beam_matrices
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
MU = quantity("mu", "kg/m", "mass per length")
JY = quantity("J_y", "kg*m", "rotary inertia per length about y: density times the integral of z^2")
JZ = quantity("J_z", "kg*m", "rotary inertia per length about z: density times the integral of y^2")
AXIAL = quantity("EA", "N", "axial stiffness")
BENDING_Y = quantity("EI_y", "N*m^2", "bending stiffness about y, for displacements w")
BENDING_Z = quantity("EI_z", "N*m^2", "bending stiffness about z, for displacements v")
TORSION = quantity("GJ", "N*m^2", "torsional stiffness")
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

    forced, damped, stiff, energy, dissipated = _elastic(names, matrix, invariants, rates)
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
    return DirectorBeam(
        residual=sp.ImmutableMatrix(residual),
        mass=sp.ImmutableMatrix(mass),
        damping=sp.ImmutableMatrix(parts.T * damping * parts),
        stiffness=sp.ImmutableMatrix(parts.T * stiffness * parts),
        energies=sp.ImmutableMatrix([kinetic, energy, -(loads.T * sp.Matrix(_Q))[0], dissipated]),
        section=sp.ImmutableMatrix(_section(names, residual, first, second)),
    )


def _elastic(
    names: Names,
    matrix: Callable[..., sp.Matrix],
    invariants: Sequence[sp.Expr],
    rates: Sequence[sp.Expr],
) -> tuple[sp.Matrix, sp.Matrix, sp.Matrix, sp.Expr, sp.Expr]:
    """Return forces on the invariants, their slopes by rates and invariants, strain energy, and lost power.

    By the chain rule over named matrices, without products of long expressions: measures of the invariants,
    and strains of the measures.
    """
    measures, unknown = _measures(invariants), len(invariants)
    named = [
        names.scalar(f"measure{k}", e, "1", f"measure {k} of the strain") for k, e in enumerate(measures)
    ]
    strained = _strains(named)
    tau, stiffnesses = DAMPING.symbol, sp.diag(*(k for _, k in strained))
    by, curves = _slopes(measures, invariants, "by", matrix)
    inner, curves_inner = _slopes([e for e, _ in strained], named, "inner", matrix)
    measure_rates = matrix("measure_rate", "1/s", (by * sp.Matrix(rates)).tolist())
    strain_rates = matrix("strain_rate", "1/s", (inner * measure_rates).tolist())
    stresses = stiffnesses * (sp.Matrix([e for e, _ in strained]) + tau * strain_rates)
    stresses = matrix("stress", "N*m", stresses.tolist())
    on_measures = matrix("on_measure", "N*m", (inner.T * stresses).tolist())
    forced = matrix("force", "N*m", (by.T * on_measures).tolist())
    dissipated = sp.Add(*(tau * k * v**2 for (_, k), v in zip(strained, strain_rates, strict=True)))
    weighted = matrix("weighted", "N*m", (inner.T * stiffnesses).tolist())
    damped_inner = matrix("damped_inner", "N*m*s", (tau * weighted * inner).tolist())
    moved = inner + tau * sp.Matrix.vstack(*((h * measure_rates).T for h in curves_inner))
    bent = sum((x * h for x, h in zip(stresses, curves_inner, strict=True)), sp.zeros(unknown))
    stiff_inner = matrix("stiff_inner", "N*m", (weighted * moved + bent).tolist())
    damped_by = matrix("damped_by", "N*m*s", (damped_inner * by).tolist())
    turned_by = sp.Matrix.vstack(*((h * sp.Matrix(rates)).T for h in curves))
    stiff_by = matrix("stiff_by", "N*m", (stiff_inner * by + damped_inner * turned_by).tolist())
    damped = matrix("damped", "N*m*s", (by.T * damped_by).tolist())
    bent = sum((x * h for x, h in zip(on_measures, curves, strict=True)), sp.zeros(unknown))
    stiff = matrix("stiff", "N*m", (by.T * stiff_by + bent).tolist())
    energy = sp.Add(*(k * e**2 for e, k in strained)) / 2
    return forced, damped, stiff, energy, dissipated


def _slopes(
    of: Sequence[sp.Expr], by: Sequence[sp.Expr], word: str, named: Callable[..., sp.Matrix]
) -> tuple[sp.Matrix, list[sp.Matrix]]:
    """Return first and second slopes of expressions, of named entries."""
    first = named(word, "1", [[sp.diff(e, x) for x in by] for e in of])
    return first, [named(f"{word}{k}__", "1", sp.hessian(e, by).tolist()) for k, e in enumerate(of)]


def _measures(invariants: Sequence[sp.Expr]) -> list[sp.Expr]:
    """Return measures of the strain, to the second order in the length of the element.

    They are the mean axial strain; mean and slope of w'' along the element in the plane of d2, in that of d3,
    as angles; the twist. With the angles b of c against d1 at both nodes, in the axes of each node, and the
    twist t of the nodes, they are d = b' - b and a = b + b' with d t^2/12 and t/3 (-d3, d2) in addition: the
    axes turn with the section. The twist has b x b' in addition, by which the line rotates.
    """
    stretch, z1, z2, y1, y2, twist = invariants
    # Angles by sines over L: the line between the nodes is shorter than the arc.
    (z1, y1), (z2, y2) = (
        [p * (1 - stretch + (z**2 + y**2) / 6) for p in (z, y)] for z, y in ((z1, y1), (z2, y2))
    )
    bowed = sp.Add(*((2 * a**2 - a * b + 2 * b**2) / 30 for a, b in ((z1, z2), (y1, y2))))
    mean = [e * (1 + twist**2 / 12) for e in (z2 - z1, y2 - y1)]
    slope = [z1 + z2 + twist * (y1 - y2) / 3, y1 + y2 + twist * (z2 - z1) / 3]
    return [stretch + bowed, mean[0], slope[0], mean[1], slope[1], twist + twist**3 / 6 + z1 * y2 - y1 * z2]


def _strains(measures: Sequence[sp.Expr]) -> list[tuple[sp.Expr, sp.Expr]]:
    """Return strains with the derivatives of their stresses by them.

    With different bending stiffnesses the moment about the line changes along the element, and so does the
    twist, by e, which minimises the energy, and by which the mean curvatures change: without it the energy
    has an error of the second order.
    """
    length, (in_z, in_y, torsion) = LENGTH.symbol, (q.symbol for q in (BENDING_Z, BENDING_Y, TORSION))
    stretch, z, slope_z, y, slope_y, twist = measures
    change = (in_z - in_y) * z * y / (torsion + (in_z * y**2 + in_y * z**2) / 12)
    return [
        (stretch, AXIAL.symbol * length),
        (z - change * y / 12, in_z / length),
        (slope_z, 3 * in_z / length),
        (y + change * z / 12, in_y / length),
        (slope_y, 3 * in_y / length),
        (twist, torsion / length),
        (change, torsion / (12 * length)),
    ]


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
    cubic = beam_matrices(ELEMENTS["cubic"], ElementSection((MU.symbol,), none, none, none, none)).mass
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
