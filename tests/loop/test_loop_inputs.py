"""Loops with inputs: state-space models, right-hand side and matrices at any state, against Lagrange's equations."""

from __future__ import annotations

import tomllib

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from shared.floating_crank import (
    ANGLE,
    DRIFT,
    INPUTS,
    PLACE,
    SPIN,
    STATE,
    VALUES,
    accelerations_by,
    numbers,
    scene,
    slider,
)
from shared.in_numpy import build

import symgen
from symgen.errors import CapabilityError, ModelError, SceneError, SimulationError
from symgen.runtime.result.state import State
from symgen.scene.loading import shipped_scene

AT = {ANGLE: 1.2, PLACE: 0.02, SPIN: 3.0, DRIFT: -0.1, INPUTS[0]: 0, INPUTS[1]: 2, **VALUES}


@pytest.fixture(scope="module")
def model():
    return build(scene())


@pytest.fixture(scope="module")
def state(model):
    return model.state({"theta1": 1.2, "S1": 0.02}, {"theta1": 3.0, "S1": -0.1})


@pytest.fixture(scope="module")
def exact():
    """Accelerations of angle and place, and their derivatives by state and inputs."""
    return accelerations_by([*STATE, *INPUTS], AT)


@pytest.fixture(scope="module")
def by_slider():
    return np.array([float(slider().diff(x).subs(AT)) for x in (ANGLE, PLACE)])


def test_a_spatial_loop_has_its_state_space_model_at_a_state_in_motion(model, state, exact, by_slider):
    found = model.linearise(state, outputs=["S4", "theta1", "S4.acceleration"])
    assert found.states == ("theta1", "S1", "theta1'", "S1'") and found.inputs == ("M", "F")
    assert found.units["F"] == "N" and found.u.tolist() == [0.0, 2.0]
    assert found.rates == pytest.approx([3.0, -0.1, *exact[:, 0]], rel=1e-12)
    assert found.A[2:] == pytest.approx(exact[:, 1:5], rel=1e-11)
    assert found.B[2:] == pytest.approx(exact[:, 5:], rel=1e-11) and not found.B[:2].any()
    assert found.C[0] == pytest.approx([*by_slider, 0.0, 0.0], rel=1e-12)
    assert found.D[2] == pytest.approx(by_slider @ exact[:, 5:], rel=1e-11) and not found.D[:2].any()
    assert found.state_space.B.shape == (4, 2)


def test_other_joint_variables_may_be_the_coordinates(model, state, exact, by_slider):
    found = model.linearise(state, ["F"], coordinates=["S4", "S1"])
    assert found.states == ("S4", "S1", "S4'", "S1'")
    assert found.B[2:, 0] == pytest.approx([by_slider @ exact[:, 6], exact[1, 6]], rel=1e-11)
    turned = np.linalg.inv(np.array([by_slider, [0.0, 1.0]]))
    with mp.workdps(40):
        mass = np.array(numbers(AT)[0].tolist(), dtype=float)
    assert model.mass_matrix(state) == pytest.approx(mass, rel=1e-12)
    assert model.mass_matrix(state, coordinates=["S4", "S1"]) == pytest.approx(
        turned.T @ mass @ turned, rel=1e-11
    )


def test_the_right_hand_side_takes_inputs_and_agrees_with_runs(model, state, exact):
    f, y = model.rhs, np.concatenate([state.q, state.u])
    free = [8 + [v.name for v in model.description.variables].index(name) for name in ("theta1", "S1")]
    assert f.inputs == ("M", "F")
    assert f(0.0, y)[free] == pytest.approx(exact[:, 0], rel=1e-11)
    assert f(0.0, y, [5.0, 2.0])[free] == pytest.approx(exact[:, 0] + 5.0 * exact[:, 5], rel=1e-11)
    motion = solve_ivp(f, (0.0, 0.1), f.start, method="DOP853", rtol=1e-11, atol=1e-13)
    end = f.project(0.1, motion.y[:, -1])
    run = model.simulate(0.1, rtol=1e-11)
    assert end[:8] == pytest.approx(
        [run.final[v.name]["value"] for v in model.description.variables], rel=1e-8
    )
    here = model.linearise(0.1)
    there = model.linearise(
        model.state({v: run.final[v]["value"] for v in ("theta1", "S1")},
                    {v: run.final[v]["rate"] for v in ("theta1", "S1")})
    )  # fmt: skip
    assert here.t == 0.1 and here.x == pytest.approx(there.x, rel=1e-7)
    assert pytest.approx(there.A, rel=1e-6) == here.A


def test_the_jacobian_has_the_motions_of_the_closed_loop_as_its_null_space(model, state):
    jacobian = model.jacobian(state)
    assert jacobian.shape == (6, 8)
    assert np.max(np.abs(jacobian @ state.u)) < 1e-13 * np.max(np.abs(state.u))
    assert np.linalg.matrix_rank(jacobian) == 6


def test_frequencies_of_a_four_bar_are_those_of_its_points_and_links():
    written = tomllib.loads(shipped_scene("planar_4r"))
    written["loop"] |= {"inputs": {}, "free": {"theta1": {"at": "20 deg"}}}
    loop = build(symgen.Scene(**written, analysis={"t_end": "1 s"}))
    rods = build(
        symgen.Scene(
            points={
                "O": {"at": [0, 0], "ground": True},
                "A": {"at": ["0.1 m", 0]},
                "B": {"at": ["0.3 m", "0.3 m"]},
                "C": {"at": ["0.4 m", 0], "ground": True},
            },
            links={
                name: {"points": list(ends), "length": f"{length} m", "mass": f"{length} kg"}
                for name, ends, length in (
                    ("crank", "OA", 0.1),
                    ("coupler", "AB", 0.35),
                    ("rocker", "CB", 0.3),
                )
            },
            gravity={"acceleration": [0, "-9.81 m/s^2"]},
        )
    )
    rest = rods.equilibrium()
    x, y = rest.state.positions["A"]
    angle = float(np.arctan2(y, x))
    pose = loop.state({"theta1": angle})
    direction = pose.q[0] + pose.q[1]  # of the coupler
    end = rest.state.positions["A"] + 0.35 * np.array([np.cos(direction), np.sin(direction)])
    assert end == pytest.approx(rest.state.positions["B"], abs=1e-9)
    assert abs(loop.linearise(pose).rates[1]) < 1e-7
    poles = loop.linearise(pose).poles
    frequency = rods.modes(rest).frequencies[-1]
    assert poles.imag.max() / (2 * np.pi) == pytest.approx(frequency, rel=1e-9)
    by_rocker = loop.linearise(
        pose, coordinates=["theta4"]
    )  # at rest in balance poles do not depend on these
    assert by_rocker.poles.imag.max() / (2 * np.pi) == pytest.approx(frequency, rel=1e-9)


def test_runs_start_from_a_state(model):
    """A run in two parts, and the energy of a run from a state: that of the state, with the work since."""
    whole = model.simulate(0.2, rtol=1e-11, samples=2)
    half = model.simulate(0.1, rtol=1e-11, samples=2).final
    names = ("theta1", "S1")
    given = ({name: half[name][of] for name in names} for of in ("value", "rate"))
    rest = model.simulate(0.2, rtol=1e-11, samples=2, state=model.state(*given, t=0.1))
    assert rest.time[0] == 0.1 and rest.final["theta1"]["value"] == pytest.approx(
        whole.final["theta1"]["value"], rel=1e-9
    )
    assert rest["S4"].values[0] == pytest.approx(half["S4"]["value"], rel=1e-12)
    open_ = model.state({"theta1": 1.0})
    open_.q[-1] += 0.01
    with pytest.raises(ModelError, match="does not close cssp_driven"):
        model.simulate(0.1, state=open_)


def test_linkages_are_linearised_at_a_time_of_their_run():
    linkage = build("four_bar")
    run = linkage.simulate(0.2, samples=2).final
    names = linkage.description.free
    state = linkage.state(*({p: run[p][of] for p in names} for of in ("position", "velocity")), t=0.2)
    here, there = (linkage.linearise(at, coordinates=["crank.angle"]) for at in (0.2, state))
    assert here.t == 0.2 and np.array_equal(here.A, there.A) and here.x[1] != 0.0


def test_states_and_names_that_a_loop_does_not_have_are_refused(model, state):
    with pytest.raises(ModelError, match="there is no free or dependent variable 'theta9'"):
        model.state({"theta9": 0.0})
    with pytest.raises(ModelError, match="there is no free variable 'S4'"):
        model.state(rates={"S4": 1.0})
    with pytest.raises(
        SimulationError, match=r"does not close at theta1 = .*S1 = .* on the way from its start"
    ):
        model.state({"S1": 2.0})
    with pytest.raises(ModelError, match="has no input 'G'"):
        model.linearise(inputs=["G"])
    with pytest.raises(ModelError, match="expected 2 independent coordinates"):
        model.linearise(coordinates=["S4"])
    with pytest.raises(ModelError, match="does not close cssp_driven: by 8.7e-02"):
        moved = state.q.copy()
        moved[-1] += 0.043
        model.linearise(State(0.0, moved, state.u, {}, {}))
    with pytest.raises(CapabilityError, match="does not support rhs: its inputs prescribe its motion"):
        _ = build("planar_4r").rhs


def test_names_of_inputs_are_not_those_of_variables():
    written = tomllib.loads(shipped_scene("cssp"))
    for name, problem in (("S4", "is a variable of the loop"), ("stall", "is a parameter already")):
        with pytest.raises(SceneError, match=problem):
            build(symgen.Scene(**written, inputs={name: "0 N*m"}))
    with pytest.raises(SceneError, match="theta1' is an input already"):
        build(symgen.Scene(**written, inputs={"theta1": "0 N*m"}))
    written["loop"]["links"]["crank"]["mass"] = "M"
    with pytest.raises(SceneError, match="M is an input, and inputs may occur in forces and torques alone"):
        build(symgen.Scene(**written, inputs={"M": "1 kg"}))


def test_an_input_of_a_driven_loop_is_a_load_that_is_set():
    written = tomllib.loads(shipped_scene("planar_4r"))
    written["loop"]["loads"] = [{"link": "rocker", "torque": [0, 0, "T"]}]
    driven = build(symgen.Scene(**written, inputs={"T": "0 N*m"}))
    torques = [
        driven.with_parameters(T=value).inverse_dynamics(at=[1.0])["theta1.drive"].values[0]
        for value in (0.0, 1.0)
    ]
    speeds = driven.kinematics(at=[1.0])
    # the load turns the rocker by minus the rate of the joint to the ground: the power of both is zero
    ratio = -speeds["theta4.rate"].values[0] / speeds["theta1.rate"].values[0]
    assert torques[1] - torques[0] == pytest.approx(-ratio, rel=1e-10)
