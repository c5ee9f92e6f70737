"""A finite element of an elastic link as a building block: matrices, loads, shape functions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import sympy as sp

from symgen.elements.element import LENGTH, PLACE, Element, entry_unit
from symgen.mechanics.elastic.beam_matrices import BeamMatrices, ElementSection, beam_matrices, shape_rows
from symgen.mechanics.elastic.hamilton import THESIS
from symgen.mechanics.sources import ELEMENT, PRINTED_ELEMENT
from symgen.symbolic.names import Names
from symgen.symbolic.quantity import Quantity, quantity, times_lengths, whole
from symgen.symbolic.system import Export, Group, NamedMatrix, System

#: Properties of the section along the element: name, letter, number of coefficients, unit of the first.
PROPERTIES = (
    ("mass", "m", 3, "kg/m", "mass per length"),
    ("rotary", "j", 5, "kg*m", "rotary inertia per length"),
    ("axial", "a", 3, "N", "axial stiffness E A"),
    ("bending", "b", 5, "N*m^2", "bending stiffness E I"),
    ("shear", "s", 3, "N", "shear stiffness k G A"),
)
#: Matrices that are shown for a constant section too, and their letters in the thesis.
_CONSTANT = {"mass": "[MD]", "gyroscopic": "[AD]", "stiffness": "[K]"} | dict.fromkeys(
    ("load_x", "load_y", "load_out", "load_turn"), ""
)
#: The element whose equation in fixed axes is shown too.
SHOWN = "beam8"
STATION = quantity("x", "m", "distance of the station from the first node")


def elastic_element_system(element: Element) -> System:
    """Return the matrices of an element, over its length and the coefficients of its section."""
    names = Names()
    coefficients = {
        name: [
            quantity(
                f"{letter}{k}",
                times_lengths(unit, -k),
                f"{meaning}, coefficient of x^{k}" if k else f"{meaning} at the first node",
            )
            for k in range(number)
        ]
        for name, letter, number, unit, meaning in PROPERTIES
    }
    section = ElementSection(
        *(_scaled(name, unit, coefficients[name], names) for name, _, _, unit, _ in PROPERTIES)
    )
    names.scalar(PLACE.name, STATION.symbol / LENGTH.symbol, PLACE.unit, PLACE.description)
    beam = beam_matrices(element, section)
    groups = [
        Group(
            "q",
            "length, and the section as polynomials in the distance x from the first node",
            (LENGTH, *(c for name in coefficients for c in coefficients[name])),
        ),
        Group("u", "station", (STATION,)),
    ]
    matrices: list[NamedMatrix] = []
    exports: list[Export] = []
    for kernel, about, members in _matrices(element, beam):
        matrices += members
        exports.append(Export(kernel, about, tuple(m.name for m in members)))
    uniform = _uniform(element, coefficients, names)
    # Shown; no kernels, for runs assemble in the axes of the links, and any section.
    shown = [_constant(m, uniform) for m in matrices if m.name in _CONSTANT]
    if element.name == SHOWN:
        from symgen.models.elastic.fixed_axes import MOVING, fixed_axes  # no other element depends on it

        groups.append(MOVING)
        shown += fixed_axes(element, beam, uniform, names)
    return System(
        f"element_{element.name}",
        f"Element of an elastic link: {element.about}",
        tuple(groups),
        (*matrices, *shown),
        tuple(exports),
        names.definitions,
        references=(THESIS,),
        sources=PRINTED_ELEMENT if element.name == SHOWN else ELEMENT,
    )


def _uniform(
    element: Element, coefficients: Mapping[str, Sequence[Quantity]], names: Names
) -> dict[sp.Symbol, int]:
    """Return zero for the terms that a constant section does not have, and the element itself neglects."""
    none = {
        c.symbol
        for name, of in coefficients.items()
        for c in (of if name == "rotary" and not element.rotary else of[1:])
    }
    zero = {d.quantity.symbol: 0 for d in names.definitions if d.expression.free_symbols & none}
    return zero | dict.fromkeys(none, 0)


def _constant(m: NamedMatrix, uniform: Mapping[sp.Symbol, int]) -> NamedMatrix:
    """Return a matrix of a constant section: with beam8 as the thesis prints it."""
    letter = _CONSTANT[m.name]
    return replace(
        m,
        name=f"constant_{m.name}",
        matrix=sp.ImmutableMatrix(m.matrix.xreplace(dict(uniform))),
        description=f"{letter} {m.description.partition(';')[0]}, of a constant section".lstrip(),
        left=whole(letter) if letter else None,
    )


def _scaled(name: str, unit: str, coefficients: Sequence[Quantity], names: Names) -> tuple[sp.Expr, ...]:
    """Return the coefficients by powers of xi = x/L."""
    return tuple(
        names.scalar(
            f"{name}_{k}", c.symbol * LENGTH.symbol**k, unit, f"{c.description.partition(':')[0]}: of xi^{k}"
        )
        for k, c in enumerate(coefficients)
    )


def _matrices(element: Element, matrices: BeamMatrices) -> Iterator[tuple[str, str, tuple[NamedMatrix, ...]]]:
    """Yield kernel, meaning and matrices."""

    def square(name: str, matrix: sp.ImmutableMatrix, unit: str, about: str) -> NamedMatrix:
        symmetric = name != "gyroscopic"
        return NamedMatrix(name, matrix, entry_unit(unit), about, element.dofs, element.dofs, symmetric)

    def column(name: str, matrix: sp.ImmutableMatrix, unit: str, about: str) -> NamedMatrix:
        return NamedMatrix(name, matrix, entry_unit(unit), about, element.dofs)

    for name, matrix, unit, about in (
        (
            "mass",
            matrices.mass,
            "kg",
            "mass matrix; with j0..j4 = 0 that of the centrifugal term, times -omega^2",
        ),
        ("gyroscopic", matrices.gyroscopic, "kg", "gyroscopic matrix A: -2 omega A s' and -omega' A s"),
        ("stiffness", matrices.stiffness, "N/m", "stiffness matrix"),
    ):  # fmt: skip
        yield name, about, (square(name, matrix, unit, about),)
    forces = (
        ("1/m", "for a unit axial force at the first node"),
        ("kg/m", "for the inertia of what lies before: times the acceleration along the link"),
        ("kg", "for the centrifugal force of what lies before: times -omega^2"),
    )
    yield (
        "geometric",
        "geometric stiffness",
        tuple(
            square(f"geometric{k}", matrix, unit, f"geometric stiffness {about}")
            for k, (matrix, (unit, about)) in enumerate(zip(matrices.geometric, forces, strict=True))
        ),
    )
    yield (
        "load",
        "loads of the rigid motion",
        (
            column(
                "load_x", matrices.load_x, "kg", "(E): inertia of an acceleration along the link, times -ax"
            ),
            column(
                "load_y", matrices.load_y, "kg", "(G): inertia of an acceleration across the link, times -ay"
            ),
            column("load_out", matrices.load_out, "kg*m", "(N): centrifugal force, times omega^2"),
            column(
                "load_turn",
                matrices.load_turn,
                "kg*m",
                "(L): inertia of an angular acceleration, times -omega'",
            ),
        ),
    )
    rows = shape_rows(element)
    entries = sp.ImmutableMatrix([list(row) for row in rows.values()])
    about = "displacements and strains at the station"
    units = entry_unit("1, 1, 1/m, 1/m, 1/m, 1/m^2")
    yield "shape", about, (NamedMatrix("shape", entries, units, about, tuple(rows), element.dofs),)
