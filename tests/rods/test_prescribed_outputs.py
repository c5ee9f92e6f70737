"""Prescribed motions of places and angles with the efforts at chosen drives, by virtual work and Lagrange's equations."""

from __future__ import annotations

import re
from functools import lru_cache

import mpmath as mp
import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from shared.linkages import at, ground
from shared.virtual_work import G, efforts, halves, meet, of_rods, slopes

import symgen
from symgen.errors import CapabilityError, DerivationError, ModelError, SceneError, SimulationError
from symgen.export import export_c
from symgen.runtime.integrate.dead_points import dead_points

GRAVITY = {"acceleration": ["0 m/s^2", "-9.81 m/s^2"]}
T = sp.Symbol("t")


def by_drives(drives, forces, q):
    """Return the efforts at drives whose values are functions of the prescribed q: those have the virtual work of forces."""
    rates = [slopes(lambda y, k=k: np.array(drives([*q[:k], y, *q[k + 1 :]])), x)[0] for k, x in enumerate(q)]
    return np.linalg.solve(np.array(rates, dtype=float), np.array(forces, dtype=float))


def angle(z):
    return mp.arg(z)


def slider_crank(**more):
    """Return a slider-crank whose slider moves as prescribed, by a torque on its crank."""
    return {
        "symgen": 1,
        "name": "moved_slider",
        "parameters": {"w": {"value": "2 rad/s", "tunable": True}, "middle": "33 cm", "stroke": "4 cm"},
        "points": {"O": ground(0, 0), "A": at(0.05, 0.0866), "B": at(0.35, 0), "R": ground(1, 0)},
        "links": {
            "crank": {"points": ["O", "A"], "mass": "2 kg", "length": "0.1 m"},
            "rod": {"points": ["A", "B"], "mass": "1 kg", "length": "0.3 m"},
            "rail": {"points": ["O", "R"]},
        },
        "masses": [{"point": "B", "mass": "3 kg"}],
        "guides": [{"points": ["B"], "along": "rail"}],
        "gravity": GRAVITY,
        "motions": [{"of": "B.x", "value": "middle + stroke*sin(w*t)"}],
        "torques": [{"link": "crank", "torque": "?"}],
        "analysis": {
            "t_end": "3 s",
            "outputs": [
                *("torques.0.torque", "torques.0.power", "crank.angle", "crank.angular_velocity", "energy"),
                *("rod.A.force", "O.reaction", "R.reaction", "shaking_moment", "shaking_force", "B.position"),
            ],
        },
    } | more


def of_slider_crank(t):
    """Return the torque on the crank, and the force on the rod at the crank pin, by the slider's place."""
    first, second = mp.mpf("0.1"), mp.mpf("0.3")

    def turned(q):
        return [mp.acos((first**2 + q[0] ** 2 - second**2) / (2 * first * q[0]))]

    def places(q):
        pin, end = first * mp.expj(turned(q)[0]), mp.mpc(q[0], 0)
        return np.array([*of_rods((mp.mpc(0), pin), (pin, end)), end])

    masses = [*halves(2, 1), 3]
    weights = np.array([mp.mpc(0, -G * m) for m in masses])
    inputs = lambda s: [mp.mpf("0.33") + mp.mpf("0.04") * mp.sin(2 * s)]  # noqa: E731
    forces = efforts(places, inputs, masses, t, lambda *_: weights)
    (torque,) = by_drives(turned, forces, inputs(mp.mpf(t)))
    # d'Alembert's moment of the crank about O gives the part of the pin force across it; weights act at its middle.
    a = slopes(lambda s: turned(inputs(s))[0], mp.mpf(t))[1]
    theta = turned(inputs(mp.mpf(t)))[0]
    across = (torque - 2 * float(first) ** 2 / 3 * float(a) - 2 * 9.81 * 0.05 * float(mp.cos(theta))) / 0.1
    return torque, across, float(theta)


def test_slider_by_a_torque_on_its_crank():
    model = symgen.build(symgen.Scene(**slider_crank()))
    run, found = model.simulate(rtol=1e-12, samples=7), model.inverse_dynamics(samples=7, sections=(1e-9,))
    for i, t in enumerate(np.asarray(run.time)):
        torque, across, theta = of_slider_crank(float(t))
        for result in (run, found):
            assert result["torques.0.torque"].values[i] == pytest.approx(torque, abs=1e-11)
            pin = result["rod.A.force"].values[i] @ [-np.sin(theta), np.cos(theta)]
            assert pin == pytest.approx(across, abs=1e-9)
        assert found["B.position.x"].values[i] == pytest.approx(0.33 + 0.04 * np.sin(2 * t), abs=1e-15)
        assert found["crank@1e-09.moment"].values[i] == pytest.approx(torque, abs=1e-7)
    for name in ("O.reaction", "R.reaction", "shaking_moment", "energy"):
        assert np.asarray(run[name]) == pytest.approx(np.asarray(found[name]), abs=1e-9)
    power = np.asarray(run["torques.0.torque"]) * np.asarray(run["crank.angular_velocity"])
    assert np.asarray(run["torques.0.power"]) == pytest.approx(power, abs=1e-13)
    assert run.drift.energy < 1e-10 * run.drift.energy_exchanged
    assert run.drift.constraint < 1e-13
    stepper = model.stepper(rtol=1e-12)
    stepper.step(3.0)
    for name in ("torques.0.torque", "energy", "rod.A.force"):
        assert np.ravel(stepper[name]) == pytest.approx(np.ravel(found[name].values[-1]), abs=1e-9)
    # The guide pushes across the rail: of the reactions along it nothing is left.
    pushed = np.asarray(run["R.reaction"])[:, 0]
    assert pushed == pytest.approx(0.0, abs=1e-12)


LENGTHS, MASSES = (0.5, 0.4), (2.0, 1.3)
#: Motion of the end of a two-link arm, both joints driven.
END = (sp.Rational(3, 10) + sp.sin(3 * T) / 5, sp.Rational(35, 100) + sp.cos(2 * T) / 10)


def arm(**more):
    """Return an arm whose end moves as prescribed, by torques at both joints."""
    return {
        "symgen": 1,
        "name": "moved_end",
        "parameters": {"w": {"value": "1 rad/s", "tunable": True}, "x": "0.3 m", "a": "0.2 m", "y": "0.35 m", "b": "0.1 m"},
        "points": {"O": ground(0, 0), "A": at(0.45, 0.2), "B": at(0.3, 0.45)},
        "links": {
            name: {"points": ends, "mass": f"{m} kg", "length": f"{l} m"}
            for name, ends, m, l in zip(("upper", "fore"), (["O", "A"], ["A", "B"]), MASSES, LENGTHS, strict=True)
        },
        "gravity": GRAVITY,
        "motions": [
            {"of": "B.position.y", "value": "y + b*cos(2*w*t)"},
            {"of": "B.position.x", "value": "x + a*sin(3*w*t)"},
        ],
        "torques": [
            {"link": "upper", "torque": "?"},
            {"link": "fore", "against": "upper", "torque": "?"},
        ],
        "analysis": {
            "t_end": "4 s",
            "outputs": [
                *("torques.0.torque", "torques.1.torque", "torques.0.power", "torques.1.power", "B.position"),
                *("energy", "power", "upper.A.force", "O.reaction", "shaking_moment"),
            ],
        },
    } | more  # fmt: skip


@lru_cache
def lagrange():
    """Return the torques at both joints of two rods over (t, angles, rates, accelerations): Lagrange's equations."""
    a, b, ra, rb, sa, sb = sp.symbols("a b ra rb sa sb")
    (l1, l2), (m1, m2) = ([sp.nsimplify(x) for x in row] for row in (LENGTHS, MASSES))
    g = sp.nsimplify("9.81")
    vx = -l1 * ra * sp.sin(a) - l2 / 2 * (ra + rb) * sp.sin(a + b)
    vy = l1 * ra * sp.cos(a) + l2 / 2 * (ra + rb) * sp.cos(a + b)
    kinetic = m1 * l1**2 / 6 * ra**2 + m2 * (vx**2 + vy**2) / 2 + m2 * l2**2 / 24 * (ra + rb) ** 2
    potential = g * (m1 * l1 / 2 * sp.sin(a) + m2 * (l1 * sp.sin(a) + l2 / 2 * sp.sin(a + b)))
    lagrangian = kinetic - potential

    def along(f):
        return sum(f.diff(x) * y for x, y in ((a, ra), (b, rb), (ra, sa), (rb, sb)))

    torques = [along(lagrangian.diff(r)) - lagrangian.diff(x) for x, r in ((a, ra), (b, rb))]
    return sp.lambdify((a, b, ra, rb, sa, sb), torques)


def joints(t):
    """Return both angles of the arm with their rates and accelerations, where its end is as prescribed."""
    place = sp.lambdify(T, END)

    def angles(s):
        end = mp.mpc(
            *(mp.mpf(x) for x in (mp.mpf(3) / 10 + mp.sin(3 * s) / 5, mp.mpf(35) / 100 + mp.cos(2 * s) / 10))
        )
        elbow = meet(mp.mpc(0), end, mp.mpf("0.5"), mp.mpf("0.4"), -1)
        return np.array([angle(elbow), angle((end - elbow) / elbow)])

    assert place
    first, second = slopes(angles, mp.mpf(t))
    return [float(x) for x in (*angles(mp.mpf(t)), *first, *second)]


def test_end_of_an_arm_by_torques_at_its_joints():
    model = symgen.build(symgen.Scene(**arm()))
    run = model.simulate(rtol=1e-12, samples=9)
    for result in (run, model.inverse_dynamics(samples=9)):
        for i, t in enumerate(np.asarray(run.time)):
            state = joints(float(t))
            torques = lagrange()(*state)
            found = [result[f"torques.{k}.torque"].values[i] for k in (0, 1)]
            assert found == pytest.approx(torques, abs=1e-9)
            powers = [result[f"torques.{k}.power"].values[i] for k in (0, 1)]
            assert powers == pytest.approx([torques[0] * state[2], torques[1] * state[3]], abs=1e-9)
            # The motor of the shoulder stands on the ground.
            across = np.asarray(result["shaking_moment"]).reshape(-1)[i]
            assert across == pytest.approx(-torques[0], abs=1e-9)
    assert run.drift.energy < 1e-9 * run.drift.energy_exchanged
    total = np.asarray(run["torques.0.power"]) + np.asarray(run["torques.1.power"])
    assert np.asarray(run["power"]) == pytest.approx(total, abs=1e-12)


def test_order_of_motions_and_efforts_does_not_matter():
    scene = arm()
    swapped = arm(motions=scene["motions"][::-1], torques=scene["torques"][::-1])
    first, second = (symgen.build(symgen.Scene(**s)).simulate(samples=5) for s in (scene, swapped))
    for k in (0, 1):
        assert np.asarray(first[f"torques.{k}.torque"]) == pytest.approx(
            np.asarray(second[f"torques.{1 - k}.torque"]), abs=1e-8
        )


BAR = {"crank": 0.1, "coupler": 0.3, "rocker": 0.25}
BASE, BAR_MASSES = 0.28, (0.5, 1.2, 0.9)


def four_bar(motions, torques, **more):
    """Return a crank-rocker whose coupler carries the point P."""
    pin = meet(mp.expj(1) / 10, mp.mpc("0.28"), mp.mpf("0.3"), mp.mpf("0.25"), 1)
    return {
        "symgen": 1,
        "name": "moved_four_bar",
        "parameters": {"w": {"value": "3 rad/s", "tunable": True}, "x": "8 cm", "a": "4 cm"},
        "points": {
            "O": ground(0, 0),
            "A": at(0.1 * np.cos(1), 0.1 * np.sin(1)),
            "B": at(pin.real, pin.imag),
            "Q": ground(BASE, 0),
            "P": {"on": "coupler", "fraction": 0.4, "offset": "5 cm"},
        },
        "links": {
            name: {"points": ends, "mass": f"{m} kg", "length": f"{BAR[name]} m"}
            for name, ends, m in zip(BAR, (["O", "A"], ["A", "B"], ["Q", "B"]), BAR_MASSES, strict=True)
        },
        "gravity": GRAVITY,
        "motions": motions,
        "torques": torques,
        "analysis": {"t_end": "2 s", "outputs": ["torques.0.torque", "P.position", "energy", "crank.angle"]},
    } | more


def of_four_bar(theta):
    """Return its pins and the point of the coupler at an angle of its crank."""
    pin = mp.mpf("0.1") * mp.expj(theta)
    other = meet(pin, mp.mpc("0.28"), mp.mpf("0.3"), mp.mpf("0.25"), 1)
    point = pin + (other - pin) * mp.mpf("0.4") + mp.mpc(0, "0.05") * (other - pin) / mp.mpf("0.3")
    return pin, other, point


def crank_at(x):
    """Return the angle of the crank near 1 rad at which the point of the coupler is at x."""
    return mp.findroot(lambda theta: of_four_bar(theta)[2].real - x, 1.57)


def bar_places(theta):
    pin, other, _ = of_four_bar(theta)
    return np.array(of_rods((mp.mpc(0), pin), (pin, other), (mp.mpc("0.28"), other)))


def test_point_of_a_coupler_by_a_torque_on_the_crank():
    moved = [{"of": "P.x", "value": "x + a*sin(w*t)"}]
    model = symgen.build(symgen.Scene(**four_bar(moved, [{"link": "crank", "torque": "?"}])))
    masses = halves(*BAR_MASSES)
    weights = np.array([mp.mpc(0, -G * m) for m in masses])
    inputs = lambda s: [mp.mpf("0.08") + mp.mpf("0.04") * mp.sin(3 * s)]  # noqa: E731
    run = model.simulate(rtol=1e-12, samples=5)
    for result in (run, model.inverse_dynamics(samples=5)):
        for i, t in enumerate(np.asarray(run.time)):
            forces = efforts(lambda q: bar_places(crank_at(q[0])), inputs, masses, t, lambda *_: weights)
            (torque,) = by_drives(lambda q: [crank_at(q[0])], forces, inputs(mp.mpf(t)))
            assert result["torques.0.torque"].values[i] == pytest.approx(torque, abs=1e-8)
    assert run.drift.energy < 1e-9 * run.drift.energy_exchanged


def test_angle_over_revolutions_is_that_of_a_drive():
    moved = [{"of": "crank.angle", "value": "1 + 3*w*t"}]
    torque = [{"link": "crank", "torque": "?"}]
    model = symgen.build(symgen.Scene(**four_bar(moved, torque)))
    driven = four_bar([], [], drivers=[{"link": "crank", "angle": "1 + 3*w*t"}])
    driven["analysis"] = {"t_end": "2 s", "outputs": ["crank.torque", "energy", "P.position"]}
    other = symgen.build(symgen.Scene(**driven))
    for verb, arguments in (("simulate", {"rtol": 1e-11}), ("inverse_dynamics", {"over": "time"})):
        at_times = arguments if verb == "simulate" else {}
        first, second = (getattr(m, verb)(samples=41, **at_times) for m in (model, other))
        for name, known in (("torques.0.torque", "crank.torque"), ("P.position", "P.position")):
            assert np.asarray(first[name]) == pytest.approx(np.asarray(second[known]), abs=1e-9), verb
    assert np.asarray(model.kinematics(samples=41)["crank.angle"])[-1] == pytest.approx(19.0)
    assert len(model.assemblies()) == len(other.assemblies()) == 2


def _dead_points(found):
    notes = (note for note in found.notes if "dead point of torques.0" in note)
    return [float(note.split()[3]) for note in notes]


def test_a_motion_that_returns_from_a_dead_point_touches_it():
    stretched = float(np.arccos((BASE**2 + 0.4**2 - BAR["rocker"] ** 2) / (2 * BASE * 0.4)))
    moved, torque = (
        [{"of": "crank.angle", "value": "d + (1 - d)*cos(w*t)**2"}],
        [{"link": "rocker", "torque": "?"}],
    )
    tables = four_bar(moved, torque)
    tables["parameters"] = tables["parameters"] | {"d": f"{stretched!r} rad"}
    model = symgen.build(symgen.Scene(**tables))
    found = model.inverse_dynamics(0, 2, samples=40, over="time")
    assert _dead_points(found) == pytest.approx([np.pi / 6, np.pi / 2], abs=1e-6)
    ends = np.array([np.pi / 6, np.pi / 2])  # at both ends of the motion, too
    notes = dead_points(
        model.counting(model.initial_state()).evaluator, ends, np.array([model.reached(t).q for t in ends])
    )
    assert [float(note.split()[3]) for note in notes] == pytest.approx(ends, abs=1e-8)


def test_rocker_cannot_turn_the_crank_past_its_dead_points():
    moved, torque = [{"of": "crank.angle", "value": "1 + w*t"}], [{"link": "rocker", "torque": "?"}]
    model = symgen.build(symgen.Scene(**four_bar(moved, torque)))
    # The rocker stands where crank and coupler are in line.
    base, rocker = BASE, BAR["rocker"]
    stretched = [
        np.arccos((base**2 + s**2 - rocker**2) / (2 * base * s)) + turn
        for s, turn in ((0.4, 0), (0.2, np.pi))
    ]
    times = sorted(((angle - 1) % (2 * np.pi)) / 3 for angle in stretched)
    for found in (
        model.inverse_dynamics(samples=30),
        model.inverse_dynamics(samples=3),
        model.simulate(samples=2),  # both are between the two
        model.simulate(samples=201),
    ):
        assert _dead_points(found) == pytest.approx([t for t in times if t < 2], abs=1e-8)
    with pytest.raises(
        SimulationError, match=r"torques.0 cannot move crank.angle there: it is at a dead point"
    ):
        model.inverse_dynamics(at=[times[0]], over="time")
    away = model.inverse_dynamics(at=[times[0] + 1e-3], over="time")
    assert np.isfinite(np.asarray(away["torques.0.torque"])).all()


@pytest.mark.parametrize(
    ("second", "message"),
    [
        ({"of": "P.x", "value": "x"}, r"\[motions.1\] of: P.x has a prescribed motion already, by motions.0"),
        ({"of": "P.position.x", "value": "x"}, r"P.position.x has a prescribed motion already, by motions.0"),
        ({"of": "2*P.x", "value": "2*x"}, r"the motion of P.x, the motion of 2\*P.x prescribe the same motion\n  Drive each"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("verb", ["simulate", "kinematics"])
def test_two_motions_of_one_quantity_are_both_named(second, message, verb):
    torques = [{"link": "rocker", "torque": "?"}, {"link": "crank", "torque": "?"}]
    with pytest.raises(SceneError, match=message):
        getattr(
            symgen.build(symgen.Scene(**four_bar([{"of": "P.x", "value": "x"}, second], torques))), verb
        )()


def test_motions_are_a_remedy_for_too_few_drives():
    with pytest.raises(CapabilityError, match=r"needs 1 more drive\n.*prescribe .* under \[\[motions\]\]"):
        symgen.build(symgen.Scene(**pushed_pole())).kinematics()


def test_boom_by_a_cylinder():
    """The force of the cylinder over the rate of its length is the moment of the boom over its rate."""
    scene = {
        "symgen": 1,
        "parameters": {"w": "1.5 rad/s", "first": "0.6 rad", "swing": "0.4 rad"},
        "points": {"O": ground(0, 0), "A": at(0.8, 0.5), "C": {"on": "boom", "fraction": 0.4}, "D": ground(0.3, -0.2)},
        "links": {"boom": {"points": ["O", "A"], "mass": "40 kg", "length": "1 m"}},
        "gravity": GRAVITY,
        "motions": [{"of": "boom.angle", "value": "first + swing*sin(w*t)"}],
        "actuators": [{"between": ["D", "C"], "force": "?"}],
        "analysis": {"t_end": "3 s", "outputs": ["actuators.0.force", "actuators.0.power", "actuators.0.length"]},
    }  # fmt: skip
    model = symgen.build(symgen.Scene(**scene))
    run = model.simulate(rtol=1e-12, samples=9)
    t = np.asarray(run.time)
    angle, acceleration = 0.6 + 0.4 * np.sin(1.5 * t), -0.4 * 1.5**2 * np.sin(1.5 * t)
    arm = np.stack([0.4 * np.cos(angle) - 0.3, 0.4 * np.sin(angle) + 0.2])
    length = np.hypot(*arm)
    lever = (0.4 * np.cos(angle) * arm[1] - 0.4 * np.sin(angle) * arm[0]) / length
    force = (40 / 3 * acceleration + 40 * 9.81 / 2 * np.cos(angle)) / lever
    for result in (run, model.inverse_dynamics(samples=9)):
        assert np.asarray(result["actuators.0.force"]) == pytest.approx(force, rel=1e-11)
        assert np.asarray(result["actuators.0.length"]) == pytest.approx(length, abs=1e-13)
    rate = lever * 0.4 * 1.5 * np.cos(1.5 * t)
    assert np.asarray(run["actuators.0.power"]) == pytest.approx(force * rate, rel=1e-10, abs=1e-9)


def pushed_pole(**more):
    """Return a cart whose force keeps the tip of its pole moving as prescribed; the other freedom follows."""
    return {
        "symgen": 1,
        "parameters": {"w": {"value": "2 rad/s", "tunable": True}, "first": "1.2 rad", "swing": "0.2 rad"},
        "points": {"L": ground(-3, 0), "R": ground(3, 0), "C": at(0, 0), "P": at(0.5 * np.cos(1.2), 0.5 * np.sin(1.2))},
        "links": {"rail": {"points": ["L", "R"]}, "pole": {"points": ["C", "P"], "mass": "0.6 kg"}},
        "masses": [{"point": "C", "mass": "2 kg"}],
        "guides": [{"points": ["C"], "along": "rail"}],
        "gravity": GRAVITY,
        "motions": [{"of": "pole.angle", "value": "first + swing*sin(w*t)"}],
        "actuators": [{"between": ["L", "C"], "force": "?"}],
        "start": {"velocities": {"C": ["0.4 m/s", "0 m/s"]}},
        "analysis": {"t_end": "0.6 s", "outputs": ["actuators.0.force", "C.position", "energy"]},
    } | more  # fmt: skip


def test_motion_that_leaves_a_freedom_to_the_forces():
    """The pole has no torque at its pin: its angle determines the acceleration of the cart, that the force."""
    run = symgen.build(symgen.Scene(**pushed_pole())).simulate(rtol=1e-12, samples=7)
    length, mass, cart, g = 0.5, 0.6, 2.0, 9.81

    def turned(t):
        s, c = np.sin(2 * t), np.cos(2 * t)
        return 1.2 + 0.2 * s, 0.4 * c, -0.8 * s

    def rates(t, y):
        a, _, second = turned(t)
        # about the pin: m l^2/3 a'' - m x'' l/2 sin a + m g l/2 cos a = 0
        return [y[1], (length / 3 * second + g / 2 * np.cos(a)) / (np.sin(a) / 2)]

    t = np.asarray(run.time)
    truth = solve_ivp(rates, (0, 0.6), [0.0, 0.4], "DOP853", t_eval=t, rtol=1e-13, atol=1e-14).y
    a, rate, second = turned(t)
    across = -length / 2 * (np.sin(a) * second + np.cos(a) * rate**2)
    x = np.array([rates(s, y)[1] for s, y in zip(t, truth.T, strict=True)])
    force = (cart + mass) * x + mass * across
    assert np.asarray(run["C.position"])[:, 0] == pytest.approx(truth[0], abs=1e-10)
    assert np.asarray(run["actuators.0.force"]) == pytest.approx(force, abs=1e-8)
    assert run.drift.energy < 1e-9 * run.drift.energy_exchanged


def test_a_run_that_comes_to_a_dead_point_names_it():
    """A level pole does not turn by a push of its pin along it, whatever the acceleration of the cart."""
    scene = pushed_pole(motions=[{"of": "pole.angle", "value": "first - swing*sin(w*t)"}])
    scene["parameters"] |= {"first": "0.5 rad", "swing": "1 rad"}
    scene["points"]["P"] = at(0.5 * np.cos(0.5), 0.5 * np.sin(0.5))
    scene["analysis"]["t_end"] = "1 s"
    with pytest.raises(
        SimulationError, match=r"actuators.0 cannot move pole.angle there.*\n  Choose drives that move it"
    ) as error:
        symgen.build(symgen.Scene(**scene)).simulate()
    assert error.value.time == pytest.approx(np.arcsin(0.5) / 2, abs=1e-3)


def turned_arms(place):
    """Return the angles of the arms of a delta robot from its drawing: circles about the motors meet spheres about the tool."""
    found = []
    for k in range(3):
        third = 2 * mp.pi * k / 3
        out = place[0] * mp.cos(third) + place[1] * mp.sin(third) - mp.mpf("0.14")
        aside = place[1] * mp.cos(third) - place[0] * mp.sin(third)
        tool = mp.mpc(out, place[2])
        elbow = meet(mp.mpc(0), tool, mp.mpf("0.25"), mp.sqrt(mp.mpf("0.25") - aside**2), 1)
        found.append(-mp.arg(elbow) - mp.pi / 9)
    return found


def test_tool_of_a_delta_robot_by_its_motors():
    """Its arms turn downwards about their axes: see the drawing."""

    def places(place):
        arms = []
        for k, turn in enumerate(turned_arms(place)):
            third, angle = 2 * mp.pi * k / 3, mp.pi / 9 + turn
            out = np.array([mp.cos(third), mp.sin(third), mp.mpf(0)])
            hip = mp.mpf("0.14") * out
            arms.append((hip, hip + (out * mp.cos(angle) - [0, 0, mp.sin(angle)]) / 4))
        tool = np.array(place)
        return np.array([*of_rods(*arms), *of_rods(*((elbow, tool) for _, elbow in arms)), tool])

    def inputs(t):
        x = 2 * t
        s = 10 * x**3 - 15 * x**4 + 6 * x**5
        return [
            mp.mpf("0.16") * (s - mp.mpf(1) / 2),
            mp.mpf(0),
            mp.mpf("-0.45") + mp.mpf("0.04") * mp.sin(mp.pi * s),
        ]

    masses = [*halves(*3 * ["0.4"], *3 * ["0.12"]), mp.mpf("0.8")]
    weights = np.array([[mp.mpf(0), mp.mpf(0), -G * m] for m in masses])
    times = [0.01, 0.13, 0.22, 0.41]
    model = symgen.build("pick_and_place")
    run = model.simulate(t_eval=times, rtol=1e-12)
    found = model.inverse_dynamics(at=times, over="time")
    for n, t in enumerate(times):
        forces = efforts(places, inputs, masses, t, lambda *_: weights)
        torques = by_drives(turned_arms, forces, inputs(mp.mpf(t)))
        for of in (run, found):
            assert [of[f"torques.{k}.torque"].values[n] for k in range(3)] == pytest.approx(torques, rel=1e-8)
    assert np.asarray(run["P.position"]) == pytest.approx(np.asarray(found["P.position"]), abs=1e-12)


def test_what_motions_cannot_have_is_refused(tmp_path):
    model = symgen.build(symgen.Scene(**slider_crank()))
    turned = symgen.build(
        symgen.Scene(
            **slider_crank(motions=[{"of": "crank.angle", "value": "w*t"}], parameters={"w": "2 rad/s"})
        )
    )
    for of, verb in (
        (model, "equilibrium"),
        (model, "linearise"),
        (model, "sensitivity"),
        (turned, "equilibrium"),
    ):
        with pytest.raises(CapabilityError, match="its motions are kept by unknown efforts"):
            getattr(of, verb)
    for method, step in (("radau5", {}), ("taylor", {}), ("rattle", {"step": 1e-3})):
        with pytest.raises(ModelError, match="is not for unknown efforts"):
            model.simulate(method=method, **step)
    with pytest.raises(CapabilityError, match=r"unknown efforts keep its \[\[motions\]\]"):
        export_c(symgen.Scene(**slider_crank()), tmp_path)
    with pytest.raises(DerivationError, match="no momentum rows"):
        symgen.derive(symgen.Scene(**slider_crank()), cut=["rod.A"])


@pytest.mark.parametrize(
    ("changes", "where", "problem"),
    [
        ({"torques": []}, "motions.0", "as many unknown efforts as motions, got 0 and 1"),
        ({"motions": []}, "torques.0", "as many unknown efforts as motions, got 1 and 0"),
        ({"motions": [{"of": "B.vx", "value": 0}]}, "motions.0.of", "expected places and angles, got B.vx"),
        ({"motions": [{"of": "B.x*t", "value": 0}]}, "motions.0.of", "depends on t"),
        ({"motions": [{"of": "middle", "value": 0}]}, "motions.0.of", "does not depend on the state"),
        ({"motions": [{"of": "abs(B.x)", "value": "middle"}]}, "motions.0.of", "has kinks or jumps"),
        ({"motions": [{"of": "B.x*B.x", "value": 0}]}, "motions.0.of", "expected a length of places"),
        (
            {"motions": [{"of": "2*crank.angle", "value": 0}]},
            "motions.0.of",
            "a sum or a difference of angles",
        ),
        ({"motions": [{"of": "B.x", "value": "w*t"}]}, "motions.0.value", "expected a length"),
        ({"motions": [{"of": "Z.x", "value": 0}]}, "motions.0.of", "Z.x"),
        ({"motions": [{"of": "R.x", "value": "middle"}]}, "motions.0.of", "R.x does not move"),
        ({"motions": [{"of": "B.x", "value": "middle + stroke*abs(w*t - 1)"}]}, "motions.0.value", "jump"),
    ],
)
def test_motions_that_are_none_are_named(changes, where, problem):
    with pytest.raises(SceneError, match=problem) as error:
        symgen.build(symgen.Scene(**slider_crank(**changes)))
    assert where.rpartition(".")[0] in str(error.value)


@pytest.mark.parametrize(
    "third",
    [
        {"motions": [{"of": "upper.angle", "value": "w*t"}], "torques": [{"link": "fore", "torque": "?"}]},
        {
            "motions": [{"of": "upper.angle - fore.angle", "value": "w*t"}],
            "torques": [{"link": "fore", "torque": "?"}],
        },
        {"drivers": [{"link": "upper", "angle": "w*t"}]},
    ],
)
def test_more_motions_than_freedoms_are_counted(third):
    scene = arm()
    changes = {table: [*scene.get(table, []), *rows] for table, rows in third.items()}
    with pytest.raises(SceneError, match="2 freedoms and 3 drives, which contradict each other") as error:
        symgen.build(symgen.Scene(**arm(**changes)))
    assert "the motion of B.position.x" in str(error.value)


def test_an_angle_out_of_reach_is_named_with_its_table():
    moved, torque = [{"of": "rocker.angle", "value": "far + w*t"}], [{"link": "crank", "torque": "?"}]
    scene = four_bar(moved, torque)
    scene["parameters"]["far"] = "0.3 rad"
    with pytest.raises(SceneError, match=r"\[motions\] 0: the linkage cannot be assembled") as error:
        symgen.build(symgen.Scene(**scene))
    assert "misses" in str(error.value) and "the motion of rocker.angle" in str(error.value)


def test_redundant_constraints_leave_the_effort_determined():
    """A bar on three parallel cranks moves without rotation: one equation of the angle of the cranks."""
    scene = {
        "symgen": 1,
        "parameters": {"w": "2 rad/s", "first": "0.56 m", "stroke": "0.02 m"},
        "points": {
            **{name: ground(x, 0) for name, x in (("O", 0), ("M", 0.5), ("Q", 1))},
            **{name: at(x + 0.06, 0.08) for name, x in (("A", 0), ("C", 0.5), ("B", 1))},
        },
        "links": {
            **{k: {"points": ends, "mass": "1 kg"} for k, ends in (("a", "OA"), ("b", "QB"), ("c", "MC"))},
            "bar": {"points": ["A", "B", "C"], "mass": "3 kg", "centre": ["0.56 m", "0.08 m"], "inertia": "0.25 kg*m^2"},
        },
        "gravity": GRAVITY,
        "motions": [{"of": "C.x", "value": "first + stroke*sin(w*t)"}],
        "torques": [{"link": "a", "torque": "?"}],
        "analysis": {"t_end": "2 s", "outputs": ["torques.0.torque"]},
    }  # fmt: skip
    for ends in scene["links"].values():
        ends["points"] = [*ends["points"]]
    model = symgen.build(symgen.Scene(**scene))
    assert model.description.redundant
    run = model.simulate(samples=9, rtol=1e-11)
    x = [0.06 + 0.02 * np.sin(2 * run.time), 0.04 * np.cos(2 * run.time), -0.08 * np.sin(2 * run.time)]
    y = np.sqrt(0.01 - x[0] ** 2)
    rate = -x[1] / y
    acceleration = -(x[2] + x[0] * rate**2) / y
    torque = (3 + 1) * 0.01 * acceleration + (3 + 3 / 2) * 9.81 * x[0]
    for result in (run, model.inverse_dynamics(samples=9)):
        assert np.asarray(result["torques.0.torque"]) == pytest.approx(torque, abs=1e-9)


def test_motions_in_kinematics_and_in_many_runs():
    scene = slider_crank(torques=[])
    scene["analysis"] = {"kind": "kinematics", "t_end": "3 s", "outputs": ["crank.angle"]}
    moved = symgen.build(symgen.Scene(**scene)).kinematics(samples=7)
    model = symgen.build(symgen.Scene(**slider_crank()))
    forces = model.inverse_dynamics(samples=7)
    assert np.asarray(moved["crank.angle"]) == pytest.approx(np.asarray(forces["crank.angle"]), abs=1e-13)
    speeds = [1.0, 2.0, 3.0]
    for many in (model.inverse_dynamics_many, model.simulate_many):
        found = many({"w": speeds}, samples=7)["torques.0.torque"].values
        assert found[1] == pytest.approx(np.asarray(forces["torques.0.torque"]), abs=1e-8)
        assert np.max(np.abs(found[2] - found[0])) > 0.1


@pytest.mark.parametrize("motion", [{}, {"motion": "space"}], ids=["in its plane", "in space"])
def test_a_plane_in_space_has_the_efforts_of_the_plane(motion):
    """The end of a boom is moved along x by a cylinder: a lever in closed form."""
    scene = {
        "symgen": 1,
        "parameters": {"w": "1.5 rad/s", "x": "0.75 m", "a": "0.05 m"},
        "points": {"O": ground(0, 0, 0), "A": at(0.8, 0.6, 0), "D": ground(0.3, -0.2, 0)},
        "links": {"boom": {"points": ["O", "A"], "mass": "40 kg"}},
        "gravity": {"acceleration": ["0 m/s^2", "-9.81 m/s^2", "0 m/s^2"]},
        "motions": [{"of": "A.x", "value": "x + a*sin(w*t)"}],
        "actuators": [{"between": ["D", "A"], "force": "?"}],
        "analysis": {"t_end": "3 s", "outputs": ["actuators.0.force"]} | motion,
    }
    if motion:
        scene["joints"] = [{"point": "O", "links": ["boom"], "kind": "revolute", "axis": [0, 0, 1]}]
    run = symgen.build(symgen.Scene(**scene)).simulate(samples=9, rtol=1e-11)
    t = np.asarray(run.time)
    x = [0.75 + 0.05 * np.sin(1.5 * t), 0.075 * np.cos(1.5 * t), -0.1125 * np.sin(1.5 * t)]
    y = np.sqrt(1 - x[0] ** 2)
    rate = -x[1] / y
    acceleration = -(x[2] + x[0] * rate**2) / y
    lever = (x[0] * (y + 0.2) - y * (x[0] - 0.3)) / np.hypot(x[0] - 0.3, y + 0.2)
    force = (40 / 3 * acceleration + 40 * 9.81 / 2 * x[0]) / lever
    assert np.asarray(run["actuators.0.force"]) == pytest.approx(force, rel=1e-9)


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        (
            {"torques": [{"link": "rod0", "torque": "?"}]},
            "about a revolute joint with the ground, not on rod0",
        ),
        ({"torques": [{"link": "arm1", "against": "arm0", "torque": "?"}]}, "not on arm1 against arm0"),
    ],
)
def test_unknown_torques_in_space_without_axis_are_refused(changes, problem):
    tables = symgen.load_scene("pick_and_place").model_dump(exclude_none=True)
    tables["torques"] = changes["torques"] + tables["torques"][1:]
    with pytest.raises(SceneError, match=problem):
        symgen.build(symgen.Scene(**tables))


def test_drives_that_move_nothing_of_what_is_prescribed_are_named():
    """Two torques on one link, and a trolley over a load that hangs still: both are judged where they act."""
    twice = arm(torques=[{"link": "upper", "torque": "?"}, {"link": "upper", "torque": "?"}])
    model = symgen.build(symgen.Scene(**twice))
    assert np.isfinite(np.asarray(model.kinematics(samples=3)["B.position"])).all()
    for verb in (model.simulate, model.inverse_dynamics):
        with pytest.raises(
            SimulationError, match=r"torques.0, torques.1 cannot move B.position.y, B.position.x"
        ):
            verb(samples=3)
    crane = pushed_pole(
        motions=[{"of": "P.x", "value": "reach*sin(w*t)"}],
        masses=[{"point": "C", "mass": "2 kg"}, {"point": "P", "mass": "1 kg"}],
        start={},
    )
    crane["points"]["P"] = at(0, -1)
    crane["links"]["pole"]["mass"] = "0 kg"
    crane["parameters"] |= {"reach": "0.1 m"}
    with pytest.raises(SimulationError, match=r"actuators.0 cannot move P.x there"):
        symgen.build(symgen.Scene(**crane)).simulate(samples=3)


def test_a_dead_centre_of_the_motion_itself_is_that_of_the_kinematics():
    scene = slider_crank()
    scene["parameters"]["stroke"] = "9 cm"
    found = symgen.build(symgen.Scene(**scene)).inverse_dynamics(samples=9)
    assert "dead centre at t = 0.4455" in found.notes[0] and "have rank" not in found.notes[0]


def test_a_search_for_dead_points_that_ends_early_says_when():
    scene = slider_crank()
    scene["parameters"]["stroke"] = "9 cm"
    model = symgen.build(symgen.Scene(**scene))
    start = model.initial_state()
    (note,) = dead_points(model.counting(start).evaluator, np.array([0.0, 1.0]), np.array([start.q, start.q]))
    reached = re.fullmatch(r"the motion could not be followed beyond t = (\S+) s in search of .*", note)
    in_line = np.arcsin(7 / 9) / 2  # crank and rod
    assert float(reached[1]) == pytest.approx(in_line, abs=1e-6)
