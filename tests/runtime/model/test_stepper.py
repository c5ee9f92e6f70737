"""``model.stepper()``: motions that advance by calls, with inputs that change between them."""

from __future__ import annotations

import copy
import pickle
import signal
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from shared.ball_poles import CASE, CRANK
from shared.controlled import CART, CART_POLE, POLE, SPATIAL_PENDULUM, cart_pole, four_bar_with_torque
from shared.linkages import G, at, chain, circles, ground, rod

import symgen
from symgen.errors import CapabilityError, ModelError, RangeError, SimulationError

#: Gains of force on the cart by place, angle, and their rates.
GAIN = np.array([-1.0, -35.0, -2.6, -8.2])
OUTPUTS = {"outputs": ["C.position", "pole.angle", "energy", "R0.reaction", "forces.0.force"]}
CONTROLLED = CART_POLE.model_copy(update={"analysis": CART_POLE.analysis.model_copy(update=OUTPUTS)})


def by_minimal_equations(samples, h, first):
    """Yield place, angle and their rates after each sample of a state feedback, by Lagrange's equations in SciPy.

    The angle is clockwise from the vertical.
    """
    c, inertia = POLE * 0.5 / 2, POLE * 0.5**2 / 3
    y = np.array(first)
    for _ in range(samples):
        force = -GAIN @ y

        def rates(t, y, force=force):
            _, theta, v, omega = y
            mass = [[CART + POLE, c * np.cos(theta)], [c * np.cos(theta), inertia]]
            right = [force - 0.3 * v + c * np.sin(theta) * omega**2, c * G * np.sin(theta)]
            return [v, omega, *np.linalg.solve(mass, right)]

        y = solve_ivp(rates, (0, h), y, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        yield y


def measured(stepper):
    """Return place, clockwise angle from the vertical, and their rates."""
    (x, _, px, py), (v, _, pv, pw) = stepper.y.reshape(2, 4)
    across, up = px - x, py
    return np.array([x, np.arctan2(across, up), v, (up * (pv - v) - across * pw) / 0.25])


@pytest.fixture(scope="module")
def cart():
    return symgen.build(CONTROLLED)


def tilted(model):
    y, _ = cart_pole(model, 0.1, 0.3, 0.0, 0.0)
    return replace(model.initial_state(), q=y[:4], u=y[4:])


@pytest.mark.parametrize("method", ["dop853", "taylor", "radau5"])
def test_a_sampled_state_feedback_is_that_of_an_independent_integration(cart, method):
    """A cart-pole over 3 s, its force held for 10 ms."""
    tolerance = 1e-10 if method != "radau5" else 1e-9
    stepper = cart.stepper(state=tilted(cart), method=method, rtol=tolerance, atol=1e-3 * tolerance)
    exact = np.array([*by_minimal_equations(300, 0.01, [0.1, 0.3, 0, 0])])
    for state in exact:
        stepper.set(F=-GAIN @ measured(stepper))
        stepper.step(0.01)
        assert measured(stepper) == pytest.approx(state, abs=1e-8)
    assert stepper.t == 3.0
    assert np.ptp(exact[:, 1]) > 0.3 and abs(exact[-1, 1]) < 0.05  # the pole stands


MECHANISMS = [
    "four_bar",
    "peaucellier",
    "parallelogram",
    "double_four_bar",
    "cssp",
    "tumbling_body",
]


@pytest.mark.parametrize("scene", MECHANISMS)
def test_steps_lead_where_a_run_leads(scene):
    model = symgen.build(scene)
    run = model.simulate(0.24, rtol=1e-11, samples=2)
    stepper = model.stepper(rtol=1e-11)
    for _ in range(24):
        stepper.step(0.01)
    assert stepper.t == pytest.approx(0.24, abs=1e-15)
    assert [*stepper.outputs] == [v.name for v in run.variables]
    for v in run.variables:
        scale = np.abs(v.values).max() + 1e-3
        assert stepper[v.name] == pytest.approx(v.values[-1], abs=1e-7 * scale), v.name
        for k, component in enumerate(v.components):
            assert stepper[f"{v.name}.{component}"] == np.atleast_1d(stepper[v.name])[k]


@pytest.mark.parametrize("method", ["rk4", "rattle4", "newmark"])
def test_fixed_steps_are_those_of_a_run(method):
    model = symgen.build("four_bar")
    step = 2.0**-10
    run = model.simulate(64 * step, step=step, method=method, samples=2)
    stepper = model.stepper(step=step, method=method)
    for _ in range(16):
        stepper.step(4 * step)
    final = run.final["A"]["position"] + run.final["B"]["position"]
    assert stepper.y[: len(final)] == pytest.approx(final, abs=1e-15)
    stepper.step(step / 2)  # shorter than the fixed step
    assert stepper.t == 64.5 * step


def test_a_user_defined_system_advances(tmp_path):
    file = tmp_path / "oscillator.py"
    file.write_text(
        "import sympy as sp\n"
        "from symgen.symbolic.quantity import quantity\n"
        "from symgen.symbolic.system import Group, NamedMatrix, System\n"
        "def system():\n"
        "    x, v = quantity('x', 'm', 'position'), quantity('v', 'm/s', 'velocity')\n"
        "    f = quantity('f', 'N', 'force')\n"
        "    mass = NamedMatrix('mass_matrix', sp.ImmutableMatrix([[2]]), 'kg', 'mass')\n"
        "    force = NamedMatrix('force', sp.ImmutableMatrix([[f.symbol - 8*x.symbol]]), 'N', 'force')\n"
        "    return System(name='oscillator', title='Oscillator', matrices=(mass, force), exports=(),\n"
        "                  groups=(Group('q', 'position', (x,)), Group('u', 'velocity', (v,)),\n"
        "                          Group('p', 'parameters', (f,), per_run=True)),\n"
        "                  values={'x': 1.0, 'v': 0.0, 'f': 0.0})\n"
    )
    stepper = symgen.build(file).stepper(rtol=1e-12)
    stepper.step(0.3)
    assert stepper.y == pytest.approx([np.cos(0.6), -2 * np.sin(0.6)], abs=1e-11)
    stepper.set(f=8.0)  # about the position 1
    x, v = stepper.y
    stepper.step(0.5)
    exact = 1 + (x - 1) * np.cos(1) + v / 2 * np.sin(1), -2 * (x - 1) * np.sin(1) + v * np.cos(1)
    assert stepper.y == pytest.approx(exact, abs=1e-11)


@pytest.mark.parametrize("method", ["dop853", "taylor", "rk4", "rattle4"])
def test_changed_parameters_act_as_in_a_model_with_them(cart, method):
    """Inputs, a damper, and lengths, onto which the state is projected."""
    options = {"step": 1e-3} if method.startswith("r") else {"rtol": 1e-12}
    stepper = cart.stepper(state=tilted(cart), method=method, **options)
    changed = {}
    for values in ({"F": 3.0}, {"c": 2.0}, {"F": 0.5, "T": 0.01}):
        stepper.step(0.02)
        begin, changed = stepper.state, changed | values
        stepper.set(**values)
        end = cart.with_parameters(**changed).simulate(
            begin.t + 0.05, state=begin, samples=2, method=method, **options
        )
        stepper.step(0.05)
        for v in end.variables:
            if v.name != "energy":
                assert stepper[v.name] == pytest.approx(v.values[-1], abs=1e-9), v.name
    assert stepper.parameters == {"c": 2.0, "F": 0.5, "T": 0.01}


def test_changed_lengths_project_the_state():
    scene = four_bar_with_torque()
    links = {name: link.model_dump(exclude_unset=True) for name, link in scene.links.items()}
    links["coupler"]["length"] = "long"
    parameters = {"long": {"value": "0.8 m", "tunable": True}}
    analysis = {"outputs": ["A.position", "B.position", "coupler.tension", "crank.angle"]}
    tables = scene.model_dump(exclude_unset=True) | {"links": links, "parameters": parameters}
    model = symgen.build(symgen.Scene(**tables | {"analysis": analysis}))
    stepper = model.stepper(rtol=1e-11)
    stepper.step(0.1)
    begin = stepper.state
    stepper.set(long=0.81)
    assert np.linalg.norm(stepper["B.position"] - stepper["A.position"]) == pytest.approx(0.81, abs=1e-14)
    stepper.step(0.1)
    run = model.with_parameters(long=0.81).simulate(0.2, state=begin, rtol=1e-11, samples=2)
    for v in run.variables:
        assert stepper[v.name] == pytest.approx(v.values[-1], rel=1e-8), v.name
    with pytest.raises(RangeError, match="length"):
        stepper.set(long=-0.81)
    before = stepper.y
    with pytest.raises(SimulationError, match="constraints"):
        stepper.set(long=5.0)
    assert stepper.parameters["long"] == 0.81 and np.array_equal(stepper.y, before)
    stepper.step(0.01)


def test_a_loop_with_an_input():
    changes = {"inputs.M": "0 N*m", "loop.drives.theta1": "stall*(1 - theta1.rate/top) + M"}
    pump = symgen.build("cssp", set=changes)
    start = pump.state({"theta1": 1.2, "S1": 0.02}, {"theta1": 3.0})
    stepper = pump.stepper(state=start, rtol=1e-11)
    stepper.step(0.05)
    stepper.set(M=2.0)
    begin = stepper.state
    stepper.step(0.1)
    run = pump.with_parameters(M=2.0).simulate(0.15, state=begin, rtol=1e-11, samples=2)
    for v in run.variables:
        scale = np.abs(v.values).max() + 1e-5  # moments that vanish have the rounding of those that do not
        assert stepper[v.name] == pytest.approx(v.values[-1], abs=1e-7 * scale), v.name


def test_angles_continue_over_revolutions():
    scene = symgen.Scene(
        points={"O": ground(0, 0), "A": at(1, 0)},
        links={"OA": rod("O", "A")},
        start={"rates": {"OA": "9 rad/s"}},
        analysis={"outputs": ["OA.angle", "A.position"]},
    )
    model = symgen.build(scene)
    for method, h in (("dop853", 0.1), ("taylor", 1.5)):
        stepper = model.stepper(method=method)
        for k in range(20):
            stepper.step(h)
            assert stepper["OA.angle"] == pytest.approx(9 * (k + 1) * h, abs=1e-7)


def on_a_torsion_spring():
    """A rod without gravity, whose angle is 10 sin(2 t)."""
    return symgen.Scene(
        points={"O": ground(0, 0), "A": at(1, 0)},
        links={"OA": rod("O", "A", 3.0)},
        torsion_springs=[{"link": "OA", "stiffness": "4 N*m/rad", "angle": "0 rad"}],
        start={"rates": {"OA": "20 rad/s"}},
        analysis={"outputs": ["OA.angle"]},
    )


@pytest.mark.parametrize(
    ("method", "steps"),
    [
        ("taylor", [1e-300, 0.4]),
        ("taylor", [0.1, 2e-17, 0.3]),
        ("dop853", [1e-300, 0.1, 2e-17, 0.3]),
        ("radau5", [1e-12, 0.1, 2e-17, 0.3]),
    ],
)
def test_a_tiny_step_does_not_limit_those_after_it(method, steps):
    tolerance = 1e-8 if method == "radau5" else 1e-11
    stepper = symgen.build(on_a_torsion_spring()).stepper(method=method, rtol=tolerance)
    for h in steps:
        stepper.step(h)
    assert stepper["OA.angle"] == pytest.approx(10 * np.sin(2 * stepper.t), abs=100 * tolerance)


def test_a_torsion_spring_counts_revolutions_also_after_a_reset():
    model = symgen.build(on_a_torsion_spring())
    stepper = model.stepper(rtol=1e-11)
    for _ in range(60):
        stepper.step(0.01)
    assert stepper["OA.angle"] == pytest.approx(10 * np.sin(1.2), abs=1e-8)
    other = model.stepper(state=stepper.state, rtol=1e-11)
    other.step(0.1)
    stepper.reset(stepper.state)
    stepper.step(0.1)
    for each in (stepper, other):
        assert each["OA.angle"] % (2 * np.pi) == pytest.approx(10 * np.sin(1.4) % (2 * np.pi), abs=1e-8)


def test_limits_of_a_signal_switch_where_the_input_jumps():
    """A force limited to 2 N: m v = min(2, F) t."""
    scene = symgen.Scene(
        parameters={"most": "2 N"},
        inputs={"F": "0 N"},
        points={"A": ground(0, 0), "B": ground(1, 0), "P": at(0, 0)},
        links={"rail": {"points": ["A", "B"]}},
        masses=[{"point": "P", "mass": "4 kg"}],
        guides=[{"points": ["P"], "along": "rail"}],
        forces=[{"point": "P", "force": ["min(most, F)", "0 N"]}],
        analysis={"outputs": ["P.velocity", "forces.0.force"]},
    )
    for method in ("dop853", "taylor"):
        stepper = symgen.build(scene).stepper(method=method)
        speed = 0.0
        for force in (1.0, 5.0, -3.0, 7.0):
            stepper.set(F=force)
            assert stepper["forces.0.force.x"] == min(2.0, force)
            stepper.step(0.1)
            speed += min(2.0, force) * 0.1 / 4
            assert stepper["P.velocity.x"] == pytest.approx(speed, abs=1e-12)


def thrown(*events):
    """A point thrown upward at x = 1 m/s and 4 m/s, with g = 8 m/s^2: y = 4 t - 4 t^2."""
    return symgen.build(
        symgen.Scene(
            points={"O": ground(0, -9), "G": ground(1, -9), "A": at(0, 0)},
            links={"base": {"points": ["O", "G"]}},
            masses=[{"point": "A", "mass": "1 kg"}],
            gravity={"acceleration": ["0 m/s^2", "-8 m/s^2"]},
            start={"velocities": {"A": ["1 m/s", "4 m/s"]}},
            events=[{"name": f"e{i}", **event} for i, event in enumerate(events)],
            analysis={"outputs": ["A.position"]},
        )
    )


@pytest.mark.parametrize("method", ["dop853", "taylor"])
def test_events_belong_to_a_step_and_may_end_the_motion(method):
    model = thrown({"of": "A.y", "value": "0.75 m"}, {"of": "A.x", "value": "1.02 m", "ends_run": True})
    stepper, times = model.stepper(method=method), []
    while stepper.ended is None:
        stepper.step(0.1)
        times += [(e.name, e.time, e.rising) for e in stepper.events]
    assert [name for name, _, _ in times] == ["e0", "e0", "e1"]
    assert [t for _, t, _ in times] == pytest.approx([0.25, 0.75, 1.02], abs=1e-9)
    assert [rising for _, _, rising in times] == [True, False, True]
    assert stepper.ended == "e1" and stepper.t == pytest.approx(1.02, abs=1e-9)
    assert stepper["A.position"] == pytest.approx([1.02, 4 * 1.02 * (1 - 1.02)], abs=1e-9)
    with pytest.raises(
        SimulationError, match=r"the event 'e1' has ended the motion at t = 1\.02 s"
    ) as caught:
        stepper.step(0.1)
    assert caught.value.time == stepper.t and stepper.copy().ended == "e1"
    stepper.reset()
    stepper.step(0.3)
    assert stepper.ended is None and [e.name for e in stepper.events] == ["e0"]


def test_copies_and_readings_change_no_bit(cart):
    first, alone = (cart.stepper(state=tilted(cart)) for _ in range(2))
    for stepper in (first, alone):
        stepper.set(F=1.0)
        stepper.step(0.1)
    other = first.copy()
    other.set(F=-5.0)
    other.step(0.05)
    for _ in range(3):
        first["R0.reaction"], first["energy"], first.state, first.events, first.parameters
        first.step(0.05)
        alone.step(0.05)
    assert np.array_equal(first.y, alone.y) and first.t == alone.t
    assert not np.array_equal(other.y, alone.y) and other.parameters["F"] == -5.0
    again = first.copy()
    assert again.parameters == first.parameters and np.array_equal(again.y, first.y)
    for stepper in (again, first):
        stepper.step(0.2)
    assert np.array_equal(again.y, first.y) and again["energy"] == first["energy"]


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
def test_copies_by_the_module_copy_move_by_themselves(cart, copied):
    first = cart.stepper(state=tilted(cart))
    first.step(0.1)
    before, other = first.y.copy(), copied(first)
    assert np.array_equal(other.y, before) and other.t == first.t
    other.set(F=-5.0)
    other.step(0.1)
    assert first.t == 0.1 and np.array_equal(first.y, before) and first.parameters["F"] == 0.0


def test_a_stepper_notes_the_violation_of_its_start():
    """A pendulum of L = 1 m from the state of one of r = 0.75 m: (L^2 - r^2)/(2 L) = 0.219 m."""
    scene = symgen.Scene(
        parameters={"L": {"value": "1 m", "tunable": True}},
        points={"O": ground(0, 0), "A": at(1, 0)},
        links={"OA": {"points": ["O", "A"], "length": "L", "mass": "1 kg"}},
    )
    model = symgen.build(scene)
    stepper = model.stepper(state=model.state({"A": [0.75, 0.0]}))
    assert "violates the constraints, by 2.2e-01 m" in " ".join(stepper.notes)
    assert stepper.copy().notes == stepper.notes
    stepper.reset(model.state({"A": [1.0, 0.0]}))
    assert stepper.notes == model.stepper().notes == ()


def test_an_output_that_the_scene_does_not_list_is_to_be_listed(cart):
    with pytest.raises(ModelError, match=r"no output 'pole.power'.*\n.*outputs under \[analysis\] lists it"):
        cart.stepper()["pole.power"]


def test_a_stepper_cannot_be_pickled(cart):
    with pytest.raises(TypeError, match=r"stepper cannot be pickled.*\n.*Pickle stepper.state"):
        pickle.dumps(cart.stepper())


def test_a_reset_returns_to_start_and_parameters(cart):
    stepper = cart.stepper(state=tilted(cart))
    first = stepper.y
    stepper.set(F=2.0, c=1.0)
    stepper.step(0.2)
    end = stepper.y
    stepper.reset()
    assert stepper.t == 0.0 and np.array_equal(stepper.y, first)
    assert stepper.parameters == dict(cart.parameters)
    stepper.set(F=2.0, c=1.0)
    stepper.step(0.2)
    assert np.array_equal(stepper.y, end)
    later = replace(tilted(cart), t=5.0)
    stepper.reset(later)
    assert stepper.t == 5.0 and np.array_equal(stepper.y, first)


def test_the_time_of_many_steps_has_no_drift(cart):
    stepper = cart.stepper(step=1e-3)
    for _ in range(6000):
        stepper.step(1e-3)
    assert stepper.t == 6.0


def test_a_linkage_in_space_takes_and_returns_states():
    model = symgen.build(SPATIAL_PENDULUM)
    stepper = model.stepper(rtol=1e-11)
    stepper.set(F=1.0, H=0.0)
    stepper.step(0.2)
    run = model.with_parameters(F=1.0, H=0.0).simulate(0.2, rtol=1e-11, samples=2)
    assert stepper.state.positions["P"] == pytest.approx(run.final["P"]["position"], abs=1e-9)
    stepper.reset(stepper.state)
    assert stepper.t == 0.2


@pytest.mark.parametrize(
    ("call", "error", "text"),
    [
        (lambda s: s.step(0.0), ModelError, "the time of a step to be a finite number above zero, got 0.0"),
        (lambda s: s.step(-1e-3), ModelError, "above zero"),
        (lambda s: s.step(np.nan), ModelError, "finite number for the time of a step"),
        (lambda s: s.step("1 ms"), ModelError, "finite number for the time of a step"),
        (lambda s: s.step(True), ModelError, "finite number for the time of a step"),
        (lambda s: s.step(1e-30), ModelError, r"a step of 1e-30 s does not advance the time 0\.1 s"),
        (lambda s: s.set(F=np.nan), ModelError, "expected a finite number for F"),
        (lambda s: s.set(F="2 N"), ModelError, "F"),
        (lambda s: s.set(F=1j), ModelError, "F"),
        (lambda s: s.set(G=2.0), ModelError, "no tunable parameter 'G'"),
        (lambda s: s.set(F=2.0, G=2.0), ModelError, "no tunable parameter 'G'"),
        (lambda s: s["C.postion"], ModelError, "has no output 'C.postion'.*C.position"),
        (lambda s: s[5], ModelError, "has no output '5'"),
        (lambda s: s.reset("start"), ModelError, "state"),
    ],
)
def test_wrong_calls_change_nothing(cart, call, error, text):
    stepper = cart.stepper(state=tilted(cart))
    stepper.step(0.1)
    before = stepper.t, stepper.y.tolist(), stepper.parameters
    with pytest.raises(error, match=text):
        call(stepper)
    assert (stepper.t, stepper.y.tolist(), stepper.parameters) == before
    stepper.set(F=1)
    stepper.step(1)
    assert stepper.t == 1.1 and stepper.parameters["F"] == 1.0


def test_a_loss_of_rank_is_named():
    """A crank longer than the coupler allows, driven to the dead centre at which coupler and rocker are in line."""
    crank, coupler, rocker, base = 0.4, 0.5, 0.6, 1.0
    a = np.array([crank * np.cos(0.5), crank * np.sin(0.5)])
    b = circles(a, [base, 0.0], coupler, rocker)
    scene = symgen.Scene(
        parameters={"w": "1 rad/s"},
        points={"O": ground(0, 0), "A": at(*a), "B": at(*b), "C": ground(base, 0)},
        links={"crank": rod("O", "A"), "coupler": rod("A", "B"), "rocker": rod("C", "B")},
        drivers=[{"link": "crank", "angle": "0.5 + w*t"}],
    )
    stepper = symgen.build(scene).stepper()
    with pytest.raises(SimulationError, match=r"dead centre.*(coupler|rocker|crank)") as caught:
        for _ in range(400):
            stepper.step(0.01)
    inner = np.arccos((crank**2 + base**2 - (coupler + rocker) ** 2) / (2 * crank * base))
    assert caught.value.time == pytest.approx(inner - 0.5, abs=0.02)
    with pytest.raises(SimulationError, match="dead centre"):
        stepper.step(0.01)
    stepper.reset()
    stepper.step(0.01)


def test_whatever_has_no_run_of_the_one_loop_is_refused():
    with pytest.raises(ModelError, match="stepper of .* does not accept method"):
        symgen.build("thesis_four_bar").stepper(method="dop853")
    with pytest.raises(CapabilityError, match="does not support stepper: it has no free variable"):
        symgen.build("slider_crank").stepper  # noqa: B018
    with pytest.raises(ModelError, match="steppers are computed in float64 only"):
        symgen.build("four_bar", precision="float32").stepper()
    with pytest.raises(ModelError, match="for linkages of points and links, not for loops"):
        symgen.build("cssp").stepper(method="rattle", step=1e-3)
    with pytest.raises(ModelError, match="expected rtol to be a finite number above zero"):
        symgen.build("four_bar").stepper(rtol=-1e-9)
    model = symgen.build(chain([(0, 0), (1, 0), (2, 0)]))
    with pytest.raises(ModelError, match="point"):
        model.stepper(state=symgen.build("peaucellier").initial_state())


def test_a_loop_passes_poles_of_its_ball_joints():
    """Where angles of a ball have a pole, the loop is integrated in others; outputs, states and copies are of the table."""
    model = symgen.build(CASE).with_parameters(offset=CRANK)
    end, options = model.description.t_end, {"rtol": 1e-11, "atol": 1e-12}
    run = model.simulate(end, samples=21, **options)
    stepper, copies = model.stepper(**options), []
    for k in range(1, 21):
        stepper.step(end / 20)
        copies.append(stepper.copy())
        for v in run.variables:
            if v.name.endswith(("rate", "acceleration", "theta1", "S1")):
                scale = np.nanmax(np.abs(v.values)) + 1e-6
                assert stepper[v.name] == pytest.approx(v.values[k], abs=1e-7 * scale, nan_ok=True), v.name
    for k, other in enumerate(copies):
        for _ in range(19 - k):
            other.step(end / 20)
        assert np.array_equal(other.y, stepper.y)


def test_ctrl_c_ends_a_long_step(cart):
    """The state is that reached, from which the motion goes on."""
    stepper = cart.stepper(step=1e-5)
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        with pytest.raises(KeyboardInterrupt):
            stepper.step(1e5)
    finally:
        signal.signal(signal.SIGALRM, before)
    reached = stepper.t
    assert 0 < reached < 1e5
    stepper.step(1e-3)
    assert stepper.t == pytest.approx(reached + 1e-3, abs=1e-9)
