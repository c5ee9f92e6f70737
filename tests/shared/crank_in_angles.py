"""A slider-crank in the angles of crank and rod and in its stroke, closed and driven by constraints.

The rod has a moment of inertia and no mass.
"""

import sympy as sp

from symgen.symbolic.quantity import quantity
from symgen.symbolic.system import Group, NamedMatrix, System

TIME = quantity("t", "s", "time")
NAMES = {"theta": ("rad", "crank angle"), "phi": ("rad", "rod angle"), "s": ("m", "stroke")}
COORDINATES = tuple(quantity(name, *of) for name, of in NAMES.items())
RATES = tuple(quantity(f"{name}_v", f"{unit}/s", f"rate of {about}") for name, (unit, about) in NAMES.items())
UNITS = {"r": "m", "l": "m", "J": "kg*m^2", "I": "kg*m^2", "M": "kg", "speed": "rad/s", "push": "N"}
PARAMETERS = tuple(quantity(name, unit, f"parameter {name}") for name, unit in UNITS.items())
#: The crank turns at constant speed from 0.5 rad.
VALUES = {
    "r": 0.1,
    "l": 0.3,
    "J": 0.01,
    "I": 0.002,
    "M": 2.0,
    "speed": 10.0,
    "push": 3.0,
    "theta": 0.5,
    "phi": -0.1,
    "s": 0.4,
}


def system() -> System:
    """Return the System."""
    (theta, phi, s), (r, l, inertia, turning, mass, speed, push) = (
        [x.symbol for x in of] for of in (COORDINATES, PARAMETERS)
    )
    closure = (
        r * sp.cos(theta) + l * sp.cos(phi) - s,
        r * sp.sin(theta) + l * sp.sin(phi),
        theta - speed * TIME.symbol - sp.Rational(1, 2),
    )
    return System(
        name="crank_in_angles",
        title="Slider-crank in angles",
        groups=(
            Group("t", "time", (TIME,)),
            Group("q", "coordinates", COORDINATES),
            Group("u", "rates", RATES),
            Group("p", "parameters", PARAMETERS),
        ),
        matrices=(
            NamedMatrix("mass_matrix", sp.diag(inertia, turning, mass).as_immutable(), "SI", "masses"),
            NamedMatrix("force", sp.ImmutableMatrix([0, 0, push]), "SI", "forces"),
            NamedMatrix("constraints", sp.ImmutableMatrix(closure), "m", "closure", ("x", "y", "drive")),
        ),
        exports=(),
        values=VALUES,
    )
