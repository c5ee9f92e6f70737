"""The pump on a floating crank (the scene ``cssp``) by Lagrange's equations of angle and place of the crank.

The slider's place is the root of a quadratic: the rod has its length. The rod's spin has no inertia here, the
slider does not turn. ``M`` is a torque on the crank, ``F`` a force along the slider; both are external.
"""

from __future__ import annotations

import tomllib
from functools import cache, partial

import mpmath as mp
import numpy as np
import sympy as sp

import symgen
from symgen.scene.loading import shipped_scene

ANGLE, PLACE, SPIN, DRIFT = STATE = sp.symbols("angle place spin drift", real=True)
INPUTS = sp.symbols("M F", real=True)
STALL, TOP, PUMP, K, D, ROD = PARAMETERS = sp.symbols("stall top pump k d rod", positive=True)
#: Their values in the scene, in SI units.
VALUES = {STALL: 12, TOP: 10 * sp.pi, PUMP: 40, K: 4000, D: 30, ROD: sp.Rational(42, 100)}

_CRANK, _OFFSET, _RADIUS = sp.Rational(10, 100), sp.Rational(12, 100), sp.Rational(12, 1000)
_M_CRANK, _M_ROD, _M_SLIDER = sp.Integer(3), sp.Rational(11, 10), sp.Rational(16, 10)
_J_CRANK, _TILT, _G = sp.Rational(2, 100), 5 * sp.pi / 3, sp.Rational(981, 100)
_J_ROD = _M_ROD * (3 * _RADIUS**2 + ROD**2) / 12


def scene() -> symgen.Scene:
    """Return the scene with its inputs, and the length of the rod tunable."""
    written = tomllib.loads(shipped_scene("cssp"))
    written["parameters"]["rod"] = {"value": "42 cm", "tunable": True}
    written["inputs"] = {"M": "0 N*m", "F": {"value": "2 N", "about": "force along the slider"}}
    drives = written["loop"]["drives"]
    drives["theta1"], drives["S4"] = f"{drives['theta1']} + M", f"{drives['S4']} + F"
    return symgen.Scene(**written).called("cssp_driven")


@cache
def slider() -> sp.Expr:
    """Return the place of the slider along its joint."""
    s = sp.Symbol("s", real=True)
    pin = sp.Matrix([_CRANK * sp.cos(ANGLE), _CRANK * sp.sin(ANGLE), PLACE])
    end = -sp.Matrix([_OFFSET, s * sp.sin(_TILT), s * sp.cos(_TILT)])
    gap = sp.Poly(sp.expand((end - pin).dot(end - pin) - ROD**2), s)
    _, half, constant = (x / (2 if i == 1 else 1) for i, x in enumerate(gap.all_coeffs()))
    return -half + sp.sqrt(half**2 - constant)


@cache
def mass_matrix() -> sp.ImmutableMatrix:
    """Return the mass matrix of angle and place."""
    place = [ANGLE, PLACE]
    pin = sp.Matrix([_CRANK * sp.cos(ANGLE), _CRANK * sp.sin(ANGLE), PLACE])
    end = -sp.Matrix([_OFFSET, slider() * sp.sin(_TILT), slider() * sp.cos(_TILT)])
    middle, along = ((pin + end) / 2).jacobian(place), ((end - pin) / ROD).jacobian(place)
    sliding = sp.Matrix([slider()]).jacobian(place)
    found = sp.diag(_J_CRANK, _M_CRANK) + _M_ROD * middle.T * middle
    return sp.ImmutableMatrix(found + _J_ROD * along.T * along + _M_SLIDER * sliding.T * sliding)


@cache
def forces() -> sp.ImmutableMatrix:
    """Return the right-hand side of M(q) q'' = forces."""
    place, rates, mass = sp.Matrix([ANGLE, PLACE]), sp.Matrix([SPIN, DRIFT]), mass_matrix()
    height = -slider() * sp.cos(_TILT)
    weight = _G * (_M_CRANK * PLACE + _M_ROD * (PLACE + height) / 2 + _M_SLIDER * height)
    by_slider = sp.Matrix([slider()]).jacobian(place)
    pumped = -PUMP * (by_slider * rates)[0] + INPUTS[1]
    applied = sp.Matrix([STALL * (1 - SPIN / TOP) + INPUTS[0], -K * PLACE - D * DRIFT]) + by_slider.T * pumped
    momentum = mass * rates
    kinetic = (rates.T * momentum)[0] / 2
    return sp.ImmutableMatrix(
        applied - momentum.jacobian(place) * rates + sp.Matrix([kinetic - weight]).jacobian(place).T
    )


@cache
def _function():
    """Return mass matrix and forces as a function of state, inputs and parameters, for mpmath."""
    return sp.lambdify([*STATE, *INPUTS, *PARAMETERS], [mass_matrix(), forces()], "mpmath", cse=True)


def number(value: object) -> mp.mpf:
    return value if isinstance(value, mp.mpf) else mp.mpmathify(sp.sympify(value).evalf(mp.mp.dps + 10))


def numbers(at: dict) -> list[mp.matrix]:
    """Return mass matrix and forces at values of all symbols, in the digits of mpmath."""
    symbols = (*STATE, *INPUTS, *PARAMETERS)
    return list(_function()(*(number(at[x]) for x in symbols)))


def accelerations_by(names: list[sp.Symbol], at: dict) -> np.ndarray:
    """Return the accelerations, followed by their derivatives by some symbols, from 40 digits."""

    def found(i: int, changed: dict) -> mp.mpf:
        return mp.lu_solve(*numbers(at | changed))[i]

    def by(i: int, name: sp.Symbol, value: mp.mpf) -> mp.mpf:
        return found(i, {name: value})

    with mp.workdps(40):
        here = [number(at[x]) for x in names]
        rows = [
            [found(i, {}), *(mp.diff(partial(by, i, x), v) for x, v in zip(names, here, strict=True))]
            for i in range(2)
        ]
        return np.array([[float(x) for x in row] for row in rows])
