"""``simulate(controller=...)`` without a sampling interval, against minimal equations in SciPy."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from shared import double_pendulum
from shared.ball_poles import CASE, CRANK, Straight
from shared.controlled import CART, CART_POLE, POLE, PUSHED_MASS, cart_pole, four_bar_with_torque
from shared.floating_crank import INPUTS, STATE, VALUES, forces, mass_matrix
from shared.floating_crank import scene as floating_crank
from shared.linkages import G

import symgen
from symgen.errors import ModelError, SimulationError

OUTPUTS = ["C.position", "C.velocity", "pole.angle", "pole.angular_velocity", "forces.0.force", "energy"]
SCENE = CART_POLE.model_copy(update={"analysis": CART_POLE.analysis.model_copy(update={"outputs": OUTPUTS})})
GAIN = np.array([-1.0, -35.0, -2.6, -8.2])
TIMES = np.array([0.0, 0.0137, 0.2, 0.71234, 1.5])
TIGHT = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}


def rates(y, force, torque=0.0):
    """Return dy/dt of place, clockwise angle from the vertical and their rates, by Lagrange's equations."""
    c, inertia = POLE * 0.5 / 2, POLE * 0.5**2 / 3
    _, theta, v, omega = y
    mass = [[CART + POLE, c * np.cos(theta)], [c * np.cos(theta), inertia]]
    right = [force - 0.3 * v + c * np.sin(theta) * omega**2, c * G * np.sin(theta) + torque]
    return [v, omega, *np.linalg.solve(mass, right)]


@pytest.fixture(scope="module")
def cart():
    return symgen.build(SCENE)


def tilted(model):
    y, _ = cart_pole(model, 0.1, 0.3, 0.0, 0.0)
    return model.state({"C": y[:2], "P": y[2:4]})


def measured(view):
    angle, rate = view["pole.angle"], view["pole.angular_velocity"]
    return np.array([view["C.position.x"], np.pi / 2 - angle, view["C.velocity.x"], -rate])


@pytest.mark.parametrize(
    "options",
    [
        {"rtol": 1e-11},
        {"method": "dopri5", "rtol": 1e-10},
        {"method": "rk4", "step": 1e-3},
        {"rtol": 1e-11, "stabilisation": "baumgarte"},
    ],
)
def test_a_state_feedback_is_that_of_an_independent_integration(cart, options):
    run = cart.simulate(
        1.5,
        state=tilted(cart),
        controller=lambda _, view: {"F": -GAIN @ measured(view)},
        t_eval=TIMES,
        **options,
    )
    other = solve_ivp(lambda _, y: rates(y, -GAIN @ y), (0, 1.5), [0.1, 0.3, 0, 0], t_eval=TIMES, **TIGHT).y
    v = {name: run[name].values for name in OUTPUTS}
    rows = [
        v["C.position"][:, 0],
        np.pi / 2 - v["pole.angle"],
        v["C.velocity"][:, 0],
        -v["pole.angular_velocity"],
    ]
    assert np.array(rows) == pytest.approx(other, abs=1e-8)
    assert v["forces.0.force"][:, 0] == pytest.approx(-GAIN @ other - 0.3 * other[2], abs=1e-7)
    assert run.notes[0] == "a controller set F, T in every evaluation"
    assert run.drift.energy < 1e-7


def test_results_do_not_depend_on_samples_and_are_repeated_at_other_times(cart):
    def law(t, view):
        assert len(view.y) == 4 * 2 and view.t == t and view.parameters["F"] == 0.0
        assert view.state.positions["P"] == pytest.approx(view.y[2:4])
        return {"F": -35.0 * (view["pole.angle"] - np.pi / 2) * (1.0 + 0.1 * np.sin(20.0 * t))}

    options = {"state": tilted(cart), "controller": law, "rtol": 1e-8}
    few, many = (cart.simulate(1.0, samples=k, **options) for k in (2, 101))
    for name in OUTPUTS:
        assert np.array_equal(few[name].values, many[name].values[[0, -1]]), name
        assert np.array_equal(few.at([0.3, 0.5])[name].values, many[name].values[[30, 50]]), name
    force = lambda t, y: 35.0 * y[1] * (1.0 + 0.1 * np.sin(20.0 * t))  # noqa: E731
    found = solve_ivp(
        lambda t, y: [*rates(y[:4], force(t, y)), force(t, y) * y[2]], (0, 1), [0.1, 0.3, 0, 0, 0], **TIGHT
    )
    drag = solve_ivp(
        lambda t, y: [*rates(y[:4], force(t, y)), -0.3 * y[2] ** 2], (0, 1), [0.1, 0.3, 0, 0, 0], **TIGHT
    )
    energy = many["energy"].values
    assert energy[-1] - energy[0] == pytest.approx(found.y[4, -1] + drag.y[4, -1], abs=1e-6)
    assert few.averages()["energy"].mean == pytest.approx(many.averages()["energy"].mean, rel=1e-9)


def test_angles_count_revolutions(cart):
    """A torque turns the pole by two revolutions, and holds it there."""

    def law(_, view):
        return {"T": -1.0 * (view["pole.angle"] - 4.5 * np.pi) - 0.2 * view["pole.angular_velocity"]}

    def torque(y):  # clockwise; the scene's -T acts counterclockwise
        return -1.0 * (np.pi / 2 - y[1] - 4.5 * np.pi) + 0.2 * y[3]

    run = cart.simulate(4.0, state=tilted(cart), controller=lambda t, v: {"T": -law(t, v)["T"]}, rtol=1e-11)
    other = solve_ivp(lambda _, y: rates(y, 0.0, -torque(y)), (0, 4), [0.1, 0.3, 0, 0], **TIGHT).y[:, -1]
    assert run["pole.angle"].values[-1] == pytest.approx(np.pi / 2 - other[1], abs=1e-8)
    assert run["pole.angle"].values.max() > 4.0 * np.pi


def test_inputs_that_a_call_omits_have_the_values_of_the_model(cart):
    model = cart.with_parameters(T=0.05)
    run = model.simulate(1.0, state=tilted(cart), controller=lambda _, v: {"F": 1.0}, samples=2, rtol=1e-10)
    other = model.with_parameters(F=1.0).simulate(1.0, state=tilted(cart), samples=2, rtol=1e-10)
    for name in OUTPUTS:
        assert run[name].values == pytest.approx(other[name].values, abs=1e-8), name


def test_a_law_of_the_controller_is_that_of_the_scene():
    """A viscous torque on the crank of a four-bar linkage, from the controller and from the scene."""
    scene = four_bar_with_torque()
    law = {
        "parameters": {"constant": "0.7 N*m", "drag": "0.4 N*m*s/rad"},
        "torques": [{"link": "crank", "torque": "constant - drag*crank.rate"}],
    }
    analysis = {"outputs": ["crank.angle", "crank.angular_velocity", "C.reaction"]}
    data = scene.model_dump(exclude_unset=True) | {"analysis": analysis}
    given = symgen.build(symgen.Scene(**{k: v for k, v in data.items() if k != "inputs"} | law))
    model = symgen.build(symgen.Scene(**data))
    run = model.simulate(
        3.0, controller=lambda _, v: {"T": 0.7 - 0.4 * v["crank.angular_velocity"]}, rtol=1e-11, samples=5
    )
    other = given.simulate(3.0, rtol=1e-11, samples=5)
    for name in analysis["outputs"]:
        assert run[name].values == pytest.approx(other[name].values, abs=1e-7), name


def test_parameters_of_a_user_defined_system_may_follow_from_its_state():
    """Damping of a double pendulum that grows with the height of its end, an output independent of it."""
    model = symgen.build(double_pendulum.__file__)
    run = model.simulate(2.0, controller=lambda _, v: {"c": 0.3 + 0.2 * v["height"]}, rtol=1e-11, samples=3)
    m, l = 1.5, 0.5

    def slope(_, y):
        a, b, v, w = y
        c = 0.3 - 0.2 * l * (np.cos(a) + np.cos(b))
        mass = m * l**2 * np.array([[2.0, np.cos(a - b)], [np.cos(a - b), 1.0]])
        turning = m * l**2 * np.sin(a - b)
        right = -m * 9.81 * l * np.array([2 * np.sin(a), np.sin(b)]) + turning * np.array([-(w**2), v**2])
        return [v, w, *np.linalg.solve(mass, right - [c * v, 0.0])]

    other = solve_ivp(slope, (0, 2), [1.0, 0.0, 0.0, 0.5], t_eval=[0, 1, 2], **TIGHT).y
    heights = -l * (np.cos(other[0]) + np.cos(other[1]))
    assert run["height"].values == pytest.approx(heights, abs=1e-8)


def test_events_end_a_run():
    """A mass of 2 kg on a rail, pushed by 8 N (1 + t): x = 2 t^2 + (2/3) t^3."""
    run = symgen.build(PUSHED_MASS).simulate(controller=lambda t, _: {"F": 8.0 * (1.0 + t)}, samples=10)
    _, end = run.events
    assert 2.0 * end.time**2 + 2.0 / 3.0 * end.time**3 == pytest.approx(4.5, abs=1e-8)


def test_outputs_that_follow_from_inputs_are_refused(cart):
    with pytest.raises(SimulationError, match=r"at t = 0 s.*forces\.0\.force depends on F") as caught:
        cart.simulate(1.0, controller=lambda _, v: {"F": v["forces.0.force"][0]})
    assert isinstance(caught.value.__cause__, ModelError)


@pytest.mark.parametrize(("begin", "recorded"), [(0.0, False), (0.5, True)])
def test_an_exception_names_its_time(cart, begin, recorded):
    def law(t, view):
        if t >= begin:
            raise ValueError("no sensor")
        return {"F": 0.0}

    with pytest.raises(SimulationError, match="controller failed at t = .* ValueError: no sensor") as caught:
        cart.simulate(1.0, state=tilted(cart), controller=law)
    assert (caught.value.partial is not None) == recorded
    if recorded:
        assert np.isfinite(caught.value.partial["energy"].values).all()


def test_ctrl_c_in_a_controller_ends_the_run(cart):
    def law(t, view):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cart.simulate(1.0, state=tilted(cart), controller=law)
    assert cart.simulate(0.1, state=tilted(cart)).statistics["steps"]


@pytest.mark.parametrize("value", [float("nan"), "much", 1j])
def test_wrong_inputs_end_a_run(cart, value):
    with pytest.raises(SimulationError, match="expected a finite number for F"):
        cart.simulate(1.0, state=tilted(cart), controller=lambda *_: {"F": value})


@pytest.mark.parametrize("method", ["taylor", "radau5", "rattle"])
def test_methods_that_need_more_than_accelerations_are_refused(cart, method):
    options = {"step": 1e-3} if method == "rattle" else {}
    with pytest.raises(ModelError, match=f"{method} needs more of a controller"):
        cart.simulate(1.0, state=tilted(cart), controller=lambda *_: {"F": 0.0}, method=method, **options)


def test_many_runs(cart):
    law = lambda _, view: {"F": -GAIN @ (measured(view) - [0.1, 0.0, 0.0, 0.0])}  # noqa: E731
    rows = cart.simulate_many(parameters={"c": [0.1, 0.5]}, t_end=0.5, controller=law, rtol=1e-10, samples=2)
    for c, found in zip((0.1, 0.5), rows["C.position"].values[:, -1, 0], strict=True):
        other = solve_ivp(
            lambda _, y, c=c: rates(y, -GAIN @ (y - [0.1, 0, 0, 0]) + (0.3 - c) * y[2]), (0, 0.5), [0, 0, 0, 0],
            **TIGHT,
        )  # fmt: skip
        assert found == pytest.approx(other.y[0, -1], abs=1e-8)


@pytest.mark.parametrize("past", [1e-2, 0.0])
def test_a_loop_of_one_freedom_is_its_reduced_equation_past_poles_of_balls(past):
    """A slider-crank in space: 2.5 revolutions, held there; angles of its balls have poles once per revolution."""
    straight, target = Straight(CRANK + past), 5.5 * np.pi
    written = tomllib.loads(CASE.read_text())
    written |= {"inputs": {"M": "0 N*m"}}
    written["loop"]["drives"] = {"theta1": "M"}
    written["analysis"]["outputs"] = [
        "theta1",
        "theta1.rate",
        "theta1.power",
        "S4",
        "S4.rate",
        "S4.acceleration",
    ]
    model = symgen.build(symgen.Scene(**written)).with_parameters(offset=CRANK + past)
    seen = []

    def law(t, view):
        rates = view["S4.rate"], view["theta1.rate"]
        seen.append((view["theta1"], view["S4"], *rates, *view.y[[0, 6]], view.state.u[0]))
        return {"M": 9.0 * (target - view["theta1"]) - 2.0 * rates[1] - 3.0 * rates[0] + view["S4"]}

    def torque(y):
        place, first, _ = straight.slider(y[0])
        return 9.0 * (target - y[0]) - 2.0 * y[1] - 3.0 * first * y[1] + place

    def slope(_, y, h=1e-3):
        beside = [straight.mass(y[0] + k * h) for k in (-2, -1, 1, 2)]
        by_angle = (beside[0] - 8 * beside[1] + 8 * beside[2] - beside[3]) / (12 * h)
        return [y[1], (torque(y) - by_angle * y[1] ** 2 / 2) / straight.mass(y[0])]

    times = np.array([0.0, 0.21, 0.8, 1.7, 3.0])
    run = model.simulate(3.0, controller=law, t_eval=times, rtol=1e-11, atol=1e-12)
    exact = solve_ivp(slope, (0, 3), [np.pi / 2, 5.0], t_eval=times, **TIGHT).y
    assert exact[0].max() > 4.5 * np.pi
    assert np.array([run["theta1"].values, run["theta1.rate"].values]) == pytest.approx(exact, abs=1e-8)
    assert run["S4"].values == pytest.approx(straight.slider(exact[0])[0], abs=1e-9)
    effort = np.array([torque(y) for y in exact.T])
    assert run["theta1.power"].values == pytest.approx(effort * exact[1], abs=1e-6)
    angle, place, moving, rate, *other = np.array(seen).T
    assert np.array(other) == pytest.approx(np.array([angle, place, rate]), abs=1e-12)
    slider, first, _ = straight.slider(angle)
    assert np.max(np.abs(place - slider)) < 1e-3  # stages are next to the closure
    assert np.max(np.abs(moving - first * rate)) < 0.05
    assert run.drift.energy < 1e-6 and run.notes[0] == "a controller set M in every evaluation"


def test_a_loop_of_two_freedoms_is_lagranges_equations():
    """The pump on a floating crank: torque and force of a state feedback, over three revolutions of the crank."""
    mass_and_forces = sp.lambdify(
        [*STATE, *INPUTS], [m.subs(VALUES) for m in (mass_matrix(), forces())], cse=True
    )
    goal = 6.5 * np.pi

    def inputs(t, angle, place, spin, drift):
        return 8.0 * (goal - angle) - 1.5 * spin, 300.0 * np.sin(angle) * place - 20.0 * drift + np.cos(3 * t)

    def slope(t, y):
        mass, force = mass_and_forces(*y, *inputs(t, *y))
        return [*y[2:], *np.linalg.solve(mass, np.ravel(force))]

    def law(t, view):
        return dict(
            zip("MF", inputs(t, *(view[n] for n in ("theta1", "S1", "theta1.rate", "S1.rate"))), strict=True)
        )

    scene = floating_crank()
    analysis = scene.analysis.model_copy(update={"outputs": ["theta1", "S1", "theta1.rate", "S1.rate", "S4"]})
    model = symgen.build(scene.model_copy(update={"analysis": analysis}))
    times = np.array([0.0, 0.37, 1.0, 2.0])
    exact = solve_ivp(slope, (0, 2), [np.pi / 4, 0.01, 0, 0], t_eval=times, **TIGHT).y
    assert exact[0, -1] > 6.0 * np.pi
    run = model.simulate(2.0, controller=law, t_eval=times, rtol=1e-11, atol=1e-12)
    found = np.array([run[name].values for name in ("theta1", "S1", "theta1.rate", "S1.rate")])
    assert found == pytest.approx(exact, abs=1e-8)
    few = model.simulate(2.0, controller=law, samples=2, rtol=1e-11, atol=1e-12)
    assert few["S4"].values[-1] == run["S4"].values[-1]
    with pytest.raises(ModelError, match="taylor needs more of a controller"):
        model.simulate(2.0, controller=law, method="taylor")


def test_outputs_of_a_loop_that_follow_from_inputs_are_refused():
    changes = {"inputs.M": "0 N*m", "loop.drives.theta1": "stall*(1 - theta1.rate/top) + M"}
    model = symgen.build("cssp", set=changes | {"analysis.outputs": ["theta1.acceleration"]})
    with pytest.raises(SimulationError, match=r"theta1\.acceleration depends on M"):
        model.simulate(0.01, controller=lambda _, v: {"M": v["theta1.acceleration"]})
