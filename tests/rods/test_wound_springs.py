"""Torsion springs and angles in loads over the motion of driven linkages: revolutions count from the start."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
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


def test_derivatives_and_linearisation_at_a_time_of_the_motion(opened):
    slopes = opened.sensitivity(["door.torque"], ["k"], at=1.0)
    assert slopes.values == pytest.approx([torque_of_door(1.0)], abs=1e-11)
    assert slopes.derivatives == pytest.approx(np.radians([[240]]), abs=1e-12)
    multiplier = opened.accelerations(opened.reached(1.0)).multipliers["door_drive"]
    assert multiplier == pytest.approx(-torque_of_door(1.0), abs=1e-11)


def test_motions_from_a_state_go_on_with_its_revolutions(opened):
    begin = opened.reached(0.7)
    times = np.array([0.7, 1.1, 1.3])
    run = opened.simulate(1.3, t_eval=times, state=begin)
    assert run["door.torque"].values == pytest.approx(torque_of_door(times), abs=1e-6)
    assert not any("revolutions" in note for note in run.notes)
    forces = opened.inverse_dynamics(at=times, over="time", state=begin)
    assert forces["door.torque"].values == pytest.approx(torque_of_door(times), abs=1e-11)


def test_an_equilibrium_held_by_a_drive_counts_its_revolutions():
    """A drive that comes to rest after two and a half revolutions."""
    scene = symgen.Scene(
        parameters={"q": "900 deg", "T": "1 s"},
        points={"O": ground(0, 0), "A": at(1, 0)},
        links={"door": rod("O", "A", 20.0)},
        drivers=[{"link": "door", "angle": "q*(10*(t/T)**3 - 15*(t/T)**4 + 6*(t/T)**5)"}],
        torsion_springs=[{"link": "door", "stiffness": "10 N*m", "angle": "-150 deg"}],
        analysis={"t_end": "1 s", "outputs": ["door.torque"]},
    )
    rest = build(scene).equilibrium(at=1.0)
    assert rest.outputs["door.torque"] == pytest.approx(10 * np.radians(1050), rel=1e-12)


def test_the_way_to_an_equilibrium_counts_revolutions():
    """A rod of 40 kg pushed up, m g/2 cos(a) = k (a + 170 deg): the spring is wound by 247 degrees there."""
    scene = symgen.Scene(
        parameters={"k": {"value": "10 N*m", "tunable": True}},
        points={"O": ground(0, 0), "A": at(1, 0)},
        links={"door": rod("O", "A", 40.0)},
        torsion_springs=[{"link": "door", "stiffness": "k", "angle": "-170 deg"}],
        gravity={"acceleration": ["0 m/s^2", "9.81 m/s^2"]},
        analysis={"t_end": "1 s", "outputs": ["energy"]},
    )
    model, weight = build(scene), 40 * 9.81 / 2
    angle = brentq(lambda a: weight * np.cos(a) - 10 * (a + np.radians(170)), 0.0, np.pi / 2, xtol=1e-14)
    wound, stiffness = angle + np.radians(170), 10 + weight * np.sin(angle)
    rest = model.equilibrium()
    assert rest.stability == "stable"
    assert rest.state.positions["A"] == pytest.approx([np.cos(angle), np.sin(angle)], abs=1e-12)
    assert rest.outputs["energy"] == pytest.approx(5 * wound**2 - weight * np.sin(angle), rel=1e-12)
    frequency = np.sqrt(stiffness / (40 / 3)) / (2 * np.pi)
    assert model.modes(rest).frequencies == pytest.approx([frequency], rel=1e-12)
    slopes = model.sensitivity(["door.angle", "frequencies"], at=rest)
    by_k = -wound / stiffness
    of_frequency = frequency / (2 * stiffness) * (1 + weight * np.cos(angle) * by_k)
    assert slopes.derivatives[:, 0] == pytest.approx([by_k, of_frequency], rel=1e-9)
    assert model.linearise(rest).rates == pytest.approx(np.zeros(4), abs=1e-10)
    assert model.simulate(0.1, state=rest.state, samples=2).final["A"]["position"] == pytest.approx(
        [np.cos(angle), np.sin(angle)], abs=1e-10
    )
