"""The reference of the elastic four-bar reproduces the golden numbers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shared.elastic_golden as golden
from shared.elastic_reference import LINKS, RIG, Elastic

ANGLES = np.radians(golden.DEGREES)


def test_kinematics():
    motion = RIG.motion(ANGLES)
    found = np.stack([*np.degrees(motion.angles[1:]), *motion.rates[1:], *motion.accelerations[1:]], axis=1)
    # the printed digits, and a speed printed with eight of them
    np.testing.assert_allclose(found, golden.KINEMATICS, rtol=2e-8, atol=6e-9)


@pytest.mark.parametrize("degrees", golden.FORCES)
def test_forces_without_bearings(degrees):
    motion = replace(RIG, bearing=0.0).motion(math.radians(degrees))
    first = -motion.forces["first"][:, 0]
    expected = np.array(golden.FORCES[degrees][:2]).reshape(4, 2)
    np.testing.assert_allclose(first, expected[:3], rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(motion.forces["Q"][0], expected[3], rtol=1e-7, atol=1e-7)


def test_torque():
    np.testing.assert_allclose(RIG.motion(ANGLES).forces["torque"], golden.TORQUE, rtol=1e-6)


def test_transient():
    strain, _ = Elastic(geometric=False).transient(4096)
    for k, link in enumerate(LINKS):
        expected = np.array(golden.TRANSIENT[link])
        found = [*strain[k, [1024, 2048, 3072, 4096]], abs(strain[k]).max()]
        np.testing.assert_allclose(found, expected, atol=1e-4 * expected[-1])


def test_geometric_stiffness():
    expected = golden.FLOQUET["held", "exact", True, True]
    assert Elastic().multiplier(2048) == pytest.approx(expected, rel=1e-5)
