"""Steppers and sampled controllers of elastic links in large rotation.

The references are Lagrange's equations of one element, a beam on a hub in Hermite elements of its own, and the
rigid arm.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from shared.flexible_arms import (
    DENSITY,
    HUB,
    LENGTH,
    THIN,
    TIP,
    WIDTH,
    YOUNG,
    arm,
    built,
    one_element_matrices,
    spatial,
)
from shared.linkages import at

from symgen.errors import ModelError, OptionsError, SimulationError

GOAL, KP, KD, SAMPLE = 1.0, 8.0, 1.2, 4e-3


def steered(law="T", **more):
    """Return the tables of an arm in the plane whose hub the input T turns."""
    hub = [{"point": "tip", "mass": f"{TIP} kg"}, {"point": "O", "mass": "0 kg", "inertia": f"{HUB} kg*m^2"}]
    crank = {"link": "arm", "mode": "free", "speed": "0 rpm"}
    about = [{"link": "arm", "point": "O", "torque": law}]
    tables = arm(inputs={"T": "0 N*m"}, crank=crank, masses=hub, torques=about, **more)
    del tables["states"]
    return tables | {"analysis": {"outputs": ["tip.position", "arm.stress"]} | more.get("analysis", {})}


def torque(x, y, v, w):
    """Return the torque on the hub by the direction of the tip and its rate, from place and velocity."""
    return KP * (GOAL - np.arctan2(y, x)) - KD * (x * w - y * v) / (x * x + y * y)


@pytest.fixture(scope="module")
def model():
    return built(steered())


# -- in the plane ----------------------------------------------------------------------------------------------------


def one_element(times):
    """Return tip x, y and torque at sampling times: Lagrange's equations, with the torque held in between."""
    of, state, rows = one_element_matrices(), np.array([0.0, LENGTH, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]), []
    for t in times:
        acting = torque(state[1], state[2], state[5], state[6])
        rows.append([state[1], state[2], acting])

        def rates(_, s, acting=acting):
            mass, left = of(*s)
            force = -np.array(left, dtype=float)
            force[0] += acting
            return [*s[4:], *np.linalg.solve(mass, force)]

        state = solve_ivp(rates, (t, t + SAMPLE), state, "DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    return np.array(rows)


def test_an_arm_of_one_element_under_sampled_torque_has_lagranges_equations(model):
    stepper, rows = model.stepper(elements=1, rtol=1e-10), []
    times = SAMPLE * np.arange(51)
    n = len(stepper.y) // 2
    for _ in times:
        acting = torque(*stepper.y[:2], *stepper.y[n : n + 2])
        stepper.set(T=acting)
        rows.append([*stepper["tip.position"], acting])
        stepper.step(SAMPLE)
    exact = one_element(times)
    assert exact[-1, 1] > 0.2 and np.ptp(exact[:, 2]) > 5.0
    assert np.array(rows)[:, :2] == pytest.approx(exact[:, :2], abs=1e-8)
    assert np.array(rows)[:, 2] == pytest.approx(exact[:, 2], abs=5e-6)


def test_errors_fall_with_the_tolerance_and_with_fixed_steps(model):
    def end(**options):
        stepper = model.stepper(elements=1, **options)
        for k in range(5):
            stepper.set(T=3.0 * np.cos(0.4 * k))
            stepper.step(0.01)
        return stepper.y[:2]

    exact = end(step=0.01 / 512)
    loose, tight = (np.max(np.abs(end(rtol=rtol) - exact)) for rtol in (1e-4, 1e-9))
    assert tight < 5e-9 < loose < 1e-4
    coarse, fine = (np.max(np.abs(end(step=step) - exact)) for step in (0.01 / 64, 0.01 / 128))
    assert fine < 0.2 * coarse < 1e-8


def test_a_run_with_a_sampled_controller_is_the_steps_of_a_stepper(model, tmp_path):
    calls = []

    def law(t, view):
        n = len(view.y) // 2
        calls.append(t)
        return {"T": torque(*view["tip.position"], *view.y[n : n + 2])}

    run = model.simulate(0.1, controller=law, sample=SAMPLE, samples=51)
    assert calls == pytest.approx(SAMPLE * np.arange(25))
    stepper, n = model.stepper(), len(model.stepper().y) // 2
    for k in range(26):
        if k < 25:  # the last call is before the end
            stepper.set(T=torque(*stepper["tip.position"], *stepper.y[n : n + 2]))
        for name in ("tip.position", "arm.stress"):
            scale = np.max(np.abs(run[name].values))
            assert run[name].values[2 * k] == pytest.approx(stepper[name], abs=1e-9 * scale), name
        stepper.step(SAMPLE)
    assert run.notes[0] == f"a controller set T every {SAMPLE:g} s" and run.statistics["steps"] >= 25
    assert run.drift.constraint < 1e-9
    count = len(calls)
    run.animate(tmp_path / "run.html")
    assert len(calls) == count and "ends of links" in (tmp_path / "run.html").read_text()
    again = model.simulate(0.1, controller=law, sample=SAMPLE, samples=3)
    assert np.array_equal(again["tip.position"].values, run["tip.position"].values[::25])


def test_copies_and_resets_have_the_same_bits(model):
    stepper = model.stepper()

    def go(of, count):
        for k in range(count):
            of.set(T=2.0 + np.sin(k))
            of.step(SAMPLE)
        return of.t, *of.y, of["arm.stress"], *of.parameters.values()

    first = go(stepper, 6)
    other = stepper.copy()
    assert go(other, 5) == go(stepper, 5)
    stepper.reset()
    assert stepper.t == 0.0 and stepper.parameters["T"] == 0.0
    assert go(stepper, 6) == first
    state = stepper.state
    assert state.positions["tip"] == pytest.approx(stepper["tip.position"], abs=1e-15)
    other.reset(state)
    other.set(T=stepper.parameters["T"])
    assert np.array_equal(other.y, stepper.y) and other.t == stepper.t
    assert other["arm.stress"] == pytest.approx(stepper["arm.stress"], rel=1e-6)


def test_angles_in_loads_count_revolutions():
    """A torque of the shaft by its angle, beyond half a revolution: the motion of a run by the same parameter."""
    tables = steered("T - 0.3*this.angle*c")
    tables["parameters"]["c"] = "1 N*m"
    stepper = built(tables).stepper(elements=1)
    stepper.set(T=12.0)
    for _ in range(30):
        stepper.step(0.01)
    exact = built(tables | {"inputs": {"T": "12 N*m"}}).large_rotation(
        t_end=0.3, samples=7, elements=1, rtol=1e-5
    )
    x, y = exact["tip.position"].values.T
    assert np.unwrap(np.arctan2(y, x))[-1] > 1.2 * np.pi
    assert stepper["tip.position"] == pytest.approx(exact["tip.position"].values[-1], abs=1e-5)
    other = stepper.copy()
    for each in (stepper, other):
        each.step(0.01)
    assert np.array_equal(stepper.y, other.y)
    with pytest.raises(ModelError, match=r"count the revolutions.*\n.*copy\(\)"):
        stepper.reset(stepper.state)


# -- in space --------------------------------------------------------------------------------------------------------


RADIUS, THROW = 0.1, 2e-3


def in_space(elements=8, **more):
    """Return the hub in space with its elastic arm, turned by the input T."""
    tables = spatial(elements=elements, inputs={"T": "0 N*m"}, **more)
    del tables["states"]
    tables["torques"] = [{"link": "hub", "torque": ["0 N*m", "0 N*m", "T"]}]
    return built(tables | {"analysis": {"t_end": "0.1 s", "outputs": ["A.position", "B.position"]}})


def beam_on_hub(count):
    """Return M, K of a beam in Hermite elements on a hub, by its rotation, deflections and slopes."""
    size, part = 2 * count + 3, LENGTH / count
    bend, line = YOUNG * WIDTH * THIN**3 / 12, DENSITY * WIDTH * THIN
    mass, stiffness = np.zeros((2, size, size))
    h = part
    of_mass = line * h / 420 * np.array(
        [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h * h, 13 * h, -3 * h * h],
         [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h * h, -22 * h, 4 * h * h]]
    )  # fmt: skip
    of_bending = bend / h**3 * np.array(
        [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h],
         [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h * h, -6 * h, 4 * h * h]]
    )  # fmt: skip
    for k in range(count):
        at = slice(1 + 2 * k, 5 + 2 * k)
        mass[at, at] += of_mass
        stiffness[at, at] += of_bending
    mass[size - 2, size - 2] += TIP
    # The deflections are those from the line at rest: the first ones are R and 1 times the rotation.
    basis = np.zeros((size, size - 2))
    basis[0, 0], basis[1, 0], basis[2, 0] = 1.0, RADIUS, 1.0
    basis[3:, 1:] = np.eye(size - 3)
    mass[0, 0] = HUB
    return basis.T @ mass @ basis, basis.T @ stiffness @ basis


def of_beam(count, samples):
    """Return rotation of the hub and deflection of the tip at sampling times, under a sampled feedback."""
    mass, stiffness = beam_on_hub(count)
    n = len(mass)
    inverse = np.linalg.inv(mass)
    a = np.zeros((2 * n + 1, 2 * n + 1))
    a[:n, n : 2 * n], a[n : 2 * n, :n] = np.eye(n), -inverse @ stiffness
    a[n : 2 * n, -1] = inverse[:, 0]
    step, state, rows = expm(a * SAMPLE), np.zeros(2 * n + 1), []
    for _ in range(samples):
        rows.append([state[0], state[n - 2]])
        state[-1] = feedback(state[0], state[n])
        state = step @ state
    return np.array(rows)


def feedback(angle, rate):
    return 0.8 * (THROW - angle) - 0.05 * rate


def test_an_arm_in_space_under_sampled_torque_is_a_beam_on_a_hub():
    """Small rotations, which make the equations linear to a part of 1e-5; the error falls with the elements."""
    exact, errors = of_beam(32, 26), []
    assert of_beam(16, 26) == pytest.approx(exact, abs=2e-5 * THROW)
    for elements in (2, 4, 8):
        stepper, rows = in_space(elements).stepper(rtol=1e-8), []
        n = len(stepper.y) // 2
        for _ in range(26):
            (x, y, _), (v, w) = stepper["A.position"], stepper.y[n : n + 2]
            angle = np.arctan2(y, x)
            rows.append([angle, stepper["B.position"][1]])
            stepper.set(T=feedback(angle, (x * w - y * v) / (x * x + y * y)))
            stepper.step(SAMPLE)
        errors.append(np.max(np.abs(np.array(rows) - exact), axis=0) / np.max(np.abs(exact), axis=0))
    errors = np.array(errors)
    assert np.all(errors[1] < 0.2 * errors[0]) and np.all(errors[2] < 0.2 * errors[1])
    assert np.all(errors[2] < 1e-3)


def test_a_stepper_in_space_is_a_run_and_has_the_same_bits_again():
    model = in_space(2)
    run = model.simulate(
        0.04, controller=lambda t, v: {"T": 0.3 - 5.0 * v["A.position"][1]}, sample=0.01, samples=5
    )
    stepper = model.stepper()
    for k in range(4):
        stepper.set(T=0.3 - 5.0 * stepper["A.position"][1])
        stepper.step(0.01)
        assert run["B.position"].values[k + 1] == pytest.approx(stepper["B.position"], abs=1e-10)
    other = stepper.copy()
    for each in (stepper, other):
        each.set(T=-0.2)
        each.step(0.02)
    assert np.array_equal(stepper.y, other.y) and stepper["A.position"][1] > 1e-3
    first = stepper.y
    stepper.reset()
    for T in (0.3, *(0.3 - 5.0 * run["A.position"].values[1:4, 1])):
        stepper.set(T=float(T))
        stepper.step(0.01)
    stepper.set(T=-0.2)
    stepper.step(0.02)
    assert stepper.y == pytest.approx(first, abs=1e-9)


def test_events_are_those_of_a_run():
    model = in_space(2, events=[{"name": "up", "of": "A.y", "value": "2 mm", "ends_run": True}])
    run = model.simulate(0.2, controller=lambda t, view: {"T": 0.3}, sample=SAMPLE, samples=21)
    stepper = model.stepper()
    stepper.set(T=0.3)
    while stepper.ended is None:
        stepper.step(SAMPLE)
    (found,), (event,) = run.events, stepper.events
    assert event.name == "up" and stepper.ended == "up" and event.time == pytest.approx(found.time, rel=1e-9)
    assert stepper["A.position"][1] == pytest.approx(0.002, abs=1e-9) and 0.0 < run.time[-1] < event.time
    with pytest.raises(SimulationError, match="'up' has ended the motion"):
        stepper.step(SAMPLE)


# -- where inputs act ------------------------------------------------------------------------------------------------


def at_the_middle():
    """Return an arm with a force on its middle."""
    tables = steered()
    tables["points"]["mid"], tables["links"]["arm"]["points"] = at(LENGTH / 2, 0), ["O", "tip", "mid"]
    return tables | {"torques": [], "forces": [{"point": "mid", "force": ["0 N", "T/d"]}]}


def by_state():
    """Return an arm whose motor has a torque that follows the input with a lag, less by the angle of its shaft."""
    states = {"m": {"start": "0 N*m", "rate": "(T - 0.1*kp*arm.angle - m)/lag"}}
    outputs = ["tip.position", "m", "m.rate", "arm.torque"]
    return arm(inputs={"T": "0 N*m"}, states=states, analysis={"outputs": outputs})


def shaken():
    """Return the hub in space, with a force on the tip; the ground carries its reaction."""
    tables = spatial(elements=2, inputs={"T": "0 N*m"})
    tables["forces"] = [{"point": "B", "force": ["0 N", "0 N", "T/d"]}]
    outputs = ["m", "B.position", "input_power", "shaking_force", "shaking_moment"]
    return tables | {"analysis": {"t_end": "0.1 s", "outputs": outputs}}


@pytest.mark.parametrize("tables", [at_the_middle, by_state, shaken])
def test_inputs_act_as_parameters_of_the_scene_wherever_they_are(tables):
    scene = tables()
    scene["parameters"]["d"] = "0.5 m"
    model = built(scene)
    stepper, other, still = model.stepper(), model.with_parameters(T=2.0).stepper(), model.stepper()
    stepper.set(T=2.0)
    for each in (stepper, other, still):
        for _ in range(5):
            each.step(2e-3)
    for name in stepper.outputs:
        size = np.max(np.abs(other[name]))
        assert stepper[name] == pytest.approx(other[name], abs=1e-6 * size), name
        assert np.max(np.abs(still[name] - other[name])) > 1e-7 * size, name


# -- wrong calls -----------------------------------------------------------------------------------------------------


def test_what_steppers_and_controllers_of_elastic_links_lack(model):
    law = lambda t, view: {"T": 0.0}  # noqa: E731
    with pytest.raises(ModelError, match=r"expected sample.*\n.*expressions in loads, and \[states\]"):
        model.simulate(0.1, controller=law)
    with pytest.raises(ModelError, match=r"large rotation: linear theory.*\n  Leave out"):
        model.simulate(0.1, controller=law, sample=0.01, method="newmark")
    with pytest.raises(ModelError, match="has no inputs"):
        built(arm()).simulate(0.1, controller=law, sample=0.01)
    with pytest.raises(OptionsError, match="fixed steps have no tolerance"):
        model.stepper(step=1e-3, rtol=1e-6)
    with pytest.raises(ModelError, match="rtol"):
        model.stepper(rtol=-1.0)
    stepper = model.stepper()
    with pytest.raises(ModelError, match=r"set inputs, not lag\n.*with_parameters"):
        stepper.set(lag=0.03)
    with pytest.raises(ModelError, match=r"expected a state of \d+ unknowns of .*, got 2"):
        stepper.reset(replace(stepper.state, q=np.zeros(2), u=np.zeros(2)))
    with pytest.raises(SimulationError, match="the controller failed at t = 0 s.*'U' is no input"):
        model.simulate(0.1, controller=lambda t, v: {"U": 1.0}, sample=0.01)
    with pytest.raises(ModelError, match="checkpoint"):
        model.simulate(0.1, controller=law, sample=0.01, checkpoint="run.npz")


# -- what is refused, and what is not ------------------------------------------------------------------------------


def rooted():
    """Return the arm with a torque that is no number where the input is negative."""
    return built(steered(law="sqrt(T/unit)*unit", parameters={"unit": "1 N*m"}))


def test_an_input_without_a_finite_load_changes_nothing():
    stepper = rooted().stepper(elements=1, step=1e-3)
    stepper.set(T=0.1)
    stepper.step(1e-3)
    twin = stepper.copy()
    with pytest.raises(SimulationError, match="not a finite number at t = 0.001 s"):
        stepper.set(T=-1.0)
    assert stepper.parameters["T"] == 0.1
    stepper.step(1e-3), twin.step(1e-3)
    assert np.array_equal(stepper.y, twin.y)


def test_the_samples_before_an_input_without_a_finite_load_are_kept():
    with pytest.raises(SimulationError, match="not a finite number") as failed:
        rooted().simulate(
            0.02, controller=lambda t, view: {"T": -1.0 if t > 0.005 else 0.1}, sample=0.01, samples=5
        )
    partial = failed.value.partial
    assert np.isfinite(partial["tip.position"].values).all()
    assert partial.time[-1] == 0.01


def test_a_state_off_its_constraints_is_refused():
    stepper = in_space(1).stepper(step=1e-3)
    state = stepper.state
    moved = state.q.copy()
    moved[1] += 0.05
    with pytest.raises(ModelError, match="violates constraints by 0.0"):
        stepper.reset(replace(state, q=moved))


def test_steps_shorter_than_any_division_are_compared_once(model):
    short = model.stepper(elements=1, rtol=1e-6)
    short.step(2e-4)
    run = model.simulate(2e-4, controller=lambda t, view: {}, sample=2e-4, max_step=1e-8, samples=2)
    assert np.allclose(run["tip.position"].values[-1], short["tip.position"], rtol=0, atol=1e-9)
