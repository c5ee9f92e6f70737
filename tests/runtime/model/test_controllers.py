"""``simulate(controller=..., sample=...)`` and ``model.coordinates``, against minimal equations in SciPy."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from shared.controlled import CART, CART_POLE, POLE, PUSHED_MASS, SPATIAL_PENDULUM, cart_pole
from shared.linkages import G, at, ground, rod

import symgen
from symgen.errors import CapabilityError, ModelError, ResultError, SimulationError

OUTPUTS = {
    "outputs": ["C.position", "C.velocity", "pole.angle", "pole.angular_velocity", "forces.0.force", "energy"]
}
SCENE = CART_POLE.model_copy(update={"analysis": CART_POLE.analysis.model_copy(update=OUTPUTS)})
#: Gains of the force on the cart by place, angle from the vertical, and their rates; its limit [N].
GAIN, LIMIT = np.array([-1.0, -35.0, -2.6, -8.2]), 6.0
SAMPLE, END = 0.01, 1.5
#: Times of records, none of which but the first and the last is one of the controller.
TIMES = np.array([0.0, 0.0137, 0.2, 0.20471, 0.71234, 1.31, 1.5])


class PidWithAntiWindup:
    """A state feedback with an integral of the place, which stops where the force is at its limit."""

    def __init__(self):
        self.integral, self.calls = 0.0, []

    def force(self, t, measured):
        wanted = -GAIN @ measured + 0.8 * self.integral
        force = min(LIMIT, max(-LIMIT, wanted))
        if force == wanted:
            self.integral += SAMPLE * (0.3 - measured[0])
        self.calls.append((t, force))
        return force

    def __call__(self, t, view):
        measured = view["C.position.x"], np.pi / 2 - view["pole.angle"], view["C.velocity.x"]
        return {"F": self.force(t, np.array([*measured, -view["pole.angular_velocity"]]))}


def rates(y, force):
    """Return dy/dt of place, clockwise angle from the vertical and their rates, by Lagrange's equations."""
    c, inertia = POLE * 0.5 / 2, POLE * 0.5**2 / 3
    _, theta, v, omega = y
    mass = [[CART + POLE, c * np.cos(theta)], [c * np.cos(theta), inertia]]
    right = [force - 0.3 * v + c * np.sin(theta) * omega**2, c * G * np.sin(theta)]
    return [v, omega, *np.linalg.solve(mass, right)]


@pytest.fixture(scope="module")
def reference():
    """States at ``TIMES``, and the controller's calls: sample by sample in SciPy."""
    controller, y, found = PidWithAntiWindup(), np.array([0.1, 0.3, 0.0, 0.0]), []
    for k in range(round(END / SAMPLE)):
        t, end = k * SAMPLE, (k + 1) * SAMPLE
        force = controller.force(t, y)
        inside = [x for x in TIMES if t <= x < end] + [end]
        part = solve_ivp(
            lambda t, y, force=force: rates(y, force), (t, end), y, t_eval=inside, method="DOP853", rtol=1e-12,
            atol=1e-13,
        )  # fmt: skip
        found += [*part.y.T[:-1]]
        y = part.y[:, -1]
    return np.array([*found, y]), controller


@pytest.fixture(scope="module")
def cart():
    return symgen.build(SCENE)


def tilted(model, x=0.1, theta=0.3):
    y, _ = cart_pole(model, x, theta, 0.0, 0.0)
    return model.state({"C": y[:2], "P": y[2:4]})


def measured(run):
    """Return the minimal coordinates of a run, (times, 4)."""
    v = {name: run[name].values for name in OUTPUTS["outputs"][:4]}
    angles = np.pi / 2 - v["pole.angle"], -v["pole.angular_velocity"]
    return np.array([v["C.position"][:, 0], angles[0], v["C.velocity"][:, 0], angles[1]]).T


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"rtol": 1e-11}, 1e-8),
        ({"method": "taylor", "rtol": 1e-11}, 1e-8),
        ({"method": "radau5", "rtol": 1e-10}, 1e-8),
        ({"method": "rk4", "step": 1e-3}, 1e-8),
        ({"method": "rk4", "step": 0.7e-3}, 1e-8),  # steps that do not divide the sample
    ],
)
def test_pid_with_anti_windup_is_that_of_an_independent_integration(cart, reference, options, error):
    states, controller = reference
    own = PidWithAntiWindup()
    run = cart.simulate(END, state=tilted(cart), controller=own, sample=SAMPLE, t_eval=TIMES, **options)
    assert measured(run) == pytest.approx(states, abs=error)
    assert np.array(own.calls) == pytest.approx(np.array(controller.calls), abs=1e-7)
    forces = dict(controller.calls)
    assert max(abs(f) for f in forces.values()) == LIMIT and min(abs(f) for f in forces.values()) < LIMIT
    held = [forces[max(t for t in forces if t <= x + 1e-9)] for x in TIMES]
    drag = 0.3 * run["C.velocity"].values[:, 0]
    assert run["forces.0.force"].values[:, 0] == pytest.approx(held - drag, abs=1e-7)
    assert run.notes[0] == "a controller set F, T every 0.01 s"


def test_energy_changes_by_the_work_of_the_controller(cart):
    """The work of the force, by quadrature over the velocity of an independent integration."""
    law = PidWithAntiWindup()
    run = cart.simulate(0.5, state=tilted(cart), controller=law, sample=0.05, samples=2, rtol=1e-12)
    y, work = np.array([0.1, 0.3, 0.0, 0.0]), 0.0
    for t, force in law.calls:
        part = solve_ivp(
            lambda _, y, force=force: rates(y, force), (t, t + 0.05), y, method="DOP853", dense_output=True, rtol=1e-12,
            atol=1e-13,
        )  # fmt: skip
        work += quad(
            lambda x, f=force, p=part: (f - 0.3 * p.sol(x)[2]) * p.sol(x)[2], t, t + 0.05, epsabs=1e-12
        )[0]
        y = part.y[:, -1]
    energy = run["energy"].values
    assert abs(work) > 0.1 and energy[-1] - energy[0] == pytest.approx(work, abs=1e-8)
    assert run.drift.energy < 1e-9


def test_a_run_records_events_and_ends_at_one():
    """A mass of 2 kg on a rail, pushed by 4 N, then 8 N: x = t^2, then 1 + 2 (t - 1) + 2 (t - 1)^2."""
    calls = []

    def push(t, view):
        calls.append((t, view.t, view.y[0], view.parameters["F"], view.outputs, view.state.positions["P"][0]))
        return {"F": 4 if t < 1 else np.float32(8)}

    run = symgen.build(PUSHED_MASS).simulate(controller=push, sample=0.25, samples=10)
    assert [e.name for e in run.events] == ["first", "last"]
    assert [e.time for e in run.events] == pytest.approx([0.5, 1 + (np.sqrt(8) - 1) / 2], abs=1e-9)
    assert run["P.position"].values[:, 0] == pytest.approx([0.0, 1.0], abs=1e-9)
    assert [c[0] for c in calls] == pytest.approx(np.arange(8) * 0.25)
    t, now, x, force, outputs, place = calls[6]
    assert (
        t == now == 1.5 and x == place == pytest.approx(2.5) and force == 8.0 and outputs == ("P.position",)
    )
    assert calls[4][3] == 4.0  # the force held so far


def test_a_run_is_repeated_with_the_inputs_of_its_controller(cart, tmp_path):
    """Dense output, averages and animations repeat a run; the controller, whose memory has changed, is not called."""
    own = PidWithAntiWindup()
    run = cart.simulate(END, state=tilted(cart), controller=own, sample=SAMPLE, samples=11, rtol=1e-9)
    calls = len(own.calls)
    times = np.linspace(0, END, 11)
    again = run.at([*times[:4], 0.4711, *times[4:]])
    for name in ("C.position", "pole.angle", "forces.0.force", "energy"):
        assert np.array_equal(np.delete(again[name].values, 4, axis=0), run[name].values), name
    run.animate(tmp_path / "run.html")
    assert run.averages() and len(own.calls) == calls
    with pytest.raises(ResultError, match="runs with a controller have no gradient"):
        run.gradient(["pole.angle"], ["c"], coordinates=["C.position.x", "pole.angle"])


def test_a_loop_under_a_sampled_drive():
    """Against the right-hand side of the same loop in SciPy, sample by sample."""
    changes = {"inputs.M": "0 N*m", "loop.drives.theta1": "stall*(1 - theta1.rate/top) + M"}
    changes["analysis.outputs"] = ["theta1", "theta1.rate", "theta1.acceleration"]
    pump = symgen.build("cssp", set=changes)

    def law(t, view):
        return {"M": 3.0 * np.sin(40 * t) - 0.1 * view["theta1.rate"]}

    run = pump.simulate(0.06, controller=law, sample=0.01, rtol=1e-11, samples=4)
    f, place = pump.rhs, [v.name for v in pump.description.variables].index("theta1")
    y, n, found, torque = f.start, len(f.start) // 2, [], 0.0
    for k in range(7):
        torque = 3.0 * np.sin(0.4 * k) - 0.1 * y[n + place] if k < 6 else torque
        found.append([y[place], y[n + place], f(0.01 * k, y, [torque])[n + place]])
        options = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-12}
        y = solve_ivp(lambda t, y, u=torque: f(t, y, [u]), (0.01 * k, 0.01 * k + 0.01), y, **options).y[:, -1]
    values = np.array([run[name].values for name in ("theta1", "theta1.rate", "theta1.acceleration")]).T
    assert values == pytest.approx(np.array(found)[::2], rel=1e-7, abs=1e-7)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ({"G": 1.0}, r"'G' is no input\. Known: F, T"),
        ({"c": 1.0}, r"'c' is no input"),
        ({1: 1.0}, r"1 is no input"),
        ({"F": np.nan}, "expected a finite number for F, got nan"),
        ({"F": "2 N"}, "expected a finite number for F, got '2 N'"),
        ({"F": [2.0]}, "expected a finite number for F"),
        ({"F": True}, "expected a finite number for F"),
        (None, r"expected a dict of inputs, such as \{'F': 2\.0\}, got None"),
        (2.0, "expected a dict of inputs"),
    ],
)
def test_wrong_inputs_end_a_run_with_their_time(cart, value, text):
    def late(t, view):
        return {"F": 1.0} if t < 0.295 else value

    with pytest.raises(SimulationError, match=r"the controller failed at t = 0\.3 s: " + text) as caught:
        cart.simulate(1.0, controller=late, sample=0.1, samples=21)
    assert caught.value.time == pytest.approx(0.3)
    assert caught.value.partial.coordinate.values[-1] == pytest.approx(0.3)


def test_an_exception_of_a_controller_names_its_time(cart):
    def broken(t, view):
        return {"F": 1 / (t - 0.5)}

    with pytest.raises(SimulationError, match=r"t = 0\.5 s: ZeroDivisionError: .*division by zero") as caught:
        cart.simulate(1.0, controller=broken, sample=0.25)
    assert isinstance(caught.value.__cause__, ZeroDivisionError)
    with pytest.raises(SimulationError, match=r"t = 0 s: .* has no output 'pole.angel'"):
        cart.simulate(1.0, controller=lambda t, view: {"F": view["pole.angel"]}, sample=0.25)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"sample": 0.0}, "sample to be a finite number above zero"),
        ({"sample": -1.0}, "sample to be a finite number above zero"),
        ({"sample": np.inf}, "finite number for sample"),
        ({"sample": 1e-30}, "too short"),
        ({"sample": 0.1, "checkpoint": "run.npz"}, "checkpoint"),
    ],
)
def test_options_of_controllers_are_checked(cart, options, text):
    with pytest.raises(ModelError, match=text):
        cart.simulate(1.0, controller=lambda t, view: {}, **options)


def test_a_sampling_interval_needs_a_controller_and_a_controller_inputs(cart):
    with pytest.raises(ModelError, match="sample is the sampling interval of a controller"):
        cart.simulate(1.0, sample=0.1)
    with pytest.raises(ModelError, match="has no inputs for a controller"):
        symgen.build("four_bar").simulate(1.0, controller=lambda t, view: {}, sample=0.1)
    with pytest.raises(ModelError, match="has no inputs for a controller"):
        symgen.build("thesis_four_bar").simulate(controller=lambda t, view: {}, sample=0.1)


def test_many_runs_take_a_controller(cart):
    """Each with the bits of a single run; a run without inputs from its controller is that without one."""

    def law(t, view):
        return {"F": -20.0 * view["C.position.x"]}

    data = cart.simulate_many(
        {"c": [0.1, 0.3]}, t_end=0.3, controller=law, sample=0.05, samples=4, outputs=["C.position"]
    )
    run = cart.with_parameters(c=0.1).simulate(0.3, controller=law, sample=0.05, samples=4)
    assert np.array_equal(data["C.position"].values[0], run["C.position"].values)
    free = cart.simulate(0.3, method="dop853", samples=4)
    assert np.array_equal(
        cart.simulate(0.3, controller=lambda t, view: {}, sample=0.3, samples=4)["C.position"].values,
        free["C.position"].values,
    )


def test_an_input_may_be_an_array_without_axes(cart):
    runs = [
        cart.simulate(0.1, controller=lambda t, view, f=f: {"F": f}, sample=0.05, samples=3)[
            "C.position"
        ].values
        for f in (2.0, np.array(2.0))
    ]
    assert np.array_equal(*runs)


class Integral:
    """A force that grows with the integral of the distance from the place 1 m, as at the samples of 10 ms."""

    def __init__(self):
        self.sum = 0.0

    def __call__(self, t, view):
        self.sum += 0.01 * (1.0 - view["C.position.x"])
        return {"F": 5.0 * (1.0 - view["C.position.x"]) + 20.0 * self.sum}


def weighed(place, integral, t, view):
    return integral(t, {"C.position.x": view[place]})


@pytest.fixture(scope="module")
def slide():
    """A mass m on a rail, pushed by F."""
    return symgen.build(
        symgen.Scene(
            parameters={"m": {"value": "1 kg", "tunable": True}},
            inputs={"F": "0 N"},
            points={"A": ground(-1, 0), "B": ground(1, 0), "C": at(0, 0)},
            links={"rail": {"points": ["A", "B"]}},
            masses=[{"point": "C", "mass": "m"}],
            guides=[{"points": ["C"], "along": "rail"}],
            forces=[{"point": "C", "force": ["F", 0]}],
            gravity={"acceleration": [0, 0]},
            analysis={"outputs": ["C.position.x"]},
        )
    )


def ends_of_discrete_runs(masses):
    """Places after 1 s: under a constant force over a sample, x and v change by closed forms."""
    places = []
    for mass in masses:
        x = v = total = 0.0
        for _ in range(100):
            total += 0.01 * (1.0 - x)
            a = (5.0 * (1.0 - x) + 20.0 * total) / mass
            x, v = x + 0.01 * v + 0.5e-4 * a, v + 0.01 * a
        places.append(x)
    return places


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize(
    "form", [lambda c: c, lambda c: c.__call__, lambda c: partial(weighed, "C.position.x", c)]
)
def test_every_one_of_many_runs_begins_with_the_memory_of_the_controller_given(slide, threads, form):
    controller, masses = Integral(), [1.0, 1.0, 2.0, 1.0]
    run = slide.simulate_many(
        {"m": masses}, t_end=1.0, controller=form(controller), sample=0.01, threads=threads
    )
    assert run["C.position.x"].values[:, -1] == pytest.approx(ends_of_discrete_runs(masses), abs=1e-9)
    assert controller.sum == 0.0


def test_sweeps_and_optimisations_give_each_run_a_controller_of_its_own(slide):
    options = {"analysis": "simulate", "t_end": 1.0, "sample": 0.01}
    swept = slide.sweep(
        {"m": [1.0, 1.0, 2.0]}, controller=Integral(), outputs=["C.position.x"], reduce="final", **options
    )
    expected = ends_of_discrete_runs([1.0, 1.0, 2.0])
    assert swept["C.position.x.final"].values == pytest.approx(expected, abs=1e-9)
    found = slide.optimise({"m": (1.0, 3.0)}, "C.position.x.final", controller=Integral(), **options)
    assert found.objective == pytest.approx(min(ends_of_discrete_runs(np.linspace(1, 3, 401))), abs=1e-4)


def test_stores_of_sweeps_have_no_controller(cart, tmp_path):
    """Two laws may have one name, so that a store would take results of one for those of the other."""
    options = {"controller": lambda t, view: {"F": 0.0}, "sample": 0.1, "t_end": 0.2}
    with pytest.raises(ModelError, match=r"cannot know whether a controller is still the same\n.*NAME.csv"):
        cart.sweep({"F": [0.0, 1.0]}, analysis="simulate", file=tmp_path / "runs.zarr", **options)
    assert not any(tmp_path.iterdir())


def test_a_controller_without_copies_is_refused_by_many_runs(slide):
    controller = Integral()
    controller.f = slide.rhs
    with pytest.raises(ModelError, match=r"copy of the controller .*\n?.*right-hand side cannot be copied"):
        slide.simulate_many({"m": [1.0]}, t_end=1.0, controller=controller, sample=0.01)


# -- coordinates ---------------------------------------------------------------------------------------------------


def test_coordinates_are_those_of_the_linear_model(cart):
    theta, omega = 0.3, -1.7
    y, _ = cart_pole(cart, 0.2, theta, 0.5, omega)
    found = cart.coordinates(y)
    exact = {
        "C.position.x": 0.2,
        "C.position.x'": 0.5,
        "pole.angle": np.pi / 2 - theta,
        "pole.angle'": -omega,
    }
    assert {name: found[name] for name in exact} == pytest.approx(exact, abs=1e-14)
    assert all(type(x) is float for x in found.values())
    plant = cart.linearise(coordinates=["C.position.x", "pole.angle"])
    start = cart.coordinates(cart.initial_state())
    assert [start[name] for name in plant.states] == pytest.approx(plant.x, abs=1e-14)
    rows = cart.coordinates(np.array([y, y, 0 * y + y]))
    assert rows["pole.angle"] == pytest.approx(np.full(3, np.pi / 2 - theta), abs=1e-14)


def test_coordinates_invert_the_state_of_a_linkage():
    model = symgen.build("four_bar")
    state = model.state({"crank.angle": 1.1}, {"crank.angle": 3.0})
    found = model.coordinates(state)
    assert (found["crank.angle"], found["crank.angle'"]) == pytest.approx((1.1, 3.0), abs=1e-10)
    again = model.coordinates(np.concatenate([state.q, state.u]))
    assert again == pytest.approx(found, abs=0)


def test_coordinates_of_links_on_moving_ground_depend_on_the_time():
    """A rod from a point that moves along x with 2 m/s, at 1 s: the direction to a point at rest."""
    scene = symgen.Scene(
        parameters={"w": "2 m/s"},
        points={"O": {"at": [0, 0], "ground": True, "motion": ["w*t", "0 m"]}, "P": at(0, 1)},
        links={"OP": rod("O", "P")},
        analysis={"outputs": ["OP.angle"]},
    )
    model = symgen.build(scene)
    y = np.array([1.0, 1.0, 0.0, 0.0])
    found = model.coordinates(np.array([y, y]), [0.0, 1.0])
    assert found["OP.angle"] == pytest.approx([np.pi / 4, 3 * np.pi / 4])
    assert found["OP.angle'"] == pytest.approx(
        [2 * 1 / 2, 2 * 1 / 2]
    )  # the end of the rod moves by (-2, 0) m/s


def test_coordinates_of_loops_and_in_space():
    pump = symgen.build("cssp")
    state = pump.state({"theta1": 1.2, "S1": 0.02}, {"theta1": 3.0})
    found = pump.coordinates(np.concatenate([state.q, state.u]))
    assert (found["theta1"], found["S1"], found["theta1'"]) == pytest.approx((1.2, 0.02, 3.0), abs=1e-12)
    ball = symgen.build(SPATIAL_PENDULUM)
    found = ball.coordinates([0.2, 0.3, -0.6, 1, 2, 3])
    assert (found["P.position.z"], found["P.position.y'"]) == (-0.6, 2.0) and not any(
        ".angle" in x for x in found
    )


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (([0.0, 1.0],), r"expected a state y = \(q, u\) of 8 numbers, or rows of them, got shape \(2,\)"),
        ((np.zeros((2, 2, 8)),), r"got shape \(2, 2, 8\)"),
        ((1j * np.zeros(8),), "numbers"),
        ((np.zeros((3, 8)), [0.0, 1.0]), "expected one time"),
    ],
)
def test_wrong_states_have_no_coordinates(cart, arguments, text):
    with pytest.raises(ModelError, match=text):
        cart.coordinates(*arguments)


def test_elastic_links_have_no_coordinates():
    with pytest.raises(CapabilityError, match="does not support coordinates"):
        symgen.build("thesis_four_bar").coordinates  # noqa: B018
