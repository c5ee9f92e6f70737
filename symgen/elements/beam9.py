"""Element of the thesis with a quadratic stretch: one inner displacement."""

from __future__ import annotations

from symgen.elements.element import Element

ELEMENT = Element(
    "beam9",
    "Euler-Bernoulli beam: quintic deflection with curvature at its nodes, quadratic stretch",
    ("u", "w", "theta", "kappa"),
    axial=2,
    transverse=5,
    inner_dofs=("mid",),
)
