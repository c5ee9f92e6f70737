"""Errata of the text on momentum rows, each against the equations without it; the projection vector."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st
from shared.momentum import chain_system, from_reference

from symgen.mechanics.rods.momentum import perpendicular, smallest_axis, transverse
from symgen.mechanics.rods.particles import particle_masses

_DIRECTION = sp.symbols("x y z", real=True)
_ACROSS = sp.lambdify(_DIRECTION, perpendicular(_DIRECTION, smallest_axis(_DIRECTION)), "math")


def robust(d):
    crossed, size = _ACROSS(*d)
    first = np.array(crossed) / size
    return first, np.cross(d / np.linalg.norm(d), first)


SIZES = st.floats(-1, 1).flatmap(lambda x: st.integers(-12, 0).map(lambda k: x * 10.0**k))


@given(st.tuples(SIZES, SIZES, SIZES).filter(lambda d: max(map(abs, d)) > 1e-13))
def test_the_projection_vector_is_regular_in_every_direction(d):
    d = np.array(d) / np.linalg.norm(d)
    frame = np.array([d, *robust(d)])
    assert np.max(np.abs(frame @ frame.T - np.eye(3))) < 1e-15


def test_erratum_joint_masses_are_those_of_both_rods():
    """With the rod's own third particle in Eq. (12) the accelerations are wrong by their own size."""
    _, place, speed, exact, rods, gravity = from_reference("rods_triple_pendulum_planar")
    right = np.linalg.solve(*chain_system(place, speed, rods, gravity))
    assert np.max(np.abs(right - exact)) < 1e-12 * np.max(np.abs(exact))
    wrong = np.linalg.solve(*chain_system(place, speed, rods, gravity, own_mass=True))
    assert np.max(np.abs(wrong - exact)) > 0.3 * np.max(np.abs(exact))
    rng, errors = np.random.default_rng(3), []
    for _ in range(20):
        place, speed, rods, _, _ = three_rods(rng)
        gravity = np.array([0, 0, -9.81])
        exact = symmetric(place, speed, rods, gravity, np.zeros((3, 3)))
        for own_mass, expected in ((False, True), (True, False)):
            a, b = chain_system(place, speed, rods, gravity, own_mass=own_mass, project=robust)
            error = np.max(np.abs(np.linalg.solve(a, b) - exact)) / np.max(np.abs(exact))
            assert (error < 1e-12) == expected
            errors.append(error)
    assert np.median(errors[1::2]) > 0.3


def three_rods(rng):
    """A chain of three rods in space in any pose, with couples of any direction on them."""
    d = rng.standard_normal((3, 3))
    lengths = np.linalg.norm(d, axis=1)
    place = np.vstack([np.zeros(3), np.cumsum(d, axis=0)])
    w = rng.standard_normal((3, 3))
    speed = np.vstack([np.zeros(3), np.cumsum(np.cross(w, d), axis=0)])
    rods = []
    for l in lengths:
        m, lc, ic = rng.uniform(0.5, 2), l * rng.uniform(0.2, 0.8), rng.uniform(0.03, 0.2)
        masses = [float(x) for x in particle_masses(m, l, lc, m * l**2 * ic)]
        rods.append({"m": m, "lc": lc, "l": l, "particles": masses, "Io": m * l**2 * ic + m * lc**2})
    return place, speed, rods, d, lengths


def symmetric(place, speed, rods, gravity, couples):
    """The same chain by its end masses and multipliers, couples as forces on the ends."""
    n = len(rods)
    mass, force = np.zeros((3 * n + 3, 3 * n + 3)), np.zeros(3 * n + 3)
    jacobian, gamma = np.zeros((n, 3 * n + 3)), np.zeros(n)
    for i, rod in enumerate(rods):
        m, lc, l, io = (rod[k] for k in ("m", "lc", "l", "Io"))
        d, at = place[i + 1] - place[i], slice(3 * i, 3 * i + 6)
        a22, a12 = io / l**2, m * lc / l - io / l**2
        mass[at, at] += np.kron([[m - 2 * m * lc / l + a22, a12], [a12, a22]], np.eye(3))
        pair = np.cross(couples[i], d) / l**2
        force[at] += np.concatenate([m * (1 - lc / l) * gravity - pair, m * lc / l * gravity + pair])
        jacobian[i, at] = np.concatenate([-d, d])
        gamma[i] = -np.sum((speed[i + 1] - speed[i]) ** 2)
    mass, force, jacobian = mass[3:, 3:], force[3:], jacobian[:, 3:]
    whole = np.block([[mass, jacobian.T], [jacobian, np.zeros((n, n))]])
    return np.linalg.solve(whole, np.concatenate([force, gamma]))[: 3 * n]


def test_erratum_only_the_part_of_a_couple_across_a_rod_counts():
    """Taken whole, the axial part on an outer rod leaks into the rows of the inner ones, Eq. (13)."""
    rng = np.random.default_rng(5)
    gravity, errors = np.array([0, 0, -9.81]), []
    for _ in range(20):
        place, speed, rods, d, lengths = three_rods(rng)
        couples = 5 * rng.standard_normal((3, 3))
        exact = symmetric(place, speed, rods, gravity, couples)
        across = [[float(x) for x in transverse(tuple(c), tuple(a), l)]
                  for c, a, l in zip(couples, d, lengths, strict=True)]  # fmt: skip
        size = np.max(np.abs(exact))
        for taken, expected in ((np.array(across), True), (couples, False)):
            a, b = chain_system(place, speed, rods, gravity, couples=taken, project=robust)
            error = np.max(np.abs(np.linalg.solve(a, b) - exact)) / size
            assert (error < 1e-11) == expected
            if not expected:
                errors.append(error)
    assert min(errors) > 1e-3 and max(errors) > 0.3


def literal(d):
    """The directions of section 2.2 with the principal arc tangent, as printed."""
    x, y, z = d
    theta = np.arctan(y / x) if x else np.pi / 2
    phi = np.arctan(z / np.hypot(x, y)) if x or y else np.pi / 2
    first = np.array([-np.sin(theta), np.cos(theta), 0])
    return first, np.array([-np.cos(theta) * np.sin(phi), -np.sin(theta) * np.sin(phi), np.cos(phi)])


@pytest.mark.parametrize("azimuth", [20, 160, 250, 340])
def test_erratum_the_arc_tangent_is_singular_at_45_degrees(azimuth):
    """For x < 0 the printed second direction is not across the rod; at an elevation of 45 degrees it lies along it."""
    rods = [{"m": 1.0, "lc": 0.5, "l": 1.0, "particles": [1 / 6, 2 / 3, 1 / 6]}]

    def condition(elevation, project):
        a, e = np.radians([azimuth, elevation])
        d = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        place = np.vstack([np.zeros(3), d])
        return np.linalg.cond(chain_system(place, 0 * place, rods, np.zeros(3), project=project)[0])

    behind = np.cos(np.radians(azimuth)) < 0
    for elevation in (-90, -45, -44, 0, 30, 44, 45, 60, 90):
        assert condition(elevation, robust) < 10
        if not behind:
            assert condition(elevation, literal) < 10
    if behind:
        assert condition(45, literal) > 1e15 and condition(-45, literal) > 1e15
        assert 30 < condition(44, literal) < 1000
