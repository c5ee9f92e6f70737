"""Friction of bearings: against closed forms and Newton-Euler equations with the forces solved for; refusals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

import symgen
from symgen.errors import CapabilityError, DerivationError, ModelError, SceneError, SimulationError
from symgen.export import export_c

G = 9.81
BEARING = {"link": "rod", "point": "O", "coefficient": 0.2, "radius": "20 mm", "transition": "0.5 rad/s"}


def pendulum(**changes):
    return symgen.Scene(
        name="bearing_pendulum",
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["0.3 m", "0 m"]}},
        links={"rod": {"points": ["O", "A"], "mass": "2 kg"}},
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        analysis={
            "outputs": ["rod.angle", "bearings.0.torque", "bearings.0.dissipated_power", "rod.O.force"]
        },
        bearings=[BEARING | changes],
    )


def tuned():
    """The pendulum with a coefficient that can be changed."""
    data = pendulum(coefficient="mu").model_dump(exclude_unset=True)
    return symgen.build(symgen.Scene(**data | {"parameters": {"mu": {"value": 0.2, "tunable": True}}}))


def couple_of_pendulum(angle, rate, arm=0.2 * 0.02):
    """The couple of the rod's bearing: the root of a quadratic, since it changes the force linearly.

    Of two roots against the rate the smaller one: that which rises from zero with the coefficient.
    """
    mass, length, transition = 2.0, 0.3, 0.5
    inertia, c = mass * length**2 / 3, arm * rate / np.hypot(rate, transition)
    along = mass * (rate**2 * length / 2 - G * np.sin(angle))
    free = mass * G * np.cos(angle) - mass * length / 2 * mass * G * length / 2 * np.cos(angle) / inertia
    by = mass * length / 2 / inertia  # of the transverse force by the couple
    # couple^2 = c^2 (along^2 + (free + by couple)^2), against the rate
    roots = np.roots([1 - (c * by) ** 2, -2 * c**2 * free * by, -(c**2) * (along**2 + free**2)])
    against = [x.real for x in roots if x.imag == 0 and x.real * rate <= 0]
    return float(min(against, key=abs, default=np.nan)), inertia, mass * G * length / 2


def test_pendulum_against_the_closed_form_of_its_force():
    run = symgen.build(pendulum()).simulate(t_end=3.0, rtol=1e-12, samples=61)

    def rates(_, y):
        couple, inertia, moment = couple_of_pendulum(*y)
        return [y[1], (couple - moment * np.cos(y[0])) / inertia]

    truth = solve_ivp(rates, (0, 3), [0.0, 0.0], method="DOP853", rtol=1e-13, atol=1e-14, t_eval=run.time)
    assert np.max(np.abs(run["rod.angle"].values.ravel() - truth.y[0])) < 1e-10
    couples = np.array([couple_of_pendulum(*y)[0] for y in truth.y.T])
    assert np.max(np.abs(run["bearings.0.torque"].values.ravel() - couples)) < 1e-10 * np.max(np.abs(couples))
    assert np.max(np.abs(couples)) > 0.1  # of a moment of 2.9 N m
    lost = run["bearings.0.dissipated_power"].values.ravel()
    assert lost == pytest.approx(-couples * truth.y[1], abs=1e-9)
    assert np.all(lost >= 0)
    energy = 0.5 * 0.06 * truth.y[1] ** 2 + 2 * G * 0.15 * np.sin(truth.y[0])
    work = solve_ivp(
        lambda _, y: [*rates(0, y[:2]), -couple_of_pendulum(*y[:2])[0] * y[1]],
        (0, 3), [0.0, 0.0, 0.0], method="DOP853", rtol=1e-13, atol=1e-14,
    ).y[2, -1]  # fmt: skip
    assert energy[-1] == pytest.approx(-work, rel=1e-9)
    assert run.drift.energy < 1e-9 * work


LENGTHS = {"crank": 0.1, "coupler": 0.3, "rocker": 0.25}
MASSES = {"crank": 0.5, "coupler": 1.2, "rocker": 0.9}
BASE, MU, RADIUS, TRANSITION, TORQUE = 0.28, 0.15, 0.012, 0.8, 1.5


def four_bar(**changes):
    joints = (
        ("crank", "O", None),
        ("coupler", "A", "crank"),
        ("rocker", "B", "coupler"),
        ("rocker", "Q", None),
    )
    law = {"coefficient": MU, "radius": f"{RADIUS} m", "transition": f"{TRANSITION} rad/s"} | changes
    angles = closed(np.pi / 3)
    a = 0.1 * np.array([np.cos(angles[0]), np.sin(angles[0])])
    b = a + 0.3 * np.array([np.cos(angles[1]), np.sin(angles[1])])
    return symgen.Scene(
        name="bearing_four_bar",
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "A": {"at": [f"{x!r} m" for x in a.tolist()]},
            "B": {"at": [f"{x!r} m" for x in b.tolist()]},
            "Q": {"at": [f"{BASE} m", "0 m"], "ground": True},
        },
        links={
            name: {"points": points, "mass": f"{MASSES[name]} kg", "length": f"{LENGTHS[name]} m"}
            for name, points in (("crank", ["O", "A"]), ("coupler", ["A", "B"]), ("rocker", ["Q", "B"]))
        },
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        torques=[{"link": "crank", "torque": f"{TORQUE} N*m"}],
        analysis={"outputs": ["crank.angle", *(f"bearings.{i}.torque" for i in range(4))]},
        bearings=[
            {"link": link, "point": point} | ({"against": other} if other else {}) | law
            for link, point, other in joints
        ],
    )


def closed(crank):
    """Angles of crank, coupler and rocker (from Q) of the open four-bar."""
    a = 0.1 * np.array([np.cos(crank), np.sin(crank)])
    line = np.array([BASE, 0.0]) - a
    d = np.hypot(*line)
    at = np.arctan2(line[1], line[0]) + np.arccos((d**2 + 0.3**2 - 0.25**2) / (2 * d * 0.3))
    b = a + 0.3 * np.array([np.cos(at), np.sin(at)])
    return np.array([crank, at, np.arctan2(b[1], b[0] - BASE)])


class Newton:
    """The four-bar by Newton's and Euler's equations of three bodies, with forces at four joints as unknowns."""

    def __init__(self, crank, rate):
        self.angles = angles = closed(crank)
        u, n = np.array([np.cos(angles), np.sin(angles)]), np.array([-np.sin(angles), np.cos(angles)])
        lengths = np.array([*LENGTHS.values()])
        # rates: crank + coupler = rocker in velocities of B
        system = np.column_stack([lengths[1] * n[:, 1], -lengths[2] * n[:, 2]])
        self.rates = rates = np.append(rate, np.linalg.solve(system, -lengths[0] * rate * n[:, 0]))
        # unknowns: angular accelerations, forces O on crank, A on coupler, B on rocker, Q on rocker
        matrix, right = np.zeros((11, 11)), np.zeros(11)
        matrix[:2, 0], matrix[:2, 1], matrix[:2, 2] = (
            lengths[0] * n[:, 0],
            lengths[1] * n[:, 1],
            -lengths[2] * n[:, 2],
        )
        squares = lengths * rates**2
        right[:2] = squares[0] * u[:, 0] + squares[1] * u[:, 1] - squares[2] * u[:, 2]
        forces = {name: slice(3 + 2 * i, 5 + 2 * i) for i, name in enumerate("OABQ")}
        bodies = (("O", 1, "A", -1), ("A", 1, "B", -1), ("Q", 1, "B", 1))  # at the start, at the end
        for k, (start, of_start, end, of_end) in enumerate(bodies):
            mass, rows = [*MASSES.values()][k], slice(2 + 3 * k, 4 + 3 * k)
            turn = 4 + 3 * k
            matrix[rows, forces[start]] += of_start * np.eye(2)
            matrix[rows, forces[end]] += of_end * np.eye(2)
            half = lengths[k] / 2
            matrix[rows, k] -= mass * half * n[:, k]
            right[rows] += [0, mass * G] - mass * half * rates[k] ** 2 * u[:, k]
            if k == 1:  # its start is A
                matrix[rows, 0] -= mass * lengths[0] * n[:, 0]
                right[rows] -= mass * lengths[0] * rates[0] ** 2 * u[:, 0]
            matrix[turn, k] -= mass * lengths[k] ** 2 / 12
            matrix[turn, forces[start]] += of_start * -half * n[:, k]
            matrix[turn, forces[end]] += of_end * half * n[:, k]
        right[4] -= TORQUE
        self.matrix, self.right, self.forces = matrix, right, forces

    def solved(self, couples):
        o, a, b, q = couples
        right = self.right.copy()
        right[[4, 7, 10]] -= [o - a, a - b, b + q]
        return np.linalg.solve(self.matrix, right)

    def couples(self, arm=MU * RADIUS):
        w = self.rates
        turning = np.array([w[0], w[1] - w[0], w[2] - w[1], w[2]])
        sliding = turning / np.hypot(turning, TRANSITION)

        def missed(couples):
            x = self.solved(couples)
            sizes = np.array([np.hypot(*x[self.forces[name]]) for name in "OABQ"])
            return couples + arm * sizes * sliding

        found = root(missed, np.zeros(4), tol=1e-15)
        assert np.max(np.abs(missed(found.x))) < 1e-12
        return found.x


def test_four_bar_with_four_bearings_against_newton_and_euler():
    run = symgen.build(four_bar()).simulate(t_end=0.6, rtol=1e-13, samples=31)

    def rates(_, y):
        of = Newton(*y)
        return [y[1], of.solved(of.couples())[0]]

    truth = solve_ivp(
        rates, (0, 0.6), [np.pi / 3, 0.0], method="DOP853", rtol=1e-13, atol=1e-14, t_eval=run.time
    )
    found = np.unwrap(run["crank.angle"].values.ravel())
    assert np.max(np.abs(found - truth.y[0])) < 1e-8
    couples = np.array([Newton(*y).couples() for y in truth.y.T])
    for i, name in enumerate("OABQ"):
        of_run = run[f"bearings.{i}.torque"].values.ravel()
        assert np.max(np.abs(of_run - couples[:, i])) < 1e-8 * np.max(np.abs(couples[:, i])), name
    assert truth.y[0, -1] - np.pi / 3 > 2 * np.pi
    without = symgen.build(four_bar(coefficient=0)).simulate(t_end=0.6, rtol=1e-13, samples=31)
    assert np.max(np.abs(np.unwrap(without["crank.angle"].values.ravel()) - truth.y[0])) > 0.1


@pytest.mark.parametrize(
    "built", [{}, {"backend": "numpy"}, {"precision": "longdouble"}, {"backend": "mpmath"}]
)
def test_couples_that_change_the_forces_much(built):
    """A quarter of the crank as arm of friction, at states along a run, also side by side in lanes."""
    scene = four_bar(coefficient=0.5, radius="50 mm")
    states = [symgen.build(scene).reached(t) for t in np.linspace(0, 0.6, 13).tolist()]
    q, u = (np.array([getattr(s, x) for s in states]) for x in "qu")
    model = symgen.build(scene, **built)
    found = np.array(model.batch("joint_couples", 0.0, q, u)["joint_couples"], dtype=float)
    for (x, y), (v, w), couples in zip(q[:, :2], u[:, :2], found.reshape(13, 4), strict=True):
        truth = Newton(np.arctan2(y, x), (x * w - y * v) / 0.01).couples(0.025)
        assert couples == pytest.approx(truth, rel=1e-9, abs=1e-12)
    if built.get("precision"):
        run = model.simulate(t_end=0.6, rtol=1e-12, samples=2)
        turned = run["crank.angle"].values[-1].item() - np.arctan2(q[-1, 1], q[-1, 0])
        assert abs(np.sin(turned / 2)) < 1e-7


def test_many_runs_a_stepper_and_explicit_methods_are_the_same_run():
    scene, model = pendulum(), tuned()
    alone = {mu: model.with_parameters(mu=mu).simulate(t_end=0.4, step=1e-3, samples=3) for mu in (0.1, 0.3)}
    both = model.simulate_many({"mu": [0.1, 0.3]}, t_end=0.4, step=1e-3, samples=3)
    for i, run in enumerate(alone.values()):
        for name in ("rod.angle", "bearings.0.torque"):
            assert both[name].values[i] == pytest.approx(run[name].values, abs=1e-13)
        stepper = model.with_parameters(mu=[0.1, 0.3][i]).stepper(step=1e-3)
        stepper.step(0.4)
        for name in ("rod.angle", "bearings.0.torque", "rod.O.force"):
            assert np.ravel(stepper[name]) == pytest.approx(np.ravel(run[name].values[-1]), abs=1e-11)
    assert alone[0.1].time[-1] == 0.4
    assert abs(alone[0.1]["rod.angle"].values[-1] - alone[0.3]["rod.angle"].values[-1]) > 1e-3
    rk4 = symgen.build(scene).simulate(t_end=0.4, method="rk4", step=1e-4, samples=3)
    fine = symgen.build(scene).simulate(t_end=0.4, rtol=1e-12, samples=3)
    assert rk4["rod.angle"].values == pytest.approx(fine["rod.angle"].values, abs=1e-10)


def test_a_bearing_without_force_is_no_fault():
    """A wheel about its centre of mass without gravity: rounding alone is left of the force."""
    model = symgen.build(
        symgen.Scene(
            points={
                "O": {"at": ["0 m", "0 m"], "ground": True},
                "A": {"at": ["0.1 m", "0.02 m"]},
            },
            links={
                "wheel": {
                    "points": ["O", "A"],
                    "mass": "3 kg",
                    "centre": ["0 m", "0 m"],
                    "inertia": "0.01 kg*m^2",
                }
            },
            start={"rates": {"wheel": "30 rad/s"}},
            analysis={"outputs": ["wheel.angular_velocity", "bearings.0.torque"]},
            bearings=[BEARING | {"link": "wheel"}],
        )
    )
    run = model.simulate(t_end=1.0, samples=5)
    assert run["wheel.angular_velocity"].values == pytest.approx(30.0, abs=1e-6)
    assert np.max(np.abs(run["bearings.0.torque"].values)) < 1e-12


def test_a_bearing_that_holds_the_pendulum():
    """Friction outgrows the force on the pin at rates above the transition, below which the rod sinks."""
    arm = 2.5 * 0.1
    run = symgen.build(pendulum(coefficient=2.5, radius="100 mm")).simulate(t_end=3.0, rtol=1e-12, samples=31)

    def rates(_, y):
        couple, inertia, moment = couple_of_pendulum(*y, arm)
        return [y[1], (couple - moment * np.cos(y[0])) / inertia]

    truth = solve_ivp(rates, (0, 3), [0.0, 0.0], method="LSODA", rtol=1e-12, atol=1e-13, t_eval=run.time)
    assert np.max(np.abs(run["rod.angle"].values.ravel() - truth.y[0])) < 1e-9
    assert -1.0 < truth.y[0, -1] < -0.3


@pytest.mark.parametrize("arm", [0.05, 0.15, 0.2, 0.24])
def test_friction_is_found_wherever_it_rises_from_none(arm):
    """Two thirds of the length is an arm with which a couple changes the force by as much as it is."""
    model = symgen.build(pendulum(coefficient=arm, radius="1 m"))
    angles, rates = np.meshgrid(np.linspace(-3, 3, 25), np.linspace(-9, 9, 19))
    found = []
    for angle, rate in zip(angles.ravel(), rates.ravel(), strict=True):
        along = np.array([np.cos(angle), np.sin(angle)])
        at, by = 0.3 * along, 0.3 * rate * np.array([-along[1], along[0]])
        state = model.state({"A": at}, {"A": by})
        couple = couple_of_pendulum(angle, rate, arm)[0]
        of_model = model.evaluator("accelerations", 0.0, state.q, state.u)
        assert np.isnan(of_model[0]) == np.isnan(couple)
        if np.isfinite(couple):
            assert of_model[-1] == pytest.approx(couple, rel=1e-9, abs=1e-12)
        found.append(np.isfinite(couple))
    assert all(found) == (arm <= 0.2) and any(found)


def test_a_bearing_that_locks_is_refused():
    """The rod is thrown down from the horizontal, along which nothing is left for the pin to bear."""
    model = symgen.build(pendulum(coefficient=2.5, radius="100 mm"))
    state = model.state({"A": [0.3, 0.0]}, {"A": [0.0, -1.0]})
    assert np.isnan(couple_of_pendulum(0.0, -1.0 / 0.3, 0.25)[0])
    with pytest.raises(ModelError, match="the linkage locks: as friction of its bearings rises"):
        model.accelerations(state)
    with pytest.raises(
        SimulationError, match=r"the linkage locks.*\n  Give smaller coefficients or radii, or end"
    ):
        model.simulate(t_end=3.0, state=state)
    thrown = pendulum(coefficient=2.5, radius="100 mm").model_dump(exclude_unset=True)
    with pytest.raises(
        SceneError, match=r"\[bearings\]: the linkage locks.*\n  Give smaller coefficients or radii"
    ):
        symgen.build(symgen.Scene(**thrown | {"start": {"rates": {"rod": "-3.3 rad/s"}}}))
    driven = symgen.Scene(
        **pendulum(coefficient=2.5, radius="100 mm").model_dump(exclude_unset=True)
        | {"drivers": [{"link": "rod", "angle": "-w*t"}], "parameters": {"w": "10 rad/s"}}
    )
    assert np.isfinite(symgen.build(driven).inverse_dynamics(at=[0.0])["rod.torque"].values).all()


@pytest.mark.parametrize("method", ["taylor", "radau5", "newmark", "generalized-alpha", "rattle", "rattle4"])
def test_methods_without_it_are_refused(method):
    model = symgen.build(pendulum())
    options = {"step": 1e-3} if method not in ("taylor", "radau5") else {}
    with pytest.raises(ModelError, match="friction of bearings"):
        model.simulate(method=method, t_end=0.1, **options)


def test_analyses_without_it_are_refused(tmp_path):
    with pytest.raises(ModelError, match="derivatives at a state do: give at\\."):
        tuned().sensitivity(["rod.angle"], ["mu"], t_end=0.1)
    with pytest.raises(ModelError, match="derivatives along runs and those of frequencies do not have its"):
        tuned().sensitivity(["frequencies"], ["mu"], at=tuned().equilibrium())
    with pytest.raises(CapabilityError, match="has no export in C: its bearings have friction"):
        export_c(pendulum(), tmp_path / "c")
    with pytest.raises(DerivationError, match="momentum rows"):
        symgen.derive(pendulum(), cut=["rod.O"])


def test_at_rest_there_is_no_friction():
    found = symgen.build(pendulum()).equilibrium()
    assert found.state.positions["A"] == pytest.approx([0.0, -0.3], abs=1e-12)


def test_small_vibrations_are_damped_by_the_weight_on_the_bearing():
    """At rest friction is a damper of the couple over the transition rate: I s^2 + c s + m g l/2 = 0."""
    model = symgen.build(pendulum())
    found = model.modes()
    roots = np.roots([2 * 0.3**2 / 3, 0.2 * 0.02 * 2 * G / 0.5, 2 * G * 0.15])
    assert found[0].s == pytest.approx(max(roots, key=lambda s: s.imag), rel=1e-12)
    linear = model.linearise(model.equilibrium(), coordinates=["rod.angle"], outputs=["bearings.0.torque"])
    assert np.linalg.eigvals(linear.A) == pytest.approx(np.linalg.eigvals(np.diag(roots)), rel=1e-12)
    assert linear.C.ravel() == pytest.approx([0.0, -0.2 * 0.02 * 2 * G / 0.5], rel=1e-12)
    data = pendulum().model_dump(exclude_unset=True)
    data |= {"inputs": {"M": "0 N*m"}, "torques": [{"link": "rod", "torque": "M"}]}
    pushed = symgen.build(symgen.Scene(**data))
    linear = pushed.linearise(pushed.equilibrium(), coordinates=["rod.angle"], inputs=["M"])
    assert linear.B.ravel() == pytest.approx([0.0, 1 / 0.06], rel=1e-12)
    assert not linear.notes


def slopes(function, at):
    """Central differences of the fourth order of a function of two numbers, a column each."""
    steps = (1e-3 * np.eye(2)[k] for k in range(2))
    return np.column_stack(
        [
            (
                8 * (function(*(at + h)) - function(*(at - h)))
                - function(*(at + 2 * h))
                + function(*(at - 2 * h))
            )
            / (12 * np.max(h))
            for h in steps
        ]
    )


def test_linear_models_at_moving_states():
    """Slopes of the acceleration and of couples, which change the forces much, against Newton's equations."""
    model = symgen.build(four_bar(coefficient=0.5, radius="50 mm"))
    state = model.reached(0.35)
    (x, y), (v, w) = state.q[:2], state.u[:2]
    at = np.array([np.arctan2(y, x), (x * w - y * v) / 0.01])
    names = [f"bearings.{i}.torque" for i in range(4)]
    linear = model.linearise(state, coordinates=["crank.angle"], outputs=names)

    def values(angle, rate):
        of = Newton(angle, rate)
        couples = of.couples(0.025)
        return np.append(of.solved(couples)[0], couples)

    of_newton = slopes(values, at)
    assert linear.A[1] == pytest.approx(of_newton[0], rel=1e-7)
    np.testing.assert_allclose(linear.C, of_newton[1:], rtol=1e-6, atol=1e-7)


def test_derivatives_by_the_coefficient():
    """At a moving state by differences of the closed form; at rest nothing but the damping depends on it."""
    model, at = tuned(), (0.4, -2.5)
    along = np.array([np.cos(at[0]), np.sin(at[0])])
    state = model.state({"A": 0.3 * along}, {"A": 0.3 * at[1] * np.array([-along[1], along[0]])})
    found = model.sensitivity(
        ["bearings.0.torque", "rod.angular_acceleration"], ["mu"], at=state, coordinates=["rod.angle"]
    )
    h, inertia = 1e-4, 0.06
    couple = [couple_of_pendulum(*at, (0.2 + k * h) * 0.02)[0] for k in (-2, -1, 1, 2)]
    slope = (8 * (couple[2] - couple[1]) - (couple[3] - couple[0])) / (12 * h)
    assert found.derivatives.ravel() == pytest.approx([slope, slope / inertia], rel=1e-8)
    still = model.sensitivity(["rod.O.force", "bearings.0.torque"], ["mu"], at=model.equilibrium())
    assert np.max(np.abs(still.derivatives)) == 0


def test_a_bearing_without_force_has_no_derivatives():
    data = pendulum().model_dump(exclude_unset=True) | {"gravity": {"acceleration": ["0 m/s^2", "0 m/s^2"]}}
    model = symgen.build(symgen.Scene(**data))
    with pytest.raises(ModelError, match="the force in one of the bearings with friction vanishes"):
        model.linearise(model.initial_state(), coordinates=["rod.angle"])


@pytest.mark.parametrize(
    ("changes", "where", "what"),
    [
        ({"point": "A"}, "[bearings.0] point", "there are: rod"),
        ({"link": "ghost"}, "[bearings.0] link", "ghost"),
        ({"point": "P"}, "[bearings.0] point", "P"),
        ({"coefficient": "-0.1"}, "[bearings.0] coefficient", "at least zero"),
        ({"radius": "1 s"}, "[bearings.0] radius", "a length"),
        ({"transition": "0 rad/s"}, "[bearings.0] transition", "above zero"),
    ],
)
def test_scenes_that_are_refused(changes, where, what):
    with pytest.raises(SceneError) as caught:
        symgen.build(pendulum(**changes))
    assert where in str(caught.value) and what in str(caught.value)


def test_three_links_on_one_pin_are_refused():
    scene = four_bar()
    data = scene.model_dump(exclude_unset=True)
    data["points"]["D"] = {"at": ["0.3 m", "0.5 m"]}
    data["links"]["flap"] = {"points": ["B", "D"], "mass": "1 kg"}
    with pytest.raises(
        SceneError, match="rocker and coupler alone meet, at B there are: coupler, rocker, flap"
    ):
        symgen.build(symgen.Scene(**data))


SLIDER = {
    "w": 12.0,
    "r": 0.1,
    "l": 0.35,
    "m": (0.8, 1.1, 2.3),
    "arms": (0.0018, 0.0024, 0.0016),
    "transition": 0.7,
}


def slider_crank(drive="w*t", **parameters):
    w, r, l, masses, arms = (SLIDER[x] for x in ("w", "r", "l", "m", "arms"))
    joints = (("crank", "O", {}), ("rod", "A", {"against": "crank"}), ("rod", "B", {"against": "slider"}))
    return symgen.Scene(
        name="bearing_slider_crank",
        parameters={"w": {"value": f"{w} rad/s", "tunable": True}},
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "E": {"at": ["1 m", "0 m"], "ground": True},
            "A": {"at": [f"{r} m", "0 m"]},
            "B": {"on": "slider", "fraction": 0.5},
            "S": {"at": [f"{r + l - 0.05} m", "0 m"]},
            "F": {"at": [f"{r + l + 0.05} m", "0 m"]},
        },
        links={
            "crank": {"points": ["O", "A"], "mass": f"{masses[0]} kg", "length": f"{r} m"},
            "slider": {"points": ["S", "F"], "mass": f"{masses[2]} kg", "length": "0.1 m"},
            "rod": {"points": ["A", "B"], "mass": f"{masses[1]} kg", "length": f"{l} m"},
            "rail": {"points": ["O", "E"]},
        },
        guides=[{"points": ["S", "F"], "along": "rail"}],
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        drivers=[{"link": "crank", "angle": drive}],
        bearings=[
            {"link": link, "point": point, "coefficient": arm / 0.02, "radius": "20 mm"}
            | {"transition": f"{SLIDER['transition']} rad/s"} | against
            for (link, point, against), arm in zip(joints, arms, strict=True)
        ],
        analysis={"t_end": "0.5 s", "outputs": ["crank.torque", *(f"bearings.{i}.torque" for i in range(3))]},
    )  # fmt: skip


def forces_of_slider_crank(angle):
    """Drive torque, couples, forces on the rod and of the guides, by the balances of three bodies."""
    w, r, l, (m1, m2, m3) = (SLIDER[x] for x in ("w", "r", "l", "m"))
    b = np.arcsin(-r * np.sin(angle) / l)  # direction of the rod
    wb = -r * w * np.cos(angle) / (l * np.cos(b))
    ab = (r * w**2 * np.sin(angle) + l * wb**2 * np.sin(b)) / (l * np.cos(b))
    u, n, v, k = (
        np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)]),
        np.array([np.cos(b), np.sin(b)]), np.array([-np.sin(b), np.cos(b)]),
    )  # fmt: skip
    crank, at_a = -(w**2) * r / 2 * u, -(w**2) * r * u
    rod = at_a + l / 2 * (ab * k - wb**2 * v)
    slider = at_a + l * (ab * k - wb**2 * v)
    assert abs(slider[1]) < 1e-9
    weight = np.array([0, -G])
    # unknowns: O on the crank, A on the rod, B on the rod, both guides on the slider, torque
    matrix, right = np.zeros((9, 9)), np.zeros(9)
    matrix[0:2, 0:2], matrix[0:2, 2:4], right[0:2] = np.eye(2), -np.eye(2), m1 * (crank - weight)
    matrix[2, 0:2], matrix[2, 2:4], matrix[2, 8] = -r / 2 * n, -r / 2 * n, 1.0
    matrix[3:5, 2:4], matrix[3:5, 4:6], right[3:5] = np.eye(2), np.eye(2), m2 * (rod - weight)
    matrix[5, 2:4], matrix[5, 4:6], right[5] = -l / 2 * k, l / 2 * k, m2 * l**2 / 12 * ab
    matrix[6:8, 4:6], matrix[7, 6:8], right[6:8] = -np.eye(2), 1.0, m3 * (slider - weight)
    matrix[8, 6:8] = -0.05, 0.05
    rates = np.array([w, wb - w, wb])  # crank on the ground, rod on the crank, rod on the slider
    sliding = rates / np.hypot(rates, SLIDER["transition"])

    def solved(couples):
        o, a, b = couples
        known = right.copy()
        known[[2, 5, 8]] -= [o - a, a + b, -b]
        return np.linalg.solve(matrix, known)

    def missed(couples):
        x = solved(couples)
        sizes = np.array([np.hypot(*x[i : i + 2]) for i in (0, 2, 4)])
        return couples + np.array(SLIDER["arms"]) * sizes * sliding

    couples = root(missed, np.zeros(3), tol=1e-15).x
    assert np.max(np.abs(missed(couples))) < 1e-12
    return couples, solved(couples)


def test_the_torque_of_a_drive_overcomes_friction():
    """Inverse dynamics of a slider-crank with friction in three bearings, against Newton and Euler."""
    model = symgen.build(slider_crank())
    found = model.inverse_dynamics(samples=25)
    for i, angle in enumerate(SLIDER["w"] * found.times):
        couples, x = forces_of_slider_crank(angle)
        size = np.max(np.abs(x[:8]))
        for name, values in (("rod.A.force", x[2:4]), ("rod.B.force", x[4:6]), ("crank.O.force", x[0:2])):
            assert found[name].values[i] == pytest.approx(values, abs=1e-9 * size), name
        of_guides = [found[f"rail.{p}.guide_force"].values[i] for p in "SF"]
        assert of_guides == pytest.approx(x[6:8], abs=1e-9 * size)
        of_model = [found[f"bearings.{k}.torque"].values[i] for k in range(3)]
        assert of_model == pytest.approx(couples, abs=1e-9 * np.max(np.abs(couples)))
        assert found["crank.torque"].values[i] == pytest.approx(x[8], abs=1e-9 * np.max(np.abs(x[8])))
    assert found.statistics["residual"] < 1e-12
    run = model.simulate(t_end=0.5, samples=25)
    both = model.inverse_dynamics_many({"w": [12.0, 15.0]}, stop=0.5, samples=25)
    assert both["crank.torque"].values[0] == pytest.approx(found["crank.torque"].values, abs=1e-9)
    assert run["crank.torque"].values == pytest.approx(found["crank.torque"].values, abs=1e-6)


def test_bearings_of_gears_are_refused():
    """Gears join couples alone: forces at their axes lack the pressure of the teeth, and say so."""
    data = pressed("rod", "crank", "rod").model_dump(exclude_unset=True)
    data |= {"gears": [{"links": ["crank", "wheel"], "teeth": [20, 40]}]}
    data["points"] |= {"W": {"at": ["0 m", "0.4 m"], "ground": True}, "V": {"at": ["0.1 m", "0.4 m"]}}
    data["links"] |= {"wheel": {"points": ["W", "V"], "mass": "1 kg"}}
    outputs = {
        "outputs": ["crank.O.force", "wheel.W.force", "W.reaction", "crank.A.force", "bearings.0.torque"]
    }
    run = symgen.build(symgen.Scene(**data | {"analysis": outputs})).simulate(t_end=0.01)
    assert [run[name].attrs["long_name"].endswith("gear teeth") for name in outputs["outputs"]] == [
        True, True, True, False, False
    ]  # fmt: skip
    for link, point in (("crank", "O"), ("wheel", "W")):
        bearing = BEARING | {"link": link, "point": point}
        with pytest.raises(SceneError, match=f"the force in the bearing of {link} at {point} is not known"):
            symgen.build(symgen.Scene(**data | {"bearings": [bearing]}))


def pressed(link, against, carrier, **changes):
    """A slider-crank whose crank pin is pressed with 1 kN; ``carrier`` has the point at which the force acts."""
    return symgen.Scene(
        name="pressed_pin",
        parameters={"w": "10 rad/s"},
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "A": {"at": ["0.1 m", "0 m"]},
            "B": {"at": ["0.4 m", "0 m"]},
            "E": {"at": ["1 m", "0 m"], "ground": True},
            "X": {"on": carrier, "fraction": 1 if carrier == "crank" else 0},
        },
        links={
            "crank": {"points": ["O", "A"], "mass": "1 kg"},
            "rod": {"points": ["A", "B"], "mass": "1 kg"},
            "rail": {"points": ["O", "E"]},
        },
        guides=[{"points": ["B"], "along": "rail"}],
        bearings=[BEARING | {"link": link, "against": against, "point": "A"}],
        drivers=[{"link": "crank", "angle": "0.5 + w*t"}],
        analysis={"t_end": "0.1 s", "outputs": ["bearings.0.torque", "crank.torque", "rod.A.force"]},
        **({"forces": [{"point": "X", "force": ["0 N", "-1000 N"]}]} | changes),
    )


@pytest.mark.parametrize("carrier", ["crank", "rod"])
def test_friction_does_not_depend_on_the_order_of_links(carrier):
    """A force on the pin acts on the link that has its point, whichever link the bearing names first."""
    runs = [
        symgen.build(pressed(*order, carrier)).simulate() for order in (("rod", "crank"), ("crank", "rod"))
    ]
    one, other = ([r[n].values for n in ("bearings.0.torque", "crank.torque", "rod.A.force")] for r in runs)
    assert np.abs(other[0] + one[0]).max() < 1e-10 * np.abs(one[0]).max()
    assert np.abs(other[1] - one[1]).max() < 1e-10 * np.abs(one[1]).max()
    pressing = (
        np.abs(one[2][:, 1]).min() > 900
    )  # the rod carries the force through its joint, the crank does not
    assert pressing == (carrier == "rod")


@pytest.mark.parametrize(
    "changes",
    [
        {"forces": [{"point": "A", "force": ["0 N", "-1000 N"]}]},
        {"masses": [{"point": "A", "mass": "5 kg"}]},
        {"springs": [{"between": ["O", "A"], "stiffness": "1 kN/m", "length": "0.2 m"}]},
        {"guides": [{"points": ["A", "B"], "along": "rail"}]},
    ],
)
def test_what_else_acts_on_a_pin_is_refused(changes):
    (key,) = changes
    what = "guide along rail" if key == "guides" else rf"{key}\.0"
    with pytest.raises(SceneError, match=f"to bear on each other alone at A, there are also: {what}"):
        symgen.build(
            symgen.Scene(**(pressed("rod", "crank", "rod").model_dump(exclude_unset=True) | changes))
        )
