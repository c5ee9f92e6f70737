"""A double pendulum in its angles, with damping at the upper joint."""

import sympy as sp

from symgen.symbolic.quantity import quantity
from symgen.symbolic.system import Export, Group, NamedMatrix, System

ANGLES = tuple(quantity(f"theta{i}", "rad", f"angle {i} from the vertical") for i in (1, 2))
RATES = tuple(quantity(f"omega{i}", "rad/s", f"rate of angle {i}") for i in (1, 2))
PARAMETERS = (
    quantity("m", "kg", "mass of each bob"),
    quantity("l", "m", "length of each rod"),
    quantity("g", "m/s^2", "gravity"),
    quantity("c", "N*m*s/rad", "damping of the upper joint"),
)


def system() -> System:
    """Return the System: by Lagrange's equations on paper."""
    (a, b), (v, w), (m, l, g, c) = ([x.symbol for x in of] for of in (ANGLES, RATES, PARAMETERS))
    coupling = m * l**2 * sp.cos(a - b)
    turning = m * l**2 * sp.sin(a - b)
    mass = sp.ImmutableMatrix([[2 * m * l**2, coupling], [coupling, m * l**2]])
    force = sp.ImmutableMatrix(
        [-2 * m * g * l * sp.sin(a) - turning * w**2 - c * v, -m * g * l * sp.sin(b) + turning * v**2]
    )
    potential = sp.ImmutableMatrix([-m * g * l * (2 * sp.cos(a) + sp.cos(b))])
    first = l * sp.sin(a), -l * sp.cos(a)
    second = first[0] + l * sp.sin(b), first[1] - l * sp.cos(b)
    places = sp.ImmutableMatrix([[0, 0], first, second])
    return System(
        name="double_pendulum",
        title="Double pendulum in its angles",
        groups=(
            Group("q", "angles", ANGLES),
            Group("u", "rates", RATES),
            Group("p", "parameters", PARAMETERS),
        ),
        matrices=(
            NamedMatrix("mass_matrix", mass, "kg*m^2", "mass matrix"),
            NamedMatrix("force", force, "N*m", "moments"),
            NamedMatrix("potential_energy", potential, "J", "potential of gravity"),
            NamedMatrix("positions", places, "m", "positions", ("O", "A", "B"), ("x", "y")),
            NamedMatrix("height", sp.ImmutableMatrix([second[1]]), "m", "height of B"),
            NamedMatrix("events", sp.ImmutableMatrix([b]), "rad", "the lower rod is vertical", ("upright",)),
        ),
        exports=(Export("outputs", "outputs", ("height",)),),
        values={"m": 1.5, "l": 0.5, "g": 9.81, "c": 0.0, "theta1": 1.0, "omega2": 0.5},
    )
