"""The beam element with directors as a building block: its equation, slopes, energies and sections."""

from __future__ import annotations

import sympy as sp

from symgen.mechanics.directors.beam import (
    FIBRES,
    FRACTION,
    PLACES,
    RATES,
    RESULTANTS,
    SECOND_RATES,
    SECTION,
    director_beam,
)
from symgen.mechanics.sources import NONE
from symgen.symbolic.names import Names
from symgen.symbolic.system import Export, Group, NamedMatrix, System

REFERENCES = (
    "M. A. Crisfield, Computer Methods in Applied Mechanics and Engineering 81 (1990) 131-150",
    "P. Betsch, P. Steinmann, International Journal for Numerical Methods in Engineering 54 (2002) 1775-1788",
)
_ROWS = tuple(x.name for x in PLACES)


def director_beam_system() -> System:
    """Return the System of one element in space in large rotation, over its nodes' motion and its section."""
    names = Names()
    kernels = director_beam(names)

    def slope(name: str, matrix: sp.ImmutableMatrix, by: str) -> NamedMatrix:
        about = f"slope of the residual by {by}"
        return NamedMatrix(name, matrix, "SI", about, _ROWS, _ROWS, name != "stiffness")

    about = "inertia and internal force less gravity"
    matrices = (
        NamedMatrix("residual", kernels.residual, "N; N*m of directors", about, _ROWS),
        slope("mass", kernels.mass, "second rates"),
        slope("damping", kernels.damping, "rates"),
        slope("stiffness", kernels.stiffness, "places"),
        NamedMatrix(
            "energies",
            kernels.energies,
            "J, J, J, W",
            "kinetic energy, strain energy, potential of gravity, power dissipated",
            ("kinetic", "strain", "gravity", "dissipated"),
        ),
        NamedMatrix(
            "section", kernels.section, "1; N*m; Pa; m", "strains, moments, stresses, place", RESULTANTS
        ),
    )
    return System(
        "director_beam",
        "Beam element in space in large rotation",
        (
            Group("q", "positions and directors of the nodes", PLACES),
            Group("u", "their rates and second rates", (*RATES, *SECOND_RATES)),
            Group("p", "length, section, damping, gravity, fraction", (*SECTION, *FIBRES, FRACTION)),
        ),
        matrices,
        (
            Export("residual", about, ("residual",)),
            Export("tangent", "slopes of the residual", ("mass", "damping", "stiffness")),
            Export("energies", "energies of the element", ("energies",)),
            Export("section", "strains and stress in a section of the element", ("section",)),
        ),
        names.definitions,
        references=REFERENCES,
        sources=NONE,
    )
