"""Runs that start in the static equilibrium, against closed forms and minimal equations with their own root."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize, root
from shared.linkages import GRAVITY, G, at, chain, ground, rod

import symgen
from symgen.errors import InitialStateError, ModelError, SimulationError
from symgen.export import exported

M, K, C, L0 = 2.0, 100.0, 4.0, 0.5


def hung(**tables):
    """A mass on a vertical rail below a spring, whose upper end moves with ``up``."""
    return symgen.Scene(
        name="hung",
        parameters={
            "m": {"value": f"{M} kg", "tunable": True},
            "k": {"value": f"{K} N/m", "tunable": True},
            "c": {"value": f"{C} N*s/m", "tunable": True},
            "f": {"value": "3 N", "tunable": True},
            "w": "5 rad/s",
        },
        inputs={"u": "0 N"},
        points={"O": ground(0, 0), "E": ground(0, -2), "A": at(0, -0.4), **tables.pop("points", {})},
        links={"rail": {"points": ["O", "E"]}},
        guides=[{"points": ["A"], "along": "rail"}],
        masses=[{"point": "A", "mass": "m"}],
        gravity=GRAVITY,
        **{
            "springs": [{"between": ["O", "A"], "stiffness": "k", "damping": "c", "length": f"{L0} m"}],
            "start": {"equilibrium": True},
            **tables,
        },
    )


PUSHED = {"forces": [{"point": "A", "force": ["0 N", "f*sin(w*t) + u"]}]}


@pytest.fixture(scope="module")
def pushed():
    return symgen.build(hung(**PUSHED))


def drop(m=M, k=K, **_):
    return -L0 - m * G / k


def response(t, m, k, c, f):
    """Displacement by f*sin(w t) from rest, by complex exponentials."""
    w, lead = 5.0, np.sqrt(complex(c * c - 4 * k * m))
    roots = np.array([(-c + lead) / (2 * m), (-c - lead) / (2 * m)])
    forced = f / (k - m * w * w + 1j * c * w)  # Im(forced exp(i w t))
    free = np.linalg.solve(np.array([[1, 1], roots]), -np.array([forced.imag, (1j * w * forced).imag]))
    return ((forced * np.exp(1j * w * t)).imag + free @ np.exp(np.outer(roots, t))).real


def test_a_mass_on_a_spring_starts_where_its_weight_stretches_it(pushed):
    begin = pushed.initial_state()
    assert begin.positions["A"] == pytest.approx([0, drop()], abs=1e-13) and not begin.u.any()
    assert np.max(np.abs(pushed.accelerations().points["A"])) < 1e-12
    run = pushed.simulate(2.0, rtol=1e-11, samples=41)
    expected = drop() + response(run.time, M, K, C, 3.0)
    assert run["A.position"].values[:, 1] == pytest.approx(expected, abs=1e-10)
    assert run.notes == ()


def test_a_changed_parameter_moves_the_start_in_every_kind_of_run(pushed):
    masses = np.array([1.0, 2.0, 2.5, 4.0])
    many = pushed.simulate_many({"m": masses}, t_end=1.0, rtol=1e-11, samples=11, outputs=["A.position"])
    assert "equilibrium of its own" in many.attrs["notes"]
    swept = pushed.sweep(
        {"m": masses}, t_end=1.0, rtol=1e-11, samples=11, outputs=["A.position"], reduce="final"
    )
    for i, m in enumerate(masses):
        expected = drop(m) + response(np.linspace(0, 1, 11), m, K, C, 3.0)
        assert many["A.position"].values[i, :, 1] == pytest.approx(expected, abs=1e-10)
        assert swept["A.position.final"].values[i, 1] == pytest.approx(expected[-1], abs=1e-10)
        changed = pushed.with_parameters(m=m)
        stepper = changed.stepper(rtol=1e-11)
        stepper.step(1.0)
        assert stepper["A.position"][1] == pytest.approx(expected[-1], abs=1e-10)
        stepper.reset()
        assert stepper["A.position"][1] == pytest.approx(drop(m), abs=1e-13)
        held = changed.simulate(
            1.0, controller=lambda t, view: {"u": 0.0}, sample=0.1, rtol=1e-11, samples=11
        )
        assert held["A.position"].values[:, 1] == pytest.approx(expected, abs=1e-10)
        assert changed.rhs.start[1] == pytest.approx(drop(m), abs=1e-13)
        assert changed.equilibrium().state.q == pytest.approx(changed.initial_state().q, abs=0.0)


def test_derivatives_of_the_run_hold_the_forces_in_balance(pushed):
    names, t = ["m", "k", "c", "f"], np.array([0.5, 1.0, 1.7])
    at_start = pushed.sensitivity(["A.position.y"], names).derivatives
    assert at_start == pytest.approx(np.array([[-G / K, M * G / K**2, 0, 0]]), rel=1e-12, abs=1e-15)

    def value(x):
        return drop(*x[:2]) + response(t, *x)

    x = np.array([M, K, C, 3.0])
    expected = np.array([_slope(lambda s, i=i: value(x + s * np.eye(4)[i]), 1e-3 * x[i]) for i in range(4)]).T
    forward = pushed.sensitivity(["A.position.y"], names, t_eval=t, rtol=1e-12).derivatives[:, 0]
    assert forward == pytest.approx(expected, rel=1e-8, abs=1e-11)
    backward = pushed.sensitivity(["A.position.y"], names, t_end=t[-1], rtol=1e-12).derivatives
    assert np.ravel(backward) == pytest.approx(expected[-1], rel=1e-8, abs=1e-11)
    of_run = pushed.simulate(t[-1], rtol=1e-12).gradient(["A.position.y"], names)
    assert np.ravel(of_run.derivatives) == pytest.approx(expected[-1], rel=1e-8, abs=1e-11)
    both = pushed.sensitivity(
        ["A.position.y"], ["k", "A.position.y"], coordinates=["A.position.y"], t_eval=t, method="radau5"
    ).derivatives[:, 0]  # by the stiffness the equilibrium moves, by the coordinate the start leaves it
    decay = [_slope(lambda s, i=i: _free(t, s)[i], 1e-3) for i in range(3)]
    assert both == pytest.approx(np.column_stack([expected[:, 1], decay]), rel=1e-6, abs=1e-8)
    with pytest.raises(symgen.SymgenError, match="coordinates"):
        pushed.sensitivity(["A.position.y"], ["k"], t_eval=t, method="radau5")


def _slope(f, h):
    """Derivative at zero by central differences at three step sizes, extrapolated."""
    one, two, four = (((f(s) - f(-s)) / (2 * s)) for s in (h, 2 * h, 4 * h))
    return (64 * one - 20 * two + four) / 45


def _free(t, offset):
    roots = np.roots([M, C, K])
    return (np.linalg.solve(np.array([[1, 1], roots]), [offset, 0]) @ np.exp(np.outer(roots, t))).real


def test_optimised_stiffness_and_damping_move_the_start():
    """The weight's sag bounds the stiffness; a closed form of the run finds the same optimum."""
    model = symgen.build(hung(**PUSHED, analysis={"t_end": "4 s"}))
    limits = {"k": (80.0, 300.0), "c": (1.0, 20.0)}
    highest = -0.66
    best = model.optimise(
        limits, "A.velocity.rms.y", {"A.position.greatest.y": (None, highest)}, samples=401, rtol=1e-10
    )
    t = np.linspace(0.0, 4.0, 401)

    def moved(x):
        return response(t, M, *x, 3.0)

    def speed(x):
        return (response(t + 1e-5, M, *x, 3.0) - response(t - 1e-5, M, *x, 3.0)) / 2e-5

    own = minimize(
        lambda x: np.sqrt(np.trapezoid(speed(x) ** 2, t) / 4.0),
        [K, C],
        bounds=list(limits.values()),
        constraints={"type": "ineq", "fun": lambda x: highest - np.max(drop(k=x[0]) + moved(x))},
        options={"ftol": 1e-12},
    )
    assert best.converged and best.gradients == "exact"
    assert best.constraints["A.position.greatest.y"] == pytest.approx(highest, abs=1e-7)
    assert [best.parameters["k"], best.parameters["c"]] == pytest.approx(own.x, rel=1e-3)
    assert best.objective == pytest.approx(own.fun, rel=1e-5)


def test_an_unstable_equilibrium_is_kept_and_noted():
    upright = chain([(0, 0), (0, 1)], [2.0], gravity=GRAVITY, start={"equilibrium": True})
    model = symgen.build(upright)
    run = model.simulate(0.1)
    assert run["P1.position"].values[:, 1] == pytest.approx(1.0, abs=1e-12)
    assert "the equilibrium at the start is unstable" in run.notes[0]
    assert not model.simulate(0.1, state=model.state({"P1": [0.6, 0.8]})).notes, "this one starts elsewhere"
    near = symgen.build(chain([(0, 0), (0.1, 1)], [2.0], gravity=GRAVITY, start={"equilibrium": True}))
    assert near.initial_state().positions["P1"] == pytest.approx([0, -np.hypot(0.1, 1)], abs=1e-9)
    assert not near.simulate(0.1).notes


def test_the_note_is_that_of_the_parameters():
    """A rod upright on a torsion spring is stable if the stiffness exceeds m g l / 2."""
    scene = chain(
        [(0, 0), (0, 1)],
        [2.0],
        parameters={"k": {"value": "8.829 N*m", "tunable": True}},
        torsion_springs=[{"link": "L0", "stiffness": "k", "angle": "90 deg"}],
        start={"equilibrium": True},
    )
    model = symgen.build(scene)
    assert len(model.simulate(0.1).notes) == 1
    assert model.with_parameters(k=1.1 * G).simulate(0.1).notes == ()
    assert len(model.with_parameters(k=0.8 * G).simulate(0.1).notes) == 1


def test_threads_may_start_a_model_at_once(monkeypatch):
    """One thread finds the equilibrium while another, which has found it, goes on."""
    from symgen.runtime.rods import equilibrium

    model = symgen.build(hung(**PUSHED)).with_parameters(m=1.5)
    found, own = threading.Barrier(2), equilibrium.resting

    def together(*args):
        rest = own(*args)
        found.wait(60)
        return rest

    monkeypatch.setattr(equilibrium, "resting", together)
    with ThreadPoolExecutor(2) as pool:
        for begin in pool.map(lambda _: model.initial_state(), range(2)):
            assert begin.positions["A"][1] == pytest.approx(drop(1.5), abs=1e-13)


def test_a_torsion_spring_is_wound_over_revolutions():
    """A couple of 7 N m on 1 N m/rad holds an arm 7 rad from its free angle: runs start with the revolution."""
    scene = symgen.Scene(
        name="wound",
        parameters={"couple": {"value": "7 N*m", "tunable": True}},
        points={"O": ground(0, 0), "A": at(1, 0)},
        links={"arm": rod("O", "A", 3.0)},
        torsion_springs=[{"link": "arm", "stiffness": "1 N*m/rad", "damping": "0.5 N*m*s/rad"}],
        torques=[{"link": "arm", "torque": "couple"}],
        start={"equilibrium": True},
        analysis={"outputs": ["A.position", "torsion_springs.0.angle"]},
    )
    model = symgen.build(scene)
    assert model.initial_state().positions["A"] == pytest.approx([np.cos(7), np.sin(7)], abs=1e-12)
    assert np.max(np.abs(model.accelerations().points["A"])) < 1e-10
    run = model.simulate(1.0)
    assert run["torsion_springs.0.angle"].values == pytest.approx(7.0, abs=1e-12)
    stepper = model.stepper()
    stepper.step(0.5)
    assert stepper["torsion_springs.0.angle"] == pytest.approx(7.0, abs=1e-12)
    y = model.rhs.start
    assert np.max(np.abs(model.rhs(0.0, y))) < 1e-10
    assert np.ravel(model.sensitivity(["arm.angle"], t_eval=[0.4, 0.8]).derivatives) == pytest.approx(1.0)
    assert model.with_parameters(couple=2.0).initial_state().positions["A"] == pytest.approx(
        [np.cos(2), np.sin(2)], abs=1e-12
    )
    with pytest.raises(ModelError, match="revolution"):
        exported(scene)


def test_first_order_states_start_at_rest():
    """A motor with a current: K i = m g l cos(angle) in a series circuit under an integrator of the angle."""
    scene = chain(
        [(0, 0), (1, 0.1)],
        [2.0],
        gravity=GRAVITY,
        parameters={"kp": {"value": 60, "tunable": True}, "Km": "1 N*m", "T": "1 s"},
        states={"i": {"start": 0, "rate": "(kp*(0.2 - L0.angle) - i)/T"}},
        torques=[{"link": "L0", "torque": "Km*i"}],
        start={"equilibrium": True},
        analysis={"outputs": ["i", "P1.position"]},
    )
    model = symgen.build(scene)
    length = np.hypot(1, 0.1)

    def rest(kp):
        return root(lambda a: kp * (0.2 - a) - 2 * G * length / 2 * np.cos(a), 0.0, tol=1e-14).x[0]

    angle = rest(60.0)
    run = model.simulate(2.0, rtol=1e-11)
    assert run["i"].values == pytest.approx(60 * (0.2 - angle), abs=1e-8)
    assert run["P1.position"].values[-1] == pytest.approx(
        length * np.array([np.cos(angle), np.sin(angle)]), abs=1e-9
    )
    slope = model.sensitivity(["L0.angle"], ["kp"], t_eval=[0.5, 1.0], rtol=1e-11).derivatives
    assert np.ravel(slope) == pytest.approx(_slope(lambda s: rest(60.0 + s), 1e-1), rel=1e-7)


def test_a_drive_may_accelerate_at_the_start_but_not_move():
    """A spring hangs from a point that rises as a (1 - cos w t): the mass starts at rest, the closed form."""
    moving = {"points": {"U": ground(0, 0, motion=["0 m", "b*(1 - cos(w*t))"])}}
    tables = {"springs": [{"between": ["U", "A"], "stiffness": "k", "length": f"{L0} m"}]}
    scene = hung(**moving, **tables)
    scene = symgen.Scene(
        name="hung",
        **{
            **scene.model_dump(exclude_unset=True),
            "parameters": {
                "m": {"value": "2 kg", "tunable": True},
                "k": {"value": "100 N/m", "tunable": True},
                "c": "1 N*s/m",
                "f": "3 N",
                "w": "5 rad/s",
                "b": {"value": "1 cm", "tunable": True},
            },
        },
    )
    model = symgen.build(scene)
    run = model.simulate(1.0, rtol=1e-11)
    w, own, t = 5.0, np.sqrt(K / M), run.time
    lifted = 0.01 * (1 - np.cos(own * t) - own**2 / (own**2 - w**2) * (np.cos(w * t) - np.cos(own * t)))
    assert run["A.position"].values[:, 1] == pytest.approx(drop() + lifted, abs=1e-10)
    with pytest.raises(ModelError, match="(?s)the ground point U accelerates.*zero acceleration"):
        model.sensitivity(["A.position.y"], ["k"], t_end=1.0)


def test_a_rod_below_a_drive_that_starts_to_accelerate():
    """The second rod hangs; the first is driven by a (1 - cos w t): against the equation of its angle."""
    scene = chain(
        [(0, 0), (1, 0), (1.5, -0.3)],
        parameters={
            "a": {"value": 0.4, "tunable": True},
            "w": "3 rad/s",
            "v": {"value": "0 rad/s", "tunable": True},
        },
        drivers=[{"link": "L0", "angle": "a*(1 - cos(w*t)) + v*t"}],
        start={"equilibrium": True},
    )
    model, length = symgen.build(scene), np.hypot(0.5, 0.3)

    def rates(t, y):
        turned, speed, rise = 0.4 * (1 - np.cos(3 * t)), 1.2 * np.sin(3 * t), 3.6 * np.cos(3 * t)
        c, s = np.cos(turned), np.sin(turned)
        pivot = rise * np.array([-s, c]) - speed**2 * np.array([c, s])
        across = np.array([-np.sin(y[0]), np.cos(y[0])])
        return [y[1], 1.5 / length * across @ (np.array([0, -G]) - pivot)]

    run = model.simulate(1.0, rtol=1e-11, samples=11)
    own = solve_ivp(rates, (0, 1), [-np.pi / 2, 0], "DOP853", rtol=1e-12, atol=1e-13, t_eval=run.time).y[0]
    hanging = model.equilibrium()  # of the drive at its value
    assert hanging.state.positions["P2"] == pytest.approx([1.0, -length], abs=1e-9)
    assert np.array_equal(hanging.state.q, model.initial_state().q)
    (frequency,) = model.modes().frequencies
    assert frequency == pytest.approx(np.sqrt(1.5 * G / length) / (2 * np.pi), rel=1e-9)
    apart = run["P2.position"].values - run["P1.position"].values
    assert apart == pytest.approx(length * np.column_stack([np.cos(own), np.sin(own)]), abs=1e-9)
    with pytest.raises(ModelError, match="zero acceleration"):
        model.sensitivity(["P2.position"], ["a"], t_end=1.0)
    with pytest.raises(InitialStateError, match="the drive of"):
        model.with_parameters(v=0.1).simulate(1.0)
    with pytest.raises(ModelError, match="a change of v sets a drive in motion"):
        model.with_parameters(a=0.0).sensitivity(["P2.position"], ["v"], t_end=1.0)


def test_a_linkage_written_in_space_starts_in_its_equilibrium_there():
    """A rod between its weight and a spring without free length, which pull along k P + m g / 2."""
    length = np.hypot(0.3, 0.5)
    scene = symgen.Scene(
        parameters={"m": {"value": "2 kg", "tunable": True}},
        points={"O": ground(0, 0, 0), "P": ground(1, 0, 0), "A": at(0.3, 0, -0.5)},
        links={"rod": {"points": ["O", "A"], "mass": "m"}},
        springs=[{"between": ["P", "A"], "stiffness": "30 N/m", "length": "0 m"}],
        gravity={"acceleration": [0, 0, f"{-G} m/s^2"]},
        start={"equilibrium": True},
    )

    def place(m):
        pull = np.array([30.0, 0.0, -m * G / 2])
        return length * pull / np.linalg.norm(pull)

    model = symgen.build(scene)
    run = model.simulate(1.0)
    assert run["A.position"].values == pytest.approx(np.tile(place(2.0), (len(run.time), 1)), abs=1e-11)
    found = model.sensitivity(["A.position"], ["m"], t_eval=[0.5, 1.0], rtol=1e-11).derivatives[-1, :, 0]
    assert found == pytest.approx(_slope(lambda s: place(2.0 + s), 1e-3), rel=1e-8, abs=1e-11)


def test_an_idle_freedom_is_left_where_drawn_and_has_no_derivative():
    """A rod without weight keeps its drawn direction: no force determines it."""
    scene = symgen.Scene(
        parameters={"l": {"value": "1 m", "tunable": True}},
        points={"O": ground(0, 0), "A": at(0.6, 0.8)},
        links={"arm": rod("O", "A", length="l")},
        start={"equilibrium": True},
    )
    model = symgen.build(scene)
    assert model.simulate(1.0)["A.position"].values[-1] == pytest.approx([0.6, 0.8], abs=1e-14)
    with pytest.raises(ModelError, match="neutral"):
        model.sensitivity(["A.position"], ["l"], t_end=1.0)


def test_an_exported_program_starts_in_it_and_states_for_which_parameters(pushed):
    code = exported(hung(**PUSHED))
    assert float(code.start.strip("{}").split(",")[1]) == pushed.initial_state().q[1]
    assert any("equilibrium at the default parameters" in note for note in code.notes)


def test_a_resumed_run_continues_from_the_equilibrium(pushed, tmp_path):
    options = {"samples": 11, "method": "rk4", "step": 1e-4, "checkpoint": tmp_path / "run"}
    changed = pushed.with_parameters(m=3.0)
    whole = changed.simulate(1.0, **options | {"checkpoint": None})
    with pytest.raises(SimulationError):
        changed.simulate(1.0, **options, max_wall=1e-4)
    resumed = pushed.with_parameters(m=3.0).simulate(1.0, **options, resume=tmp_path / "run")
    assert np.array_equal(resumed["A.position"].values, whole["A.position"].values)
