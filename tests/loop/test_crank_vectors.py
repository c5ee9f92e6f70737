"""The independent vector model against every checked number: the reference of the other tests of loops."""

from __future__ import annotations

import numpy as np
import pytest
from shared.crank_vectors import PI, Crank, dead_centres, driven
from shared.golden import reference
from shared.jets import Real

NUMBERS = reference("dual_slider_crank")
SPEED = 50 * 2 * PI / 60
NAMES = {
    "S1": "S1",
    "S4": "S4",
    "th2": "theta2",
    "et2": "eta2",
    "th3": "theta3",
    "et3": "eta3",
    "al3": "alpha3",
}
MODES = {"mode_L": {"S4_drive": Real(0)}, "mode_T": {"theta1_drive": Real(100)}}


def radians(degrees):
    return np.array([degrees], dtype=Real) * PI / 180


def crank_of(scene):
    return Crank(a4=Real(scene["a4"]), alpha4=radians(scene["alpha4_deg"])[0])


def close(found, expected, tolerance=2e-14):
    expected = float(expected)
    assert abs(float(found) - expected) <= tolerance * max(1.0, abs(expected))


def same(name, found, expected):
    """Angles may differ by turns: -pi is pi."""
    turns = 0 if name[0] == "S" else 2 * np.pi * np.round((float(found) - expected) / (2 * np.pi))
    close(float(found) - turns, expected)


def check(forces, expected):
    for name, value in expected.items():
        close(forces[name[:2]][0]["ijk".index(name[2])], value)


@pytest.mark.parametrize("scene", NUMBERS["scenes"], ids=lambda s: s["name"])
def test_every_checked_number(scene):
    crank = crank_of(scene)
    for at in scene["positions"]:
        inputs = driven(radians(at["theta1_deg"]), SPEED, scene["S1_or_amplitude"], scene["alpha"])
        motion = crank.motion(*inputs)
        for short, name in NAMES.items():
            variable, expected = getattr(motion, name), at["kin"][short]
            same(name, variable.value[0], expected["pos"])
            close(variable.rate[0], expected["vel"])
            close(variable.second[0], expected["acc"])
        for mode, given in MODES.items():
            check(motion.forces(**given), at[mode])


@pytest.mark.parametrize("scene", NUMBERS["scenes"], ids=lambda s: s["name"])
def test_dead_centres(scene):
    crank = crank_of(scene)
    S1 = scene["S1_or_amplitude"]
    found = dead_centres(crank, S1)
    assert np.allclose(
        np.rad2deg(found), [d["theta1_deg"] for d in scene["dead_centres"]], rtol=0, atol=1e-11
    )
    for at in scene["dead_centres"]:
        motion = crank.motion(*driven(radians(at["theta1_deg"]), SPEED, S1, 0))
        same("theta2", motion.theta2.value[0], at["th2"])
        close(motion.S4.value[0], at["S4"])
        close(motion.S4.rate[0], at["S4_vel"], 1e-12)
        close(motion.S4.second[0], at["S4_acc"])
        close(motion.eta2.rate[0], at["et2_vel"])
        close(motion.eta2.second[0], at["et2_acc"], 1e-12)
        forces = motion.forces(S4_drive=Real(0))
        for name, value in at["mode_L"].items():
            close(forces[name[:2]][0]["ijk".index(name[2])], value, 1e-12)
        # the pole of the slider's load where the crank's torque is given: power balance gives its residue
        lacking = 100 - forces["theta1.drive"][0]
        close(lacking * SPEED**2 / motion.S4.second[0], at["mode_T_F4k_residue"], 1e-11)
        # and so does the load itself, on either side: odd in the distance, so the mean of both is free of it
        near = Real(2) ** -20
        loads = [
            crank.motion(*driven(radians(at["theta1_deg"]) + d, SPEED, S1, 0)).forces(theta1_drive=Real(100))
            for d in (near, -near)
        ]
        residue = (loads[0]["S4.drive"][0] - loads[1]["S4.drive"][0]) * near / 2
        close(residue, at["mode_T_F4k_residue"], 1e-10)


@pytest.mark.parametrize("ratio", [0, 2])
def test_power_balance(ratio):
    """The power of the drives is the rate of the kinetic energy: its rate from differences of high order."""
    crank = Crank(a4=20.0, alpha4=float(radians(232)[0]))
    h = Real(2) ** -9
    steps = np.arange(-5, 6) * h
    weights = np.array([-2, 25, -150, 600, -2100, 0, 2100, -600, 150, -25, 2], dtype=Real) / 2520
    for start in (0.3, 2.0, 4.4):
        motion = crank.motion(*driven(Real(start) + steps * SPEED, SPEED, 3.5, ratio))
        forces = motion.forces()
        power = forces["theta1.drive"] * SPEED + forces["S1.drive"] * motion.S1.rate
        rate = (motion.kinetic_energy() @ weights) / h
        close(power[5], rate, 1e-12)


def test_a_general_rod_that_is_round_gives_the_round_one():
    crank = Crank(a4=30.0)
    round_rod = Crank(
        a4=30.0,
        rod_centre=(-25.0, 0.0, 0.0),
        rod_inertia=np.diag([Real(0), *[crank.masses[1] * (Real(1) / 4 + Real(2500) / 12)] * 2]),
    )
    angles = np.linspace(0, 2 * np.pi, 37)
    ways = [c.motion(*driven(angles, SPEED, 9.0, 2)).forces() for c in (crank, round_rod)]
    for name in ways[0]:
        assert np.allclose(*(np.asarray(w[name], dtype=float) for w in ways), rtol=1e-12, atol=1e-12)
