"""The beam element in space as a building block: its matrices in axes that rotate at a constant rate."""

from __future__ import annotations

import sympy as sp

from symgen.mechanics.elastic.spatial import DOFS, MOTION, SECTION, point_mass, spatial_beam
from symgen.symbolic.quantity import AXES
from symgen.symbolic.system import Export, Group, NamedMatrix, System

REFERENCES = (
    "J. C. Houbolt, G. W. Brooks, NACA Report 1346 (1958)",
    "D. H. Hodges, E. H. Dowell, NASA TN D-7818 (1974)",
)
_PER = "m per rotation, strain or twist rate, m^2 per curvature or twist"


def spatial_beam_system() -> System:
    """Return the System of an element in space, over its section and its place in rotating axes."""
    made = spatial_beam()

    def square(name: str, matrix: sp.ImmutableMatrix, unit: str, about: str) -> NamedMatrix:
        return NamedMatrix(name, matrix, f"{unit}; *{_PER}", about, DOFS, DOFS, name != "gyroscopic")

    matrices = (
        square("mass", made.mass, "kg", "mass matrix"),
        square("gyroscopic", made.gyroscopic, "kg/s", "gyroscopic matrix, antisymmetric: times the rates"),
        square("centrifugal", made.centrifugal, "N/m", "what rotation subtracts from the stiffness"),
        square("stiffness", made.stiffness, "N/m", "stiffness matrix"),
        square("geometric", made.geometric, "N/m", "geometric stiffness of the axial force"),
        NamedMatrix("load", made.load, f"N; *{_PER}", "centrifugal load", DOFS),
    )
    axes = tuple(AXES)
    gyroscopic, centrifugal, load = point_mass()
    of_point = (
        NamedMatrix("point_gyroscopic", gyroscopic, "1/s", "gyroscopic matrix of a unit mass", axes, axes),
        NamedMatrix(
            "point_centrifugal",
            centrifugal,
            "1/s^2",
            "what rotation subtracts from its stiffness",
            axes,
            axes,
            True,
        ),
        NamedMatrix("point_load", load, "m/s^2", "its centrifugal load", axes),
    )
    return System(
        "spatial_beam",
        "Beam element in space, in axes that rotate at a constant rate",
        (
            Group("q", "length and section", SECTION),
            Group("u", "rotation, place and axial force", MOTION),
        ),
        (*matrices, *of_point),
        (
            *(Export(m.name, m.description, (m.name,)) for m in matrices),
            Export("point", "a unit mass in the rotating axes", tuple(m.name for m in of_point)),
        ),
        references=REFERENCES,
    )
