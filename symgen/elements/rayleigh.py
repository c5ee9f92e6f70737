"""Element of the thesis with the rotary inertia of the section."""

from __future__ import annotations

from symgen.elements.element import Element

ELEMENT = Element(
    "rayleigh",
    "Rayleigh beam: quintic deflection with curvature at its nodes, linear stretch, rotary inertia",
    ("u", "w", "theta", "kappa"),
    axial=1,
    transverse=5,
    rotary=True,
)
