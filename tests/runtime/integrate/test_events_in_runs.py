"""Events in runs: their times, their order, and the runs they end."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from shared.linkages import G, at, ground, rod

import symgen
from symgen.runtime.integrate.integrators import INTEGRATORS
from symgen.runtime.result.files import load_result


def pendulum(*events, **tables):
    """A uniform rod of 1 m let go level."""
    tables = {
        "points": {"O": ground(0, 0), "A": at(1, 0)},
        "links": {"OA": rod("O", "A")},
        "gravity": {"acceleration": ["0 m/s^2", f"{-G!r} m/s^2"]},
        "events": list(events),
    } | tables
    return symgen.build(symgen.Scene(**tables))


def fallen(angle):
    """Time [s] at which the rod has turned down by an angle, by SciPy on theta'' = 3 g cos(theta) / 2."""
    run = solve_ivp(
        lambda _, y: [y[1], 1.5 * G * np.cos(y[0])], (0, 3), [0, 0], "DOP853", rtol=1e-13, atol=1e-14,
        dense_output=True,
    )  # fmt: skip
    return brentq(lambda t: run.sol(t)[0] - angle, 1e-6, 0.75, xtol=1e-15)


def options(name, tight=True):
    if INTEGRATORS[name].adaptive:
        return {"method": name, "rtol": 1e-11 if tight else 1e-6}
    return {"method": name, "step": 2e-4 if tight else 1e-2}


@pytest.mark.parametrize("name", ["dop853", "dopri5", "rk4", "taylor"])
def test_an_event_is_where_the_motion_says(name):
    model = pendulum({"name": "down", "of": "A.y", "value": "-0.6 m", "direction": "falling"})
    (event,) = model.simulate(0.6, **options(name)).events
    assert (event.name, event.rising) == ("down", False)
    assert event.time == pytest.approx(fallen(np.arcsin(0.6)), abs=1e-10)
    x, y = event.motion["A"]["position"]
    assert abs(y + 0.6) < 1e-14
    assert np.hypot(x, y) == pytest.approx(1, abs=1e-15)


@pytest.mark.parametrize("name", ["dop853", "dopri5", "rk4", "taylor"])
def test_the_error_of_an_event_is_that_of_the_run(name):
    model = pendulum({"name": "down", "of": "A.y", "value": "-0.6 m"})
    (event,) = model.simulate(0.6, **options(name, tight=False)).events
    assert abs(event.time - fallen(np.arcsin(0.6))) < 1e-5


def test_events_of_one_step_come_in_the_order_of_time():
    """Written in another order, and nearer to each other than any step."""
    heights = ["-0.32 m", "-0.3 m", "-0.31 m", "-0.300001 m"]
    model = pendulum(*({"name": f"e{i}", "of": "A.y", "value": h} for i, h in enumerate(heights)))
    result = model.simulate(0.6, rtol=1e-6)
    assert [e.name for e in result.events] == ["e1", "e3", "e2", "e0"]
    times = [e.time for e in result.events]
    assert times == sorted(times)
    assert times == pytest.approx([fallen(np.arcsin(y)) for y in (0.3, 0.300001, 0.31, 0.32)], abs=1e-6)


def test_directions():
    events = [{"name": d, "of": "A.x", "direction": d} for d in ("rising", "falling", "both")]
    result = pendulum(*events).simulate(3.0)
    found = {d: [e.time for e in result.events if e.name == d] for d in ("rising", "falling", "both")}
    assert len(found["falling"]) == 2 and len(found["rising"]) == 1
    assert sorted(found["rising"] + found["falling"]) == found["both"]
    quarter = fallen(np.pi / 2)
    assert found["both"] == pytest.approx([quarter, 3 * quarter, 5 * quarter], abs=1e-7)


def test_passing_and_coming_back_within_a_step_is_seen_between_looks():
    """The lowest point is passed in the middle of a step of 0.2 s; both crossings lie in it."""
    model = pendulum({"name": "low", "of": "A.y", "value": "-0.97 m"})
    quarter = fallen(np.pi / 2)
    result = model.simulate(1.0, step=0.25)
    assert [e.rising for e in result.events] == [False, True]
    assert np.mean([e.time for e in result.events]) == pytest.approx(quarter, abs=5e-2)


def test_a_touch_is_no_event():
    model = pendulum({"name": "lowest", "of": "A.y", "value": "-1.0000001 m"})
    assert model.simulate(1.0).events == ()


@pytest.mark.parametrize("of, value", [("A.y", "0 m"), ("A.x", "1 m"), ("A.vy", "0 m/s"), ("t", "0 s")])
@pytest.mark.parametrize("name", ["dop853", "taylor"])
def test_what_holds_at_the_start_is_no_event(of, value, name):
    model = pendulum({"name": "start", "of": of, "value": value})
    assert model.simulate(0.3, method=name).events == ()


@pytest.mark.parametrize("name", ["dop853", "taylor"])
def test_a_terminal_event_ends_the_run_there(name):
    model = pendulum(
        {"name": "late", "of": "A.y", "value": "-0.61 m"},
        {"name": "stop", "of": "A.y", "value": "-0.6 m", "ends_run": True},
        {"name": "early", "of": "A.y", "value": "-0.59 m"},
    )
    result = model.simulate(0.6, rtol=1e-9, samples=601, method=name)
    assert [e.name for e in result.events] == ["early", "stop"]
    end = fallen(np.arcsin(0.6))
    assert result.statistics["t"] == result.events[-1].time == pytest.approx(end, abs=1e-8)
    assert result.final == result.events[-1].motion
    assert result.time[-1] <= end < result.time[-1] + 1.1e-3
    assert result.notes == (f"the event 'stop' ended the run at t = {end:.9g} s",)
    whole = pendulum().simulate(0.6, rtol=1e-9, samples=601, method=name)
    count = len(result.time)
    assert np.array_equal(whole.time[:count], result.time)


def test_looking_changes_nothing():
    watched = pendulum({"name": "e", "of": "A.y", "value": "-0.5 m"}).simulate(1.0)
    plain = pendulum().simulate(1.0)
    assert watched.final == plain.final
    assert watched.statistics["steps"] == plain.statistics["steps"]


def test_more_events_than_the_core_remembers():
    rate = {"w": {"value": "1000 rad/s"}}
    model = pendulum({"name": "beat", "of": "sin(w*t)"}, parameters=rate)
    result = model.simulate(1.0, step=2e-4, samples=2)
    times = np.array([e.time for e in result.events])
    assert np.max(np.abs(times - np.pi * np.arange(1, len(times) + 1) / 1000)) < 1e-14
    assert len(times) == 318


def test_events_are_saved_and_summed_up(tmp_path):
    result = pendulum({"name": "e", "of": "A.y", "value": "-0.5 m"}).simulate(0.6)
    again = load_result(result.save(tmp_path / "run.npz"))
    assert again.events == result.events and len(again.events) == 1
    summary = json.loads(json.dumps(result.summary()))
    time = result.events[0].time
    assert summary["events"] == [{"name": "e", "time": time, "rising": False}]
    assert repr(result.events[0]) == f"LocatedEvent(name='e', time={time!r}, rising=False)"


def test_an_event_without_a_value_is_told():
    """An expression that is not defined everywhere may pass unseen: the result says so."""
    never = {"name": "never", "of": "asin(2 + (A.position.x/unit)**2)", "value": "0 rad"}
    run = pendulum(never, parameters={"unit": "1 m"}).simulate(0.1)
    assert not run.events
    assert any("the event 'never' has no finite value near t = 0 s" in note for note in run.notes)
