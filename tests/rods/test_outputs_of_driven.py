"""Inverse dynamics has the outputs that a scene selects; torques of drives react on the ground."""

from __future__ import annotations

import numpy as np
import pytest
from shared.in_numpy import build
from shared.linkages import GRAVITY, at, ground, rod

import symgen

G = 9.81


@pytest.fixture(scope="module")
def leg():
    """A leg of two uniform rods of 0.4 m, the shank driven against the ground, over several revolutions."""
    outputs = ["thigh.torque", "shank.torque", "thigh.angle", "K.velocity", "kinetic_energy", "O.reaction"]
    return build(
        symgen.Scene(
            parameters={"w": "4 rad/s"},
            points={"O": ground(0, 0), "K": at(0.4, 0), "F": at(0.4, -0.4)},
            links={"thigh": rod("O", "K", 5.0), "shank": rod("K", "F", 3.0)},
            drivers=[{"link": "thigh", "angle": "w*t"}, {"link": "shank", "angle": "-pi/2 + 0.3*sin(w*t)"}],
            gravity=GRAVITY,
            analysis={"t_end": "4 s", "outputs": outputs},
        )
    )


def test_outputs_of_the_scene_by_their_own_expressions(leg):
    found = leg.inverse_dynamics(0.0, 4.0, samples=41)
    t, w = found.time, 4.0
    thigh, shank = w * t, -np.pi / 2 + 0.3 * np.sin(w * t)
    turning = 0.3 * w * np.cos(w * t)
    assert found["thigh.angle"].values == pytest.approx(thigh, abs=1e-12)
    velocity = 0.4 * w * np.stack([-np.sin(thigh), np.cos(thigh)], axis=1)
    assert found["K.velocity"].values == pytest.approx(velocity, abs=1e-12)
    centre = velocity + 0.2 * turning[:, None] * np.stack([-np.sin(shank), np.cos(shank)], axis=1)
    energy = 0.5 * (5 * 0.16 / 3 * w**2 + 3 * np.sum(centre**2, axis=1) + 3 * 0.16 / 12 * turning**2)
    assert found["kinetic_energy"].values == pytest.approx(energy, abs=1e-12)


def test_the_motor_of_a_joint_gives_the_torques_of_all_drives_beyond_it(leg):
    """Angular momentum of the whole leg about the hip: its rate, and the moment of the weight."""
    found = leg.inverse_dynamics(0.0, 4.0, samples=41)
    t, w = found.time, 4.0
    a, b = w * t, -np.pi / 2 + 0.3 * np.sin(w * t)
    rate, second = 0.3 * w * np.cos(w * t), -0.3 * w**2 * np.sin(w * t)
    # acceleration of the centre of the shank
    x = 0.4 * np.cos(a) + 0.2 * np.cos(b)
    y = 0.4 * np.sin(a) + 0.2 * np.sin(b)
    ax = -0.4 * w**2 * np.cos(a) - 0.2 * (second * np.sin(b) + rate**2 * np.cos(b))
    ay = -0.4 * w**2 * np.sin(a) + 0.2 * (second * np.cos(b) - rate**2 * np.sin(b))
    hip = 5 * G * 0.2 * np.cos(a) + 3 * (x * (ay + G) - y * ax) + 3 * 0.16 / 12 * second
    both = found["thigh.torque"].values + found["shank.torque"].values
    assert both == pytest.approx(hip, abs=1e-11)
