"""Drives between two links in the plane, against Lagrange's equations by the angles of the links."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from shared.linkages import at, ground
from shared.momentum import solved

import symgen
from symgen.errors import SceneError
from symgen.models.momentum.rows import momentum_system
from symgen.scene.resolve import resolve

LENGTHS, MASSES, G = (0.5, 0.4, 0.3), (2.0, 1.3, 0.7), 9.81
NAMES = ("upper", "fore", "hand")
T = sp.Symbol("t")
#: Angles of the first link from the ground and of the others from the one before: turns, and past half a turn.
MOTIONS = (sp.Rational(7, 10) * sp.sin(3 * T), 2 * T, 3 - 4 * sp.sin(T) ** 2 - T / 2)
TEXTS = ("0.7*sin(3*w*t)", "2*w*t", "3 - 4*sin(w*t)**2 - w*t/2")


def arm(count=2, **more):
    """Return rods in a row from the ground, each driven against the one before."""
    places = np.cumsum([0.0, *LENGTHS[:count]])
    points = {"P0": ground(0, 0)} | {f"P{i}": at(places[i], 0.1 * i) for i in range(1, count + 1)}
    links = {
        name: {"points": [f"P{i}", f"P{i + 1}"], "mass": f"{m} kg", "length": f"{l} m"}
        for i, (name, m, l) in enumerate(zip(NAMES[:count], MASSES, LENGTHS, strict=False))
    }
    drivers = [{"link": name, "angle": text} for name, text in zip(NAMES[:count], TEXTS, strict=False)]
    for i in range(1, count):
        drivers[i]["against"] = NAMES[i - 1]
    outputs = [f"{name}.{word}" for name in NAMES[:count] for word in ("torque", "power")]
    outputs += [f"{name}.relative_angle" for name in NAMES[1:count]]
    outputs += [f"P{count}.position", "P0.reaction", "P1.position", "energy", "upper.P1.force"]
    return {
        "symgen": 1,
        "parameters": {"w": {"value": "1 rad/s", "tunable": True}},
        "points": points,
        "links": links,
        "gravity": {"acceleration": ["0 m/s^2", f"-{G} m/s^2"]},
        "drivers": drivers,
        "analysis": {"t_end": "8 s", "outputs": outputs},
    } | more


@lru_cache
def torques_of_joints(motions):
    """Return T_i(t) at the joints of uniform rods in a row: sums of Lagrange's forces from the tip inwards."""
    angles = [sp.Symbol(f"a{i}") for i in range(len(motions))]
    rates = [sp.Symbol(f"r{i}") for i in range(len(motions))]
    absolute = [sum(motions[: i + 1]) for i in range(len(motions))]
    x = y = vx = vy = sp.Integer(0)
    lagrangian = sp.Integer(0)
    sizes = [[sp.nsimplify(x) for x in row] for row in zip(MASSES, LENGTHS, strict=True)]
    for a, r, (m, length) in zip(angles, rates, sizes, strict=False):
        cx, cy = vx - length / 2 * r * sp.sin(a), vy + length / 2 * r * sp.cos(a)
        lagrangian += m * (cx**2 + cy**2) / 2 + m * length**2 / 12 * r**2 / 2
        lagrangian -= m * sp.nsimplify(G) * (y + length / 2 * sp.sin(a))
        x, y = x + length * sp.cos(a), y + length * sp.sin(a)
        vx, vy = vx - length * r * sp.sin(a), vy + length * r * sp.cos(a)
    at_time = dict(zip(angles, absolute, strict=True))
    at_time |= dict(zip(rates, [sp.diff(f, T) for f in absolute], strict=True))
    forces = [
        sp.diff(sp.diff(lagrangian, r).subs(at_time), T) - sp.diff(lagrangian, a).subs(at_time)
        for a, r in zip(angles, rates, strict=True)
    ]
    return sp.lambdify(T, [sum(forces[i:]) for i in range(len(forces))])


def expected_torques(motions, times):
    return np.array([torques_of_joints(tuple(motions))(t) for t in times]).T


@pytest.mark.parametrize("count", [2, 3])
def test_torques_of_an_arm_are_those_of_lagrange(count):
    found = symgen.build(symgen.Scene(**arm(count))).inverse_dynamics(samples=41)
    expected = expected_torques(MOTIONS[:count], found.time)
    for name, torque in zip(NAMES, expected, strict=False):
        assert np.asarray(found[f"{name}.torque"]) == pytest.approx(torque, abs=1e-10)
    turned = np.asarray(found["fore.relative_angle"])
    assert turned == pytest.approx(2 * np.asarray(found.time), abs=1e-13)
    assert turned[-1] > 4 * np.pi


@pytest.mark.parametrize("method", ["dop853", "radau5", "taylor"])
def test_runs_of_an_arm_keep_the_drives_over_turns(method):
    """Reaction and tip follow from the angles; the work of the drives is the change of the energy."""
    run = symgen.build(symgen.Scene(**arm(3))).simulate(method=method, rtol=1e-11, samples=33)
    t = np.asarray(run.time)
    for name, torque in zip(NAMES, expected_torques(MOTIONS, t), strict=True):
        assert np.asarray(run[f"{name}.torque"]) == pytest.approx(torque, abs=1e-7)
    angles = np.cumsum([sp.lambdify(T, f)(t) for f in MOTIONS], axis=0)
    tip = sum(l * np.stack([np.cos(a), np.sin(a)], 1) for l, a in zip(LENGTHS, angles, strict=True))
    assert np.asarray(run["P3.position"]) == pytest.approx(tip, abs=1e-9)
    assert run.drift.energy < 1e-8 * max(1.0, run.drift.energy_exchanged)


def test_forces_by_elements_and_by_multipliers_agree_on_the_sections():
    """The bending moment at the elbow is the torque of the drive on the forearm, on either side of it."""
    found = symgen.build(symgen.Scene(**arm(2))).inverse_dynamics(samples=17, sections=(1e-9, 1 - 1e-9))
    torque = np.asarray(found["fore.torque"])
    assert np.asarray(found[f"upper@{1 - 1e-9:.6g}.moment"]) == pytest.approx(torque, abs=1e-7)
    assert np.asarray(found["upper@1e-09.moment"]) == pytest.approx(
        np.asarray(found["upper.torque"]), abs=1e-7
    )


def test_power_of_the_drives_is_the_rate_of_the_energy():
    found = symgen.build(symgen.Scene(**arm(3))).inverse_dynamics(samples=9)
    rates = [sp.lambdify(T, sp.diff(f, T)) for f in MOTIONS]
    power = sum(
        np.asarray(found[f"{name}.torque"]) * rate(np.asarray(found.time))
        for name, rate in zip(NAMES, rates, strict=True)
    )
    assert sum(np.asarray(found[f"{name}.power"]) for name in NAMES) == pytest.approx(power, abs=1e-12)
    step = 1e-4
    model = symgen.build(symgen.Scene(**arm(3)))
    times = np.asarray(found.time)[1:-1]
    around = np.sort(np.concatenate([times - step, times + step, times - 2 * step, times + 2 * step]))
    energy = np.asarray(model.inverse_dynamics(at=around, over="time")["energy"]).reshape(-1, 4)
    rate = (energy @ [1, -8, 8, -1]) / (12 * step)
    assert power[1:-1] == pytest.approx(rate, abs=1e-7)


def free_arm():
    """Return an arm whose elbow is driven, and whose shoulder is free."""
    scene = arm(2)
    scene["drivers"] = scene["drivers"][1:]
    scene["start"] = {"angles": {"upper": "0.4"}, "rates": {"upper": "-1 rad/s"}}
    scene["analysis"] = {"t_end": "2 s", "outputs": ["upper.angle", "fore.torque", "fore.angle"]}
    return scene


def swung(times, w=1.0):
    """Return the angle of its upper arm and the torque of the elbow, by one equation; the elbow is 2 w t."""
    (l1, l2), (m1, m2) = LENGTHS[:2], MASSES[:2]
    coupled = m2 * l1 * l2 / 2

    def rate(t, y):
        a, r = y
        b, rb = 2 * w * t, 2.0 * w
        whole = m1 * l1**2 / 3 + m2 * l1**2 + m2 * l2**2 / 3 + 2 * coupled * np.cos(b)
        weight = G * ((m1 / 2 + m2) * l1 * np.cos(a) + m2 * l2 / 2 * np.cos(a + b))
        return [r, (coupled * np.sin(b) * (2 * r * rb + rb**2) - weight) / whole]

    options = {"rtol": 1e-12, "atol": 1e-12, "method": "DOP853"}
    angle, spin = solve_ivp(rate, (0, times[-1]), [0.4, -1.0], t_eval=times, **options).y
    second = np.array([rate(t, y)[1] for t, y in zip(times, np.stack([angle, spin], 1), strict=True)])
    torque = m2 * l2**2 / 3 * second + coupled * (
        np.cos(2 * w * times) * second + np.sin(2 * w * times) * spin**2
    )
    return angle, torque + m2 * G * l2 / 2 * np.cos(angle + 2 * w * times)


@pytest.mark.parametrize("method", ["dop853", "radau5", "taylor", "rattle4"])
def test_a_free_arm_swings_by_one_equation(method):
    """The reaction of the elbow moves the upper arm."""
    options = {"step": 1e-3} if method == "rattle4" else {"rtol": 1e-11}
    run = symgen.build(symgen.Scene(**free_arm())).simulate(method=method, samples=9, **options)
    times = np.asarray(run.time)
    angle, torque = swung(times)
    assert np.asarray(run["upper.angle"]) == pytest.approx(angle, abs=1e-8)
    assert np.asarray(run["fore.angle"]) == pytest.approx(angle + 2 * times, abs=1e-8)
    assert np.asarray(run["fore.torque"]) == pytest.approx(torque, abs=1e-7)


def test_derivatives_along_a_run_of_a_free_arm():
    model, step, times = symgen.build(symgen.Scene(**free_arm())), 1e-4, np.array([0.0, 1.5])
    found = model.sensitivity(
        ["upper.angle", "fore.torque"], ["w"], t_eval=[1.5], coordinates=["upper.angle"]
    )
    near = np.array([np.array(swung(times, 1 + k * step))[:, -1] for k in (-2, -1, 1, 2)])
    angle, torque = np.array([1, -8, 8, -1]) @ near / (12 * step)
    assert found["upper.angle", "w"] == pytest.approx(angle, rel=1e-6)
    assert found["fore.torque", "w"] == pytest.approx(torque, rel=1e-6)


def test_a_drive_against_a_telescope():
    """The reference turns and changes its length: the torque is that of the forearm about a point on a known path.

    Torque and push of the upper arm hold the force there; its power is that of both drives.
    """
    scene = arm(2)
    scene["points"] |= {"P1": at(0.5, 0), "P2": at(0.9, 0)}
    scene["parameters"] |= {"l": "0.5 m", "x": "0.1 m"}
    scene["links"]["upper"] = {"points": ["P0", "P1"], "length": "l + x*sin(2*w*t)"}
    scene["analysis"]["outputs"] += ["upper.force"]
    found = symgen.build(symgen.Scene(**scene)).inverse_dynamics(samples=9)
    length = sp.Rational(1, 2) + sp.sin(2 * T) / 10
    elbow = sp.Matrix([sp.cos(MOTIONS[0]), sp.sin(MOTIONS[0])]) * length
    direction = sum(MOTIONS[:2])
    arm_of = sp.Matrix([sp.cos(direction), sp.sin(direction)]) * LENGTHS[1] / 2
    force = MASSES[1] * (elbow.diff(T, 2) + sp.Matrix([0, G]))
    torque = (
        MASSES[1] * LENGTHS[1] ** 2 / 3 * sp.diff(direction, T, 2)
        + arm_of[0] * force[1]
        - arm_of[1] * force[0]
    )
    whole = MASSES[1] * ((elbow + arm_of).diff(T, 2) + sp.Matrix([0, G]))
    push = elbow.dot(whole) / length
    turning = elbow[0] * whole[1] - elbow[1] * whole[0] + torque
    power = push * sp.diff(length, T) + turning * sp.diff(MOTIONS[0], T)
    words = {"fore.torque": torque, "upper.torque": turning, "upper.force": push, "upper.power": power}
    for name, value in words.items():
        expected = sp.lambdify(T, value)(np.asarray(found.time))
        assert np.asarray(found[name]) == pytest.approx(expected, abs=1e-10)


def test_a_floating_pair_turns_without_angular_momentum():
    """No ground, no gravity: the links turn against each other by the ratio of their inertias."""
    scene = {
        "symgen": 1,
        "parameters": {"w": "2 rad/s"},
        "points": {"A": at(0, 0), "B": at(0.6, 0), "C": at(0.6, 0.2)},
        "links": {
            "one": {"points": ["A", "B"], "mass": "2 kg"},
            "two": {"points": ["B", "C"], "mass": "1 kg"},
        },
        "drivers": [{"link": "two", "against": "one", "angle": "pi/2 + sin(w*t)"}],
        "gravity": {"acceleration": ["0 m/s^2", "0 m/s^2"]},
        "analysis": {"t_end": "3 s", "outputs": ["angular_momentum", "momentum", "two.torque", "one.angle"]},
    }
    run = symgen.build(symgen.Scene(**scene)).simulate(rtol=1e-11, samples=7)
    assert np.asarray(run["angular_momentum"]) == pytest.approx(0, abs=1e-10)
    assert np.asarray(run["momentum"]) == pytest.approx(0, abs=1e-10)

    def rate(t, y):
        reduced, b = 2 / 3, np.pi / 2 + np.sin(2 * t)  # about the centre of the pair, u = B from A
        coupled = reduced * 0.6 * 0.2 / 4 * np.cos(b)
        first, second = 2 * 0.36 / 12 + reduced * 0.09, 0.04 / 12 + reduced * 0.01
        return [-(second + coupled) / (first + second + 2 * coupled) * 2 * np.cos(2 * t)]

    times = np.asarray(run.time)
    angle = solve_ivp(rate, (0, 3), [0.0], t_eval=times, rtol=1e-12, atol=1e-13).y[0]
    assert np.asarray(run["one.angle"]) == pytest.approx(angle, abs=1e-8)


def test_a_held_elbow_makes_one_pendulum():
    """Equilibrium and frequency are those of a compound pendulum; the drive holds the weight of the forearm."""
    scene = arm(2)
    scene["drivers"] = [{"link": "fore", "against": "upper", "angle": "pi/2"}]
    scene["start"] = {"angles": {"upper": "-1.2"}}
    scene["analysis"]["outputs"] = ["upper.angle", "fore.torque", "P1.position"]
    model = symgen.build(symgen.Scene(**scene))
    (l1, l2), (m1, m2) = LENGTHS[:2], MASSES[:2]
    moment = np.array([(m1 / 2 + m2) * l1, m2 * l2 / 2])  # along the upper arm and to its left
    hanging = -np.pi / 2 - np.arctan2(moment[1], moment[0])
    rest = model.equilibrium()
    assert rest.outputs["upper.angle"] == pytest.approx(hanging, abs=1e-9)
    assert rest.outputs["fore.torque"] == pytest.approx(
        m2 * G * l2 / 2 * np.cos(hanging + np.pi / 2), abs=1e-9
    )
    inertia = m1 * l1**2 / 3 + m2 * l1**2 + m2 * l2**2 / 3
    (frequency,) = model.modes(rest).frequencies
    assert frequency == pytest.approx(np.sqrt(G * np.hypot(*moment) / inertia) / (2 * np.pi), rel=1e-9)
    linear = model.linearise(at=rest, inputs=[], coordinates=["upper.angle"])
    poles = np.linalg.eigvals(linear.A)
    assert np.abs(poles.imag) == pytest.approx(2 * np.pi * frequency, rel=1e-8)


def test_derivatives_of_torques_are_those_of_lagrange():
    scaled = [f.subs(T, sp.Symbol("w") * T) for f in MOTIONS[:2]]
    step, t = 1e-5, 1.3
    model = symgen.build(symgen.Scene(**arm(2)))
    found = model.sensitivity(["fore.torque", "upper.torque"], at=t)
    near = [
        expected_torques([f.subs(sp.Symbol("w"), sp.Float(1 + k * step, 30)) for f in scaled], [t])[:, 0]
        for k in (-2, -1, 1, 2)
    ]
    upper, fore = np.array([1, -8, 8, -1]) @ near / (12 * step)
    assert found["fore.torque", "w"] == pytest.approx(fore, rel=1e-8)
    assert found["upper.torque", "w"] == pytest.approx(upper, rel=1e-8)


def test_variants_in_lanes_are_single_ones():
    model = symgen.build(symgen.Scene(**arm(3)))
    speeds = [0.5, 1.0, 1.5, 2.0, 2.5]
    for verb in ("inverse_dynamics", "kinematics"):
        many = getattr(model, f"{verb}_many")({"w": speeds}, samples=9)
        for i, speed in enumerate(speeds):
            one = getattr(model.with_parameters(w=speed), verb)(samples=9)
            for name in ("fore.relative_angle", "hand.torque" if verb[0] == "i" else "P3.position"):
                assert np.asarray(many[name])[i] == pytest.approx(np.asarray(one[name]), abs=1e-9)


def platform(**more):
    """An arm on a base between two ground points, which turns and changes its length."""
    scene = arm(1)
    scene["parameters"] |= {"h": "0.2 m"}
    scene["points"]["Q"] = ground(1, 0) | {"motion": ["h*sin(w*t)", "h*t*w"]}
    scene["links"]["base"] = {"points": ["P0", "Q"]}
    scene["drivers"] = [{"link": "upper", "against": "base", "angle": "pi/3 + w*t"}]
    scene["analysis"] = {
        "t_end": "6 s",
        "outputs": ["upper.torque", "P1.position", "Q.reaction", "P0.reaction"],
    }
    return scene | more


def test_a_drive_against_moving_ground():
    """The direction is that of the base plus the drive; the couple of its reaction is borne at the ends of it."""
    model = symgen.build(symgen.Scene(**platform()))
    base = sp.atan2(T / 5, 1 + sp.sin(T) / 5)
    motion = (base + sp.pi / 3 + T,)
    run = model.simulate(rtol=1e-11, samples=9)
    t = np.asarray(run.time)
    (torque,) = expected_torques(motion, t)
    assert np.asarray(run["upper.torque"]) == pytest.approx(torque, abs=1e-8)
    found = model.inverse_dynamics(samples=9)
    assert np.asarray(found["upper.torque"]) == pytest.approx(torque, abs=1e-10)
    span = np.stack([1 + 0.2 * np.sin(t), 0.2 * t], 1)
    for result in (run, found):
        push = np.asarray(result["Q.reaction"])
        assert span[:, 0] * push[:, 1] - span[:, 1] * push[:, 0] == pytest.approx(torque, abs=1e-8)
        assert np.sum(span * push, axis=1) == pytest.approx(0, abs=1e-8)


def test_gears_between_driven_links():
    """A pinion on the upper arm is driven against it and turns the forearm by its teeth."""
    scene = arm(2)
    scene["points"]["R"] = at(0.6, 0.1)
    scene["links"]["pinion"] = {
        "points": ["P1", "R"],
        "mass": "0.1 kg",
        "centre": 0,
        "inertia": "0.001 kg*m^2",
    }
    scene["points"] |= {"P1": at(0.5, 0), "P2": at(0.9, 0), "R": at(0.6, 0)}
    scene["gears"] = [{"links": ["pinion", "fore"], "teeth": [20, 50], "carrier": "upper"}]
    scene["drivers"][1] = {"link": "pinion", "against": "upper", "angle": "-5*w*t"}
    scene["analysis"] = {"t_end": "5 s", "outputs": ["P2.position", "pinion.torque", "upper.torque"]}
    model = symgen.build(symgen.Scene(**scene))
    found = model.inverse_dynamics(samples=21)
    t = np.asarray(found.time)
    upper, fore = expected_torques(MOTIONS[:2], t)
    # the mass of the pinion is at the elbow, its inertia turns at the rate of the upper arm less 5 rad/s
    a, r, s = 0.7 * np.sin(3 * t), 2.1 * np.cos(3 * t), -6.3 * np.sin(3 * t)
    spin = 0.001 * s
    assert np.asarray(found["pinion.torque"]) == pytest.approx(-20 / 50 * fore + spin, abs=1e-9)
    own = 0.1 * 0.25 * s + 0.1 * G * 0.5 * np.cos(a) + spin
    assert np.asarray(found["upper.torque"]) == pytest.approx(upper + own, abs=1e-9)
    assert r.max() > 2


def test_a_cylinder_between_moving_links_gives_the_torque_of_the_elbow():
    """Its stroke keeps a prescribed angle of the elbow by the law of cosines; F dL/d(angle) is the torque."""
    scene, bend = arm(2), "(pi/2 + sin(2*w*t)/2)"
    scene["points"] |= {"P1": at(0.5, 0), "P2": at(0.5, 0.4), "V": {"on": "fore", "fraction": 0.5}}
    scene["points"]["U"] = {"on": "upper", "fraction": 0.4, "offset": "0.05 m"}
    scene["parameters"] |= {"u": "0.3 m", "o": "0.05 m", "v": "0.2 m"}
    length = f"sqrt((v*cos{bend} + u)**2 + (v*sin{bend} - o)**2)"
    scene["links"]["cylinder"] = {"points": ["U", "V"], "length": length}
    scene["drivers"] = scene["drivers"][:1]
    scene["analysis"]["outputs"] = ["cylinder.tension", "upper.torque"]
    model = symgen.build(symgen.Scene(**scene))
    motions = MOTIONS[0], sp.pi / 2 + sp.sin(2 * T) / 2
    for found in (model.simulate(samples=9, rtol=1e-11), model.inverse_dynamics(samples=9)):
        t = np.asarray(found.time)
        x, y = 0.2 * np.cos(np.pi / 2 + np.sin(2 * t) / 2), 0.2 * np.sin(np.pi / 2 + np.sin(2 * t) / 2)
        stroke = (-y * (x + 0.3) + x * (y - 0.05)) / np.hypot(x + 0.3, y - 0.05)
        upper, elbow = expected_torques(motions, t)
        assert np.asarray(found["cylinder.tension"]) == pytest.approx(-elbow / stroke, abs=1e-9)
        assert np.asarray(found["upper.torque"]) == pytest.approx(upper, abs=1e-9)


def test_momentum_rows_give_the_accelerations_of_the_equations_of_motion():
    scene = symgen.Scene(**arm(3))
    model, rows = symgen.build(scene), momentum_system(resolve(scene))
    state = model.reached(0.7)
    found, expected = solved(rows, model, state), model.accelerations(state)
    for point in model.description.free:
        of_rows = [found[f"{point}_a{axis}"] for axis in "xy"]
        assert of_rows == pytest.approx(expected.points[point], rel=1e-9, abs=1e-9)


def test_assembly_modes_point_along_the_drives():
    """A five-bar whose elbow is driven: both modes keep the angle, none is half a turn off."""
    scene = {
        "symgen": 1,
        "parameters": {"w": "1 rad/s"},
        "points": {"O": ground(0, 0), "C": ground(1.0, 0), "A": at(0, 0.5), "B": at(0.45, 0.7), "D": at(1, 0.5)},
        "links": {
            "a": {"points": ["O", "A"], "mass": "1 kg"}, "b": {"points": ["A", "B"], "mass": "1 kg"},
            "c": {"points": ["B", "D"], "mass": "1 kg"}, "d": {"points": ["D", "C"], "mass": "1 kg"},
        },
        "drivers": [
            {"link": "a", "angle": "pi/2 + w*t"}, {"link": "b", "against": "a", "angle": "-1.1 + 0.2*sin(w*t)"}
        ],
        "analysis": {"t_end": "0.5 s", "outputs": ["A.position", "B.position"]},
    }  # fmt: skip
    model = symgen.build(symgen.Scene(**scene))
    modes = model.assemblies()
    assert len(modes) == 2
    for mode in modes:
        a, b = (np.asarray(mode.positions[p]) for p in "AB")
        turned = np.angle(complex(*(b - a)) / complex(*a))
        assert turned == pytest.approx(-1.1, abs=1e-9)


def test_the_start_leads_the_drawing_to_the_relative_angle():
    """Drawn at another angle, more than a quarter turn away, also with the reference led itself."""
    for angle in ("2.9", "-3.0", "1.8"):
        scene = arm(2)
        scene["drivers"][0]["angle"], scene["drivers"][1]["angle"] = "2.2", angle
        scene["analysis"]["outputs"] = ["upper.angle", "fore.angle"]
        state = symgen.build(symgen.Scene(**scene)).initial_state()
        first, second = (np.asarray(state.positions[p]) for p in ("P1", "P2"))
        assert np.angle(complex(*first)) == pytest.approx(2.2)
        assert np.angle(complex(*(second - first)) / complex(*first)) == pytest.approx(float(angle))


def errors():
    """Yield scenes that are refused, with words of the message."""
    twice = arm(2)
    twice["drivers"].append({"link": "fore", "angle": "w*t"})
    yield twice, ("driven twice",)
    itself = arm(2)
    itself["drivers"][1]["against"] = "fore"
    yield itself, ("another link", "[drivers.1] against")
    circle = arm(3)
    circle["drivers"] = [
        {"link": "upper", "against": "hand", "angle": "w*t"}, {"link": "fore", "against": "upper", "angle": "w*t"},
        {"link": "hand", "against": "fore", "angle": "w*t"},
    ]  # fmt: skip
    yield circle, ("in a circle", "[drivers.2] against")
    unknown = arm(2)
    unknown["drivers"][1]["against"] = "uper"
    yield unknown, ("uper", "upper")
    mean = arm(1)
    mean["analysis"]["outputs"] = ["upper.relative_angle"]
    yield mean, ("no relative angle",)


@pytest.mark.parametrize(("scene", "words"), [*errors()])
def test_refused_drives_name_their_table(scene, words):
    with pytest.raises(SceneError) as caught:
        symgen.build(symgen.Scene(**scene))
    assert all(word in str(caught.value) for word in words)


def test_drives_that_gears_determine_already_are_refused():
    """The elbow is driven, and geared to the ground besides: one condition too many."""
    scene = arm(2)
    scene["points"] |= {"S": ground(0.1, 0), "P1": at(0.5, 0), "P2": at(0.9, 0)}
    scene["links"]["sun"] = {"points": ["P0", "S"]}
    scene["gears"] = [{"links": ["fore", "sun"], "teeth": [1, 1], "carrier": "upper"}]
    with pytest.raises(SceneError, match=r"the (drive|gears) of .* not independent(.|\n)*Drive each freedom"):
        symgen.build(symgen.Scene(**scene))


def test_a_drawing_in_line_with_its_reference():
    """Half a turn: the forearm folds back; the torque is that of the folded pair."""
    scene = arm(2)
    scene["drivers"][1]["angle"] = "pi + w*t"
    found = symgen.build(symgen.Scene(**scene)).inverse_dynamics(samples=9)
    expected = expected_torques((MOTIONS[0], sp.pi + T), found.time)
    assert np.asarray(found["fore.torque"]) == pytest.approx(expected[1], abs=1e-10)
