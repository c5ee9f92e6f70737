"""Derivation steps common to all elements of elastic links, as a system for inspection: no kernels."""

from __future__ import annotations

import sympy as sp

from symgen.elements.element import Element
from symgen.mechanics.elastic.hamilton import APPLIED, FIELDS, MOTION, PATH, SECTION, THESIS, derive
from symgen.mechanics.elastic.turning_axes import COSINE, SINE, transformation
from symgen.symbolic.system import NO_SOURCE, Group, NamedMatrix, System


def elastic_derivation_system(element: Element | None = None) -> System:
    """Return the steps of Hamilton's principle for a link, each with the source's equation numbers.

    With an element, the transformation of its displacements to fixed axes follows.
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
    fixed = (
        ()
        if element is None
        else (
            NamedMatrix(
                "transformation",
                transformation(element),
                "1",
                "T of S = T s: displacements in the link's axes, s, to those in fixed axes, S",
                element.dofs,
                element.dofs,
                source="thesis (E.4)-(E.7)",
            ),
        )
    )
    return System(
        "elastic_link_derivation",
        "Elastic link by Hamilton's principle, step by step",
        (
            Group("fields", "displacements, their rates, and strains", tuple(FIELDS.values())),
            Group("motion", "rigid motion of the link", (*MOTION, *APPLIED, *PATH)),
            Group("section", "properties at x", SECTION),
            *((Group("axes", "direction of the link", (COSINE, SINE)),) if fixed else ()),
        ),
        (*matrices, *fixed),
        (),
        references=(THESIS,),
    )
