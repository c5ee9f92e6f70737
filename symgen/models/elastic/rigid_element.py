"""One rigid element of a link as a building block: its [d], a force on it, and its inertia."""

from __future__ import annotations

import sympy as sp

from symgen.mechanics.elastic import rigid_elements
from symgen.mechanics.elastic.rigid_elements import NODAL
from symgen.mechanics.sources import RIGID_ELEMENT
from symgen.symbolic.quantity import AXES, Quantity, quantity
from symgen.symbolic.system import Definition, Export, Group, NamedMatrix, System

REFERENCE = "The thesis on kineto-elastodynamics, Chapter IV, Eqs. (4.1)-(4.10)"
#: Rows of the balance of an element.
ROWS = ("x", "y", "moment")
#: Units of entries are those of their row; in columns of moments, over a metre.
PER_MOMENT = "; /m per moment"
#: Matrices without kernels.
_SHOWN = "levers", "motion"
#: Ways of the thesis by their letter.
_LEVERS = {
    "R": "from the first node to the centre of mass",
    "S": "from the centre of mass to the second node",
}


def rigid_element_system() -> System:
    """Return the System of one rigid element between the nodes i and k, with a point p of it."""
    plane = tuple(AXES[:2])
    places = {
        letter: [quantity(f"{letter}_{a}", "m", f"{a} position of {about}") for a in plane]
        for letter, about in (
            ("i", "the first node"),
            ("k", "the second node"),
            ("p", "a point of the element"),
        )
    }
    moved = {
        letter: [quantity(f"{name}_{a}", "m/s^2", f"{a} component of the {about}") for a in plane]
        for letter, name, about in (
            ("i", "a_i", "acceleration of the first node"),
            ("k", "a_k", "acceleration of the second node"),
            ("g", "g", "acceleration of free fall"),
        )
    }
    mass = quantity("m", "kg", "mass")
    along = quantity("c_along", "1", "centre of mass on the way from the first node to the second")
    across = quantity("c_across", "1", "centre of mass to the left of that way, over its length")
    moment = quantity("I_c", "kg*m^2", "moment of inertia about the centre of mass")
    start, end, point = (_symbols(places[letter]) for letter in "ikp")
    first, second, gravity = (_symbols(moved[letter]) for letter in "ikg")

    at = along.symbol, across.symbol
    centre = rigid_elements.between(start, end, *at)
    d, relative = (
        tuple(y - x for x, y in zip(*pair, strict=True)) for pair in ((start, end), (first, second))
    )
    turning = rigid_elements.angular_acceleration(d, relative)
    before = rigid_elements.between((sp.S.Zero, sp.S.Zero), d, *at)
    behind = tuple(x - y for x, y in zip(d, before, strict=True))
    levers = [
        Definition(quantity(f"{letter}_{a}", "m", f"{a} component of the way {_LEVERS[letter]}"), x)
        for letter, way in (("R", before), ("S", behind))
        for a, x in zip(plane, way, strict=True)
    ]
    acceleration = rigid_elements.between(first, second, *at)
    about = "component of the acceleration of the centre of mass"
    moved_centre = [
        *(
            Definition(quantity(f"G_a{a}", "m/s^2", f"{a} {about}"), x)
            for a, x in zip(plane, acceleration, strict=True)
        ),
        Definition(quantity("theta_acceleration", "rad/s^2", "angular acceleration"), turning),
    ]
    *centre_of, angular = (x.quantity.symbol for x in moved_centre)
    right = rigid_elements.inertia(mass.symbol, moment.symbol, tuple(centre_of), angular, gravity)
    r_x, r_y, *to_end = (x.quantity.symbol for x in levers)
    at_nodes = tuple(f"{name} at {node}" for node in "ik" for name in NODAL)
    matrices = (
        NamedMatrix(
            "nodal_matrix", rigid_elements.nodal_matrix((-r_x, -r_y), tuple(to_end), (0, 0)),
            "1, 1, m" + PER_MOMENT,
            "[d] of the forces and moments (F) at both nodes, as they act at the centre of mass", ROWS,
            at_nodes,
        ),
        NamedMatrix(
            "point_matrix", rigid_elements.point_matrix(point, centre), "1, 1, 1, 1, m, m",
            "a force at the point p, as it acts at the centre of mass", ROWS, plane,
        ),
        NamedMatrix(
            "levers", sp.ImmutableMatrix([x.expression for x in levers]), "m",
            "(R) and (H), in (4.9) R and S: ways to and from the centre of mass",
            tuple(x.quantity.name for x in levers),
        ),
        NamedMatrix(
            "motion",
            sp.ImmutableMatrix([*(x.expression for x in moved_centre), -mass.symbol * gravity[1]]),
            "m/s^2, m/s^2, rad/s^2, N",
            "(P): acceleration of the centre of mass, angular acceleration and weight",
            (*(x.quantity.name for x in moved_centre), "weight"),
        ),
        NamedMatrix(
            "inertia", sp.ImmutableMatrix(3, 1, right), "N, N, N*m",
            "mass times acceleration less gravity, and moment of inertia times angular acceleration", ROWS,
        ),
    )  # fmt: skip
    return System(
        name="rigid_element",
        title="One rigid element of a link in the plane",
        groups=(
            Group("q", "positions of the nodes and of a point", tuple(x for p in "ikp" for x in places[p])),
            Group(
                "u", "accelerations of the nodes and of free fall", tuple(x for p in "ikg" for x in moved[p])
            ),
            Group("p", "mass properties", (mass, along, across, moment)),
        ),
        matrices=matrices,
        exports=tuple(Export(m.name, m.description, (m.name,)) for m in matrices if m.name not in _SHOWN),
        definitions=(*levers, *moved_centre),
        references=(REFERENCE,),
        sources=RIGID_ELEMENT,
    )


def _symbols(quantities: list[Quantity]) -> tuple[sp.Symbol, ...]:
    return tuple(x.symbol for x in quantities)
