"""Beam with shear and rotary inertia: independent rotation of the section, linear shear strain.

With deflection and rotation of equal degree a slender element locks: it can bend only by shearing. Here the
deflection is one degree above the rotation, so the shear strain w' - phi can be zero along the whole element.
The shear strains at both ends are separate unknowns, not shared with other elements; if they are zero, the
element is the cubic one. One element is exact for a uniform beam without load, and no stiffness divides.
"""

from __future__ import annotations

import sympy as sp

from symgen.elements.element import Element, derivative


def second_derivative(gamma: sp.Expr) -> sp.Expr:
    """Return the second derivative of the shear strain, which is zero if the shear strain is linear."""
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
