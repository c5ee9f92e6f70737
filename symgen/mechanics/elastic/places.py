"""Terms of an elastic link at one of its places, over the fields there.

Matrices of the link are sums of shape^T * term * shape, with the rows ``SHAPES`` of its element.
"""

from __future__ import annotations

import sympy as sp

from symgen.mechanics.elastic.hamilton import AXIAL, FIELDS, MU, PROFILE, ROTARY, X, derive
from symgen.mechanics.elastic.weights import CONSTANTS
from symgen.symbolic.quantity import quantity

#: Fields of a place by the name of their shape functions, in the order of the kernels ``shape``.
SHAPES = {
    "u": "u",
    "w": "w",
    "slope": "w_x",
    "rotation": "phi",
    "axial_strain": "u_x",
    "curvature": "phi_x",
}
#: Constants of a link to which a mass, a force or an axial force at one place contributes.
AT_A_PLACE = (
    "mass", "gyroscopic", "geometric0", "load_x", "load_y", "load_out", "load_turn", "force_x", "force_y",
    "follower_x", "follower_y",
)  # fmt: skip
#: Those to which a moment of inertia at one place contributes.
ROTATING = ("mass", "load_turn")
RIGID_FORCE = quantity("N", "N", "axial force of the rigid motion at x, tension positive")


def at_a_place() -> dict[str, sp.ImmutableMatrix]:
    """Return the constants of a link for a unit mass, force, axial force and moment of inertia at x.

    They are the densities of the terms of Hamilton's principle, Eqs. (7.24)-(7.28), with mass, force and
    rotary inertia per length concentrated at x [m] from the first point of the link. Matrices are (6, 6),
    load vectors (6, 1), over ``SHAPES``; those of the moment of inertia are called ``rotary_NAME``.
    """
    one, none = sp.Integer(1), sp.Integer(0)
    translating = {MU.symbol: one, PROFILE.symbol: one, ROTARY.symbol: none}
    rotating = {MU.symbol: none, PROFILE.symbol: none, ROTARY.symbol: one}
    translational = {name: _concentrated(name, translating) for name in AT_A_PLACE}
    return translational | {f"rotary_{name}": _concentrated(name, rotating) for name in ROTATING}


def _concentrated(name: str, unit: dict[sp.Symbol, sp.Expr]) -> sp.ImmutableMatrix:
    """Return the densities of a constant for unit quantities concentrated at x."""
    at = {field: k for k, field in enumerate(SHAPES.values())}
    constant = CONSTANTS[name]
    term = sp.zeros(len(at), len(at) if constant.order is not None else 1)
    for (test, trial), density in constant.densities(derive()).items():
        term[at[test], at[trial] if trial else 0] += density.xreplace(unit)
    return sp.ImmutableMatrix(term)


def second_order() -> sp.ImmutableMatrix:
    """Return the forces of second degree in the displacements per length that linear theory omits, (6, 1).

    The energy of stretching is E A (u' + w'^2/2)^2/2, with von Karman's axial strain of a slender link under
    moderate rotations. Of the second degree in its variation, linear theory has the part of the axial force N
    of the rigid motion, N w' on the variation of w'. The forces act on the variations of ``SHAPES``. Not in
    the thesis.
    """
    fields = {name: FIELDS[name].symbol for name in ("u_x", "w_x")}
    size = sp.Symbol("size", positive=True)
    stretch = fields["u_x"] + fields["w_x"] ** 2 / 2
    energy = AXIAL.symbol * stretch**2 / 2
    linear = RIGID_FORCE.symbol * fields["w_x"] ** 2 / 2
    scaled = {symbol: size * symbol for symbol in fields.values()}
    term = sp.zeros(len(SHAPES), 1)
    for k, field in enumerate(SHAPES.values()):
        if field in fields:
            variation = sp.expand(sp.diff(energy, fields[field]).xreplace(scaled))
            term[k] = variation.coeff(size, 2) - sp.diff(linear, fields[field])
    return sp.ImmutableMatrix(term)


#: Arguments of :func:`at_a_place`, and of :func:`second_order`.
PLACE = (X,)
STATE = (AXIAL, FIELDS["u_x"], FIELDS["w_x"], RIGID_FORCE)
