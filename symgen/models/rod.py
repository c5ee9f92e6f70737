"""One free rod as a building block: end masses, kinetic energy and the length constraint, for inspection."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import chain

import sympy as sp

from symgen.mechanics.rods.particles import (
    EndMass,
    end_mass,
    kinetic_energy,
    length_constraint,
    printed_particle_masses,
)
from symgen.mechanics.sources import ROD
from symgen.symbolic.calculus import ZERO, Calculus
from symgen.symbolic.quantity import AXES, Quantity, quantity
from symgen.symbolic.system import Definition, Export, Group, NamedMatrix, System
from symgen.symbolic.vectors import cross

REFERENCE = "H. A. Attia, Dynamic Analysis of a Chain of Rigid Rods, sections 2.1 and 2.2"


def rod_system(dimension: int) -> System:
    """Return the system of one rod with the particles 1, 2 and 3, in the plane (2) or in space (3)."""
    axes = AXES[:dimension]
    (q, u, accelerations), middle = (
        [_motion(numbers, ending, unit, noun, axes) for ending, unit, noun in _MOTION]
        for numbers in ((1, 3), (2,))
    )
    m = quantity("m", "kg", "mass")
    length = quantity("l", "m", "length")
    centre = quantity("l_c", "m", "centre of mass from particle 1 along the rod")
    inertia = quantity("I_c", "kg*m^2", "moment of inertia about the centre of mass, across the rod")
    parameters = (m, length, centre, inertia)
    symbols = tuple(x.symbol for x in parameters)
    calculus = Calculus(q, u, sp.Symbol("t", real=True))
    ends = end_mass(*symbols)
    entries = {
        quantity(f"a{k}", "kg", f"entry {k} of the mass matrix of the ends, of each axis"): mass
        for k, mass in zip(("11", "12", "22"), ends, strict=False)
    }
    named = EndMass(*(x.symbol for x in entries))
    start, end = (tuple(x.symbol for x in u[k : k + dimension]) for k in (0, dimension))
    inner, outer = (tuple(x.symbol for x in q[k : k + dimension]) for k in (0, dimension))
    along = tuple(
        calculus.define(f"r31_{a}", y - x, "m", f"{a} component of the vector from particle 1 to 3")
        for a, x, y in zip(axes, inner, outer, strict=True)
    )
    phi = length_constraint(along, length.symbol)
    block = sp.kronecker_product(
        sp.Matrix([[named.a11, named.a12], [named.a12, named.a22]]), sp.eye(dimension)
    )
    names = tuple(x.name for x in q)
    particles = [quantity(f"m_{k}", "kg", f"mass of the particle {at}") for k, at in _PARTICLES.items()]
    about_start = quantity("I_o", "kg*m^2", "moment of inertia about particle 1, across the rod")
    halves = [quantity(f"r21_{a}", "m", f"{a} component of the vector from particle 1 to 2") for a in axes]
    of_particles = tuple(x.symbol for x in particles)
    printed = printed_particle_masses(
        m.symbol, length.symbol, centre.symbol, about_start.symbol, of_particles[1:]
    )
    known = [tuple(x.symbol for x in part) for part in (q, u, accelerations)]
    three = _three_particles(
        of_particles, known, [x.symbol for x in chain(*middle)], along, tuple(h.symbol for h in halves)
    )
    momenta = _momenta(of_particles, accelerations, along, tuple(x.symbol for x in halves))
    across, projected = _projected(along, length.symbol, momenta[1]) if dimension == 3 else ((), ())
    shown = (
        *_particles(of_particles, about_start.symbol, symbols),
        *three,
        *_distance(calculus, along, length.symbol, known[2]),
        *momenta,
        *projected,
    )
    matrices = (
        *shown,
        NamedMatrix(
            "mass_matrix",
            sp.ImmutableMatrix(block),
            "kg",
            "end mass matrix, the middle particle eliminated",
            names,
            names,
            True,
        ),
        _matrix("kinetic_energy", [kinetic_energy(named, start, end)], "J", "kinetic energy"),
        _matrix("constraint", [phi], "m^2", "length constraint, whose gradient is r31"),
        _matrix(
            "velocity_constraint", [calculus.rate(phi)], "m^2/s", "rate of the constraint; zero", left=ZERO
        ),
        NamedMatrix(
            "constraint_jacobian",
            calculus.jacobian([phi]),
            "m",
            "derivative of the constraint by the coordinates",
            ("length",),
            names,
        ),
        _matrix(
            "acceleration_rhs",
            [-calculus.rate(calculus.rate(phi))],
            "m^2/s^2",
            "right-hand side gamma of J a = gamma",
        ),
    )
    return System(
        name="rod" if dimension == 2 else "rod_spatial",
        title=f"One rigid rod {'in the plane' if dimension == 2 else 'in space'}",
        groups=(
            Group("q", "coordinates of the ends", tuple(q)),
            Group("u", "velocities of the ends", tuple(u)),
            Group("p", "parameters", parameters),
            Group(
                "work", "accelerations of the ends, motion of the middle", (*accelerations, *chain(*middle))
            ),
        ),
        matrices=matrices,
        exports=tuple(Export(x.name, x.description, (x.name,)) for x in matrices[len(shown) :]),
        definitions=(
            *calculus.definitions,
            *(Definition(x, d / 2) for x, d in zip(halves, along, strict=True)),
            *(Definition(x, e) for x, e in entries.items()),
            Definition(about_start, inertia.symbol + m.symbol * centre.symbol**2),
            *reversed([Definition(x, e) for x, e in zip(particles, printed, strict=True)]),
            *across,
        ),
        references=(REFERENCE,),
        sources=ROD,
    )


#: The particles that stand for a rod.
_PARTICLES = {1: "1, at one end", 2: "2, in the middle", 3: "3, at the other end"}

#: Left sides: sum of the forces on a rod, and of their moments about particle 1.
_FORCES, _MOMENTS = (sp.Symbol(name, real=True) for name in ("R", "G1"))

#: Ending of the name, unit and noun of a position and its rates.
_MOTION = (
    ("", "m", "position"),
    ("_rate", "m/s", "velocity"),
    ("_acceleration", "m/s^2", "acceleration"),
)


def _motion(numbers: Iterable[int], ending: str, unit: str, noun: str, axes: Sequence[str]) -> list[Quantity]:
    """Return positions of particles, or one of their rates."""
    return [
        quantity(f"r{k}_{a}{ending}", unit, f"{a} {noun} of particle {_PARTICLES[k]}")
        for k in numbers
        for a in axes
    ]


def _particles(
    masses: Sequence[sp.Expr], about_start: sp.Expr, rod: Sequence[sp.Expr]
) -> tuple[NamedMatrix, ...]:
    """Return the particles, their conditions, and the masses of the ends without the middle particle."""
    (m1, m2, m3), (m, length, centre, _) = masses, rod
    three = [m1 + m2 + m3 - m, (m2 / 2 + m3) * length - m * centre, (m2 / 4 + m3) * length**2 - about_start]
    ends = sp.ImmutableMatrix([[m1 + m2 / 4, m2 / 4], [m2 / 4, m3 + m2 / 4]])
    conditions = "mass, first and second moment of the particles, less those of the rod; zero"
    places, names = ("start", "middle", "end"), ("r1", "r3")
    return (
        _matrix(
            "particle_conditions", three, "kg, kg*m, kg*m^2", conditions, ("mass", "first", "second"), ZERO
        ),
        _matrix(
            "particle_masses", [m1, m2, m3], "kg", f"equivalent particles at {', '.join(places)}", places
        ),
        NamedMatrix("end_masses", ends, "kg", "masses of the ends, of each axis", names, names, True),
    )


def _three_particles(
    masses: Sequence[sp.Expr],
    ends: Sequence[Sequence[sp.Expr]],
    middle: Sequence[sp.Expr],
    along: Sequence[sp.Expr],
    half: Sequence[sp.Expr],
) -> tuple[NamedMatrix, ...]:
    """Return the momenta of all three particles, and the constraint of the middle one with its rates.

    ``ends`` are positions, velocities and accelerations of particles 1 and 3, ``middle`` those of 2.
    """
    (m1, m2, m3), n = masses, len(along)
    axes = tuple(AXES[:n])
    start, end = ends[2][:n], ends[2][n:]
    own = middle[2 * n :]
    forces = [m1 * a + m2 * b + m3 * c for a, b, c in zip(start, own, end, strict=True)]
    second, third = _crossed(half, own), _crossed(along, end)
    moments = [m2 * x + m3 * y for x, y in zip(second, third, strict=True)]
    before = ", before the middle one is eliminated"
    sums = (
        _matrix(
            "particle_momentum",
            forces,
            "N",
            f"sum of mass times acceleration of the particles{before}",
            axes,
            _FORCES,
        ),
        _matrix(
            "particle_moment",
            moments,
            "N*m",
            f"sum of mass times moment of the acceleration of the particles about particle 1{before}",
            _across(axes),
            _MOMENTS,
        ),
    )
    return sums + tuple(
        _matrix(
            f"middle_{noun}",
            [middle[k * n + i] - (x[i] + x[n + i]) / 2 for i in range(n)],
            unit,
            f"{noun} of the middle particle less the mean of those of the ends; zero",
            axes,
            ZERO,
        )
        for k, ((_, unit, noun), x) in enumerate(zip(_MOTION, ends, strict=True))
    )


def _distance(
    calculus: Calculus, along: Sequence[sp.Expr], length: sp.Expr, accelerations: Sequence[sp.Expr]
) -> tuple[NamedMatrix, NamedMatrix]:
    """Return the condition of the distance of the ends, and its second rate, halved."""
    n = len(along)
    relative = [b - a for a, b in zip(accelerations[:n], accelerations[n:], strict=True)]
    squares = [x**2 for x in along]
    second = [x * a + calculus.rate(x) ** 2 for x, a in zip(along, relative, strict=True)]
    return (
        _matrix(
            "distance", [sp.Add(*squares, -(length**2))], "m^2", "squared distance less l^2; zero", left=ZERO
        ),
        _matrix(
            "acceleration_constraint",
            [sp.Add(*second)],
            "m^2/s^2",
            "second rate of the constraint; zero",
            left=ZERO,
        ),
    )


def _momenta(
    masses: Sequence[sp.Expr],
    accelerations: Sequence[Quantity],
    along: Sequence[sp.Expr],
    middle: Sequence[sp.Expr],
) -> tuple[NamedMatrix, NamedMatrix]:
    """Return the rates of the linear momentum and of the moment of momentum about particle 1.

    The middle particle moves with the mean of the ends (:func:`_three_particles` has it).
    """
    m1, m2, m3 = masses
    n = len(along)
    inner, outer = ([x.symbol for x in accelerations[k : k + n]] for k in (0, n))
    linear = [(m1 + m2 / 2) * a + (m3 + m2 / 2) * b for a, b in zip(inner, outer, strict=True)]
    weighted = tuple(m3 * x + m2 / 2 * y for x, y in zip(along, middle, strict=True))
    first, second = (_crossed(arm, a) for arm, a in ((middle, inner), (weighted, outer)))
    angular = [m2 / 2 * x + y for x, y in zip(first, second, strict=True)]
    about = "rate of the moment of momentum about particle 1: the moment of the forces"
    axes = tuple(AXES[:n])
    return (
        _matrix(
            "linear_momentum",
            linear,
            "N",
            "rate of the linear momentum: the sum of the forces",
            axes,
            _FORCES,
        ),
        _matrix("angular_momentum", angular, "N*m", about, _across(axes), _MOMENTS),
    )


def _projected(
    along: Sequence[sp.Expr], length: sp.Expr, moment: NamedMatrix
) -> tuple[list[Definition], tuple[NamedMatrix]]:
    """Return the moment of momentum along the unit vectors of section 2.2, with what they are made of.

    With r31 = l (cos(theta) cos(phi), sin(theta) cos(phi), sin(phi)) they are (-y, x, 0)/rho and (-x z, -y z,
    rho^2)/(l rho), rho^2 = x^2 + y^2: as printed where x > 0, and across the rod for every x.
    """
    x, y, z = along
    rho = quantity("rho", "m", "distance of particle 3 from the axis z through particle 1")
    vectors = {
        "u_bar": (-y / rho.symbol, x / rho.symbol),
        "u_hat": (-x * z / length / rho.symbol, -y * z / length / rho.symbol, rho.symbol / length),
    }
    definitions = [Definition(rho, sp.sqrt(x**2 + y**2))]

    def defined(name: str, unit: str, expressions: Iterable[sp.Expr], about: str) -> list[sp.Symbol]:
        pairs = zip(AXES, expressions, strict=False)
        new = [Definition(quantity(f"{name}_{a}", unit, f"{a} component of {about}"), e) for a, e in pairs]
        definitions.extend(new)
        return [d.quantity.symbol for d in new]

    sides = defined("G", moment.unit, moment.matrix, f"the {moment.description}")
    units = [defined(name, "1", vector, "a unit vector across the rod") for name, vector in vectors.items()]
    entries = [sp.Add(*(u * g for u, g in zip(unit, sides, strict=False))) for unit in units]
    about = "rate of the moment of momentum about particle 1 along two unit vectors across the rod"
    return definitions, (_matrix("projected_momentum", entries, moment.unit, about, tuple(vectors)),)


def _crossed(arm: Sequence[sp.Expr], vector: Sequence[sp.Expr]) -> tuple[sp.Expr, ...]:
    """Return the cross product, of which the plane has the component across it."""
    if len(arm) == 2:
        return (arm[0] * vector[1] - arm[1] * vector[0],)
    return tuple(cross(tuple(arm), tuple(vector)))


def _across(axes: tuple[str, ...]) -> tuple[str, ...]:
    """Return the axes of moments: in the plane the one across it."""
    return axes if len(axes) == 3 else tuple(AXES[2:])


def _matrix(
    name: str,
    entries: list[sp.Expr],
    unit: str,
    description: str,
    rows: tuple[str, ...] = (),
    left: sp.Expr | None = None,
) -> NamedMatrix:
    column = sp.ImmutableMatrix(len(entries), 1, entries)
    return NamedMatrix(name, column, unit, description, rows, left=left)
