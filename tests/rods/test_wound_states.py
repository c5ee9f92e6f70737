"""States with and without revolutions: runs from them, and the motion linearised there."""

from __future__ import annotations

import ctypes
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from shared.in_numpy import build

import symgen
from symgen.errors import ModelError, SimulationError

DOOR = {
    "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", "0 m"]}},
    "links": {"door": {"points": ["O", "A"], "mass": "1 kg"}},
    "torsion_springs": [{"link": "door", "stiffness": "10 N*m", "angle": "170 deg"}],
    "start": {"rates": {"door": "-20 rad/s"}},
    "gravity": {"acceleration": ["0 m/s^2", "0 m/s^2"]},
}


def notes_of_a_restart(**tables) -> str:
    model = build(symgen.Scene(**tables))
    whole = model.simulate(0.2, samples=3)
    state = model.state({"A": whole.final["A"]["position"]}, {"A": whole.final["A"]["velocity"]}, 0.2)
    assert not any("revolutions" in note for note in whole.notes)
    return " ".join(model.simulate(0.3, samples=3, state=state).notes)


def test_a_run_from_a_given_state_says_that_springs_count_revolutions_anew():
    assert "the given state has no revolutions: angles of loads and torsion springs" in notes_of_a_restart(
        **DOOR
    )


def test_a_run_from_a_given_state_without_angles_in_loads_has_no_such_note():
    assert "revolutions" not in notes_of_a_restart(
        **{k: v for k, v in DOOR.items() if k != "torsion_springs"}
    )


def angle_of_door(t):
    """I a'' = -k (a - free) with I = 1/3 kg m^2, from a = 0 and a' = -20 rad/s, and its two rates."""
    free, rate, w = np.radians(170), -20.0, np.sqrt(30.0)
    cos, sin = np.cos(w * t), np.sin(w * t)
    away = -free * cos + rate / w * sin
    return free + away, free * w * sin + rate * cos, -(w**2) * away


@pytest.fixture(scope="module")
def wound():
    return build(symgen.Scene(**DOOR))


def test_a_time_of_a_run_has_its_revolutions(wound):
    angle, rate, second = angle_of_door(0.2)
    line, across = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    assert angle - np.radians(170) < -np.pi  # beyond half a revolution
    state = wound.reached(0.2)
    expected = second * across - rate**2 * line
    assert wound.accelerations(state)["A"] == pytest.approx(expected, rel=1e-6)
    assert wound.linearise(at=0.2).rates[2:] == pytest.approx(expected, rel=1e-6)


def test_a_run_from_a_state_with_revolutions_is_the_rest_of_the_run(wound):
    run = wound.simulate(0.6, samples=2, state=wound.reached(0.2))
    angle = angle_of_door(0.6)[0]
    assert run.final["A"]["position"] == pytest.approx([np.cos(angle), np.sin(angle)], abs=1e-6)
    assert not any("revolutions" in note for note in run.notes)


@pytest.mark.parametrize("angle", [-0.3, 2.0])
def test_a_state_by_its_angle_counts_from_the_start(wound, angle):
    """The free angle is 170 deg: at -0.3 rad the spring is wound by more than half a revolution."""
    second = wound.accelerations(wound.state({"door.angle": angle}))["A"]
    expected = 30.0 * (np.radians(170) - angle)
    assert second == pytest.approx([-expected * np.sin(angle), expected * np.cos(angle)], abs=1e-9)


@pytest.mark.parametrize(("angle", "same"), [(4.0, "-2.28319"), (7.0, "0.716815"), (-100.0, "0.530965")])
def test_a_state_by_an_angle_beyond_half_a_revolution_is_refused_where_springs_count_them(wound, angle, same):
    text = rf"expected door.angle within half a revolution of its 0 rad at the start, got {angle:g} rad.*\n +{same} "
    with pytest.raises(ModelError, match=text):
        wound.state({"door.angle": angle})


def test_a_state_takes_the_revolutions_that_it_is_given(wound):
    """M a = k (free - angle) at 4 rad, of which a pose has -2.28 rad; references are of angle - free."""
    state = wound.state({"door.angle": 4.0 - 2 * np.pi})
    given = replace(state, references=np.array([4.0 - np.radians(170)]))
    second = 30.0 * (np.radians(170) - 4.0)
    expected = [-second * np.sin(4.0), second * np.cos(4.0)]
    assert wound.accelerations(given)["A"] == pytest.approx(expected, abs=1e-9)


def test_a_state_by_an_angle_without_loads_by_angles_is_a_pose():
    model = build(symgen.Scene(**{k: v for k, v in DOOR.items() if k != "torsion_springs"}))
    assert model.state({"door.angle": 7.0}).positions["A"] == pytest.approx([np.cos(7.0), np.sin(7.0)])


def test_other_solvers_count_revolutions(wound):
    """The door turns by more than half a revolution away from the free angle, and back beyond."""
    f, times = wound.rhs, np.linspace(0.0, 2.0, 41)
    angle, rate, _ = angle_of_door(times)
    assert np.ptp(angle) > 2 * np.pi and f.start.tolist() == [1, 0, 0, -20, pytest.approx(np.radians(-170))]
    y = solve_ivp(f, (0.0, 2.0), f.start, "DOP853", times, rtol=1e-12, atol=1e-13).y
    assert y[:2] == pytest.approx(np.array([np.cos(angle), np.sin(angle)]), abs=1e-8)
    assert y[4] == pytest.approx(angle - np.radians(170), abs=1e-8)
    energy = 10 * np.radians(170) ** 2 / 2 + 400 / 6
    assert [f.energy(t, row) for t, row in zip(times, y.T, strict=True)] == pytest.approx(
        [energy] * 41, rel=1e-8
    )
    run = wound.record(times, y.T)
    assert run.drift.energy < 1e-7 * energy and run.drift.energy_exchanged > 0.5 * energy
    assert f.project(2.0, y[:, -1]) == pytest.approx(y[:, -1], abs=1e-8)
    assert wound.coordinates(y.T)["door.angle'"] == pytest.approx(rate, abs=1e-7)


def test_solvers_in_c_count_revolutions():
    """The compiled function takes the angle behind the state: a revolution more has its torque."""
    f = symgen.build(symgen.Scene(**DOOR)).rhs
    handle, rates = f.low_level, np.zeros(5)
    signature = ctypes.CFUNCTYPE(None, ctypes.c_double, *[ctypes.c_void_p] * 3)
    call = ctypes.cast(handle.function, signature)
    for turned in (0.0, -2 * np.pi, 4 * np.pi):
        y = f.start + [0, 0, 0, 0, turned]
        call(0.0, y.ctypes.data, rates.ctypes.data, handle.user_data)
        assert rates == pytest.approx([0, -20, -400, -30 * y[4], -20], rel=1e-12)
        assert np.array_equal(rates, f(0.0, y))


def test_states_of_other_solvers_have_the_revolutions_of_a_state(wound):
    state = wound.reached(0.2)
    y = wound.rhs.at(state)
    assert y[4] == pytest.approx(angle_of_door(0.2)[0] - np.radians(170), abs=1e-6) and y[4] < -np.pi
    assert wound.rhs(0.2, y)[2:4] == pytest.approx(wound.accelerations(state)["A"], rel=1e-12)
    with pytest.raises(
        ModelError, match=r"\(q, u, angles in loads\) of 5 numbers, got shape \(4,\)\n.*rhs.at\(state\)"
    ):
        wound.rhs(0.2, y[:4])
    with pytest.raises(ModelError, match=r"expected states of shape \(1, 5\)"):
        wound.record([0.0], [y[:4]])


def test_a_time_after_the_event_that_ends_the_run_is_refused():
    model = build(
        symgen.Scene(
            **DOOR, events=[{"name": "edge", "of": "A.position.y", "value": "-0.5 m", "ends_run": True}]
        )
    )
    with pytest.raises(SimulationError, match="the event 'edge' ends the run at t = "):
        model.linearise(at=0.2)
