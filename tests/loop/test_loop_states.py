"""``[states]`` of loops of joints: a motor with a controller on the floating crank, against Lagrange's equations."""

from __future__ import annotations

from functools import cache
from io import StringIO

import numpy as np
import pytest
import sympy as sp
from rich.console import Console
from scipy.integrate import solve_ivp
from shared.floating_crank import INPUTS, PARAMETERS, PLACE, STATE, VALUES, forces, mass_matrix, slider
from shared.servo_loop import KE, KI, KM, KP, LIMIT, START, TARGET, L, R, servo

import symgen
from symgen.errors import ModelError, SceneError
from symgen.methods import table_of


@cache
def motion():
    """Return mass matrix and forces by state and torque, as functions of numbers."""
    values = {**VALUES, INPUTS[1]: 0}
    assert set(values) == {*PARAMETERS, INPUTS[1]}
    matrices = [mass_matrix().subs(values), forces().subs(values)]
    return sp.lambdify([*STATE, INPUTS[0]], matrices, "numpy", cse=True)


def minimal(t, y, resistance=R, limit=LIMIT, target=TARGET):
    angle, _, spin, drift, i, z = y
    mass, force = motion()(*y[:4], KM * i)
    second = np.linalg.solve(mass, np.ravel(force))
    voltage = np.clip(KP * (target - angle) + KI * z, -limit, limit)
    return [spin, drift, *second, (voltage - resistance * i - KE * spin) / L, target - angle]


def integrated(times, start=(np.pi / 4, 0.01, 0.0, 0.0, START, 0.0), **constants):
    found = solve_ivp(
        lambda t, y: minimal(t, y, **constants),
        (0, times[-1]),
        start,
        "DOP853",
        times,
        rtol=1e-12,
        atol=1e-13,
    )
    return found.y


@pytest.fixture(scope="module")
def model():
    return symgen.build(servo())


def states_of(run):
    return np.array([run[name].values for name in ("theta1", "S1", "i", "z")])


@pytest.mark.parametrize("method", ["taylor", "dop853"])
def test_motor_and_controller_are_those_of_lagranges_equations(model, method):
    """The voltage leaves its limit during the run, at a switching point that the run steps to."""
    run = model.simulate(0.8, samples=41, method=method, rtol=1e-11)
    times = run.coordinate.values
    exact = integrated(times)
    assert states_of(run) == pytest.approx(exact[[0, 1, 4, 5]], abs=2e-9)
    rates = np.array([minimal(0.0, y)[4] for y in exact.T])
    assert run["i.rate"].values == pytest.approx(rates, abs=2e-8 * np.max(np.abs(rates)))
    place = sp.lambdify([STATE[0], PLACE], slider().subs(VALUES), "numpy")(exact[0], exact[1])
    assert run["S4"].values == pytest.approx(place, abs=1e-9)
    assert any("[states] i" in note for note in run.notes)
    # a state has no power: the drive has that of its torque
    torque = 12 * (1 - exact[2] / (10 * np.pi)) + KM * exact[4]
    assert run["theta1.power"].values == pytest.approx(torque * exact[2], abs=1e-6)
    assert run.drift.energy < 1e-8


def test_other_solvers_steppers_and_states_begin_as_given(model):
    start = model.state({"theta1": 1.0, "S1": 0.005}, {"theta1": 2.0}, states={"i": -0.7})
    assert model.coordinates(start)["i"] == -0.7 and "i.integral" not in model.coordinates(start)
    times = np.linspace(0, 0.2, 5)
    exact = integrated(times, (1.0, 0.005, 2.0, 0.0, -0.7, 0.0))[[0, 1, 4, 5]]
    assert states_of(model.simulate(0.2, samples=5, state=start, rtol=1e-11)) == pytest.approx(
        exact, abs=1e-9
    )
    rhs, n = model.rhs, len(start.q)
    found = solve_ivp(rhs, (0, 0.2), [*start.q, *start.u], "DOP853", times, rtol=1e-12, atol=1e-13).y
    assert found[[0, 1, n + n - 2, n + n - 1]] == pytest.approx(exact, abs=1e-9)
    stepper = model.stepper(state=start, rtol=1e-11)
    for t in times[1:]:
        stepper.step(t - stepper.t)
    assert [stepper[name] for name in ("theta1", "S1", "i", "z")] == pytest.approx(exact[:, -1], abs=1e-9)
    assert "first-order states: 2" in model.mobility[0] and "8 variables" in model.mobility[0]


def test_a_loop_is_linearised_with_its_states():
    model = symgen.build(servo("kp*(target - theta1) + ki*z"))
    at = model.state({"theta1": 1.2, "S1": 0.02}, {"theta1": 3.0, "S1": -0.1}, states={"i": 0.4, "z": 0.1})
    found = model.linearise(at, outputs=["i", "S4", "i.rate"])
    assert found.states == ("theta1", "S1", "theta1'", "S1'", "i", "z") and found.units["z"] == "s"
    y, h = np.array([1.2, 0.02, 3.0, -0.1, 0.4, 0.1]), 1e-5
    slopes = np.array(
        [
            (8 * np.subtract(*(minimal(0, y + s * h * e, limit=np.inf) for s in (1, -1)))
             - np.subtract(*(minimal(0, y + 2 * s * h * e, limit=np.inf) for s in (1, -1)))) / (12 * h)
            for e in np.eye(6)
        ]
    ).T  # fmt: skip
    by_state, outputs = found.A, found.C
    assert by_state == pytest.approx(slopes, rel=1e-8, abs=1e-7 * np.max(np.abs(slopes)))
    assert outputs[[0, 2]] == pytest.approx(np.array([np.eye(6)[4], slopes[4]]), rel=1e-8, abs=1e-7)
    assert found.rates == pytest.approx(minimal(0, y, limit=np.inf), rel=1e-9)


def test_derivatives_along_a_run():
    model = symgen.build(servo("kp*(target - theta1) + ki*z"))
    found = model.sensitivity(["i", "theta1"], ["R", "target"], t_end=0.3, rtol=1e-11)

    def end(**constants):
        return integrated([0.0, 0.3], limit=np.inf, **constants)[[4, 0], -1]

    h = 1e-4
    by = [
        (
            8 * (end(**{name: x + h}) - end(**{name: x - h}))
            - (end(**{name: x + 2 * h}) - end(**{name: x - 2 * h}))
        )
        / (12 * h)
        for name, x in (("resistance", R), ("target", TARGET))
    ]
    assert found.derivatives[0] == pytest.approx(np.array(by).T, rel=1e-6)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"states": {"S4": {"start": 0, "rate": "theta1.rate"}}}, "variable of the loop"),
        ({"states": {"crank_": {"start": 0, "rate": "S9"}}}, "S9"),
        ({"states": {"rod": {"start": 0, "rate": "theta1.rate"}}}, "rod"),
        ({"states": {"x": {"start": 0, "rate": "theta1"}}}, "expected an angular velocity"),
        ({"states": {"x": {"start": "stall", "rate": "power_*theta1.rate"}}}, "power_"),
        ({"states": {"theta1_rate": {"start": 0, "rate": "theta1.rate"}}}, "reserved"),
        ({"states": {"mass_matrix": {"start": 0, "rate": "theta1.rate"}}}, "states. mass_matrix.*reserved"),
        (
            {"loop.links.crank.mass": "x*m_crank", "states": {"x": {"start": 0, "rate": "theta1.rate"}}},
            "x is a state",
        ),
    ],
)
def test_wrong_states_of_loops_are_named(change, text):
    with pytest.raises(SceneError, match=text):
        symgen.build("cssp", set=change)


def test_starts_are_constants_and_driven_loops_have_no_states(model):
    written = {"states": {"x": {"start": "stall", "rate": "stall*theta1.rate"}}}
    with pytest.raises(SceneError, match=r"states.x. start(.|\n)*tunable parameter stall"):
        symgen.build("cssp", set=written)
    with pytest.raises(SceneError, match=r"\[states\] x(.|\n)*inputs alone move the loop(.|\n)*loop.free"):
        symgen.build("rssr", set={"states": {"x": {"start": 0, "rate": "theta1.rate"}}})
    with pytest.raises(ModelError, match="no state 'j'"):
        model.state({}, states={"j": 1.0})


def test_the_table_of_a_run_has_states_by_their_names(model):
    run, text = model.simulate(0.05, samples=2), StringIO()
    table_of(model, "simulate")(run, model, Console(file=text, width=100))
    rows = [line.split() for line in text.getvalue().partition("Recorded")[0].splitlines()]
    values = {row[0]: row[1:] for row in rows if len(row) > 2}
    assert "i.integral" not in text.getvalue().partition("Recorded")[0]
    assert values["i"][0] == "1" and float(values["i"][1]) == pytest.approx(run["i"].values[-1], rel=1e-5)
    assert values["z"] == ["s", values["z"][1]]
