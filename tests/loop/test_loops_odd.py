"""Loops at the edges: motions that end or reach turning points, loads without a value, lost rank, odd arguments."""

from __future__ import annotations

import math

import numpy as np
import pytest

import symgen
from symgen.errors import CapabilityError, ModelError, RangeError, SimulationError

MASSES = {"crank": {"mass": "1 kg"}, "coupler": {"mass": "1 kg"}, "rocker": {"mass": "1 kg"}}
START = {"theta2": "60 deg", "theta3": "-150 deg", "theta4": "90 deg"}


def four_bar(motion="w*t", lengths=("0.1 m", "0.35 m", "0.3 m", "-0.4 m"), start=START, **loop):
    links = ("crank", "coupler", "rocker", "ground")
    rows = [
        {"joint": "R", "link": link, "theta": "?" if i else "theta1", "a": a}
        for i, (link, a) in enumerate(zip(links, lengths, strict=True))
    ]
    table = {"rows": rows, "inputs": {"theta1": motion}, "start": start, "links": MASSES, **loop}
    return symgen.build(
        symgen.Scene(parameters={"w": "1 rad/s", "tq": "1 N*m"}, loop=table).called("odd_four_bar")
    )


@pytest.fixture(scope="module")
def plain():
    return four_bar()


def test_an_input_that_ends_is_told_from_lost_rank():
    """Beyond 1 rad S5 has no value, though in the plane no entry of the closure but one shows it."""
    rows = [
        {"joint": "R", "link": "a", "theta": "theta1", "a": "1 m"},
        {"joint": "R", "link": "b", "theta": "?", "a": "1.5 m"},
        {"joint": "R", "link": "c", "theta": "?", "a": "1 m"},
        {"joint": "R", "link": "d", "theta": "?", "alpha": "90 deg"},
        {"joint": "P", "link": "ground", "S": "S5", "alpha": "-90 deg"},
    ]
    model = symgen.build(
        symgen.Scene(
            parameters={"w": "1 rad/s", "L": "1 m"},
            loop={
                "rows": rows,
                "inputs": {"theta1": "w*t", "S5": "0.4*L*sqrt(1 - theta1)**5 + 1.2*L"},
                "range": ["0 rad", "1.5 rad"],
                "start": {"theta2": "60 deg", "theta3": "60 deg", "theta4": "90 deg"},
            },
        ).called("ending_input")
    )
    assert np.isfinite(model.inverse_dynamics(at=[0.5]).variable("theta2").values).all()
    with pytest.raises(SimulationError, match="no finite value"):
        model.inverse_dynamics(at=[1.2])


def test_a_load_without_a_value_is_an_error():
    model = four_bar(drives={"theta4": "tq*sqrt(1 - theta1)"})
    assert np.isfinite(model.inverse_dynamics(at=[0.5]).variable("theta1.drive").values).all()
    with pytest.raises(SimulationError, match="no finite value"):
        model.inverse_dynamics(at=[1.4])


def test_a_pose_that_loses_rank_has_no_forces():
    """A parallelogram in line is assembled, reported and passed."""
    model = four_bar(
        lengths=("0.1 m", "0.4 m", "0.1 m", "-0.4 m"),
        start={"theta2": "-45 deg", "theta3": "225 deg", "theta4": "135 deg"},
        range=["45 deg", "400 deg"],
    )
    turn = model.inverse_dynamics(at=np.radians([170.0, 180.0, 190.0]))
    assert np.isfinite(turn.variable("theta3").values).all()
    for name in ("theta3.rate", "theta1.drive", "crank.joint1.force"):
        values = turn.variable(name).values.reshape(3, -1)
        assert np.isnan(values[1]).all() and np.isfinite(values[[0, 2]]).all(), name
    assert "180 deg the screws of the joints lose rank" in turn.notes[0]
    # Coupler parallel to the ground before and after: it did not fold over.
    parallel = turn.variable("theta1").values + turn.variable("theta2").values
    assert np.allclose(np.sin(parallel), 0.0, atol=1e-9) and np.allclose(
        np.cos(parallel), np.cos(parallel[0])
    )


def test_the_first_time_of_a_value(plain):
    """An input that goes back and forth on its way comes to a value the first time."""
    model = four_bar("w*t + 1.5*sin(3*w*t)", range=["0 rad", "6 rad"])
    at = np.array([0.5, 3.75, 4.0, 6.0])
    times = model.inverse_dynamics(at=at).time
    assert np.allclose(times + 1.5 * np.sin(3 * times), at, atol=1e-12)
    for value, time in zip(at, times, strict=True):
        earlier = np.linspace(0.0, time, 20_000)[:-1]
        assert np.all(earlier + 1.5 * np.sin(3 * earlier) < value)


@pytest.mark.parametrize(
    ("motion", "value", "time"),
    [("0.5*(w*t)**2", 2.0, 2.0), ("1 - cos(w*t)", 1.0, math.pi / 2), ("exp(w*t) - 1", 1.0, math.log(2))],
)
def test_motions_from_rest(motion, value, time):
    assert four_bar(motion, range=["0.1 rad", "0.2 rad"]).inverse_dynamics(at=[value]).time == pytest.approx(
        [time], rel=1e-14
    )


def test_a_value_the_motion_does_not_reach():
    with pytest.raises(RangeError, match="does not come to"):
        four_bar("1 - cos(w*t)", range=["0.1 rad", "0.2 rad"]).inverse_dynamics(at=[2.5])


def test_the_first_written_input_leads():
    rows = [
        {"joint": "C", "link": "crank", "theta": "theta1", "S": "s1", "a": "12 in"},
        {"joint": "S", "link": "rod", "theta": "?", "eta": "?", "a": "50 in"},
        {"joint": "S", "link": "slider", "theta": "?", "eta": "?", "alpha": "?"},
        {"joint": "P", "link": "ground", "S": "?", "alpha": "270 deg", "a": "10 in"},
    ]
    model = symgen.build(
        symgen.Scene(
            units={"length": "in"},
            parameters={"w": "1 rad/s", "v": "1 in/s"},
            loop={
                "rows": rows,
                "inputs": {"s1": "v*t", "theta1": "w*t"},
                "range": ["0 in", "5 in"],
                "start": {"S4": "40 in"},
            },
        ).called("lead")
    )
    turn = model.inverse_dynamics(samples=6)
    assert turn.input == "s1" and np.allclose(turn.variable("s1").values, 0.0254 * np.arange(6.0))
    assert np.allclose(turn.variable("theta1").values, np.arange(6.0))


def test_a_drive_without_hold_is_an_error():
    """In the plane eta2 never moves, so no torque about it can balance the crank."""
    rows = [
        {"joint": "R", "link": "crank", "theta": "theta1", "a": "0.3 m"},
        {"joint": "U", "link": "rod", "theta": "?", "eta": "?", "a": "1.25 m"},
        {"joint": "S", "link": "slider", "theta": "?", "eta": "?", "alpha": "?"},
        {"joint": "P", "link": "ground", "S": "?", "alpha": "270 deg"},
    ]
    body = {"mass": "1 kg", "inertia": ["1 kg*m^2", "1 kg*m^2", "1 kg*m^2"]}
    scene = symgen.Scene(
        parameters={"w": "1 rad/s", "tq": "1 N*m"},
        loop={
            "rows": rows,
            "inputs": {"theta1": "w*t"},
            "drives": {"theta1": "tq", "eta2": "?"},
            "start": {"S4": "1 m", "theta2": "125 deg", "theta3": "-125 deg", "alpha3": "90 deg"},
            "links": {"crank": body, "rod": body, "slider": body},
        },
    )
    with pytest.raises(ModelError, match="transmit no force to theta1"):
        symgen.build(scene.called("no_hold")).inverse_dynamics()


def test_through_with_a_negative_speed():
    turn = four_bar("-w*t").inverse_dynamics(samples=41, through=True)
    values = turn.coordinate.values
    assert values[0] == pytest.approx(0.0, abs=1e-12) and values[-1] == pytest.approx(2 * math.pi)
    assert turn.closure < 1e-13


@pytest.mark.parametrize(
    "call",
    [
        lambda m: m.inverse_dynamics(at="x"),
        lambda m: m.inverse_dynamics(at="1.0"),
        lambda m: m.inverse_dynamics(at=[]),
        lambda m: m.inverse_dynamics(at={}),
        lambda m: m.inverse_dynamics(at=[1 + 2j]),
        lambda m: m.inverse_dynamics(at=[math.nan]),
        lambda m: m.inverse_dynamics(at=[1e9]),
        lambda m: m.inverse_dynamics(samples="3"),
        lambda m: m.inverse_dynamics(samples=3.5),
        lambda m: m.inverse_dynamics(stop=math.inf),
        lambda m: m.inverse_dynamics(start=2.0, stop=1.0),
        lambda m: m.assemblies("x"),
        lambda m: m.with_parameters(nothing=1.0),
        lambda m: m.simulate(),
        lambda m: m.modes(),
        lambda m: symgen.build("cssp").simulate(samples="3"),
        lambda m: symgen.build("cssp").simulate(rtol="x"),
        lambda m: symgen.build("cssp").simulate(method=3),
        lambda m: symgen.build("slider_crank").with_parameters(a4="3 in"),
    ],
)
def test_odd_arguments_are_errors_of_symgen(plain, call):
    with pytest.raises((ModelError, CapabilityError)):
        call(plain)


def test_a_turn_in_a_few_words(plain):
    assert repr(plain.inverse_dynamics(at=[0.5, 1.0])).startswith(
        "<Turn 'odd_four_bar': 2 values of theta1, "
    )
