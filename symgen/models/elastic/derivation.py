"""Derivation steps common to all elements of elastic links, as a system for inspection: no kernels."""

from __future__ import annotations

import sympy as sp

from symgen.mechanics.elastic.hamilton import APPLIED, FIELDS, MOTION, PATH, SECTION, THESIS, derive
from symgen.symbolic.system import NO_SOURCE, Group, NamedMatrix, System


def elastic_derivation_system() -> System:
    """Return the steps of Hamilton's principle for a link, each with the source's equation numbers."""
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
    return System(
        "elastic_link_derivation",
        "Elastic link by Hamilton's principle, step by step",
        (
            Group("fields", "displacements, their rates, and strains", tuple(FIELDS.values())),
            Group("motion", "rigid motion of the link", (*MOTION, *APPLIED, *PATH)),
            Group("section", "properties at x", SECTION),
        ),
        matrices,
        (),
        references=(THESIS,),
    )
