"""A rigid rod as constrained particles (point coordinates).

Source: H. A. Attia, *Dynamic Analysis of a Chain of Rigid Rods*, section 2.1: a rod is replaced by three
particles, at its ends and its middle, with the same mass, centre of mass and moment of inertia. The
middle particle moves with the mean of the ends, so the rod's kinetic energy is a constant quadratic form
of the end velocities. Simulations use only that form.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import sympy as sp

from symgen.symbolic.vectors import cross_in_plane

Vector = tuple[sp.Expr, ...]

ZERO = sp.Integer(0)


class EndMass(NamedTuple):
    """Mass matrix [[a11, a12], [a12, a22]] of a link's end velocities [kg], equal for each axis.

    ``cross`` couples an axis of one end with the other axis of the other end, in the plane, when the centre
    of mass lies off the line of the ends; it is zero for a rod.
    """

    a11: sp.Expr
    a12: sp.Expr
    a22: sp.Expr
    cross: sp.Expr = sp.Integer(0)


def particle_masses(mass: sp.Expr, length: sp.Expr, centre: sp.Expr, inertia: sp.Expr) -> tuple[sp.Expr, ...]:
    """Return the masses [kg] of the equivalent particles at start, middle and end.

    They are the solution of the three conditions of section 2.1: equal mass, first moment m l_c and second
    moment I_o about the start. One of them may be negative; the end mass matrix is nevertheless positive
    definite while the moment of inertia about the centre is positive.

    Parameters
    ----------
    mass, length, centre, inertia
        Mass [kg], length [m], centre of mass from the start [m], moment of inertia about it [kg m^2].
    """
    rest, half, squared = length - centre, length - 2 * centre, length**2
    return (
        (mass * rest * half + 2 * inertia) / squared,
        4 * (mass * centre * rest - inertia) / squared,
        (2 * inertia - mass * centre * half) / squared,
    )


def printed_particle_masses(
    mass: sp.Expr, length: sp.Expr, centre: sp.Expr, inertia: sp.Expr, particles: Sequence[sp.Expr]
) -> tuple[sp.Expr, ...]:
    """Return the masses [kg] of the equivalent particles in the form of section 2.1, for inspection.

    Parameters
    ----------
    mass, length, centre
        As for :func:`particle_masses`.
    inertia
        Moment of inertia about the start, I_o [kg m^2].
    particles
        Symbols of the masses of the middle and the end, by which that of the start is given.
    """
    middle = 4 / length**2 * (mass * length * centre - inertia)
    end = 2 / length**2 * (inertia - mass / 2 * length * centre)
    return mass - sp.Add(*particles), middle, end


def end_mass(
    mass: sp.Expr, length: sp.Expr, centre: sp.Expr, inertia: sp.Expr, offset: sp.Expr = ZERO
) -> EndMass:
    """Return the end mass matrix of a rod, or of a planar body that two of its points carry.

    A point of a planar body is r = (1 - z) r_i + z r_j with a complex z (multiplication by i rotates by a
    right angle), so its kinetic energy is a constant quadratic form of the two velocities as well: a11 = sum
    of m |1 - z|^2, a12 = Re sum of m z (1 - z)*, a22 = sum of m |z|^2 and cross = Im sum of m z. For a rod z
    is real, and the three equivalent particles give the same.

    Every sum is written about the centre of mass, so that a11 and a22 add positive terms only: in terms of
    moments about the start, a11 = m - 2 s1 + s2 would cancel for a centre near the end.

    Parameters
    ----------
    mass, length, centre, inertia
        Mass [kg], distance of the ends [m], centre of mass from the start along their line [m], moment of
        inertia about it [kg m^2].
    offset
        Distance of the centre of mass from the line of the ends, to the left of it [m].
    """
    share = centre / length
    if isinstance(share, sp.Rational) and offset == 0:
        rest = 1 - share
        turning = sp.Mul(inertia, sp.Pow(mass, -1), sp.Pow(length, -2)) if mass != 0 else None
        if isinstance(turning, sp.Rational):  # that of a uniform rod, and such
            factors = turning + rest**2, share * rest - turning, turning + share**2
            return EndMass(*(mass * factor for factor in factors))
        inertia = inertia / length**2
        return EndMass(inertia + mass * rest**2, mass * (share * rest) - inertia, inertia + mass * share**2)
    squared, rest, across = length**2, length - centre, mass * offset**2
    about_start, about_end = (inertia + mass * part**2 + across for part in (centre, rest))
    between = mass * centre * rest - across - inertia
    return EndMass(about_end / squared, between / squared, about_start / squared, mass * offset / length)


def joint_mass(ends: EndMass, along: sp.Expr, across: sp.Expr, count: int) -> sp.Expr:
    """Return a mass [kg] of a link that can be counted at one of ``count`` of its points instead.

    The kinetic energy of the link, less that of particles at (along, across), over its length, stays positive
    definite. With the weights w = (1 - z, z) of the ends, z = along + i across, a particle may have the mass
    1/(w* A^-1 w), where w* A^-1 w is at most 2 (a22 |1 - z|^2 + a11 |z|^2)/det A; half of that bound is used.
    """
    determinant = ends.a11 * ends.a22 - ends.a12**2 - ends.cross**2
    first, second = (1 - along) ** 2 + across**2, along**2 + across**2
    return determinant / (4 * count * (ends.a22 * first + ends.a11 * second))


def kinetic_energy(ends: EndMass, start: Vector, end: Vector) -> sp.Expr:
    """Return the kinetic energy [J] of a link with these velocities of its ends [m/s]."""
    straight = sp.Add(
        *(
            ends.a11 * a**2 / 2 + ends.a12 * a * b + ends.a22 * b**2 / 2
            for a, b in zip(start, end, strict=True)
        )
    )
    return straight - ends.cross * cross_in_plane(start, end) if ends.cross != 0 else straight


def length_constraint(along: Vector, length: sp.Expr) -> sp.Expr:
    """Return (d.d - l^2)/2, Eq. (3a) halved, of a rod with d from start to end [m] and length l [m]."""
    half = sp.S.Half
    return sp.Add(*(sp.Mul(half, c**2) for c in along), sp.Mul(-half, length**2))
