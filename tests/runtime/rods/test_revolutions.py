"""Angles of links over many revolutions: in outputs, events and loads."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import symgen
from symgen.errors import ModelError, SimulationError

CASES = Path(__file__).parents[2] / "cases"


def test_angles_of_events_and_outputs_are_continuous():
    """The crank turns by 0.5 + 6 t: one passage of each angle, none at the jumps of atan2."""
    result = symgen.build(CASES / "event_wrap.toml").simulate(rtol=1e-10)
    found = [(e.name, e.time, e.rising) for e in result.events]
    assert [name for name, _, _ in found] == ["quarter", "past_pi"] and all(rising for _, _, rising in found)
    assert [t for _, t, _ in found] == pytest.approx([(math.pi / 2 - 0.5) / 6, 2.5 / 6], abs=1e-10)
    assert result["r.angle"].values == pytest.approx(0.5 + 6 * result.time, abs=1e-9)


def test_an_event_after_two_revolutions():
    changed = {"events.0.value": "13 rad"}
    result = symgen.build(CASES / "event_wrap.toml", set=changed).simulate(rtol=1e-10, samples=4)
    assert [e.time for e in result.events if e.name == "zero"] == pytest.approx([12.5 / 6], abs=1e-10)
    assert result["r.angle"].values == pytest.approx(0.5 + 6 * result.time, abs=1e-9)


WHIRL, FIVE = 20.0, np.linspace(0.0, 20.0, 5)


def _whirling(**options):
    """A uniform rod of 0.5 m that whirls about its end under gravity, its angle recorded alone."""
    scene = symgen.Scene(
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["0.5 m", "0 m"]}},
        links={"arm": {"points": ["O", "A"], "mass": "1 kg"}},
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        start={"rates": {"arm": f"{WHIRL} rad/s"}},
        analysis={"t_end": "20 s", "outputs": ["arm.angle"]},
    )
    return symgen.build(scene, **options)


def _whirled():
    """Its angle at five times, by its own equation."""
    found = solve_ivp(
        lambda t, y: [y[1], -1.5 * 9.81 / 0.5 * math.cos(y[0])],
        (0.0, 20.0), [0.0, WHIRL], method="DOP853", rtol=1e-12, atol=1e-12, t_eval=FIVE,
    )  # fmt: skip
    return found.y[0]


@pytest.mark.parametrize(
    ("built", "run", "within"),
    [
        ({}, {"rtol": 1e-9}, 1e-4),
        ({"backend": "numpy"}, {"rtol": 1e-7}, 1e-3),
        ({}, {"method": "rattle4", "step": 1e-3}, 1e-3),
        ({}, {"method": "rk4", "step": 5e-3}, 0.02),
        ({"precision": "float32"}, {"rtol": 2e-5}, 1.0),
        ({"precision": "longdouble"}, {"rtol": 1e-9}, 1e-4),
    ],
)
def test_revolutions_between_samples_are_counted(built, run, within):
    """Five samples of 63 revolutions whose rate is not uniform."""
    found = _whirling(**built).simulate(samples=5, **run)["arm.angle"].values
    assert found == pytest.approx(_whirled(), abs=within)


def test_a_resumed_run_goes_on_with_the_revolutions_counted(tmp_path):
    model, kept = _whirling(), tmp_path / "kept"
    with pytest.raises(SimulationError, match="max_steps"):
        model.simulate(samples=5, max_steps=200, checkpoint=kept, checkpoint_every=0)
    found = model.simulate(samples=5, resume=kept)["arm.angle"].values
    assert found == pytest.approx(_whirled(), abs=1e-3)


@pytest.mark.parametrize("analysis", ["kinematics", "simulate"])
def test_driven_links_count_revolutions_between_samples(analysis):
    """A drag-link: its follower stays within half a revolution of its crank, which turns 19 times."""
    crank, coupler, follower, ground = 0.5, math.hypot(0.2, 0.5), math.hypot(0.1, 0.5), 0.2
    scene = symgen.Scene(
        parameters={"w": "6 rad/s"},
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "C": {"at": ["0.2 m", "0 m"], "ground": True},
            "A": {"at": ["0.5 m", "0 m"]},
            "B": {"at": ["0.3 m", "0.5 m"]},
        },
        links={
            "crank": {"points": ["O", "A"], "mass": "1 kg"},
            "coupler": {"points": ["A", "B"], "mass": "1 kg"},
            "follower": {"points": ["C", "B"], "mass": "1 kg"},
        },
        drivers=[{"link": "crank", "angle": "w*t"}],
        analysis={"t_end": "20 s", "outputs": ["follower.angle"]},
    )
    model = symgen.build(scene)
    result = model.kinematics(0.0, 20.0, samples=4) if analysis == "kinematics" else model.simulate(samples=4)
    angle = 6.0 * result.time
    line = crank * np.exp(1j * angle) - ground
    opening = np.arccos((abs(line) ** 2 + follower**2 - coupler**2) / (2 * follower * abs(line)))
    both = [np.angle(line) + side * opening for side in (1, -1)]
    ahead = np.angle(np.exp(1j * (both - angle)))
    found = result["follower.angle"].values
    assert np.min(np.abs(found - angle - ahead), axis=0) == pytest.approx(np.zeros(4), abs=1e-6)
    assert found[0] == pytest.approx(math.atan2(0.5, 0.1), abs=1e-9)


def _arm(**tables):
    """A point of 2 kg on an arm of 0.5 m about the ground, without gravity: I = 0.5 kg m^2."""
    return symgen.Scene(
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["0.5 m", "0 m"]}},
        links={"arm": {"points": ["O", "A"], "mass": "0 kg"}},
        masses=[{"point": "A", "mass": "2 kg"}],
        **tables,
    )


@pytest.mark.parametrize("method", ["dop853", "radau5"])
def test_a_torsion_spring_winds_over_revolutions(method):
    """I theta'' = -k (theta - free): a spring that is wound by two revolutions and swings back past its start."""
    stiffness, free, most = 0.5, 0.7, 4 * math.pi
    scene = _arm(
        torsion_springs=[{"link": "arm", "stiffness": "0.5 N*m/rad", "angle": "0.7 rad"}],
        start={"rates": {"arm": f"{most!r} rad/s"}},
        analysis={"t_end": "6.5 s", "outputs": ["arm.angle", "energy", "O.reaction"]},
    )
    result = symgen.build(scene).simulate(method=method, rtol=1e-10, samples=41)
    cos, sin = np.cos(result.time), np.sin(result.time)
    angle = free - free * cos + most * sin
    assert result["arm.angle"].values == pytest.approx(angle, abs=1e-6)
    energy = stiffness * (most**2 + free**2) / 2
    assert result["energy"].values == pytest.approx(energy, rel=1e-7)
    assert result.drift.energy < 1e-7 * energy
    inward, tangent = 2.0 * 0.5 * (free * sin + most * cos) ** 2, -stiffness * (angle - free) / 0.5
    reaction = np.column_stack(
        [-inward * np.cos(angle) - tangent * np.sin(angle), -inward * np.sin(angle) + tangent * np.cos(angle)]
    )
    assert result["O.reaction"].values == pytest.approx(reaction, abs=1e-3)


@pytest.mark.parametrize("name", ["this", "arm"])
def test_a_load_written_with_an_angle_winds_over_revolutions(name):
    """I theta'' = k (9 - theta) from rest: theta = 9 (1 - cos t), up to nearly three revolutions."""
    torque = {"link": "arm", "torque": f"k*(9 - {name}.angle)"}
    scene = _arm(
        parameters={"k": "0.5 N*m"}, torques=[torque], analysis={"t_end": "7 s", "outputs": ["arm.angle"]}
    )
    result = symgen.build(scene).simulate(rtol=1e-10, samples=8)
    assert result["arm.angle"].values == pytest.approx(9 * (1 - np.cos(result.time)), abs=1e-6)


@pytest.mark.parametrize("method", ["dop853", "dopri5", "radau5", "taylor"])
def test_steps_within_loose_tolerances_keep_the_revolutions_of_loads(method):
    """The same swing by 40 rad, of which steps of dop853 within 1e-3 would rotate by more than half a revolution."""
    torque = {"link": "arm", "torque": "-k*arm.angle"}
    scene = _arm(
        parameters={"k": "0.5 N*m"},
        torques=[torque],
        start={"rates": {"arm": "40 rad/s"}},
        analysis={"t_end": "6 s", "outputs": ["arm.angle"]},
    )
    result = symgen.build(scene).simulate(method=method, rtol=1e-3, atol=1e-5, samples=8)
    assert result["arm.angle"].values == pytest.approx(40.0 * np.sin(result.time), abs=1.0)


def test_references_of_angles_are_no_parameters(tmp_path):
    scene = tmp_path / "spring.toml"
    scene.write_text("""
symgen = 1
[parameters]
k = { value = "2 N*m", tunable = true }
[points]
O = { at = ["0 m", "0 m"], ground = true }
A = { at = ["0.3 m", "0 m"] }
[links]
rod = { points = ["O", "A"], mass = "1 kg" }
[[torques]]
link = "rod"
torque = "-k*this.angle"
""")
    model = symgen.build(scene, backend="numpy")
    assert model.parameters == {"k": 2.0}
    assert model.simulate(0.1).provenance["parameters"] == {"k": 2.0}
    with pytest.raises(ModelError, match="no tunable parameter 'turned_0'"):
        model.with_parameters(turned_0=1.0)
