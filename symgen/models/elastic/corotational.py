"""The beam element in large rotation, and what acts at its nodes, as building blocks."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from symgen.mechanics.elastic.corotational import PLACES, PROPERTIES, RATES, SECOND_RATES, corotational
from symgen.mechanics.sources import NONE
from symgen.symbolic.names import Names
from symgen.symbolic.system import Export, Group, NamedMatrix, System

REFERENCE = "M. A. Crisfield, Computer Methods in Applied Mechanics and Engineering 81 (1990) 131-150"
_ROWS = tuple(x.name for x in PLACES)
_FORCES = "N, N, N*m, N, N, N*m"
_ENERGIES, _OF_ENERGIES = (
    "J, J, J, W",
    "kinetic energy, strain energy, potential of gravity, power dissipated",
)
#: Kernels of every element that the runtime assembles.
_EXPORTS = (
    Export("residual", "inertia and internal force less gravity", ("residual",)),
    Export("tangent", "slopes of the residual", ("mass", "damping", "stiffness")),
    Export("energies", "energies of the element", ("energies",)),
)
_PLACES = Group("q", "positions and rotations of the nodes", PLACES)
_RATES = Group("u", "their rates and second rates", (*RATES, *SECOND_RATES))


def _slope(name: str, matrix: sp.ImmutableMatrix, by: str, about: str) -> NamedMatrix:
    return NamedMatrix(name, matrix, f"SI, force over {by}", about, _ROWS, _ROWS, name == "mass")


def corotational_beam_system() -> System:
    """Return the System of one element in large rotation, over its nodes' motion and its section."""
    names = Names()
    kernels = corotational(names)

    def scalars(of: dict[str, sp.Expr], name: str, unit: str, about: str) -> NamedMatrix:
        return NamedMatrix(name, sp.ImmutableMatrix(list(of.values())), unit, about, tuple(of))

    about = "inertia and internal force less gravity"
    matrices = (
        NamedMatrix("residual", kernels.residual, _FORCES, about, _ROWS),
        _slope("mass", kernels.mass, "acceleration", "slope of the residual by second rates"),
        _slope("damping", kernels.damping, "rate", "slope of the residual by rates"),
        _slope("stiffness", kernels.stiffness, "place", "slope of the residual by places"),
        scalars(dict(kernels.energies), "energies", _ENERGIES, _OF_ENERGIES),
        scalars(
            dict(kernels.strains),
            "strains",
            "1, rad, rad, N*m, N*m",
            "mean axial strain, rotations and bending moments of the ends",
        ),
    )
    return System(
        "corotational_beam",
        "Beam element in large rotation",
        (
            _PLACES,
            _RATES,
            Group("p", "length, section and gravity", PROPERTIES),
        ),
        matrices,
        (
            *_EXPORTS,
            Export("strains", "strain, end rotations and moments", ("strains",)),
        ),
        names.definitions,
        references=(REFERENCE,),
        sources=NONE,
    )


def corotational_node_system() -> System:
    """Return the System of bodies, forces and directions at the nodes of these elements."""
    from symgen.mechanics.elastic import nodes  # the element does not depend on it

    def column(name: str, entries: Sequence[sp.Expr], unit: str, about: str) -> NamedMatrix:
        return NamedMatrix(name, sp.ImmutableMatrix(list(entries)), unit, about)

    residual, mass, energies = nodes.body()
    error, slopes, curvature = nodes.weld()
    matrices = (
        column("shares", nodes.shares(), "1, m, 1, m", "shares of a force along the link by node"),
        column("force", nodes.force(), "N, N, N*m", "forces on a node by a force along the link"),
        column(
            "follower", nodes.follower(), "N, N, N*m", "forces on two nodes by a force that follows sections"
        ),
        column("far_end", nodes.far_end(), "m, m/s, m/s^2", "place of the far end, and its rates"),
        column("chord", nodes.chord(), "rad, rad/s", "direction of the line between the nodes, and its rate"),
    )
    of_body = (
        column("residual", residual, _FORCES, "inertia of a body at the first node less gravity"),
        _slope("mass", sp.ImmutableMatrix(mass), "acceleration", "slope of the residual by second rates"),
        _slope("damping", sp.zeros(6).as_immutable(), "rate", "slope of the residual by rates"),
        _slope("stiffness", sp.zeros(6).as_immutable(), "place", "slope of the residual by places"),
        column("energies", energies, _ENERGIES, _OF_ENERGIES),
    )
    welded = (
        column("weld_error", error, "1, 1/s", "error of a weld to a rigid link, and its rate"),
        column("weld_slopes", slopes, "1/m, 1", "slopes of the error by the state"),
        NamedMatrix("weld_curvature", sp.ImmutableMatrix(curvature), "SI", "slopes of these", _ROWS, _ROWS),
    )
    return System(
        "corotational_node",
        "Bodies, forces and directions at the nodes of elements in large rotation",
        (
            _PLACES,
            _RATES,
            Group("p", "length, gravity, a force along the link, and a body", nodes.PROPERTIES),
            Group("work", "shares of a force and the force in the axes of a link", nodes.ACTING),
        ),
        (*of_body, *matrices, *welded),
        (
            *_EXPORTS,
            *(Export(m.name, m.description, (m.name,)) for m in matrices),
            Export("weld", "a section that is welded to a rigid link", tuple(m.name for m in welded)),
        ),
        sources=NONE,
    )
