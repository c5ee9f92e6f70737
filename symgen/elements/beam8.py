"""Element of the thesis: quintic deflection with curvature at the nodes, linear stretch (Chapters V, VI)."""

from __future__ import annotations

from symgen.elements.element import Element

ELEMENT = Element(
    "beam8",
    "Euler-Bernoulli beam: quintic deflection with curvature at its nodes, linear stretch",
    ("u", "w", "theta", "kappa"),
    axial=1,
    transverse=5,
)
