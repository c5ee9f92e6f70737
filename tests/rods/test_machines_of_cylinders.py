"""Machines of the documentation that cylinders, screws and profiles drive, by closed forms and virtual work."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from shared.virtual_work import G, carried, efforts, halves, meet, of_body, of_rods, slopes

import symgen


def at_times(name, times):
    return symgen.build(name).inverse_dynamics(at=times, over="time")


def poly345(x):
    return 10 * x**3 - 15 * x**4 + 6 * x**5


def test_excavator():
    """Each cylinder is a side of a triangle; the bucket hangs on a four-bar linkage."""
    drawn = {
        "A": "0 1.8", "B": "0.45 1.4", "C": "2.2 3.9", "D": "2.4 4.3", "E": "5 4.1", "F": "4.9 4.8", "G": "5.4 3.9",
        "H": "5.7 1.9", "I": "6.1 2", "J": "5.8 1.5", "K": "6.2 1.55", "Z": "5.7 0.2",
        "boom": "2.4 3.6", "stick": "5.3 3.3", "bucket": "6 0.9",
    }  # fmt: skip
    at = {name: mp.mpc(*text.split()) for name, text in drawn.items()}

    def size(a, b):
        return abs(at[a] - at[b])

    def joints(q):
        p = {"A": at["A"], "B": at["B"]}
        p["C"] = meet(p["A"], p["B"], size("A", "C"), q[0], 1)
        for name in "DE":
            p[name] = carried(p["A"], p["C"], [at[x] for x in ("A", "C", name)])
        p["F"] = meet(p["D"], p["E"], q[1], size("E", "F"), 1)
        for name in "GHJ":
            p[name] = carried(p["E"], p["F"], [at[x] for x in ("E", "F", name)])
        p["I"] = meet(p["G"], p["H"], q[2], size("H", "I"), 1)
        p["K"] = meet(p["I"], p["J"], size("I", "K"), size("J", "K"), 1)
        p["Z"] = carried(p["J"], p["K"], [at[x] for x in ("J", "K", "Z")])
        return p

    bodies = {"boom": ("A", "E", 1500, 4000), "stick": ("E", "J", 700, 600), "bucket": ("J", "Z", 900, 200)}

    def places(q):
        p = joints(q)
        found = of_rods((p["H"], p["I"]), (p["I"], p["K"]))
        for name, (a, b, mass, inertia) in bodies.items():
            found += of_body(p[a], p[b], [at[a], at[b], at[name]], mass, inertia)
        return np.array([*found, p["J"], p["Z"]])

    masses = [*halves(40, 50, *(body[2] for body in bodies.values())), 0, 0]

    def force(r, _):
        loads = np.array([mp.mpc(0, -G * m) for m in masses])
        loads[-1] += 40000j * (r[-1] - r[-2]) / abs(r[-1] - r[-2])
        return loads

    def lengths(t):
        first, strokes = ("3.05", "2.55", "2.02"), ("0.3", "0.4", "0.25")
        return [mp.mpf(a) + mp.mpf(b) * poly345(t / 4) for a, b in zip(first, strokes, strict=True)]

    times = [0.1, 0.9, 2.3, 3.7]
    found = at_times("excavator", times)
    for n, t in enumerate(times):
        teeth = joints(lengths(mp.mpf(t)))["Z"]
        assert found["Z.position"].values[n] == pytest.approx(
            [float(teeth.real), float(teeth.imag)], abs=1e-11
        )
        thrusts = efforts(places, lengths, masses, t, force)
        for name, thrust in zip(("boom", "stick", "bucket"), thrusts, strict=True):
            assert -found[f"{name}_cylinder.tension"].values[n] == pytest.approx(thrust, rel=1e-8), (name, t)


def test_scissor_lift():
    """All arms have the slope of the first; the screw carries three times the load over it, and inertia."""
    arm, masses = mp.mpf("1.2"), [*halves(*6 * [18]), 60, 300]
    wide = mp.mpf("1.1")

    def places(q):
        high = mp.sqrt(arm**2 - q[0] ** 2)
        found = []
        for k in range(3):
            for sign in (1, -1):
                a, b = mp.mpc(0, (k + (sign < 0)) * high), mp.mpc(q[0], (k + (sign > 0)) * high)
                found += of_body(a, b, [mp.mpc(0), mp.mpc(1), mp.mpc("0.5")], 18, 2)
        platform = mp.mpc(0, 3 * high)
        # The platform does not rotate: its mass may be at its centre.
        return np.array([*found, platform + mp.mpf("0.3") * 2 * wide, platform + mp.mpf("0.3") * 2 * wide])

    def s_curve(x):
        """Third differences of the distance: linear accelerations in six parts."""
        jerk, total = [1, -1, 0, 0, -1, 1], mp.mpf(0)
        s = v = a = mp.mpf(0)
        for k, j in enumerate(jerk):
            h = min(max(x - mp.mpf(k) / 6, 0), mp.mpf(1) / 6)
            s, v, a = s + v * h + a * h**2 / 2 + j * h**3 / 6, v + a * h + j * h**2 / 2, a + j * h
            total += h
        return s * 54

    weight = np.array([mp.mpc(0, -G * m) for m in masses])
    inputs = lambda t: [wide - mp.mpf("0.4") * s_curve(t / 10)]  # noqa: E731
    times = [0.0, 0.7, 2.5, 5.1, 8.2]
    found = at_times("scissor_lift", times)
    for n, t in enumerate(times):
        (q,) = inputs(mp.mpf(t))
        high = 3 * mp.sqrt(arm**2 - q**2)
        assert found["L3.position.y"].values[n] == pytest.approx(float(high), abs=1e-11)
        assert found["R3.position"].values[n] == pytest.approx([float(q), float(high)], abs=1e-11)
        (thrust,) = efforts(places, inputs, masses, t, lambda *_: weight)
        assert -found["screw.tension"].values[n] == pytest.approx(thrust, rel=1e-8)
        static = -9.81 * 3 * float(q / (high / 3)) * (360 + 6 * 18 / 2)
        assert thrust == pytest.approx(static, rel=0.03 if n else 1e-8)


def modified_sine(x):
    """Return the distance, from an acceleration of a quarter of a fast sine, half a slow one, a quarter of a fast one."""
    a = 4 + mp.pi
    if x < mp.mpf(1) / 8:
        return (mp.pi * x - mp.sin(4 * mp.pi * x) / 4) / a
    if x < mp.mpf(7) / 8:
        return (2 + mp.pi * x - 9 * mp.sin((4 * mp.pi * x + mp.pi) / 3) / 4) / a
    return (4 + mp.pi * x - mp.sin(4 * mp.pi * x) / 4) / a


def test_indexing_table():
    """The motor has the inertia of the table by the square of the ratio, and its friction by the ratio."""
    on_table = 0.9 + 3 * 0.25**2

    def angle(t):
        return (
            mp.pi
            / 2
            * (
                modified_sine(t / mp.mpf("0.4"))
                if t < 0.4
                else 1 + modified_sine((t - mp.mpf("1.2")) / mp.mpf("0.4"))
            )
        )

    times = [0.03, 0.11, 0.29, 0.37, 1.22, 1.45]
    found = at_times("indexing_table", times)
    for n, t in enumerate(times):
        rate, acceleration = slopes(angle, mp.mpf(t))
        needed = float(on_table * acceleration + 4 * mp.tanh(rate / mp.mpf("0.01")))
        assert found["table.angle"].values[n] == pytest.approx(float(angle(mp.mpf(t))), abs=1e-11)
        assert found["motor.torque"].values[n] == pytest.approx(
            -needed / 5 - 5 * 0.0004 * float(acceleration), abs=1e-8 * 13
        )
        assert found["gears.0.torque"].values[n] == pytest.approx(needed / 5, abs=1e-8 * 13)
