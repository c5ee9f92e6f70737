"""The generalized slider-crank by symgen against checked numbers: kinematics and forces, both causalities.

Reference: ``reference/dual_slider_crank.json``, 20 digits of a closed form and of two derivations of the forces,
which ``test_crank_vectors`` meets as well.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from shared.golden import reference
from shared.inches import INCH, POUND, in_inches

import symgen

NUMBERS = reference("dual_slider_crank")
SCENES = {s["name"]: s for s in NUMBERS["scenes"]}
KINEMATICS = {
    "S1": "s1",
    "S4": "S4",
    "th2": "theta2",
    "et2": "eta2",
    "th3": "theta3",
    "et3": "eta3",
    "al3": "alpha3",
}
RATES = {"pos": "", "vel": ".rate", "acc": ".acceleration"}
WRENCHES = {
    "F1": "crank.joint1.force",
    "T1": "crank.joint1.moment",
    "F2": "crank.joint2.force",
    "F3": "slider.joint3.force",
    "F4": "slider.joint4.force",
    "T4": "slider.joint4.moment",
}
#: Prescribed quantities and unknowns of each mode.
MODES = {
    "mode_L": {"loop.drives.theta1": "?", "loop.drives.S4": "0 lbf"},
    "mode_T": {"loop.drives.theta1": "100 lbf*in", "loop.drives.S4": "?"},
}


@cache
def model(mode, scene):
    given = SCENES[scene]
    built = _built(mode)
    return built.with_parameters(
        a4=given["a4"] * INCH,
        alpha4=np.deg2rad(given["alpha4_deg"]),
        S1=given["S1_or_amplitude"] * INCH,
        ratio=given["alpha"],
    )


@cache
def _built(mode):
    return symgen.build("slider_crank", set=MODES[mode])


def close(found, expected, what, tolerance=1e-9):
    error = abs(found - expected)
    assert error <= tolerance * max(1.0, abs(expected)), f"{what}: {found!r}, not {expected!r}"


def check_forces(run, i, expected):
    for name, value in expected.items():
        found = run.variable(WRENCHES[name[:2]]).values[i]["ijk".index(name[2])]
        close(found, value, name)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("scene", SCENES)
def test_every_value(mode, scene):
    positions = SCENES[scene]["positions"]
    run = in_inches(model(mode, scene).inverse_dynamics(at=np.deg2rad([p["theta1_deg"] for p in positions])))
    count = 0
    for i, expected in enumerate(positions):
        for short, name in KINEMATICS.items():
            for key, suffix in RATES.items():
                found = float(run.variable(name + suffix).values[i])
                value = expected["kin"][short][key]
                if key == "pos" and name[0] not in "sS":  # followed angles count turns, the numbers do not
                    found -= 2 * np.pi * np.round((found - value) / (2 * np.pi))
                close(found, value, f"{name}{suffix} at {expected['theta1_deg']}")
                count += 1
        check_forces(run, i, expected[mode])
        count += len(expected[mode])
        torque, load = run.variable("theta1.drive").values[i], run.variable("S4.drive").values[i]
        close(torque, expected[mode]["T1k"], "theta1.drive")
        close(load, -expected[mode]["F4k"], "S4.drive")  # of the slider on the frame: it drives S4 up
        close(run.variable("s1.drive").values[i], expected[mode]["F1k"], "s1.drive")
    assert count == len(positions) * (3 * 7 + 18)


@pytest.mark.parametrize("scene", SCENES)
def test_dead_centres_are_regular_where_the_load_is_given(scene):
    centres = SCENES[scene]["dead_centres"]
    angles = np.deg2rad([c["theta1_deg"] for c in centres])
    run = in_inches(model("mode_L", scene).inverse_dynamics(at=angles))
    assert run.poles == ()
    for i, expected in enumerate(centres):
        for key, name in {
            "S4": "S4",
            "S4_vel": "S4.rate",
            "S4_acc": "S4.acceleration",
            "et2_vel": "eta2.rate",
            "et2_acc": "eta2.acceleration",
        }.items():
            close(run.variable(name).values[i], expected[key], name)
        angle = run.variable("theta2").values[i] - expected["th2"]
        close(angle - 2 * np.pi * np.round(angle / (2 * np.pi)), 0.0, "theta2")
        check_forces(run, i, expected["mode_L"])


@pytest.mark.parametrize("scene", SCENES)
def test_dead_centres_are_poles_where_the_torque_is_given(scene):
    """Met on a sample or passed between two: reported with the residue, and no number in its place."""
    centres = SCENES[scene]["dead_centres"]
    passed = model("mode_T", scene).inverse_dynamics(samples=101)
    met = model("mode_T", scene).inverse_dynamics(at=np.deg2rad([c["theta1_deg"] for c in centres]))
    for run in (passed, met):
        assert len(run.poles) == len(centres)
        for pole, expected in zip(run.poles, centres, strict=True):
            close(pole.at, np.deg2rad(expected["theta1_deg"]), "dead centre")
            residue = expected["mode_T_F4k_residue"]
            close(pole.residues["S4.drive"] / POUND, -residue, "residue of the load", 1e-6)
            close(
                pole.residues["slider.joint4.force.z"] / POUND, residue, "residue of the guide's force", 1e-6
            )
            assert not {n for n in pole.residues if n.startswith(("theta", "eta", "alpha3", "S4.r"))}
    assert np.all(np.isnan(met.variable("S4.drive").values))
    assert np.all(np.isfinite(met.variable("S4.acceleration").values))
    # the transverse force of the rod is its inertia alone, and has no pole
    assert np.all(np.isfinite(met.variable("slider.joint3.force").values[:, 1:]))
    assert not {
        n for p in met.poles for n in p.residues if n in ("slider.joint3.force.y", "slider.joint3.force.z")
    }


def test_numbers_can_fail():
    """A tenth of a thousandth of an inch of offset shows at once."""
    positions = SCENES["a4_S1"]["positions"]
    shifted = model("mode_L", "a4_S1").with_parameters(a4=(30 + 1e-4) * INCH)
    run = shifted.inverse_dynamics(at=np.deg2rad([p["theta1_deg"] for p in positions]))
    with pytest.raises(AssertionError):
        for i, expected in enumerate(positions):
            check_forces(run, i, expected["mode_L"])
