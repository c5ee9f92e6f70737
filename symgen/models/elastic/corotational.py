"""The beam element in large rotation as a building block: its equation, slopes, energies and strains."""

from __future__ import annotations

import sympy as sp

from symgen.mechanics.elastic.corotational import PLACES, PROPERTIES, RATES, SECOND_RATES, corotational
from symgen.symbolic.names import Names
from symgen.symbolic.system import Export, Group, NamedMatrix, System

REFERENCE = "M. A. Crisfield, Computer Methods in Applied Mechanics and Engineering 81 (1990) 131-150"
_ROWS = tuple(x.name for x in PLACES)
_FORCES = "N, N, N*m, N, N, N*m"


def corotational_beam_system() -> System:
    """Return the System of one element in large rotation, over its nodes' motion and its section."""
    names = Names()
    made = corotational(names)

    def slope(name: str, matrix: sp.ImmutableMatrix, by: str, about: str) -> NamedMatrix:
        return NamedMatrix(name, matrix, f"SI, force over {by}", about, _ROWS, _ROWS, name == "mass")

    def scalars(of: dict[str, sp.Expr], name: str, unit: str, about: str) -> NamedMatrix:
        return NamedMatrix(name, sp.ImmutableMatrix(list(of.values())), unit, about, tuple(of))

    about = "inertia and internal force less gravity"
    matrices = (
        NamedMatrix("residual", made.residual, _FORCES, about, _ROWS),
        slope("mass", made.mass, "acceleration", "slope of the residual by second rates"),
        slope("damping", made.damping, "rate", "slope of the residual by rates"),
        slope("stiffness", made.stiffness, "place", "slope of the residual by places"),
        scalars(dict(made.energies), "energies", "J", "kinetic energy, strain energy, potential of gravity"),
        scalars(
            dict(made.strains),
            "strains",
            "1, rad, rad, N*m, N*m",
            "mean axial strain, rotations and bending moments of the ends",
        ),
    )
    return System(
        "corotational_beam",
        "Beam element in large rotation",
        (
            Group("q", "positions and rotations of the nodes", PLACES),
            Group("u", "their rates and second rates", (*RATES, *SECOND_RATES)),
            Group("p", "length, section and gravity", PROPERTIES),
        ),
        matrices,
        (
            Export("residual", about, ("residual",)),
            Export("tangent", "slopes of the residual", ("mass", "damping", "stiffness")),
            Export("energies", "energies of the element", ("energies",)),
            Export("strains", "strain, end rotations and moments", ("strains",)),
        ),
        names.definitions,
        references=(REFERENCE,),
    )
