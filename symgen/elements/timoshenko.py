"""Beam with shear and rotary inertia: deflection and rotation that satisfy the balance of moments.

With independent fields of low degree a slender element locks: it can bend only by shearing. Here both
come from the static solution of the uniform beam of the mean section, so there is nothing to lock, and a
uniform beam without load is exact at its nodes with one element.
"""

from __future__ import annotations

import sympy as sp

from symgen.elements.element import LENGTH, PLACE, SHARE, Element


def balance(w: sp.Expr, phi: sp.Expr) -> sp.Expr:
    """Return E I phi'' + k G A (w' - phi) over (k G A + 12 E I/L^2): zero where no moment is applied.

    Over the sum of both stiffnesses, it divides by nothing that vanishes for rigid or for slack shear.
    """
    xi, share = PLACE.symbol, SHARE.symbol
    shear = sp.diff(w, xi) / LENGTH.symbol - phi
    return sp.expand((1 - share) * sp.diff(phi, xi, 2) + 12 * share * shear)


ELEMENT = Element(
    "timoshenko",
    "Timoshenko beam: cubic deflection and quadratic rotation in balance, shear, rotary inertia",
    ("u", "w", "theta"),
    axial=1,
    transverse=3,
    rotation=2,
    balance=balance,
    rotary=True,
)
