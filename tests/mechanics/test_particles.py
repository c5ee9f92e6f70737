"""The rod as particles: conditions, energy and definiteness, proved symbolically."""

from __future__ import annotations

import sympy as sp

from symgen.mechanics.rods.particles import end_mass, kinetic_energy, length_constraint, particle_masses

M, L, LC, IC = sp.symbols("m l l_c I_c", positive=True)


def test_particles_have_the_mass_centre_and_inertia_of_the_rod():
    m1, m2, m3 = particle_masses(M, L, LC, IC)
    assert sp.simplify(m1 + m2 + m3 - M) == 0
    assert sp.simplify((m2 / 2 + m3) * L - M * LC) == 0
    assert sp.simplify((m2 / 4 + m3) * L**2 - (IC + M * LC**2)) == 0


def test_closed_form_of_the_particle_masses():
    about_start = IC + M * LC**2
    m1, m2, m3 = particle_masses(M, L, LC, IC)
    assert sp.simplify(m2 - 4 * (M * L * LC - about_start) / L**2) == 0
    assert sp.simplify(m3 - 2 * (about_start - M * L * LC / 2) / L**2) == 0
    assert sp.simplify(m1 - (M - m2 - m3)) == 0


def test_uniform_rod():
    masses = particle_masses(M, L, L / 2, M * L**2 / 12)
    assert [sp.simplify(m / M) for m in masses] == [sp.Rational(1, 6), sp.Rational(2, 3), sp.Rational(1, 6)]


def test_end_mass_is_positive_definite_whatever_the_signs_of_the_particles():
    a = end_mass(M, L, LC, IC)
    assert sp.simplify(a.a11 * a.a22 - a.a12**2 - M * IC / L**2) == 0


def test_kinetic_energy_is_that_of_the_rigid_rod():
    """In the plane: m v_c^2/2 + I_c w^2/2 for any motion of the ends that keeps the length."""
    angle, rate, vx, vy = sp.symbols("theta omega v_x v_y", real=True)
    along = (L * sp.cos(angle), L * sp.sin(angle))
    turn = (-along[1] * rate, along[0] * rate)
    start, end = (vx, vy), (vx + turn[0], vy + turn[1])
    centre = tuple(s + LC / L * t for s, t in zip(start, turn, strict=True))
    rigid = M * (centre[0] ** 2 + centre[1] ** 2) / 2 + IC * rate**2 / 2
    assert sp.simplify(kinetic_energy(end_mass(M, L, LC, IC), start, end) - rigid) == 0


def test_kinetic_energy_equals_that_of_the_particles_for_any_end_velocities():
    """In space, the middle particle moving with the mean of the ends."""
    start, end = sp.symbols("v1:4"), sp.symbols("w1:4")
    middle = tuple((a + b) / 2 for a, b in zip(start, end, strict=True))
    particles = sum(
        m * sum(c**2 for c in v) / 2
        for m, v in zip(particle_masses(M, L, LC, IC), (start, middle, end), strict=True)
    )
    assert sp.simplify(kinetic_energy(end_mass(M, L, LC, IC), start, end) - particles) == 0


def test_length_constraint_vanishes_at_the_length():
    d = sp.symbols("d1:3")
    assert sp.simplify(length_constraint(d, sp.sqrt(d[0] ** 2 + d[1] ** 2))) == 0


def test_planar_body_on_two_of_its_points_has_the_energy_of_the_rigid_body():
    """Centre of mass off the line of the ends, by ``offset`` to the left; any rigid motion."""
    offset = sp.Symbol("h", real=True)
    angle, rate, vx, vy = sp.symbols("theta omega v_x v_y", real=True)
    direction, left = (sp.cos(angle), sp.sin(angle)), (-sp.sin(angle), sp.cos(angle))

    def velocity(along, across):
        x, y = (along * d + across * n for d, n in zip(direction, left, strict=True))
        return vx - y * rate, vy + x * rate

    centre = velocity(LC, offset)
    rigid = M * (centre[0] ** 2 + centre[1] ** 2) / 2 + IC * rate**2 / 2
    ends = end_mass(M, L, LC, IC, offset)
    assert sp.simplify(kinetic_energy(ends, velocity(0, 0), velocity(L, 0)) - rigid) == 0
