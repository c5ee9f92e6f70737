"""``[states]``: filters, motors and controllers of a scene, against closed forms and minimal equations in SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from shared.linkages import GRAVITY, G, at, ground

import symgen
from symgen.errors import ModelError, SceneError, SimulationError

# -- a filter of first order pushes a mass on a rail: closed form ----------------------------------------------------

T, PUSH, MASS = 0.1, 3.0, 2.0


def filtered(**more):
    return symgen.Scene(
        parameters={"T": {"value": f"{T} s", "tunable": True}, "k": f"{PUSH} N"},
        inputs={"U": 1},
        states={"v": {"start": 0, "rate": "(U - v)/T", "about": "voltage of an RC filter"}},
        points={"A": ground(0, 0), "B": ground(1, 0), "P": at(0, 0)},
        links={"rail": {"points": ["A", "B"]}},
        masses=[{"point": "P", "mass": f"{MASS} kg"}],
        guides=[{"points": ["P"], "along": "rail"}],
        forces=[{"point": "P", "force": ["k*v", 0]}],
        analysis={"outputs": ["v", "v.rate", "P.position", "P.velocity", "kinetic_energy"], "t_end": "1 s"},
        **more,
    )


def exact(t, tau=T, scale=1.0):
    """Return state, its rate, place and speed of the mass."""
    e = np.exp(-t / tau)
    place = t**2 / 2 - tau * t + tau**2 * (1 - e)
    return scale * np.array([1 - e, e / tau, PUSH / MASS * place, PUSH / MASS * (t - tau * (1 - e))])


def found(run):
    v = {name: run[name].values for name in ("v", "v.rate", "P.position", "P.velocity")}
    return np.array([v["v"], v["v.rate"], v["P.position"][:, 0], v["P.velocity"][:, 0]])


@pytest.fixture(scope="module")
def rc():
    return symgen.build(filtered())


METHODS = [
    ({"method": "dop853", "rtol": 1e-10}, 1e-8),
    ({"method": "taylor", "rtol": 1e-10}, 1e-8),
    ({"method": "dopri5", "rtol": 1e-10}, 1e-8),
    ({"method": "radau5", "rtol": 1e-10}, 1e-8),
    ({"method": "rk4", "step": 2e-3}, 1e-8),
    ({"method": "rattle4", "step": 2e-3}, 1e-7),
    ({"method": "newmark", "step": 1e-4}, 1e-6),
]


@pytest.mark.parametrize(("options", "error"), METHODS)
def test_a_filter_has_its_closed_form_by_every_method(rc, options, error):
    run = rc.simulate(1.0, samples=11, **options)
    assert found(run) == pytest.approx(exact(run.coordinate.values), abs=error)
    assert run["kinetic_energy"].values == pytest.approx(
        MASS / 2 * exact(run.coordinate.values)[3] ** 2, abs=10 * error
    )
    assert run.drift.energy < 100 * error


def test_a_filter_in_lanes_by_steps_and_of_another_solver(rc):
    taus = np.linspace(0.05, 0.3, 8)
    for options in ({"step": 2e-3, "method": "rk4"}, {"method": "taylor"}):
        data = rc.simulate_many({"T": taus}, t_end=1.0, samples=6, **options)
        for i, tau in enumerate(taus):
            assert data["v"].values[i] == pytest.approx(exact(np.linspace(0, 1, 6), tau)[0], abs=1e-7)
    stepper = rc.stepper(rtol=1e-11)
    stepper.step(0.3)
    stepper.set(U=0.0)
    stepper.step(0.2)
    assert stepper["v"] == pytest.approx(exact(0.3)[0] * np.exp(-2), abs=1e-10)
    assert rc.coordinates(stepper.state)["v"] == rc.coordinates(stepper.y)["v"] == stepper["v"]
    f = rc.rhs
    motion = solve_ivp(f, (0, 1), f.start, rtol=1e-10, atol=1e-12, t_eval=[0.0, 0.5, 1.0])
    assert found(rc.record(motion.t, motion.y.T)) == pytest.approx(exact(motion.t), abs=1e-8)


def test_states_begin_as_given(rc):
    start = rc.state({"P": [0, 0]}, states={"v": 0.25})
    run = rc.simulate(0.2, state=start, samples=3)
    assert run["v"].values == pytest.approx(1 - 0.75 * np.exp(-run.coordinate.values / T), abs=1e-9)
    placed = rc.state({"P.position.x": 0.5}, {"P.position.x": 2.0}, states={"v": 0.25})
    got = rc.coordinates(placed)
    assert (got["P.position.x"], got["P.position.x'"], got["v"]) == pytest.approx((0.5, 2.0, 0.25))
    other = symgen.build(filtered(), set={"states.v.start": 0.5}).simulate(0.1, samples=2)
    assert other["v"].values == pytest.approx([0.5, 1 - 0.5 * np.exp(-1)], abs=1e-9)
    with pytest.raises(ModelError, match="has no state 'w'"):
        rc.state({"P": [0, 0]}, states={"w": 1.0})


def test_a_filter_is_linearised_with_the_mass(rc):
    plant = rc.linearise(coordinates=["P.position.x"], outputs=["P.velocity.x", "v"])
    assert plant.states == ("P.position.x", "P.position.x'", "v") and plant.freedoms == 1
    assert pytest.approx(np.array([[0, 1, 0], [0, 0, PUSH / MASS], [0, 0, -1 / T]]), abs=1e-12) == plant.A
    assert (
        pytest.approx(np.array([[0], [0], [1 / T]])) == plant.B and pytest.approx(np.zeros((2, 1))) == plant.D
    )
    assert pytest.approx(np.array([[0, 1, 0], [0, 0, 1]])) == plant.C
    assert plant.rates == pytest.approx([0, 0, 1 / T]) and plant.units["v"] == "1"
    assert sorted(plant.poles.real) == pytest.approx([-1 / T, 0, 0])
    whole = rc.linearise()
    assert whole.states[-1] == "v" and whole.A.shape == (5, 5)
    assert rc.mass_matrix(coordinates=["P.position.x"]) == pytest.approx(np.array([[MASS]]))


def test_derivatives_along_a_run(rc):
    """By the time constant: of the closed form."""
    t, step = 0.4, 1e-6
    slopes = (exact(t, T + step) - exact(t, T - step)) / (2 * step)
    for method in ("dop853", "radau5", "taylor"):
        result = rc.sensitivity(
            ["v", "P.position.x"], ["T"], t_end=t, coordinates=["P.position.x"], method=method
        )
        values = np.ravel(result.derivatives)
        assert values[-2:] == pytest.approx(slopes[[0, 2]], abs=1e-6)


def test_a_run_resumes_with_the_same_bits(rc, tmp_path):
    file = tmp_path / "run.npz"
    whole = rc.simulate(1.0, method="dop853", samples=5)
    with pytest.raises(SimulationError):
        rc.simulate(
            1.0,
            method="dop853",
            samples=5,
            max_steps=whole.statistics["steps"] // 2,
            checkpoint=file,
            checkpoint_every=1e-9,
        )
    again = rc.simulate(1.0, method="dop853", samples=5, resume=file)
    assert np.array_equal(again["v"].values, whole["v"].values)


# -- a motor with a PI controller and anti-windup moves a pendulum ---------------------------------------------------

L, M = 0.5, 1.2  # length [m] and mass [kg] of a uniform rod
K, R, IND = 0.4, 2.0, 0.02  # torque per current [N m], resistance and inductance over the unit of voltage
KP, KI, KD, LIMIT, TT = 30.0, 20.0, 3.0, 12.0, 0.3
TARGET = 0.6


def servo(rate, **more):
    """A rod, hanging along -y, whose angle from there a motor leads to a target."""
    return symgen.Scene(
        parameters={
            "K": f"{K} N*m", "R": R, "Ind": f"{IND} s", "Ke": f"{K} s", "kp": KP, "ki": f"{KI} 1/s", "kd": f"{KD} s",
            "most": LIMIT, "Tt": f"{TT} s", "target": {"value": TARGET, "tunable": True}, "down": f"{-np.pi / 2!r}",
        },
        inputs={"load": "0 N*m"},
        states={
            "i": {"start": 0, "rate": f"(min(most, max(-most, {VOLTAGE})) - R*i - Ke*rod.rate)/Ind"},
            "z": {"start": "0 s", "rate": rate},
        },
        points={"O": ground(0, 0), "P": at(0, -L)},
        links={"rod": {"points": ["O", "P"], "mass": f"{M} kg"}},
        gravity=GRAVITY,
        torques=[{"link": "rod", "torque": "K*i + load"}],
        analysis={"outputs": ["rod.angle", "rod.angular_velocity", "i", "z"], "t_end": "2 s"},
        **more,
    )  # fmt: skip


VOLTAGE = "(kp*(target - (rod.angle - down)) + ki*z - kd*rod.rate)"
BACK = f"target - (rod.angle - down) + (min(most, max(-most, {VOLTAGE})) - {VOLTAGE})*Tt/kp/Tt"
CONDITIONAL = f"(target - (rod.angle - down))*(1 - sign(abs({VOLTAGE}) - most))/2"
INERTIA, WEIGHT = M * L**2 / 3, M * G * L / 2


def minimal(t, y, conditional=False, target=TARGET, load=0.0):
    theta, omega, i, z = y
    error = target - theta
    u = KP * error + KI * z - KD * omega
    limited = min(LIMIT, max(-LIMIT, u))
    change = error * (abs(u) < LIMIT) if conditional else error + (limited - u) / KP
    return [
        omega,
        (K * i + load - WEIGHT * np.sin(theta)) / INERTIA,
        (limited - R * i - K * omega) / IND,
        change,
    ]


def switched(times, conditional):
    """Integrate from one kink of the law to the next."""

    def kink(t, y):
        return abs(KP * (TARGET - y[0]) + KI * y[3] - KD * y[1]) - LIMIT

    kink.terminal = True
    y, t, rows = np.zeros(4), 0.0, {0.0: np.zeros(4)}
    while t < times[-1]:
        inside = [x for x in times if t < x]
        options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "args": (conditional,)}
        part = solve_ivp(
            minimal, (t, times[-1]), y, events=lambda t, y, _: kink(t, y), t_eval=inside, **options
        )
        rows |= dict(zip(part.t, part.y.T, strict=True))
        if not len(part.t_events[0]):
            break
        over = part.t_events[0][0]
        y = solve_ivp(minimal, (over, over + 1e-9), part.y_events[0][0], **options).y[:, -1]
        t = over + 1e-9
    return np.array([rows[x] for x in times])


def states_of(run):
    v = [run[name].values for name in ("rod.angle", "rod.angular_velocity", "i", "z")]
    return np.array([v[0] + np.pi / 2, *v[1:]]).T


@pytest.mark.parametrize("method", ["dop853", "taylor"])
@pytest.mark.parametrize("law", ["back-calculation", "conditional"])
def test_pid_with_anti_windup_is_that_of_an_independent_integration(law, method):
    conditional = law == "conditional"
    model = symgen.build(servo(CONDITIONAL if conditional else BACK))
    run = model.simulate(1.5, samples=16, method=method, rtol=1e-11, atol=1e-13)
    times = run.coordinate.values
    reference = solve_ivp(
        minimal, (0, 1.5), np.zeros(4), method="DOP853", rtol=1e-12, atol=1e-13, t_eval=times, max_step=1e-3,
        args=(conditional,),
    ).y.T  # fmt: skip
    assert states_of(run) == pytest.approx(reference, abs=1e-8)
    assert any("switching point" in note and "[states]" in note for note in run.notes)
    u = KP * (TARGET - reference[:, 0]) + KI * reference[:, 3] - KD * reference[:, 1]
    assert abs(u[0]) > LIMIT > abs(u[-1])  # saturated at first


def test_servo_rests_at_its_target():
    """z and i hold the weight; the eigenvalues of A are those of the closed form."""
    model = symgen.build(servo(BACK))
    rest = model.equilibrium()
    at_rest = model.coordinates(rest.state)
    holding = WEIGHT * np.sin(TARGET) / K
    exact = {"rod.angle": TARGET - np.pi / 2, "i": holding, "z": R * holding / KI}
    assert {name: at_rest[name] for name in exact} == pytest.approx(exact, abs=1e-9)
    plant = model.linearise(rest, coordinates=["rod.angle"], inputs=["load"])
    assert plant.states == ("rod.angle", "rod.angle'", "i", "z")
    closed = np.array(
        [
            [0, 1, 0, 0],
            [-WEIGHT * np.cos(TARGET) / INERTIA, 0, K / INERTIA, 0],
            [-KP / IND, (-KD - K) / IND, -R / IND, KI / IND],
            [-1, 0, 0, 0],
        ]
    )
    assert pytest.approx(closed, abs=1e-8) == plant.A
    assert pytest.approx(
        np.array([[0], [1 / INERTIA], [0], [0]])
    ) == plant.B and plant.rates == pytest.approx(np.zeros(4), abs=1e-9)
    poles = np.linalg.eigvals(closed)
    assert np.sort_complex(plant.poles) == pytest.approx(np.sort_complex(poles), abs=1e-7)
    assert rest.stability == ("stable" if np.all(poles.real < 0) else "unstable") and rest.freedoms == 1
    slopes = model.sensitivity(["rod.angle", "i", "z"], ["target"], at=rest)
    exact = [1.0, WEIGHT * np.cos(TARGET) / K, R * WEIGHT * np.cos(TARGET) / K / KI]
    assert np.ravel(slopes.derivatives) == pytest.approx(exact, abs=1e-8)
    with pytest.raises(ModelError, match=r"poles.*\[states\]"):
        model.sensitivity(["poles"], ["target"], at=rest)
    modes = [mode.s for mode in model.modes(rest)]
    upper = [s for s in poles if s.imag >= 0]
    assert sorted(modes, key=abs) == pytest.approx(sorted(upper, key=abs), abs=1e-6)


def test_a_state_in_space_and_in_a_plane_of_space():
    """A filtered force on a mass on a spring, drawn in space."""
    for direction in (["0 m", "0 m", "1 m"], ["1 m", "2 m", "-1 m"]):
        scene = symgen.Scene(
            parameters={"T": f"{T} s", "k": f"{PUSH} N"},
            states={"v": {"start": 0, "rate": "(1 - v)/T"}},
            points={"O": {"at": [0, 0, 0], "ground": True}, "P": {"at": direction}},
            links={"OP": {"points": ["O", "P"], "mass": "1 kg"}},
            torques=[],
            forces=[{"point": "P", "force": ["k*v", 0, 0]}],
            analysis={"outputs": ["v", "P.position"], "t_end": "1 s"},
        )
        model = symgen.build(scene)
        run = model.simulate(samples=5)
        assert run["v"].values == pytest.approx(exact(run.coordinate.values)[0], abs=1e-9)
        again = model.simulate(
            0.5, state=model.state({"P": model.initial_state().positions["P"]}, states={"v": 1.0}), samples=2
        )
        assert again["v"].values == pytest.approx([1.0, 1.0], abs=1e-12)


def test_events_of_states():
    events = [{"name": "half", "of": "v", "value": 0.5, "ends_run": True}]
    run = symgen.build(filtered(events=events)).simulate(1.0)
    assert run.statistics["t"] == pytest.approx(T * np.log(2), abs=1e-9)


@pytest.mark.parametrize(
    ("states", "text"),
    [
        ({"v": {"start": 0, "rate": "U - v"}}, "expected an angular velocity"),
        ({"v": {"start": 0, "rate": "w/T"}}, "w"),
        ({"U": {"start": 0, "rate": "U/T"}}, "is an input already"),
        ({"k": {"start": 0, "rate": "1/T"}}, "is a parameter already"),
        ({"P": {"start": 0, "rate": "1/T"}}, "is a point already"),
        ({"rail": {"start": 0, "rate": "1/T"}}, "is a link already"),
        ({"t": {"start": 0, "rate": "1/T"}}, "the time"),
        ({"v": {"start": 0}}, "rate"),
        ({"v": {"rate": "1/T"}}, "start"),
        ({"v": {"start": "U", "rate": "1/T"}}, "U"),
        ({"v": 3}, ""),
    ],
)
def test_wrong_states_are_named(states, text):
    with pytest.raises(SceneError, match=r"\[states(.|\n)*" + text):
        symgen.build(filtered(), set={"states": states, "forces": [], "analysis.outputs": ["P.position"]})


def test_states_are_refused_outside_loads():
    with pytest.raises(SceneError, match="v is a state, and states may occur in forces and torques alone"):
        symgen.build(filtered(), set={"masses.0.mass": "v*k"})


@pytest.mark.parametrize("name", ["power", "kinetic_energy", "force", "mass_matrix", "positions", "time"])
def test_states_are_not_called_as_quantities_of_the_linkage(name):
    data = filtered().model_dump(exclude_unset=True)
    data["states"] = {name: {"start": 0, "rate": "(U - 0.5)/T"}}
    data["forces"][0]["force"] = ["k", 0]
    data["analysis"] = {}
    with pytest.raises(SceneError, match="states. .*reserved for a quantity of the linkage"):
        symgen.build(symgen.Scene(**data))


def test_derivatives_by_the_start_of_a_state_are_refused():
    """The start is held: v = v0 exp(-t/T) would have the derivative zero."""
    data = filtered().model_dump(exclude_unset=True)
    data["parameters"]["v0"] = {"value": 0.5, "tunable": True}
    data["states"]["v"]["start"] = "v0"
    model = symgen.build(symgen.Scene(**data))
    with pytest.raises(ModelError, match="hold the starts of states, and v0 sets one"):
        model.sensitivity(["v"], ["v0"], t_end=0.1, coordinates=["P.position.x"])
    slope = model.sensitivity(["v"], ["T"], t_eval=[0.1], coordinates=["P.position.x"]).derivatives[0, 0, 0]
    # v = 1 - e/2 with e = exp(-t/T), whose derivative by T is e t/T^2
    assert slope == pytest.approx(-np.exp(-1) * 0.1 / T**2 / 2, rel=1e-8)


def test_a_state_that_never_rests_is_named_with_its_rate():
    """The integral of a constant beside a pendulum at rest; with a force that nothing balances, both."""
    scene = {
        "symgen": 1,
        "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["0 m", "-1 m"]}},
        "links": {"rod": {"points": ["O", "A"], "mass": "1 kg"}},
        "gravity": {"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        "states": {"z": {"start": "0 s", "rate": "3 + 0*rod.angle"}},
    }
    model = symgen.build(symgen.Scene(**scene))
    assert model.mobility[0].startswith("2 coordinates, 1 constraint, 1 first-order state: 1 degree")
    with pytest.raises(SimulationError, match="no force is left, but states change, z at 3 per s"):
        model.equilibrium()


def test_a_tunable_period_is_that_of_a_remainder_of_one():
    """The mean of mod(t/T, 1)*T is T/2: a mass of 1 kg from rest under F mod(t/T, 1)."""
    points = {"O": ["0 m", "0 m"], "X": ["1 m", "0 m"], "A": ["0.5 m", "0 m"]}
    model = symgen.build(
        symgen.Scene(
            parameters={"T": {"value": "0.2 s", "tunable": True}, "F": "2 N/s"},
            points={name: {"at": at, "ground": name != "A"} for name, at in points.items()},
            links={"rail": {"points": ["O", "X"]}},
            masses=[{"point": "A", "mass": "1 kg"}],
            guides=[{"points": ["A"], "along": "rail"}],
            forces=[{"point": "A", "force": ["F*mod(t/T, 1)*T", "0 N"]}],
            analysis={"outputs": ["A.velocity"]},
        )
    )
    for period in (0.2, 0.3):
        run = model.with_parameters(T=period).simulate(3 * period, samples=2)
        assert run["A.velocity"].values[-1, 0] == pytest.approx(2 * period * 3 * period / 2, rel=1e-9)
