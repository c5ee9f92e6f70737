"""A rigid rod as constrained particles (point coordinates).

Source: H. A. Attia, *Dynamic Analysis of a Chain of Rigid Rods*, section 2.1: a rod is replaced by three
particles, at its ends and its middle, with the same mass, centre of mass and moment of inertia. The
middle particle moves with the mean of the ends, so the rod's kinetic energy is a constant quadratic form
of the end velocities. That form is all a simulation needs.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import sympy as sp

Vector = tuple[sp.Expr, ...]


class EndMass(NamedTuple):
    """The 2x2 mass matrix [[a11, a12], [a12, a22]] of a rod's end velocities [kg], equal for each axis."""

    a11: sp.Expr
    a12: sp.Expr
    a22: sp.Expr


#: Mass, first and second moment of the unit mass at start, middle and end, with the length as unit.
_CONDITIONS = sp.ImmutableMatrix([[1, 1, 1], [0, sp.Rational(1, 2), 1], [0, sp.Rational(1, 4), 1]])
#: Velocities of the three particles from those of the ends, Eq. (4b).
_ENDS_TO_PARTICLES = sp.ImmutableMatrix([[1, 0], [sp.Rational(1, 2), sp.Rational(1, 2)], [0, 1]])


@lru_cache(maxsize=1)
def _masses_by_moment() -> sp.ImmutableMatrix:
    """Invert the particle conditions: columns for mass, first and second moment."""
    return _CONDITIONS.LUsolve(sp.eye(3))


@lru_cache(maxsize=1)
def _end_mass_by_moment() -> tuple[sp.ImmutableMatrix, ...]:
    """Return the end mass matrix that each moment gives: the kinetic energy's Hessian by end velocities."""
    velocities = _ENDS_TO_PARTICLES
    return tuple(
        velocities.T * sp.diag(*_masses_by_moment()[:, k]) * velocities for k in range(_CONDITIONS.cols)
    )


def _moments(mass: sp.Expr, length: sp.Expr, centre: sp.Expr, inertia: sp.Expr) -> tuple[sp.Expr, ...]:
    about_start = inertia + mass * centre**2
    return mass, mass * centre / length, about_start / length**2


def particle_masses(mass: sp.Expr, length: sp.Expr, centre: sp.Expr, inertia: sp.Expr) -> tuple[sp.Expr, ...]:
    """Return the masses [kg] of the equivalent particles at start, middle and end.

    They are the solution of the three conditions of section 2.1: equal mass, first moment m l_c and second
    moment I_o about the start. One of them may be negative; the end mass matrix is positive definite all
    the same while the moment of inertia about the centre is positive.

    Parameters
    ----------
    mass, length, centre, inertia
        Mass [kg], length [m], centre of mass from the start [m], moment of inertia about it [kg m^2].
    """
    moments = _moments(mass, length, centre, inertia)
    by_moment = _masses_by_moment()
    return tuple(dot(tuple(by_moment[row, :]), moments) for row in range(by_moment.rows))


def end_mass(mass: sp.Expr, length: sp.Expr, centre: sp.Expr, inertia: sp.Expr) -> EndMass:
    """Return the end mass matrix of a rod.

    Parameters
    ----------
    mass, length, centre, inertia
        Mass [kg], length [m], centre of mass from the start [m], moment of inertia about it [kg m^2].
    """
    moments = _moments(mass, length, centre, inertia)
    parts = _end_mass_by_moment()
    return EndMass(*(dot(tuple(part[ij] for part in parts), moments) for ij in ((0, 0), (0, 1), (1, 1))))


def kinetic_energy(ends: EndMass, start: Vector, end: Vector) -> sp.Expr:
    """Return the kinetic energy [J] of a rod with these velocities of its ends [m/s]."""
    return sp.Add(
        *(
            ends.a11 * a**2 / 2 + ends.a12 * a * b + ends.a22 * b**2 / 2
            for a, b in zip(start, end, strict=True)
        )
    )


def length_constraint(along: Vector, length: sp.Expr) -> sp.Expr:
    """Return (d.d - l^2)/2, Eq. (3a) halved, of a rod with d from start to end [m] and length l [m]."""
    return (sp.Add(*(c**2 for c in along)) - length**2) / 2


def dot(a: Vector, b: Vector) -> sp.Expr:
    """Return the scalar product."""
    return sp.Add(*(x * y for x, y in zip(a, b, strict=True)))
