"""The crank of elastic links: its shaft with flywheel and motor, and the rotation of one that is rigid.

The equation of the shaft of an elastic crank is linearised about the rigid motion.
Lagrange's equation of the shaft's rotation theta + phi, with the kinetic energy I (theta' + phi')^2/2 and the
virtual work of the torque T(theta + phi, theta' + phi'), to first order in the elastic rotation phi:
I phi'' - T_rate phi' - T_angle phi = T - I theta''. Not in the thesis, whose shaft has no motor.
"""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from symgen.mechanics.elastic.hamilton import OMEGA, OMEGA_RATE

_PHI, _PHI_T, _PHI_TT = sp.symbols("phi phi_t phi_tt", real=True)
#: The rotation phi and its rates.
ROTATION = (_PHI, _PHI_T, _PHI_TT)
#: Terms that :func:`shaft` gives, in its order.
TERMS = ("shaft_mass", "shaft_damping", "shaft_stiffness", "shaft_load")

#: Monomials of phi and its rates in the kinetic energy of the shaft, its rate, and the power of the motor.
KINETIC, RATE = ((), ("t",), ("t", "t")), ((), ("t",), ("tt",), ("t", "tt"))
POWER = ((), ("",), ("t",), ("", "t"), ("t", "t"))


def rigid_crank(along: tuple[sp.Expr, sp.Expr]) -> tuple[tuple[sp.Expr, ...], tuple[sp.Expr, ...]]:
    """Return d theta/d r [1/m] and d r/d theta [m] of a crank with the vector r and the direction theta.

    The first gives its rotation by displacements of its end, the second its torque by forces there.

    Parameters
    ----------
    along
        The vector r from its first point to its second [m].
    """
    x, y, theta = sp.symbols("x y theta", real=True)
    length, angle = sp.Symbol("r", positive=True), sp.atan2(y, x)
    rotation = (sp.diff(angle, c).xreplace({x: along[0], y: along[1]}) for c in (x, y))
    polar = {sp.cos(theta): along[0] / length, sp.sin(theta): along[1] / length}
    arm = (sp.diff(length * c, theta).xreplace(polar) for c in polar)
    return tuple(rotation), tuple(arm)


def shaft(inertia: sp.Expr, torque: sp.Expr, angle: sp.Symbol, rate: sp.Symbol) -> tuple[sp.Expr, ...]:
    """Return mass [kg m^2], damping, stiffness and load [N m] of the shaft in the rotation phi.

    Parameters
    ----------
    inertia
        Moment of inertia of the flywheel [kg m^2].
    torque
        Torque of the motor on the crank [N m], over ``angle`` [rad] and ``rate`` [rad/s] of the crank.
    """
    energy = _energy(inertia)
    momentum = sp.diff(energy, _PHI_T)
    left = _rate(momentum) - _driving(torque, angle, rate)
    still = dict.fromkeys((_PHI, _PHI_T, _PHI_TT), sp.Integer(0))
    return (*(sp.diff(left, of) for of in (_PHI_TT, _PHI_T, _PHI)), -left.xreplace(still))


def couple(torque: sp.Expr, angle: sp.Symbol, rate: sp.Symbol) -> tuple[sp.Expr, ...]:
    """Return damping, stiffness and load [N m] of a couple on a section of an elastic link.

    They are those of a shaft without inertia at this section, with the rotation phi from the rigid motion; of
    a couple between two sections phi is the difference of their rotations. Parameters are those of
    :func:`shaft`.
    """
    return shaft(sp.Integer(0), torque, angle, rate)[1:]


def _rate(expression: sp.Expr) -> sp.Expr:
    """Return the rate of an expression of the speeds of the crank."""
    rates = {OMEGA.symbol: OMEGA_RATE.symbol, _PHI_T: _PHI_TT}
    return sp.Add(*(sp.diff(expression, of) * by for of, by in rates.items()))


def powers(inertia: sp.Expr, torque: sp.Expr, angle: sp.Symbol, rate: sp.Symbol) -> dict[str, list[sp.Expr]]:
    """Return the factors of ``KINETIC`` [J], ``RATE`` and ``POWER`` [W] by name.

    They are those of the kinetic energy of the flywheel, of its rate, and of the power of the motor on the
    shaft. Parameters are those of :func:`shaft`.
    """
    energy = _energy(inertia)
    power = _driving(torque, angle, rate) * (OMEGA.symbol + _PHI_T)
    parts = ("kinetic", energy, KINETIC), ("rate", _rate(energy), RATE), ("power", power, POWER)
    return {name: [_coefficient(of, m) for m in monomials] for name, of, monomials in parts}


def _coefficient(polynomial: sp.Expr, monomial: Sequence[str]) -> sp.Expr:
    """Return a coefficient of phi and its rates, with the sums of the torque as they are."""
    by_order = {"": _PHI, "t": _PHI_T, "tt": _PHI_TT}
    for order in monomial:
        polynomial = sp.diff(polynomial, by_order[order])
    repeated = sp.Mul(*(sp.factorial(monomial.count(order)) for order in by_order))
    return polynomial.xreplace(dict.fromkeys(by_order.values(), sp.S.Zero)) / repeated


def _energy(inertia: sp.Expr) -> sp.Expr:
    """Return the kinetic energy of the flywheel [J]."""
    return inertia * (OMEGA.symbol + _PHI_T) ** 2 / 2


def _driving(torque: sp.Expr, angle: sp.Symbol, rate: sp.Symbol) -> sp.Expr:
    """Return the torque of the motor [N m] to first order in phi."""
    return torque + sp.diff(torque, angle) * _PHI + sp.diff(torque, rate) * _PHI_T
