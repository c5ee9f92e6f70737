"""Universal and prismatic joints between bodies, and what a drive reacts on, as the documentation states them."""

from __future__ import annotations

import numpy as np
import pytest

import symgen

TIMES = np.array([0.0, 0.11, 0.34, 0.62, 0.9])


def test_a_massless_rod_between_two_yokes_is_a_universal_joint():
    """The output shaft leads and lags; its angle is atan(tan(input)/cos(bend))."""
    run = symgen.build("hooke_joint").simulate(t_eval=TIMES, rtol=1e-12)
    w, bend = 2 * np.pi, np.pi / 6
    turn = w * TIMES
    share = 1 - (np.sin(bend) * np.cos(turn)) ** 2
    ratio = np.cos(bend) / share
    axis = np.array([np.cos(bend), np.sin(bend), 0])
    assert run["output.angular_velocity"].values == pytest.approx(np.outer(w * ratio, axis), abs=1e-10)
    acceleration = -np.cos(bend) * np.sin(bend) ** 2 * np.sin(2 * turn) * w**2 / share**2
    torque = (2 + 0.004 * acceleration) * ratio
    assert run["input.torque"].values == pytest.approx(torque, rel=1e-9)


def test_a_universal_joint_with_a_common_point_carries_its_shaft():
    """The output shaft has one bearing, which slides along it: the joint holds its other end."""
    tables = symgen.load_scene("hooke_joint").model_dump(exclude_none=True)
    whole = symgen.build(symgen.Scene(**tables)).simulate(t_eval=TIMES, rtol=1e-12)
    tables["points"]["X"] = {"at": ["0 m", "0 m", "0 m"]}
    tables["points"]["E"] = {"at": tables["points"]["H"]["at"]}
    tables["links"]["input"]["points"] = ["G", "I", "X", "A"]
    tables["links"]["output"]["points"] = ["X", "E", "C"]
    tables["links"]["rail"] = {"points": ["K", "H"]}
    tables["guides"] = [{"points": ["E"], "along": "rail"}]
    run = symgen.build(symgen.Scene(**tables)).simulate(t_eval=TIMES, rtol=1e-12)
    assert not [note for note in run.notes if "redundant" in note]
    for name in ("output.angular_velocity", "input.torque"):
        assert run[name].values == pytest.approx(whole[name].values, rel=1e-9, abs=1e-9)


def test_three_points_on_two_parallel_lines_are_a_prismatic_joint():
    """The boom at the distance r rotates with the turret: forces by its radial and angular momentum."""
    run = symgen.build("telescope").simulate(t_eval=TIMES, rtol=1e-12)
    s, c = np.sin(2 * TIMES), np.cos(2 * TIMES)
    tip = (0.8 + 0.1 * s)[:, None] * np.stack([c, s, 0 * s], axis=1)
    assert run["T.position"].values == pytest.approx(tip, abs=1e-12)
    radius, rate, acceleration = 0.8 + 0.1 * s, 0.2 * c, -0.4 * s
    assert run["screw.tension"].values == pytest.approx(20 * (radius * 4 - acceleration), rel=1e-9)
    assert run["turret.torque"].values == pytest.approx(2 * 20 * radius * rate * 2, rel=1e-9)
    assert any("1 of 19 constraints redundant" in note for note in run.notes)
    model = symgen.build("telescope")
    forces = model.inverse_dynamics(at=2 * TIMES)  # angles of the turret
    assert forces.time == pytest.approx(TIMES, abs=1e-12)
    assert forces["screw.tension"].values == pytest.approx(20 * (radius * 4 - acceleration), rel=1e-9)
    assert forces["turret.torque"].values == pytest.approx(2 * 20 * radius * rate * 2, rel=1e-9)
    assert forces.statistics["residual"] < 1e-12 and forces.condition < 1e3
    assert any("redundant constraints (" in note for note in forces.notes)


@pytest.mark.parametrize("carried", [True, False])
def test_the_motor_of_an_elbow_reacts_on_the_upper_arm(carried):
    """The motor of the shoulder carries both links; if the forearm is driven from the ground, the upper arm alone."""
    change = {} if carried else {"drivers.1.against": None}
    run = symgen.build("two_arms", set=change).simulate(samples=2)
    elbow, both = 1 * 9.81 * 0.15, 2 * 9.81 * 0.2 + 1 * 9.81 * 0.55
    assert run["fore.torque"].values == pytest.approx(elbow, rel=1e-12)
    assert run["upper.torque"].values == pytest.approx(both if carried else both - elbow, rel=1e-12)
