"""Torsion springs and angles in loads over the motion of driven linkages: revolutions count from the start."""

from __future__ import annotations

import numpy as np
import pytest
from shared.in_numpy import build
from shared.linkages import GRAVITY, at, ground, rod

import symgen

K, SWING = 10.0, np.pi / 2


def door():
    """A driven door of 1 m and 20 kg with a torsion spring, wound by 150 deg at the start and 240 deg at the end."""
    return symgen.Scene(
        parameters={"k": {"value": "10 N*m", "tunable": True}, "q": "90 deg", "T": "1 s"},
        points={"O": ground(0, 0), "A": at(1, 0)},
        links={"door": rod("O", "A", 20.0)},
        drivers=[{"link": "door", "angle": "q*sin(pi*t/(2*T))**2"}],
        torsion_springs=[{"link": "door", "stiffness": "k", "angle": "-150 deg"}],
        gravity=GRAVITY,
        analysis={"t_end": "1 s", "outputs": ["door.torque"]},
    )


def torque_of_door(t, stiffness=K):
    angle = SWING * np.sin(np.pi * t / 2) ** 2
    second = SWING * np.pi**2 / 2 * np.cos(np.pi * t)
    return 20 / 3 * second + 20 * 9.81 / 2 * np.cos(angle) + stiffness * (angle + np.radians(150))


@pytest.fixture(scope="module")
def opened():
    return build(door())


@pytest.mark.parametrize("samples", [2, 3, 13, 61])
def test_a_spring_wound_beyond_half_a_revolution(opened, samples):
    found = opened.inverse_dynamics(0.0, 1.0, samples=samples)
    assert found["door.torque"].values == pytest.approx(torque_of_door(found.time), abs=1e-11)


def test_variants_and_optimisation_wind_the_spring(opened):
    stiffness = np.array([1.0, 10.0, 40.0])
    many = opened.inverse_dynamics_many({"k": stiffness}, start=0.0, stop=1.0, samples=13)
    expected = torque_of_door(np.linspace(0.0, 1.0, 13), stiffness[:, None])
    assert many["door.torque"].values == pytest.approx(expected, abs=1e-10)
    best = opened.optimise({"k": (1.0, 200.0)}, "door.torque.rms", samples=41)
    times = np.linspace(0.0, 1.0, 41)
    angles = SWING * np.sin(np.pi * times / 2) ** 2  # over which the analysis takes means

    def rms(k):
        return np.sqrt(np.trapezoid(torque_of_door(times, k) ** 2, angles) / SWING)

    assert best.objective == pytest.approx(min(map(rms, np.linspace(1.0, 200.0, 200))), rel=1e-9)
    assert best.objective == pytest.approx(rms(best.parameters["k"]), rel=1e-9)


@pytest.fixture(scope="module")
def winch():
    """A drum and a shaft driven at tunable rates, with springs and a couple that depend on their angles."""
    return build(
        symgen.Scene(
            parameters={"w": {"value": "2 rad/s", "tunable": True}, "c": "2 N*m"},
            points={"O": ground(0, 0), "A": at(np.cos(0.5), np.sin(0.5)), "B": at(0, -0.3)},
            links={"drum": rod("O", "A"), "shaft": rod("O", "B")},
            drivers=[{"link": "drum", "angle": "0.5 + w*t"}, {"link": "shaft", "angle": "-pi/2 - 1.5*w*t"}],
            torsion_springs=[
                {"link": "drum", "stiffness": "3 N*m", "angle": "20 deg"},
                {"link": "drum", "against": "shaft", "stiffness": "7 N*m", "angle": "-2 rad"},
            ],
            torques=[{"link": "drum", "torque": "c*(drum.angle - shaft.angle)"}],
            analysis={
                "t_end": "12 s",
                "outputs": ["drum.torque", "shaft.torque", "drum.angle", "B.velocity"],
            },
        )
    )


def torques_of_winch(turned):
    drum, shaft = 0.5 + turned, -np.pi / 2 - 1.5 * turned
    between = 7 * (drum - shaft + 2 - 2 * np.pi)  # within half a revolution of the free angle at the start
    return 3 * (drum - np.radians(20)) + between - 2 * (drum - shaft), -between


@pytest.mark.parametrize("rate", [2.0, -2.0, 9.0])
@pytest.mark.parametrize("samples", [2, 13, 361])
def test_many_revolutions(winch, rate, samples):
    found = winch.with_parameters(w=rate).inverse_dynamics(samples=samples)
    for name, expected in zip(("drum", "shaft"), torques_of_winch(rate * found.time), strict=True):
        assert found[f"{name}.torque"].values == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("times", [[11.0], [9.0, 0.5, 3.0], [-4.0, 2.0]])
def test_revolutions_up_to_selected_times(winch, times):
    found = winch.inverse_dynamics(at=times, over="time")
    for name, expected in zip(("drum", "shaft"), torques_of_winch(2.0 * np.array(times)), strict=True):
        assert found[f"{name}.torque"].values == pytest.approx(expected, abs=1e-10)


def test_revolutions_before_the_start(winch):
    """A range on both sides of the state that it starts from, at which angles are within half a revolution."""
    found = winch.inverse_dynamics(-5.0, 5.0, samples=21)
    for name, expected in zip(("drum", "shaft"), torques_of_winch(2.0 * found.time), strict=True):
        assert found[f"{name}.torque"].values == pytest.approx(expected, abs=1e-10)
    motion = winch.kinematics(-5.0, 5.0, samples=21)
    assert motion["drum.angle"].values == pytest.approx(0.5 + 2.0 * found.time, abs=1e-12)
    several = winch.kinematics_many({"w": [2.0, 3.0]}, start=-5.0, stop=5.0, samples=21)
    assert several["shaft.angle"].values[0] == pytest.approx(motion["shaft.angle"].values, abs=1e-12)
