"""Derivation steps common to all elements of elastic links, as a system for inspection: no kernels."""

from __future__ import annotations

from collections.abc import Iterator

import sympy as sp

from symgen.elements.element import LENGTH, Element, entry_unit
from symgen.mechanics.elastic.beam_matrices import shape_products
from symgen.mechanics.elastic.hamilton import APPLIED, FIELDS, MOTION, PATH, SECTION, THESIS, derive
from symgen.mechanics.elastic.turning_axes import COSINE, SINE, transformation
from symgen.symbolic.system import NO_SOURCE, Group, NamedMatrix, System


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
    of_element: tuple[NamedMatrix, ...] = ()
    groups: tuple[Group, ...] = ()
    if element is not None:
        of_element = tuple(_of_element(element))
        groups = (Group("element", "length and direction of the link", (LENGTH, COSINE, SINE)),)
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
