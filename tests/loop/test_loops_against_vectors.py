"""The slider-crank with 29 combinations of offsets, at 361 crank angles, against the independent vector model."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from shared.crank_vectors import PI, Crank, driven
from shared.inches import INCH, in_inches
from shared.jets import Real

import symgen

SPEED = 50 * 2 * PI / 60
ANGLES = np.linspace(0, 2 * np.pi, 361)
#: a4 and S1 in inches, alpha4 in degrees, swings of S1 a turn.
OFFSETS = [
    *((a4, 270, 0, 0) for a4 in (0, 10, 20, 30)),
    *((a4, 270, 3.5, 0) for a4 in (0, 10, 20, 30)),
    *((30, 270, S1, 0) for S1 in (3, 6, 9)),
    *((20, alpha4, 0, 0) for alpha4 in (232, 245, 258, 282, 295, 310)),
    *((a4, 270, 3.5, 2) for a4 in (0, 10, 20, 30)),
    *((30, 270, S1, 2) for S1 in (3, 6, 9)),
    *((20, alpha4, 3.5, 2) for alpha4 in (232, 310)),
    *((a4, 232, 9, 2) for a4 in (0, 30)),
    (30, 310, 9, 2),
]
NAMES = {
    "theta1": "theta1",
    "S1": "s1",
    "theta2": "theta2",
    "eta2": "eta2",
    "theta3": "theta3",
    "eta3": "eta3",
    "alpha3": "alpha3",
    "S4": "S4",
}
WRENCHES = {
    "F1": "crank.joint1.force",
    "T1": "crank.joint1.moment",
    "F2": "crank.joint2.force",
    "F3": "slider.joint3.force",
    "F4": "slider.joint4.force",
    "T4": "slider.joint4.moment",
}


@cache
def built():
    return symgen.build("slider_crank")


def error(found, expected):
    """Largest error relative to max(1, |value|)."""
    expected = np.asarray(expected, dtype=float)
    return np.max(np.abs(np.asarray(found) - expected) / np.maximum(1.0, np.abs(expected)))


def compare(a4, alpha4, S1, ratio):
    """Largest errors of positions, rates, accelerations and forces."""
    model = built().with_parameters(a4=a4 * INCH, alpha4=np.deg2rad(alpha4), S1=S1 * INCH, ratio=float(ratio))
    run = in_inches(model.inverse_dynamics(at=ANGLES))
    crank = Crank(a4=Real(a4), alpha4=Real(np.deg2rad(alpha4)))
    motion = crank.motion(*driven(ANGLES, SPEED, Real(S1), ratio))
    worst = np.zeros(4)
    for ours, name in NAMES.items():
        expected = motion.variables()[ours]
        for i, (suffix, part) in enumerate(zip(("", ".rate", ".acceleration"), expected.parts, strict=True)):
            found = run.variable(name + suffix).values
            if i == 0 and ours[0] != "S":
                found = found - 2 * np.pi * np.round(np.asarray(found - part, dtype=float) / (2 * np.pi))
            worst[i] = max(worst[i], error(found, part))
    forces = motion.forces()
    for ours, name in WRENCHES.items():
        worst[3] = max(worst[3], error(run.variable(name).values, forces[ours]))
    for ours, name in {"theta1.drive": "theta1.drive", "S1.drive": "s1.drive"}.items():
        worst[3] = max(worst[3], error(run.variable(name).values, forces[ours]))
    return worst


def test_there_are_29_combinations():
    assert len(set(OFFSETS)) == len(OFFSETS) == 29


@pytest.mark.parametrize("offsets", OFFSETS, ids=lambda o: "-".join(map(str, o)))
def test_positions_rates_and_forces(offsets):
    positions, rates, accelerations, forces = compare(*offsets)
    assert positions <= 1e-12
    assert rates <= 1e-12
    assert accelerations <= 1e-12
    assert forces <= 1e-10
