"""Beam with shear and rotary inertia: the section turns by itself, and the shear strain is linear.

With deflection and rotation of equal degree a slender element locks: it can bend only by shearing. Here the
deflection is one degree above the rotation, so the shear strain w' - phi can be zero all along the element,
and it is an unknown of its own at both ends, not shared with other elements. Where it is zero the element is
the cubic one. A uniform beam without load is exact with one element, and nothing is divided by a stiffness.
"""

from __future__ import annotations

import sympy as sp

from symgen.elements.element import Element, derivative


def second_derivative(gamma: sp.Expr) -> sp.Expr:
    """Return what is zero where the shear strain is linear."""
    return derivative(gamma, 2)


ELEMENT = Element(
    "timoshenko",
    "Timoshenko beam: cubic deflection, quadratic rotation, linear shear strain, rotary inertia",
    ("u", "w", "theta"),
    axial=1,
    transverse=3,
    inner_dofs=("gamma1", "gamma2"),
    rotation=2,
    vanishing=second_derivative,
    rotary=True,
)
