"""Machines of the documentation in space: closure by closed forms or Newton, efforts by virtual work and Lagrange."""

from __future__ import annotations

from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from shared.virtual_work import G, efforts, halves, of_moments, of_rods, rotation, slopes

import symgen

CASES = Path(__file__).parents[1] / "cases"


def at_times(name, times):
    return symgen.build(name).simulate(t_eval=times, rtol=1e-12)


def prescribed(name, times):
    return symgen.build(name).inverse_dynamics(at=times, over="time")


def vector(text, unit="0.001"):
    return np.array([mp.mpf(x) * mp.mpf(unit) for x in text.split()])


def size(v):
    return mp.sqrt(v @ v)


def crossed(a, b):
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def weights(masses):
    return np.array([[mp.mpf(0), mp.mpf(0), -G * m] for m in masses])


def below(a, b, c, radius):
    """Return the lower point at one distance from three points."""
    x, y = b - a, c - a
    normal = crossed(x, y)
    centre = a + (crossed(normal, x) * (y @ y) + crossed(y, normal) * (x @ x)) / (2 * (normal @ normal))
    normal = normal / size(normal) * (1 if normal[2] < 0 else -1)
    return centre + normal * mp.sqrt(radius**2 - (centre - a) @ (centre - a))


def joints_of_delta(q):
    arms = []
    for k, turn in enumerate(q):
        third, angle = 2 * mp.pi * k / 3, mp.pi / 9 + turn
        out = np.array([mp.cos(third), mp.sin(third), mp.mpf(0)])
        hip = mp.mpf("0.14") * out
        arms.append((hip, hip + (out * mp.cos(angle) - [0, 0, mp.sin(angle)]) / 4))
    return arms, below(*(elbow for _, elbow in arms), mp.mpf("0.5"))


def delta_inputs(t):
    phase, sweep = 2 * mp.pi * t, mp.mpf("0.2")
    return [sweep * mp.sin(phase), sweep * (1 - mp.cos(phase)) / 2, -sweep * mp.sin(2 * phase) / 2]


def test_delta_robot():
    """The tool is where three spheres about the elbows meet."""

    def places(q):
        arms, tool = joints_of_delta(q)
        return np.array([*of_rods(*arms), *of_rods(*((elbow, tool) for _, elbow in arms)), tool])

    masses = [*halves(*3 * ["0.4"], *3 * ["0.12"]), mp.mpf("0.8")]
    times = [0.0, 0.17, 0.52, 0.9]
    found, forces = at_times("delta_robot", times), prescribed("delta_robot", times)
    for n, t in enumerate(times):
        tool = joints_of_delta(delta_inputs(mp.mpf(t)))[1]
        assert found["P.position"].values[n] == pytest.approx(tool.astype(float), abs=1e-11)
        torques = efforts(places, delta_inputs, masses, t, lambda *_: weights(masses))
        for k, torque in enumerate(torques):
            for of in (found, forces):
                assert of[f"arm{k}.torque"].values[n] == pytest.approx(torque, rel=1e-8), (k, t)


def test_delta_robot_with_its_parallelograms():
    """The scene with six rods and a plate, whose axes point the other way, needs the same torques."""
    tables = symgen.load_scene(CASES / "delta_robot.toml").model_dump(exclude_none=True)
    tables["parameters"] = {"T": "1 s", "sweep": "0.2 rad"}
    angles = ["-sweep*sin(2*pi*t/T)", "-sweep*(1 - cos(2*pi*t/T))/2", "sweep*sin(4*pi*t/T)/2"]
    tables["drivers"] = [{"link": f"arm{k}", "angle": angle} for k, angle in enumerate(angles)]
    tables["analysis"] = {"outputs": [f"arm{k}.torque" for k in range(3)] + ["plate.angular_velocity"]}
    times = [0.0, 0.17, 0.52, 0.9]
    whole = symgen.build(symgen.Scene(**tables)).simulate(t_eval=times, rtol=1e-12)
    found = at_times("delta_robot", times)
    assert np.max(np.abs(whole["plate.angular_velocity"].values)) < 1e-11
    for k in range(3):
        assert found[f"arm{k}.torque"].values == pytest.approx(-whole[f"arm{k}.torque"].values, rel=1e-8)


def test_stewart_platform():
    """Forces of the legs from those in six coordinates of the pose, and the slopes of the lengths by these."""
    base, radius, load = mp.mpf("1.2"), mp.mpf("0.8"), np.array([mp.mpf("0.3"), mp.mpf(0), mp.mpf("0.4")])
    legs = {}
    for k in range(3):
        for name, side in (("left", -1), ("right", 1)):
            foot, head = (2 * mp.pi * k / 3 + side * mp.pi / n for n in (12, 4))
            ends = [np.array([r * mp.cos(a), r * mp.sin(a), 0]) for r, a in ((base, foot), (radius, head))]
            legs[f"{name}{k}"] = ends
    body = of_moments(500, (80, 80, 150))

    def places(q):
        turned = rotation(*q[3:])
        return np.array([*(q[:3] + body @ turned.T), q[:3] + turned @ load])

    def lengths(q):
        turned = rotation(*q[3:])
        return np.array([size(q[:3] + turned @ head - foot) for foot, head in legs.values()])

    def changed(q, k):
        return slopes(lambda x: lengths([*q[:k], x, *q[k + 1 :]]), q[k])[0]

    def pose(t):
        nought, phase = mp.mpf(0), mp.pi * t
        height, turn = 1 + mp.mpf("0.15") * mp.sin(2 * phase), mp.pi / 18 * mp.sin(phase)
        return [nought, nought, height, nought, nought, turn]

    masses = [*6 * [mp.mpf(500) / 6], 200]
    times = [0.0, 0.3, 0.85, 1.3]
    found, forces = at_times("stewart_platform", times), prescribed("stewart_platform", times)
    for n, t in enumerate(times):
        q = pose(mp.mpf(t))
        assert found["L.position"].values[n] == pytest.approx(places(q)[-1].astype(float), abs=1e-11)
        needed = efforts(places, pose, masses, t, lambda *_: weights(masses))
        rows = [changed(q, k).astype(float) for k in range(6)]
        thrusts = dict(zip(legs, np.linalg.solve(rows, needed), strict=True))
        for name in ("left0", "right0"):
            for of in (found, forces):
                assert -of[f"{name}.tension"].values[n] == pytest.approx(thrusts[name], rel=1e-8), (name, t)


def test_double_wishbone():
    """The pose of the upright by Newton's method on five rods and the jack."""
    at = {
        "LF": "150 350 180", "LR": "-180 360 185", "LB": "5 700 170", "UF": "110 430 480", "UR": "-140 435 470",
        "UB": "-10 660 470", "TI": "-120 370 230", "TO": "-130 690 225", "W": "0 750 300", "N": "0 850 300",
        "J": "0 750 -1700", "S": "0 500 700", "C": "0 730 300",
    }  # fmt: skip
    at = {name: vector(text) for name, text in at.items()}
    pairs = ("LF", "LB"), ("LR", "LB"), ("UF", "UB"), ("UR", "UB"), ("TI", "TO"), ("J", "W")
    drawn = [size(at[a] - at[b]) for a, b in pairs]
    body = of_moments(32, (1, "1.6", 1))

    def moved(pose):
        turned = rotation(*pose[3:])
        return {
            k: at["C"] + pose[:3] + turned @ (at[k] - at["C"]) for k in ("LB", "UB", "TO", "W", "N")
        }, turned

    def solved(jack):
        def errors(*pose):
            p, _ = moved(np.array(pose))
            ends = (p[b] - at[a] for a, b in pairs)
            return [d @ d - s**2 for d, s in zip(ends, [*drawn[:5], jack], strict=True)]

        guess = [0, 0, jack - 2, 0, 0, 0]
        return np.array(list(mp.findroot(errors, guess, tol=mp.mpf(10) ** -90)))

    def places(q):
        pose = solved(q[0])
        p, turned = moved(pose)
        damper = at["LF"] + (p["LB"] - at["LF"]) * mp.mpf("0.7")
        found = of_rods(*((at[a], p[b]) for a, b in pairs[:5]))
        return np.array([*found, *(at["C"] + pose[:3] + body @ turned.T), damper])

    masses = [*halves(2, 2, "1.2", "1.2", "0.6"), *6 * [mp.mpf(32) / 6], 0]

    def force(r, v):
        loads, d = weights(masses), r[-1] - at["S"]
        length = size(d)
        loads[-1] -= d / length * (35000 * (length - mp.mpf("0.6")) + 1500 * (v[-1] @ d) / length)
        return loads

    def jack(t):
        return [2 + mp.mpf("0.06") * mp.sin(2 * mp.pi * t)]

    times = [0.0, 0.2, 0.68]
    found = at_times("double_wishbone", times)
    for n, t in enumerate(times):
        p, _ = moved(solved(jack(mp.mpf(t))[0]))
        assert found["W.position"].values[n] == pytest.approx(p["W"].astype(float), abs=1e-11)
        x, y, z = p["N"] - p["W"]
        assert found["camber"].values[n] == pytest.approx(float(-mp.atan2(z, y)), abs=1e-10)
        assert found["toe"].values[n] == pytest.approx(float(mp.atan2(x, y)), abs=1e-10)
        (thrust,) = efforts(places, jack, masses, t, force)
        assert -found["jack.tension"].values[n] == pytest.approx(thrust, rel=1e-8)


def test_macpherson_strut():
    """The pose of the upright by Newton's method on three rods, the jack, and the axis of the strut through its mount."""
    at = {
        "LF": "150 340 180", "LR": "-200 345 185", "LB": "0 700 165", "TI": "-120 330 240", "TO": "-130 690 225",
        "TOP": "-25 560 830", "K": "-5 640 330", "W": "0 750 300", "N": "0 850 300", "J": "0 750 -1700", "C": "-2 725 310",
    }  # fmt: skip
    at = {name: vector(text) for name, text in at.items()}
    pairs = ("LF", "LB"), ("LR", "LB"), ("TI", "TO"), ("J", "W")
    drawn = [size(at[a] - at[b]) for a, b in pairs]
    axis, body = at["TOP"] - at["K"], of_moments(35, ("1.1", "1.6", "1.2"))

    def moved(pose):
        turned = rotation(*pose[3:])
        return {
            k: at["C"] + pose[:3] + turned @ (at[k] - at["C"]) for k in ("LB", "TO", "W", "N", "K")
        }, turned

    def solved(jack):
        def errors(*pose):
            p, turned = moved(np.array(pose))
            ends = (p[b] - at[a] for a, b in pairs)
            off = crossed(turned @ axis, at["TOP"] - p["K"])
            return [*(d @ d - s**2 for d, s in zip(ends, [*drawn[:3], jack], strict=True)), off[0], off[1]]

        guess = [0, 0, jack - 2, 0, 0, 0]
        return np.array(list(mp.findroot(errors, guess, tol=mp.mpf(10) ** -90)))

    def places(q):
        pose = solved(q[0])
        p, turned = moved(pose)
        found = of_rods(*((at[a], p[b]) for a, b in pairs[:3]))
        return np.array([*found, *(at["C"] + pose[:3] + body @ turned.T), p["K"]])

    masses = [*halves(2, 2, "0.6"), *6 * [mp.mpf(35) / 6], 0]

    def force(r, v):
        loads, d = weights(masses), r[-1] - at["TOP"]
        length = size(d)
        loads[-1] -= d / length * (25000 * (length - mp.mpf("0.63")) + 1500 * (v[-1] @ d) / length)
        return loads

    def jack(t):
        return [2 + mp.mpf("0.06") * mp.sin(2 * mp.pi * t)]

    times = [0.0, 0.2, 0.68]
    found = at_times("macpherson_strut", times)
    for n, t in enumerate(times):
        p, _ = moved(solved(jack(mp.mpf(t))[0]))
        assert found["W.position"].values[n] == pytest.approx(p["W"].astype(float), abs=1e-11)
        x, y, z = p["N"] - p["W"]
        assert found["camber"].values[n] == pytest.approx(float(-mp.atan2(z, y)), abs=1e-10)
        assert found["toe"].values[n] == pytest.approx(float(mp.atan2(x, y)), abs=1e-10)
        assert found["springs.0.length"].values[n] == pytest.approx(
            float(size(p["K"] - at["TOP"])), abs=1e-11
        )
        (thrust,) = efforts(places, jack, masses, t, force)
        assert -found["jack.tension"].values[n] == pytest.approx(thrust, rel=1e-8)


def test_governor():
    """Lagrange's equation of the angle of the arms; the torque is the rate of the angular momentum."""
    length, width, g, damping = 0.26, 0.04, 9.81, 60.0
    arms, rods, balls, sleeve = 0.8, 0.6, 4.0, 4.0
    slow, gain, lasts = 100 * np.pi / 30, 60 * np.pi / 30, 5.0

    def inertia(x):
        """Return the moment about the axis that depends on the angle, and its slope."""
        moment = length**2 * (balls + arms / 3 + rods / 3)
        return moment * np.sin(x) ** 2, moment * np.sin(2 * x)

    def rates(t, y):
        x, v = y
        turning, s, c = slow + gain * t / lasts, np.sin(x), np.cos(x)
        mass = length**2 * (balls + arms / 3 + rods * (c * c + 7 * s * s) / 3 + 4 * sleeve * s * s)
        of_mass = length**2 * (rods * 4 * s * c + 8 * sleeve * s * c)  # its slope
        weight = g * length * s * (arms / 2 + balls + 1.5 * rods + 2 * sleeve)
        force = (
            inertia(x)[1] * turning**2 / 2
            - of_mass * v * v / 2
            - weight
            - damping * (2 * length * s) ** 2 * v
        )
        return [v, force / mass]

    start = [np.arctan2(0.1, 0.24), 0.0]
    times = np.array([0.0, 0.4, 1.3, 2.9, 5.0])
    options = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14}
    x, v = solve_ivp(rates, (0, 5), start, t_eval=times, **options).y
    run = symgen.build("governor").simulate(t_eval=times, rtol=1e-12)
    assert run["S.position.z"].values == pytest.approx(-2 * length * np.cos(x), abs=1e-9)
    moment, slope = inertia(x)
    fixed = width**2 * arms / 3 + 0.0005  # the arms at their upper ends, and the bar
    torque = (fixed + moment) * gain / lasts + slope * v * (slow + gain * times / lasts)
    assert run["bar.torque"].values == pytest.approx(torque, abs=1e-8)
