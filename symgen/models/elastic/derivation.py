"""Derivation steps common to all elements of elastic links, as a system for inspection: no kernels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import sympy as sp

from symgen.elements.element import LENGTH, Element, entry_unit
from symgen.mechanics.elastic.beam_matrices import shape_products, strain_energy
from symgen.mechanics.elastic.hamilton import APPLIED, FIELDS, MOTION, PATH, SECTION, THESIS, derive
from symgen.mechanics.elastic.turning_axes import COSINE, SINE, transformation
from symgen.models.elastic.element import SHOWN
from symgen.symbolic.quantity import Quantity, quantity
from symgen.symbolic.system import NO_SOURCE, Definition, Group, NamedMatrix, System


def elastic_derivation_system(element: Element | None = None) -> System:
    """Return the steps of Hamilton's principle for a link, each with the source's equation numbers.

    With an element, integrals of its shape functions and the transformation to fixed axes follow.
    """
    matrices = tuple(
        NamedMatrix(
            step.name,
            sp.ImmutableMatrix(len(step.rows), len(step.columns) or 1, step.expressions),
            step.unit,
            step.about,
            step.rows,
            step.columns,
            source=NO_SOURCE if step.source.startswith("not in") else f"thesis {step.source}",
        )
        for step in derive().steps
    )
    of_element, groups, definitions = list[NamedMatrix](), list[Group](), list[Definition]()
    if element is not None:
        of_element += _of_element(element)
        groups.append(Group("element", "length and direction of the link", (LENGTH, COSINE, SINE)))
        if element.name == SHOWN:
            about = ((d, *place) for d, place in zip(element.dofs, element.places(), strict=True))
            unknowns = [quantity(d, x.unit, f"{x.description} at node {1 + at}") for d, x, at in about]
            groups.append(Group("unknowns", "unknowns of the element", tuple(unknowns)))
            energy, definitions = _energy(element, unknowns)
            of_element += energy
    return System(
        "elastic_link_derivation",
        "Elastic link by Hamilton's principle, step by step",
        (
            Group("fields", "displacements, their rates, and strains", tuple(FIELDS.values())),
            Group("motion", "rigid motion of the link", (*MOTION, *APPLIED, *PATH)),
            Group("section", "properties at x", SECTION),
            *groups,
        ),
        (*matrices, *of_element),
        (),
        tuple(definitions),
        references=(THESIS,),
    )


def _of_element(element: Element) -> Iterator[NamedMatrix]:
    names = element.dofs
    for name, (matrix, product, source) in shape_products(element).items():
        about = f"[{name}]: integral of {product} along the link"
        yield NamedMatrix(name, matrix, entry_unit("m"), about, names, names, source=f"thesis {source}")
    about = "T of S = T s: displacements in the link's axes, s, to those in fixed axes, S"
    turned = transformation(element)
    yield NamedMatrix("transformation", turned, "1", about, names, names, source="thesis (E.1)-(E.7)")


def _energy(element: Element, unknowns: Sequence[Quantity]) -> tuple[list[NamedMatrix], list[Definition]]:
    """Return the steps to the strain energy of a constant section, and the letters in them."""
    steps = strain_energy(element, [q.symbol for q in unknowns])
    units = ["1/m", *(f"1/m^{k}" for k in range(2, len(steps.products) + 2))]
    about = "by powers of x"
    square = f"coefficients of the squared curvature {about}"
    curvature = [
        Definition(quantity(f"a{k}", unit, f"coefficient of the curvature {about}"), e)
        for k, (e, unit) in enumerate(zip(steps.coefficients, units, strict=False))
    ]
    squared = [
        Definition(quantity(f"D{k}", unit, f"coefficient of the squared curvature {about}"), e)
        for k, (e, unit) in enumerate(zip(steps.products, units[1:], strict=True))
    ]
    known = {d.quantity.symbol: d.expression for d in curvature}

    def column(
        name: str, about: str, source: str, rows: Sequence[str], entries: Sequence[sp.Expr], unit: str
    ) -> NamedMatrix:
        matrix = sp.ImmutableMatrix(len(entries), 1, entries)
        return NamedMatrix(name, matrix, unit, about, tuple(rows), source=f"thesis {source}")

    def coefficients(
        name: str, about: str, source: str, first: int, of: Sequence[Definition], entries: Sequence[sp.Expr]
    ) -> NamedMatrix:
        rows = [d.quantity.name for d in of]
        numbers = "; ".join(f"{row} (D.{k})" for k, row in enumerate(rows, first))
        units = ", ".join(d.quantity.unit for d in of)
        return column(name, about, f"{source}; {numbers}", rows, entries, units)

    in_unknowns = [sp.expand(e.xreplace(known)) for e in steps.products]
    both = steps.axial + steps.bending
    matrices = [
        coefficients("curvature_coefficients", f"coefficients of the curvature {about}", "(D.5)-(D.8)", 5,
                     curvature, steps.coefficients),
        coefficients("squared_curvature_coefficients", square, "(D.9)-(D.15)",
                     9, squared, steps.products),
        coefficients("squared_curvature_of_unknowns", f"{square}, in the unknowns",
                     "(D.16)-(D.22), corrected", 16, squared, in_unknowns),
        column("squared_curvature", "square of the curvature at x", "(D.23), (D.24)", (), [steps.polynomial],
               "1/m^2"),
        column("potential_energy", "strain energy of an element with a constant section",
               "(6.30), without gravity; axial (6.20), (6.21); bending (6.29), (D.25)-(D.27); sum (6.30)",
               ("axial", "bending", "sum"), [steps.axial, steps.bending, both], "J"),
    ]  # fmt: skip
    return matrices, [*curvature, *squared]
