"""The reference of the elastic four-bar reproduces the golden numbers, and agrees with itself where it must."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shared.elastic_golden as golden
from shared.elastic_reference import LINKS, RIG, Elastic, Element, stiff_limit
from shared.elastic_rigid import dot, left, unit
from shared.full import full_unless

ANGLES = np.radians(golden.DEGREES)


def test_kinematics():
    motion = RIG.motion(ANGLES)
    found = np.stack([*np.degrees(motion.angles[1:]), *motion.rates[1:], *motion.accelerations[1:]], axis=1)
    # the printed digits, and a speed printed with eight of them
    np.testing.assert_allclose(found, golden.KINEMATICS, rtol=2e-8, atol=6e-9)


def test_rates_and_accelerations_are_derivatives():
    step = 1e-6
    before, at, after = (RIG.motion(ANGLES + k * step) for k in (-1, 0, 1))
    for value, rate in (("angles", "rates"), ("rates", "accelerations")):
        change = (getattr(after, value) - getattr(before, value)) / (2 * step) * RIG.speed
        np.testing.assert_allclose(change, getattr(at, rate), rtol=1e-7, atol=1e-4)


@pytest.mark.parametrize("degrees", golden.FORCES)
def test_forces_without_bearings(degrees):
    motion = replace(RIG, bearing=0.0).motion(math.radians(degrees))
    first = -motion.forces["first"][:, 0]
    expected = np.array(golden.FORCES[degrees][:2]).reshape(4, 2)
    np.testing.assert_allclose(first, expected[:3], rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(motion.forces["Q"][0], expected[3], rtol=1e-7, atol=1e-7)
    moments = [motion.forces["torque"][0], *(-motion.moment(k)[0] for k in range(3))]
    np.testing.assert_allclose(moments, golden.FORCES[degrees][2], rtol=1e-7, atol=1e-7)


def test_torque_and_peaks():
    np.testing.assert_allclose(RIG.motion(ANGLES).forces["torque"], golden.TORQUE, rtol=1e-6)
    fine = RIG.motion(np.linspace(0, 2 * math.pi, 36_001)).forces["torque"]
    assert (round(fine.max(), 2), round(fine.min(), 2)) == golden.TORQUE_EXTREMES
    degree = replace(RIG, bearing=0.0).motion(np.radians(np.arange(360)))
    forces = dict(zip("MAB", degree.forces["first"], strict=True)) | {"Q": degree.forces["Q"]}
    for joint, (peak, at) in golden.PEAK_FORCES.items():
        size = np.linalg.norm(forces[joint], axis=1)
        assert (round(size.max(), 3), size.argmax()) == (peak, at), joint


def test_torque_is_the_power_of_the_inertia():
    step = 1e-5
    slope = (RIG.motion(ANGLES + step).inertia - RIG.motion(ANGLES - step).inertia) / (2 * step)
    np.testing.assert_allclose(
        slope * RIG.speed**2 / 2, RIG.motion(ANGLES).forces["torque"], rtol=1e-7, atol=1e-7
    )


def beam(count: int, held: list[int]):
    """Bending frequencies of a beam of unit length, mass and stiffness with dofs held, over 1/s."""
    from scipy.linalg import eigh

    element, size = Element(1 / count), 3 * count + 3
    mass, stiffness = np.zeros((2, size, size))
    local = [1, 2, 3, 5, 6, 7]
    for i in range(count):
        span = slice(3 * i, 3 * i + 6)
        mass[span, span] += element.over(element.rows(element.w), element.rows(element.w))[
            np.ix_(local, local)
        ]
        stiffness[span, span] += element.stiffness(0.0, 1.0)[np.ix_(local, local)]
    free = [i for i in range(size) if i % size not in [h % size for h in held]]
    return np.sqrt(eigh(stiffness[np.ix_(free, free)], mass[np.ix_(free, free)], eigvals_only=True))


def test_element():
    for count, expected in golden.PINNED.items():
        found = beam(count, [0, 2, -3, -1])[:2] / (math.pi * np.array([1, 2])) ** 2 - 1
        np.testing.assert_allclose(found, expected, rtol=0.15)  # printed with one digit at least
    assert beam(1, [0, 1, -1])[0] / 1.875104068711961**2 - 1 == pytest.approx(golden.CLAMPED, rel=0.05)


@pytest.mark.parametrize(("crank", "degrees"), golden.FREQUENCIES)
def test_frequencies(crank, degrees):
    found = Elastic(crank=crank).frequencies(math.radians(degrees))
    np.testing.assert_allclose(found, golden.FREQUENCIES[crank, degrees], atol=1e-3)


def test_unknowns_number_as_counted_in_the_thesis():
    for n in (1, 2, 3):
        assert len(Elastic(crank="free", elements=n).unknowns) == 12 * n - 1
    assert len(Elastic(crank="free", axial=False).unknowns) == 8
    assert len(Elastic(axial=False).unknowns) == 7


def test_quasi_static():
    bending, axial = Elastic().quasi_static(ANGLES)
    for k, link in enumerate(LINKS):
        np.testing.assert_allclose(bending[k], golden.QUASI_STATIC[link], atol=1e-5)
    np.testing.assert_allclose(axial[2], golden.QUASI_STATIC_AXIAL_OUTPUT, atol=1e-5)


def test_quasi_static_of_coupler_and_output_is_the_moment_of_the_rigid_links():
    found, motion = Elastic().quasi_static(ANGLES)[0], RIG.motion(ANGLES)
    for k in (1, 2):
        np.testing.assert_allclose(found[k], 1e6 * motion.moment(k) * RIG.half / RIG.EI, rtol=1e-9)


def test_transient():
    strain, _ = Elastic(geometric=False).transient(4096)
    for k, link in enumerate(LINKS):
        expected = np.array(golden.TRANSIENT[link])
        found = [*strain[k, [1024, 2048, 3072, 4096]], abs(strain[k]).max()]
        np.testing.assert_allclose(found, expected, atol=1e-4 * expected[-1])


@pytest.mark.parametrize(
    ("crank", "form", "axial", "geometric"),
    full_unless(lambda crank, form, axial, geometric: geometric or not axial, golden.FLOQUET),
)
def test_floquet(crank, form, axial, geometric):
    linkage = Elastic(crank=crank, form=form, axial=axial, geometric=geometric)
    found = abs(linkage.multipliers(2048)[0])
    assert found == pytest.approx(golden.FLOQUET[crank, form, axial, geometric], rel=1e-5)


def test_stiff_limit_needs_the_geometric_stiffness():
    assert stiff_limit(RIG)[0].real == pytest.approx(golden.STIFF_LIMIT, rel=1e-7)
    stiff = Elastic(RIG.stiffer(1e4), crank="free")
    found = stiff.multipliers(2048)[0]
    assert found.real == pytest.approx(golden.STIFF_ELEMENTS, rel=1e-6)
    assert found.real == pytest.approx(golden.STIFF_LIMIT, rel=1e-5)
    without = replace(stiff, geometric=False).multipliers(2048)[0]
    assert abs(without) == pytest.approx(golden.STIFF_WITHOUT, rel=1e-5)


def test_steps_converge():
    coarse, fine = (Elastic().transient(n)[0][:, :: n // 256] for n in (2048, 4096))
    assert np.abs(coarse - fine).max() < 2e-6 * np.abs(fine).max()


def test_constant_length_is_the_limit_of_high_axial_stiffness():
    full = Elastic(replace(RIG, EA=RIG.EA * 1e4), geometric=False).transient(2048)[0]
    condensed = Elastic(axial=False, geometric=False).transient(2048)[0]
    assert np.abs(full - condensed).max() < 2e-3 * np.abs(condensed).max()


def test_the_global_form_is_the_exact_one_of_the_method():
    """M, C and K from s = R S against the formula written with T and its generator J, for one link alone."""
    linkage, crank = Elastic(crank="free", geometric=True), math.radians(40)
    motion = RIG.motion(crank)
    w, al = motion.rates[1, 0], motion.accelerations[1, 0]
    local = [part[0] for part in linkage.element(motion, 1, 0, False)]
    mass, damping, stiffness, load = local
    c, s = math.cos(motion.directions[1, 0]), math.sin(motion.directions[1, 0])
    T, J = np.eye(8), np.zeros((8, 8))
    for i in (0, 4):
        T[i : i + 2, i : i + 2] = [[c, -s], [s, c]]
        J[i : i + 2, i : i + 2] = [[0, -1], [1, 0]]
    turned = stiffness + mass @ (al * J.T + w**2 * J.T @ J.T) + w * damping @ J.T
    expected = [T @ mass @ T.T, T @ (2 * w * mass @ J.T + damping) @ T.T, T @ turned @ T.T, T @ load]

    maps = linkage.maps(motion)[:, 1, :, 0]
    R = maps.reshape(3, 8, -1)
    names = ["A.x", "A.y", "coupler.th0", "B.x", "B.y", "coupler.th1"]
    columns = [linkage.unknowns.index(name) for name in names]
    rows = [0, 1, 2, 4, 5, 6]
    R0, R1, R2 = R[:, :, columns]
    found = [
        R0.T @ mass @ R0,
        R0.T @ (2 * mass @ R1 + damping @ R0),
        R0.T @ (mass @ R2 + damping @ R1 + stiffness @ R0),
        R0.T @ load,
    ]
    for ours, whole in zip(found, expected, strict=True):
        part = whole[np.ix_(rows, rows)] if whole.ndim == 2 else whole[rows]
        np.testing.assert_allclose(ours, part, atol=1e-12 * np.abs(whole).max())


def test_uniform_translation_gives_no_inertia_force():
    motion = RIG.motion(np.radians(75))
    without = Elastic(replace(RIG, EA=0.0, EI=0.0), geometric=False)
    for k in range(3):
        mass, damping, stiffness, _ = without.element(motion, k, 0, False)
        w, al, e = motion.rates[k, 0], motion.accelerations[k, 0], unit(motion.directions[k])[0]
        for way in np.eye(2):
            # the local components of what is constant in fixed axes, with their rates
            u, v = dot(way, e), dot(way, left(e))
            series = np.array([[u, v], [w * v, -w * u], [al * v - w**2 * u, -al * u - w**2 * v]])
            s = np.zeros((3, 8))
            s[:, :2] = s[:, 4:6] = series
            force = mass[0] @ s[2] + damping[0] @ s[1] + stiffness[0] @ s[0]
            assert np.abs(force).max() < 1e-15 * np.abs(stiffness @ s[0]).max()
