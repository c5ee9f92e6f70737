"""Events by polynomials over the steps of power series: none is missed, and touches of zero are reported."""

from __future__ import annotations

from functools import partial

import mpmath
import numpy as np
import pytest
from shared.linkages import at, ground, rod

import symgen
from symgen.errors import SimulationError


def bar(rate, events, **tables):
    """A uniform rod of 1 m at a rate, without gravity."""
    return symgen.Scene(
        points={"O": ground(0, 0), "A": at(1, 0)},
        links={"OA": rod("O", "A")},
        start={"rates": {"OA": f"{rate} rad/s"}},
        events=events,
        **tables,
    )


def thrown(*events, up=4.0, half="1 m", **options):
    """A point thrown upward at x = 1 m/s, with g = 8 m/s^2: y = up t - 4 t^2."""
    scene = symgen.Scene(
        parameters={"half": half},
        points={"O": ground(0, -9), "G": ground(1, -9), "A": at(0, 0)},
        links={"base": {"points": ["O", "G"]}},
        masses=[{"point": "A", "mass": "1 kg"}],
        gravity={"acceleration": ["0 m/s^2", "-8 m/s^2"]},
        start={"velocities": {"A": ["1 m/s", f"{up} m/s"]}},
        events=[{"name": f"e{i}", **event} for i, event in enumerate(events)],
    )
    return symgen.build(scene, **options)


#: Events of the falling rod as the scene writes them, with k = 1/m and w = 1 s, and by its angle and rate.
FALLEN = {
    "low": ("A.y", "-0.6 m", lambda a, r: mpmath.sin(a) + mpmath.mpf("0.6")),
    "below": ("A.x", "0 m", lambda a, r: mpmath.cos(a)),
    "fast": ("w*A.vy*A.x", "0.5 m^2", lambda a, r: r * mpmath.cos(a) ** 2 - mpmath.mpf("0.5")),
    "often": ("sin(9*k*A.x)", "0.25", lambda a, r: mpmath.sin(9 * mpmath.cos(a)) - mpmath.mpf("0.25")),
}


def exact_times(end):
    """Return the times of these events for a uniform rod of 1 m let go level, with g = 9.81 m/s^2, by 40 digits."""
    with mpmath.workdps(40):
        g = mpmath.mpf("9.81")
        motion = mpmath.odefun(lambda t, y: [y[1], -3 * g * mpmath.cos(y[0]) / 2], 0, [0, 0])
        times = [mpmath.mpf(k) * end / 300 for k in range(1, 301)]
        states = [motion(t) for t in times]
        found = {}
        for name, (_, _, function) in FALLEN.items():
            values = [function(*state) for state in states]
            changes = [k for k in range(299) if values[k] * values[k + 1] < 0]
            by_time = partial(lambda f, t: f(*motion(t)), function)
            found[name] = [
                float(mpmath.findroot(by_time, (times[k], times[k + 1]), solver="anderson", tol=1e-50))
                for k in changes
            ]
        return found


def test_all_zeros_of_a_falling_rod():
    """Against zeros between 300 places of a motion of 40 digits, also in quadruple precision."""
    exact = exact_times(1.5)
    scene = symgen.Scene(
        parameters={"k": "1 1/m", "w": "1 s"},
        points={"O": ground(0, 0), "A": at(1, 0)},
        links={"OA": rod("O", "A")},
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        events=[{"name": name, "of": of, "value": value} for name, (of, value, _) in FALLEN.items()],
    )
    for precision, rtol, error in (("float64", 1e-13, 2e-12), ("float128", 1e-26, 4e-16)):
        run = symgen.build(scene, precision=precision).simulate(1.5, samples=2, method="taylor", rtol=rtol)
        for name, times in exact.items():
            assert len(times) > 1
            assert [e.time for e in run.events if e.name == name] == pytest.approx(times, abs=error)


def test_two_events_in_one_step():
    """The point is a part of 1e-9 higher than the event for 3e-5 s; the motion is a polynomial, and one step."""
    height = "0.999999999 m"
    model = thrown({"of": "A.y", "value": height}, {"of": "A.y", "value": "0.5 m", "direction": "falling"})
    run = model.simulate(1.0, samples=2, method="taylor", rtol=1e-12)
    assert [(e.name, e.rising) for e in run.events] == [("e0", True), ("e0", False), ("e1", False)]
    wide = np.sqrt(1e-9) / 2
    exact = [0.5 - wide, 0.5 + wide, 0.5 + np.sqrt(0.5) / 2]
    assert [e.time for e in run.events] == pytest.approx(exact, abs=1e-11)


def test_a_touch_is_reported_as_one():
    """At its highest point, 1 m; not a part of 1e-9 above it. Where it ends the run, nothing follows."""
    touch = {"of": "A.y", "value": "1 m"}
    above = {"of": "A.y", "value": "1.000000001 m"}
    run = thrown(touch, above, {**touch, "direction": "falling"}).simulate(1.0, method="taylor", rtol=1e-12)
    assert [(e.name, e.rising) for e in run.events] == [("e0", None)]
    assert run.events[0].time == pytest.approx(0.5, abs=1e-7)
    assert run.events[0].motion["A"]["position"] == pytest.approx([0.5, 1.0], abs=1e-7)
    ended = thrown({**touch, "ends_run": True}).simulate(1.0, method="taylor", rtol=1e-12)
    assert ended.statistics["t"] == pytest.approx(0.5, abs=1e-7)
    assert thrown(touch).simulate(1.0, method="dop853", rtol=1e-12).events == ()


@pytest.mark.parametrize("longest", [0.5, 0.25, 0.125, 0.1, 0.05])
def test_a_touch_where_steps_join_is_one(longest):
    """Steps end at the highest point, on which rounding puts the value on one side or the other."""
    touch, back = {"of": "A.y", "value": "1 m"}, {"of": "A.x*A.y", "value": "0 m^2"}
    run = thrown(touch, back).simulate(1.25, method="taylor", rtol=1e-12, max_step=longest)
    assert [(e.name, e.rising) for e in run.events] == [("e0", None), ("e1", False)]
    assert [e.time for e in run.events] == pytest.approx([0.5, 1.0], abs=1e-7)
    other = thrown({**touch, "direction": "rising"}).simulate(
        1.25, method="taylor", rtol=1e-12, max_step=longest
    )
    assert [e.rising for e in other.events] in ([], [None])
    stepper = thrown(touch).stepper(method="taylor", rtol=1e-12)
    found = []
    for _ in range(round(1.25 / longest)):
        stepper.step(longest)
        found += stepper.events
    assert [e.rising for e in found] == [None]


@pytest.mark.parametrize("longest", [1.0, 0.25])
@pytest.mark.parametrize("late", [0.0, 1e-13, 1e-9])
def test_a_touch_where_the_run_ends_is_one(late, longest):
    """After a revolution; at the end of the run, x = 1 m is reached within rounding."""
    model = symgen.build(bar(1.0, [{"name": "top", "of": "A.x", "value": "1 m"}]))
    run = model.simulate(2 * np.pi + late, method="taylor", rtol=1e-12, max_step=longest)
    assert [e.rising for e in run.events] in ([[None], [True]] if late == 0.0 else [[None]])
    assert run.events[0].time == pytest.approx(2 * np.pi, abs=1e-7)


@pytest.mark.parametrize("longest", [0.5, 0.25, 0.1])
def test_a_crossing_where_steps_join_is_one(longest):
    """x = 0.5 m and, with the rate zero, (x - 0.5 m)^3 = 0 at t = 0.5 s."""
    events = [{"of": "A.x", "value": "0.5 m"}, {"of": "(A.x - half)**3", "value": "0 m^3"}]
    run = thrown(*events, half="0.5 m").simulate(1.0, method="taylor", rtol=1e-12, max_step=longest)
    assert sorted((e.name, e.rising) for e in run.events) == [("e0", True), ("e1", True)]
    assert [e.time for e in run.events] == pytest.approx([0.5, 0.5], abs=1e-4)
    assert min(abs(e.time - 0.5) for e in run.events) < 1e-11


def test_touches_and_crossings_of_a_fast_rotor():
    """Each revolution passes x = 0 twice and touches 1 m; there are fewer steps than these."""
    events = [{"name": "x", "of": "A.x"}, {"name": "far", "of": "A.x", "value": "1 m"}]
    outputs = ["OA.angle", "A.position"]
    model = symgen.build(bar(50, events, analysis={"outputs": outputs}))
    runs = [model.simulate(2.0, samples=5, method="taylor", rtol=10.0**-k) for k in range(6, 14)]
    assert {len(run.events) for run in runs} == {32 + 15}
    run = runs[5]
    assert run["OA.angle"].values == pytest.approx(np.linspace(0, 100, 5), abs=1e-8)
    assert run.statistics["steps"] < len(run.events)
    passed, far = ([e for e in run.events if e.name == name] for name in ("x", "far"))
    assert [e.time for e in passed] == pytest.approx((np.arange(32) + 0.5) * np.pi / 50, abs=1e-9)
    assert [e.rising for e in passed] == [False, True] * 16
    assert [e.time for e in far] == pytest.approx(np.arange(1, 16) * np.pi / 25, abs=1e-6)
    assert {e.rising for e in far} == {None}


def test_samples_and_checks_between_change_no_event():
    events = [{"name": "x", "of": "A.x"}, {"name": "y", "of": "A.y", "value": "0.3 m"}]
    model = symgen.build(bar(9, events))
    few, many = (model.simulate(3.0, samples=n, method="taylor", rtol=1e-9) for n in (2, 1000))
    assert few.events == many.events and len(few.events) == 18
    without = symgen.build(bar(9, [])).simulate(3.0, samples=2, method="taylor", rtol=1e-9)
    assert without.statistics["steps"] == few.statistics["steps"]


def test_an_angle_passes_a_value_once_and_a_terminal_event_ends_the_run():
    events = [
        {"name": "third", "of": "OA.angle", "value": "6*pi"},
        {"name": "late", "of": "A.x", "value": "0.9 m"},
    ]
    run = symgen.build(bar(20, events[:1])).simulate(3.0, method="taylor", rtol=1e-10)
    assert [e.time for e in run.events] == pytest.approx([6 * np.pi / 20], abs=1e-9)
    events[1]["ends_run"] = True
    run = symgen.build(bar(20, events)).simulate(3.0, method="taylor", rtol=1e-10)
    assert [e.name for e in run.events] == ["late"]
    assert run.statistics["t"] == pytest.approx(np.arccos(0.9) / 20, abs=1e-11)


def test_an_event_without_a_recurrence_is_looked_for_at_probes():
    """abs has none in events: steps are a quarter as long."""
    model = symgen.build(bar(9, [{"name": "e", "of": "abs(A.x)", "value": "0.5 m"}]))
    run = model.simulate(1.0, method="taylor", rtol=1e-9)
    exact = [k * np.pi / 3 / 9 for k in range(1, 9) if k % 3]
    assert [e.time for e in run.events] == pytest.approx(exact, abs=1e-8)


def test_such_an_event_leaves_the_others_to_their_series():
    """A fast rotor passes x = 0 several times within a quarter of a step, and touches 1 m."""
    events = [{"name": "x", "of": "A.x"}, {"name": "far", "of": "A.x", "value": "1 m"}]
    probed = {"name": "abs", "of": "abs(A.y)", "value": "0.5 m"}
    model = symgen.build(bar(50, [probed, *events]))
    assert [e.probed for e in model.description.events] == [True, False, False]
    run = model.simulate(2.0, samples=5, method="taylor", rtol=1e-11)
    passed, far = ([e.time for e in run.events if e.name == name] for name in ("x", "far"))
    assert passed == pytest.approx((np.arange(32) + 0.5) * np.pi / 50, abs=1e-9)
    assert far == pytest.approx(np.arange(1, 16) * np.pi / 25, abs=1e-6)
    assert run.events == model.simulate(2.0, samples=900, method="taylor", rtol=1e-11).events


def test_a_resumed_run_has_the_same_events(tmp_path):
    """Interrupted after each of some steps, with crossings and touches before and behind."""
    events = [{"name": "x", "of": "A.x"}, {"name": "far", "of": "A.x", "value": "1 m"}]
    model = symgen.build(bar(9, events))
    options = {"method": "taylor", "rtol": 1e-10, "samples": 7}
    whole = model.simulate(3.0, **options)
    assert {e.rising for e in whole.events} == {True, False, None}
    for steps in (1, 3, 5):
        file = tmp_path / f"after_{steps}"
        with pytest.raises(SimulationError, match="max_steps"):
            model.simulate(3.0, checkpoint=file, checkpoint_every=0, max_steps=steps, **options)
        again = model.simulate(3.0, resume=file, **options)
        assert again.events == whole.events and again.final == whole.final


def test_an_event_with_a_kink_stops_no_steps():
    """sqrt(1 - x) of a rotor is that of half its angle, without a sign: its series ends at every revolution."""
    event = {"name": "e", "of": "sqrt(1 - A.x/one)", "value": "0.7"}
    model = symgen.build(bar(9, [event], parameters={"one": "1 m"}))
    run = model.simulate(3.0, method="taylor", rtol=1e-10)
    turn = 2 * np.arcsin(0.7 / np.sqrt(2))
    angles = np.sort([2 * np.pi * k + side * turn for k in range(5) for side in (-1, 1)])
    exact = angles[(angles > 0) & (angles < 27)] / 9
    assert [e.time for e in run.events] == pytest.approx(exact, abs=1e-9)
    without = symgen.build(bar(9, [])).simulate(3.0, method="taylor", rtol=1e-10)
    assert run.statistics["steps"] < 4 * without.statistics["steps"]
