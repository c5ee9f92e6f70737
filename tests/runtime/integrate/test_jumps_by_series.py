"""Jumps of loads and angles in loads by polynomials over the steps of power series."""

from __future__ import annotations

import numpy as np
import pytest
from shared.linkages import at, ground, rod

import symgen
from symgen.errors import ModelError


def on_rail(force, speed=0.0, **tables):
    """A mass of 1 kg at x = 0.5 m of a rail along x, under a force along it."""
    scene = symgen.Scene(
        points={"O": ground(0, 0), "R": ground(9, 0), "A": at(0.5, 0)},
        links={"rail": {"points": ["O", "R"]}},
        guides=[{"points": ["A"], "along": "rail"}],
        masses=[{"point": "A", "mass": "1 kg"}],
        forces=[{"point": "A", "force": [force, "0 N"]}],
        start={"velocities": {"A": [f"{speed} m/s", "0 m/s"]}},
        analysis={"outputs": ["A.position", "A.velocity"]},
        **tables,
    )
    return symgen.build(scene)


def state(run):
    return run["A.position"].values[-1][0], run["A.velocity"].values[-1][0]


@pytest.mark.parametrize("rate", [3, 40, 700])
def test_no_jump_of_a_periodic_force_is_missed(rate):
    """Between jumps the motion is a parabola; the velocity is a triangular wave."""
    model = on_rail("F*sign(cos(w*t))", parameters={"F": "3 N", "w": f"{rate} rad/s"})
    end = 2.2
    run = model.simulate(end, samples=2, method="taylor", rtol=1e-11)
    jumps = (np.arange(int(rate)) + 0.5) * np.pi / rate
    times = np.concatenate([[0.0], jumps[jumps < end], [end]])
    lasting = np.diff(times)
    rates = np.concatenate([[0.0], np.cumsum(3.0 * lasting * (-1.0) ** np.arange(len(lasting)))])
    place = 0.5 + np.sum(lasting * (rates[1:] + rates[:-1]) / 2)
    assert state(run) == pytest.approx((place, rates[-1]), abs=1e-10)
    assert len(times) - 1 <= run.statistics["steps"] < 2 * len(times) + 10
    assert run.drift.energy < 1e-9


@pytest.mark.parametrize("rtol", [1e-12, 1e-9, 1e-6])
@pytest.mark.parametrize("apart", [1e-13, 1e-12, 1e-9, 1e-5])
def test_jumps_of_two_forces_at_almost_the_same_times(apart, rtol):
    """A step that begins just behind a jump does not take it for another one; the velocities are triangular waves."""
    rate, end = 50.0, 13.0
    parameters = {"F": "3 N", "G": "1 N", "w": f"{rate} rad/s", "h": f"{apart!r} rad"}
    model = on_rail("F*sign(sin(w*t)) + G*sign(sin(w*t - h))", parameters=parameters)
    run = model.simulate(end, samples=2, method="taylor", rtol=rtol)

    def triangle(angle):
        return np.arccos(np.cos(angle)) / rate

    velocity = 3 * triangle(rate * end) + triangle(rate * end - apart) - triangle(apart)
    assert state(run)[1] == pytest.approx(velocity, abs=1e-9)


def test_the_time_of_a_touch_has_no_derivatives():
    events = [{"name": "end", "of": "A.x", "value": "-0.5 m", "ends_run": True}]
    model = on_rail("-k*A.x", parameters={"k": {"value": "50 N/m", "tunable": True}}, events=events)
    with pytest.raises(ModelError, match="touches zero: this time has no derivatives"):
        model.sensitivity(["A.position.x"], ["k"], t_end=3.0, method="taylor", rtol=1e-9)


def test_a_stop_that_is_reached_and_left_within_a_step():
    """A stop of 1000 N/m at 1 m ends a swing of a spring of 1 N/m for a tenth of a second."""
    parameters = {"k": "1 N/m", "s": "1000 N/m", "a": "1 m"}
    model = on_rail("-k*A.x - s*max(A.x - a, 0*a)", 0.9, parameters=parameters)
    run = model.simulate(3.0, samples=2, method="taylor", rtol=1e-12)
    size = np.hypot(0.9, 0.5)
    speed, stiff = np.sqrt(size**2 - 1), np.sqrt(1001.0)
    reached = np.arcsin(1 / size) - np.arcsin(0.5 / size)
    lasting = (np.pi - 2 * np.arctan(1 / stiff / speed)) / stiff
    after = 3.0 - reached - lasting
    assert 0.09 < lasting < 0.11
    assert state(run)[0] == pytest.approx(np.cos(after) - speed * np.sin(after), abs=1e-9)
    assert run.statistics["steps"] < 20


def test_friction_reverses_where_the_motion_does():
    """50 N/m, 1 kg, 3 N: half swings about 0.06 and -0.06 m in turn, from 0.5 m; the third has 0.2 m."""
    model = on_rail("-k*A.x - F*sign(A.vx)", -1e-12, parameters={"k": "50 N/m", "F": "3 N"})
    run = model.simulate(1.1, samples=2, method="taylor", rtol=1e-12)
    assert state(run)[0] == pytest.approx(0.06 + 0.2 * np.cos(1.1 * np.sqrt(50.0)), abs=1e-8)
    assert run.statistics["steps"] < 20


def test_a_spring_is_wound_by_a_fast_rotor():
    """The angle is a sine of 8 revolutions; in a step it is that of no other revolution."""
    scene = symgen.Scene(
        parameters={"c": f"{1 / 3!r} N*m"},
        points={"O": ground(0, 0), "A": at(1, 0)},
        links={"OA": rod("O", "A")},
        torques=[{"link": "OA", "torque": "-c*OA.angle"}],
        start={"rates": {"OA": "50 rad/s"}},
        analysis={"outputs": ["OA.angle", "A.position"]},
    )
    model = symgen.build(scene)
    for samples in (4, 40):
        run = model.simulate(6.0, samples=samples, method="taylor", rtol=1e-12)
        assert run["OA.angle"].values == pytest.approx(50 * np.sin(run.time), abs=1e-8)
        assert run.drift.energy < 1e-8


def test_jumps_and_events_in_one_run():
    """The velocity is a triangular wave between 0.5 and -0.5 m/s."""
    event = {"name": "e", "of": "A.vx", "value": "0.25 m/s"}
    parameters = {"F": "1 N", "w": f"{np.pi!r} rad/s"}
    model = on_rail("F*sign(cos(w*t))", parameters=parameters, events=[event])
    few, many = (model.simulate(4.0, samples=n, method="taylor", rtol=1e-11) for n in (2, 301))
    assert few.events == many.events
    assert [e.time for e in few.events] == pytest.approx([0.25, 0.75, 2.25, 2.75], abs=1e-11)
    assert [e.rising for e in few.events] == [True, False, True, False]
