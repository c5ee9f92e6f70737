"""Usual beam element: cubic deflection, linear stretch."""

from __future__ import annotations

from symgen.elements.element import Element

ELEMENT = Element(
    "cubic",
    "Euler-Bernoulli beam: cubic deflection, linear stretch",
    ("u", "w", "theta"),
    axial=1,
    transverse=3,
)
