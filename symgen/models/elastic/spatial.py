"""The beam element in space as a building block: its matrices in axes that rotate at a constant rate."""

from __future__ import annotations

import sympy as sp

from symgen.mechanics.elastic.spatial import BODY, DOFS, MOTION, SECTION, body, spatial_beam
from symgen.mechanics.sources import NONE
from symgen.symbolic.quantity import AXES
from symgen.symbolic.system import Export, Group, NamedMatrix, System

REFERENCES = (
    "J. C. Houbolt, G. W. Brooks, NACA Report 1346 (1958)",
    "D. H. Hodges, E. H. Dowell, NASA TN D-7818 (1974)",
)
_PER = "m per rotation, strain or twist rate, m^2 per curvature or twist"


def spatial_beam_system() -> System:
    """Return the System of an element in space, over its section and its place in rotating axes."""
    kernels = spatial_beam()

    def square(name: str, matrix: sp.ImmutableMatrix, unit: str, about: str) -> NamedMatrix:
        return NamedMatrix(name, matrix, f"{unit}; *{_PER}", about, DOFS, DOFS, name != "gyroscopic")

    matrices = (
        square("mass", kernels.mass, "kg", "mass matrix"),
        square("gyroscopic", kernels.gyroscopic, "kg/s", "gyroscopic matrix, antisymmetric: times the rates"),
        square("centrifugal", kernels.centrifugal, "N/m", "what rotation subtracts from the stiffness"),
        square("stiffness", kernels.stiffness, "N/m", "stiffness matrix"),
        square("geometric", kernels.geometric, "N/m", "geometric stiffness of the axial force"),
        NamedMatrix("load", kernels.load, f"N; *{_PER}", "centrifugal load", DOFS),
    )
    rows = (*AXES, *(f"rotation_{a}" for a in AXES))
    kinds = (
        ("mass", "kg", "mass matrix of a rigid body"),
        ("gyroscopic", "kg/s", "gyroscopic matrix of a rigid body"),
        ("centrifugal", "N/m", "what rotation subtracts from the stiffness at a rigid body"),
    )
    *squares, load = body()
    of_body = (
        *(
            NamedMatrix(
                f"body_{name}", m, f"{unit}; *m per rotation", about, rows, rows, name != "gyroscopic"
            )
            for m, (name, unit, about) in zip(squares, kinds, strict=True)
        ),
        NamedMatrix("body_load", load, "N; *m per rotation", "centrifugal load of a rigid body", rows),
    )
    return System(
        "spatial_beam",
        "Beam element in space, in axes that rotate at a constant rate",
        (
            Group("q", "length and section", SECTION),
            Group("u", "rotation, place and axial force", MOTION),
            Group("p", "rigid body", BODY),
        ),
        (*matrices, *of_body),
        (
            *(Export(m.name, m.description, (m.name,)) for m in matrices),
            Export("body", "a rigid body in the rotating axes", tuple(m.name for m in of_body)),
        ),
        references=REFERENCES,
        sources=NONE,
    )
