"""Machines of the documentation that a crank drives: positions by closed forms, torques by virtual work."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from shared.virtual_work import G, efforts, halves, meet, of_rods

import symgen

MM = mp.mpf("0.001")


def xy(place):
    return [float(place.real), float(place.imag)]


def at_times(name, times):
    return symgen.build(name).inverse_dynamics(at=times, over="time")


def test_jansen_leg():
    """Dyad after dyad, by the sides of Jansen's triangles."""
    a, b, c, d, e, f, g, h, i, j, k = (
        mp.mpf(x) * MM
        for x in ["15", "41.5", "39.3", "40.1", "55.8", "39.4", "36.7", "65.7", "49", "50", "61.9"]
    )
    pivot = mp.mpc("-0.038", "-0.0078")

    def joints(angle):
        crank = a * mp.expj(angle)
        top = meet(crank, pivot, j, b, -1)
        back = meet(pivot, top, d, e, 1)
        low = meet(crank, pivot, k, c, 1)
        heel = meet(back, low, f, g, -1)
        return crank, top, back, low, heel, meet(low, heel, i, h, 1)

    def places(q):
        crank, top, back, low, heel, foot = joints(q[0])
        ends = (0 * crank, crank), (crank, top), (crank, low), (pivot, top), (pivot, back), (top, back)
        more = (pivot, low), (back, heel), (low, heel), (heel, foot), (low, foot)
        return np.array([*of_rods(*ends, *more), foot])

    masses = [*halves(*(mp.mpf("1.2") * x for x in (a, j, k, b, d, e, c, f, g, h, i))), mp.mpf("0.05")]
    weight = np.array([mp.mpc(0, -G * m) for m in masses])
    times = [0.0, 0.31, 0.77, 1.02, 1.64]
    found = at_times("jansen_leg", times)
    for n, t in enumerate(times):
        foot = joints(mp.pi * t)[-1]
        assert found["P.position"].values[n] == pytest.approx(xy(foot), abs=1e-11)
        (torque,) = efforts(places, lambda s: [mp.pi * s], masses, t, lambda *_: weight)
        assert found["crank.torque"].values[n] == pytest.approx(torque, rel=1e-8)


def test_wiper():
    """The arms by two dyads; the drag of the blades is a force at their ends."""
    left, right = mp.mpc("0.23", "0.02"), mp.mpc("-0.35")
    speed = 1.5 * mp.pi

    def joints(angle):
        crank = 40 * MM * mp.expj(angle)
        b = meet(crank, left, 225 * MM, 60 * MM, -1)
        r = meet(b, right, 580 * MM, 62 * MM, 1)
        return crank, b, r, left - 8 * (b - left), right - 8 * (r - right)

    def places(q):
        crank, b, r, s, t = joints(q[0])
        return np.array([*of_rods((0 * crank, crank), (crank, b), (left, b), (b, r), (right, r)), s, t])

    def drag(_, velocities):
        return np.array([*(0 * velocities[:-2]), *(-6 * velocities[-2:])])

    masses = [*halves("0.1", "0.2", "0.15", "0.3", "0.15"), mp.mpf("0.25"), mp.mpf("0.25")]
    times = [0.0, 0.21, 0.54, 0.86, 1.2]
    found = at_times("wiper", times)
    for n, t in enumerate(times):
        *_, s, r = joints(speed * t)
        for arm, pivot, end in (("left", left, s), ("right", right, r)):
            angle = found[f"{arm}.angle"].values[n]
            assert [np.cos(angle), np.sin(angle)] == pytest.approx(
                xy((pivot - end) / abs(end - pivot)), abs=1e-11
            )
        (torque,) = efforts(places, lambda s: [speed * s], masses, t, drag)
        assert found["crank.torque"].values[n] == pytest.approx(torque, rel=1e-8)


def test_toggle_press():
    """The knee by a dyad; the work is a spring that resists compression alone."""
    foot = mp.mpc("-0.32", "-0.18")

    def joints(angle):
        crank = foot + 60 * MM * mp.expj(angle)
        knee = meet(crank, mp.mpc(0), 255 * MM, 200 * MM, -1)
        return crank, knee, mp.mpc(0, knee.imag - mp.sqrt((200 * MM) ** 2 - knee.real**2))

    def places(q):
        crank, knee, ram = joints(q[0])
        return np.array([*of_rods((foot, crank), (crank, knee), (0 * knee, knee), (knee, ram)), ram])

    masses = [*halves(8, 6, 10, 10), mp.mpf(40)]

    def force(r, _):
        loads = np.array([mp.mpc(0, -G * m) for m in masses])
        loads[-1] += mp.mpc(0, 20e6 * max(0, mp.mpf("-0.392") - r[-1].imag))
        return loads

    times = [0.05, 0.1, 0.35, 0.6, 0.9]
    found = at_times("toggle_press", times)
    pressed = 0
    for n, t in enumerate(times):
        ram = joints(2 * mp.pi * t)[-1]
        assert found["R.position.y"].values[n] == pytest.approx(float(ram.imag), abs=1e-11)
        load = 20e6 * max(0.0, -0.392 - float(ram.imag))
        assert found["forces.0.force.y"].values[n] == pytest.approx(load, abs=1e-8 * 157e3)
        pressed += load > 0
        (torque,) = efforts(places, lambda s: [2 * mp.pi * s], masses, t, force)
        assert found["crank.torque"].values[n] == pytest.approx(torque, abs=1e-8 * 1182)
    assert 0 < pressed < len(times)


def test_whitworth():
    """The arm points through the pin of the crank; it and the ram return in less time than they advance."""
    centre = mp.mpc(0, "-0.03")

    def joints(angle):
        pin = 80 * MM * mp.expj(angle)
        end = centre + 60 * MM * (centre - pin) / abs(centre - pin)
        return pin, end, mp.mpc(end.real + mp.sqrt((240 * MM) ** 2 - (end - centre).imag ** 2), centre.imag)

    def places(q):
        pin, end, ram = joints(q[0])
        return np.array([*of_rods((0 * pin, pin), (centre, end), (end, ram)), ram])

    def cut(_, velocities):
        loads = 0 * velocities
        loads[-1] = mp.mpc(-800 if velocities[-1].real > 0 else 0)
        return loads

    masses = [*halves(2, 3, 2), mp.mpf(10)]
    times = [0.03, 0.3, 0.5, 0.72, 0.9]
    found = at_times("whitworth", times)
    for n, t in enumerate(times):
        _, end, ram = joints(2 * mp.pi * t)
        angle = found["arm.angle"].values[n]
        assert [np.cos(angle), np.sin(angle)] == pytest.approx(
            xy((end - centre) / abs(end - centre)), abs=1e-11
        )
        assert found["S.position.x"].values[n] == pytest.approx(float(ram.real), abs=1e-11)
        (torque,) = efforts(places, lambda s: [2 * mp.pi * s], masses, t, cut)
        assert found["crank.torque"].values[n] == pytest.approx(torque, abs=1e-8 * 36)
    # Ends of the stroke: the arm is in line with the rail.
    ends = (np.pi + np.arcsin(30 / 80)) / (2 * np.pi), 1 - np.arcsin(30 / 80) / (2 * np.pi)
    model = symgen.build("whitworth")
    stroke = model.kinematics(at=ends, over="time", of=["S"])
    assert stroke["S.velocity"].values == pytest.approx(0, abs=1e-9)
    assert stroke["S.position"].values[:, 0] == pytest.approx([0.3, 0.18], abs=1e-11)


def test_v_twin():
    """Pistons on their axes; the test of tables has the torque."""
    times = [0.0, 0.003, 0.0171, 0.0314]
    found = at_times("v_twin", times)
    for n, t in enumerate(times):
        angle = np.pi / 2 + 100 * np.pi * t
        for name, axis in (("B1", 5 * np.pi / 8), ("B2", 3 * np.pi / 8)):
            along = 0.048 * np.cos(angle - axis) + np.sqrt(0.17**2 - (0.048 * np.sin(angle - axis)) ** 2)
            place = along * np.array([np.cos(axis), np.sin(axis)])
            assert found[f"{name}.position"].values[n] == pytest.approx(place, abs=1e-12)
