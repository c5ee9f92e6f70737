"""Faults that were found by running symgen on mechanisms its tests did not contain: one test for each.

The scenes are in ``tests/cases``. Related tests of the same mechanisms of failure are with the module that they test.
"""

import json
import math
import os
import re
import shutil
import subprocess
import sys
import time
import tomllib
from fractions import Fraction
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from shared.full import full
from shared.inches import in_inches
from shared.wrong_calls import judge, sample, wrong_calls
from typer.testing import CliRunner

import symgen
from symgen.cli import app, main
from symgen.errors import (
    BuildError,
    CacheError,
    InitialStateError,
    ModelError,
    ResultError,
    SceneError,
    SimulationError,
    SlowBackendWarning,
)
from symgen.lowering import straight_line
from symgen.runtime.closure.start import close_near
from symgen.runtime.loop.kernels import LoopKernels
from symgen.scene.resolve import resolve
from symgen.toolchain import compiler
from symgen.toolchain import dependencies as graph
from symgen.toolchain.cache import Cache

CASES = Path(__file__).parent / "cases"

# ---------------------------------------------------------------------------------------------- spatial loops, 1 to 9


def along_row(theta, shift=0.0, alpha=0.0, a=0.0):
    """The transform of a row of a link-joint table as a 4x4 matrix."""
    return turned(2, theta) @ shifted(0, shift) @ turned(0, alpha) @ shifted(a, 0)


def loop_scene(rows, inputs, name, **more):
    """A loop of rows (joint, link, entries) whose first input turns at 1 rad/s."""
    tables = [{"joint": joint, "link": link, **entries} for joint, link, entries in rows]
    analysis, table = more.pop("analysis", {}), {"rows": tables, "inputs": inputs, **more}
    return symgen.Scene(parameters={"w": "1 rad/s"}, loop=table, analysis=analysis).called(name)


def four_bar(lengths, inputs, start=None, **more):
    links = ("crank", "coupler", "rocker", "ground")
    named = {f"theta{i}" for i in range(1, 5)} & set(inputs)
    rows = [
        ("R", link, {"theta": f"theta{i}" if f"theta{i}" in named else "?", "a": f"{a!r} m"})
        for i, (link, a) in enumerate(zip(links, lengths, strict=True), 1)
    ]
    guess = {k: f"{x!r} rad" for k, x in (start or {}).items()}
    return loop_scene(rows, inputs, "second_look_four_bar", start=guess, **more)


@pytest.mark.parametrize("lead", [full(400.0), full(4.0), 0.5])
def test_1_whole_revolutions_of_a_screw_carry_their_translation(lead):
    """A slider-crank whose slider is a nut on a screw closes at two turns of the nut, near to the guess or far."""
    crank, rod, first = 0.1, 0.15, math.radians(40)
    pitch = lead * 1e-3 / (2 * math.pi)
    root = math.sqrt(rod**2 - (crank * math.cos(first)) ** 2)
    turns = [1e3 * (crank * math.sin(first) + sign * root) / lead for sign in (-1, 1)]
    rows = [
        ("R", "crank", {"theta": "theta1", "a": "100 mm"}),
        ("R", "rod", {"theta": "?", "a": "150 mm"}),
        ("R", "slider", {"theta": "?", "alpha": "90 deg"}),
        ("H", "nut", {"theta": "?", "pitch": f"{pitch!r} m"}),
        ("R", "ground", {"theta": "?", "alpha": "-90 deg"}),
    ]

    def built(start):
        return symgen.build(
            loop_scene(
                rows, {"theta1": "w*t"}, "second_look_nut", range=["40 deg", "50 deg"], start=start,
                analysis={"outputs": ["theta4"]},
            )
        )  # fmt: skip

    found = built({}).assemblies()
    assert sorted(p["theta4"] / (2 * math.pi) for p in found) == pytest.approx(turns, rel=1e-9)
    for p in found:
        whole = along_row(p["theta1"], a=crank) @ along_row(p["theta2"], a=rod)
        whole = whole @ along_row(p["theta3"], alpha=math.pi / 2)
        whole = (
            whole @ along_row(p["theta4"], pitch * p["theta4"]) @ along_row(p["theta5"], alpha=-math.pi / 2)
        )
        assert np.max(np.abs(whole - np.eye(4))) < 1e-15 * (20 + abs(p["theta4"]))
    for revolutions in turns:
        guess = {"theta4": f"{revolutions + 0.2!r} rev", "theta5": f"{-revolutions - 0.2!r} rev"}
        *_, nut, ground = built(guess).closed_start().q
        assert nut == pytest.approx(2 * math.pi * revolutions, rel=1e-9)
        assert abs(nut + ground) < 2 * math.pi  # near its guess too


def test_3_idle_freedoms_are_named():
    """R-C-C-R with parallel axes: the coupler can slide along them, whatever the crank does."""
    entries = {"theta": "?", "S": "?"}

    def scene(sliding, inputs):
        rows = [
            ("R", "crank", {"theta": "theta1", "a": "0.1 m"}),
            ("C", "coupler", {**entries, "S": sliding, "a": "0.4 m"}),
            ("C", "rocker", {**entries, "a": "0.3 m"}),
            ("R", "ground", {"theta": "?", "a": "-0.35 m"}),
        ]
        return loop_scene(rows, {"theta1": "w*t", **inputs}, "second_look_rccr")

    with pytest.raises(SceneError) as error:
        symgen.build(scene("?", {}))
    text = str(error.value)
    assert "idle freedom" in text and "cannot be assembled" not in text
    assert set(re.findall(r"(\w+) of row", text)) == {"S2", "S3"}
    assert "with theta1 held, coupler can still move" in text
    held = symgen.build(scene("sliding", {"sliding": "5 mm"})).inverse_dynamics(samples=13)
    assert held.variable("S3").values == pytest.approx(np.full(13, -0.005), abs=1e-15)


def test_6_the_closure_nearest_to_the_guess_is_followed():
    """The two closures of a planar four-bar in closed form, and the nearer one by the angles from the guess."""
    lengths, first = (0.1, 0.4, 0.3, -0.35), 1.0
    model = symgen.build(four_bar(lengths, {"theta1": "w*t"}, range=["1 rad", "2 rad"]))
    a1, a2, a3, a4 = lengths
    to = np.array([-a4 - a1 * math.cos(first), -a1 * math.sin(first)])
    away, line = np.linalg.norm(to), math.atan2(to[1], to[0])
    corner = math.acos((a2**2 + away**2 - a3**2) / (2 * a2 * away))
    other = math.acos((a3**2 + away**2 - a2**2) / (2 * a3 * away))
    closures = np.array(
        [
            [line + s * corner - first, -s * (corner + other), s * other - line]
            for s in (1, -1)
        ]
    )  # fmt: skip

    def gap(angles):
        return np.abs((angles + math.pi) % (2 * math.pi) - math.pi)

    random, left_behind = np.random.default_rng(6), 0
    for guess in random.uniform(-math.pi, math.pi, (25, 3)):
        begin = close_near(model.kernels, 1.0, np.array([1.0, *guess])).q[1:]
        reached = [np.max(gap(begin - q)) for q in closures]
        assert min(reached) < 1e-12
        near = [np.linalg.norm(gap(q - guess)) for q in closures]
        left_behind += near[int(np.argmin(reached))] > min(near) + 1e-6
    assert left_behind == 0
    assert not any("branch" in note for note in symgen.build("screw_jack").inverse_dynamics(samples=37).notes)


def test_8_an_assembly_tolerance_closes_overconstrained_loops():
    """Bennett's linkage with one length 20 um off: closed by least squares, and the residual reported."""
    size, short, long = 0.2, math.radians(40), math.radians(100)
    b, c = size * math.sin(short), size * math.sin(long)
    rows = [
        ("R", "driver", {"theta": "theta1", "alpha": "40 deg", "a": f"{b!r} m"}),
        ("R", "coupler", {"theta": "?", "alpha": "100 deg", "a": f"{c + 2e-5!r} m"}),
        ("R", "follower", {"theta": "?", "alpha": "40 deg", "a": f"{b!r} m"}),
        ("R", "ground", {"theta": "?", "alpha": "100 deg", "a": f"{c!r} m"}),
    ]
    options = {
        "range": ["5 deg", "355 deg"],
        "start": {"theta2": "170 deg", "theta3": "-5 deg", "theta4": "-170 deg"},
    }
    loop = loop_scene(rows, {"theta1": "w*t"}, "second_look_bennett", **options)
    with pytest.raises(SceneError) as error:
        symgen.build(loop)
    assert "assembly_tolerance" in str(error.value) and "closest pose is theta2 = " in str(error.value)
    loop = loop_scene(
        rows, {"theta1": "w*t"}, "second_look_bennett", analysis={"assembly_tolerance": "50 um"}, **options
    )
    turn = symgen.build(loop).inverse_dynamics(samples=36)
    # tan(theta1/2) tan(theta2/2) is constant where the linkage closes exactly.
    constant = -math.sin((long + short) / 2) / math.sin((long - short) / 2)
    halves = [np.tan(turn.variable(name).values / 2) for name in ("theta1", "theta2")]
    assert halves[0] * halves[1] == pytest.approx(np.full(36, abs(constant)), rel=5e-3)
    residuals = []
    for angles in zip(*(turn.variable(f"theta{i}").values for i in range(1, 5)), strict=True):
        whole = np.eye(4)
        for angle, a, alpha in zip(angles, (b, c + 2e-5, b, c), (short, long) * 2, strict=True):
            whole = whole @ along_row(angle, alpha=alpha, a=a)
        gap = np.abs(whole - np.eye(4))
        residuals.append(max(np.max(gap[:3, 3]) / c, np.max(gap[:3, :3])))
    assert turn.closure == pytest.approx(max(residuals), rel=1e-3) and turn.closure > 1e-6
    assert "least squares" in turn.notes[0]


def test_8_errors_name_the_input_and_the_closest_pose():
    """A crank and a rocker cannot both be prescribed; a ground too long leaves the closest pose stretched."""
    lengths = (0.1, 0.4, 0.3, -0.35)
    with pytest.raises(SceneError) as error:
        symgen.build(four_bar(lengths, {"theta1": "w*t", "theta4": "0.2 rad"}))
    text = str(error.value)
    assert "theta4 of row 4" in text and "together with theta1" in text
    closes = math.radians(float(re.search(r"closes at theta4 = ([-\d.e]+) deg", text).group(1)))
    joint = np.array([0.35, 0.0]) - 0.3 * np.array([math.cos(closes), -math.sin(closes)])
    assert np.linalg.norm(joint - [0.1, 0.0]) == pytest.approx(0.4, rel=1e-6)
    with pytest.raises(SceneError) as error:
        symgen.build(four_bar((0.1, 0.2, 0.3, 0.9), {"theta1": "w*t"}))
    pose = [float(x) for x in re.findall(r"theta[234] = ([-\d.e]+) deg", str(error.value))]
    whole = along_row(0.0, a=0.1)
    for angle, a in zip(pose, (0.2, 0.3, 0.9), strict=True):
        whole = whole @ along_row(math.radians(angle), a=a)
    gap = np.abs(whole - np.eye(4))
    stated = float(re.search(r"open by ([\d.e-]+)", str(error.value)).group(1))
    assert max(np.max(gap[:3, :3]), np.max(gap[:3, 3]) / 0.9) == pytest.approx(stated, rel=0.02)
    assert re.search(r"theta\d of row \d .* holds the loop least", str(error.value))


def turned(axis, angle):
    """A rotation about an axis of the frame as a 4x4 matrix."""
    found = np.eye(4)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    found[j, j] = found[k, k] = np.cos(angle)
    found[k, j], found[j, k] = np.sin(angle), -np.sin(angle)
    return found


def shifted(x, z):
    """A translation along i and along k of the frame."""
    found = np.eye(4)
    found[[0, 2], 3] = x, z
    return found


def test_2_undetermined_force_components_are_found_at_every_pose():
    """Schatz's linkage: a wrench that does no work at any of the six hinges, moved from frame to frame.

    The screws are those of the table, by plain 4x4 matrices.
    """
    turn = symgen.build(CASES / "schatz.toml").inverse_dynamics(samples=73)  # every 5 degrees
    assert len(turn.indeterminate) == 27
    a, b, links = 0.1, 0.03, ("l1", "l2", "l3", "l4", "l5", "ground")
    rows = [(b, 0.0), (0, a), (0, a), (0, a), (0, 0), (-b, np.sqrt(3) * a)]
    angles = [turn.variable(n).values for n in ("phi", "theta2", "theta3", "theta4", "theta5", "theta6")]
    counts = set()
    for pose in range(73):
        frames = [np.eye(4)]
        for k, (offset, length) in enumerate(rows):
            twist = np.pi / 2 if k < 5 else 0.0
            row = turned(2, angles[k][pose]) @ shifted(0, offset) @ turned(0, twist) @ shifted(length, 0)
            frames.append(frames[-1] @ row)
        assert np.allclose(frames[-1], np.eye(4), atol=1e-12)
        axes, origins = np.array([f[:3, 2] for f in frames[:6]]), np.array([f[:3, 3] for f in frames[:6]])
        screws = np.hstack([np.cross(origins, axes), axes])  # times (force, moment): the power of a wrench
        _, values, right = np.linalg.svd(screws)
        assert values[4] > 1e-4 and values[5] < 1e-12
        force, moment = right[5, :3], right[5, 3:]
        expected = set()
        for k, link in enumerate(links):
            seen = frames[k][:3, :3].T @ np.array([force, moment - np.cross(origins[k], force)]).T
            for column, word in enumerate(("force", "moment")):
                for row, axis in enumerate("xyz"):
                    if abs(seen[row, column]) > 1e-9:
                        expected.add(f"{link}.joint{k + 1}.{word}.{axis}")
        assert {name for name, mask in turn.undetermined.items() if mask[pose]} == expected, pose
        counts.add(len(expected))
    assert min(counts) < max(counts) == 27


class Antiparallelogram:
    """The linkage of par4.toml and free_par.toml: cranks of 10 cm at O and 30 cm to its left, coupler 30 cm.

    On the branch in which the cranks turn against each other, tan(psi/2) = -tan(q/2)/2.
    """

    @staticmethod
    def inertia(q):
        """The kinetic energy at a rate q' = 1 is half of this [kg m^2]."""
        c = -mp.mpf(1) / 2
        psi, rate = (
            2 * mp.atan2(c * mp.sin(q / 2), mp.cos(q / 2)),
            c / (mp.cos(q / 2) ** 2 + (c * mp.sin(q / 2)) ** 2),
        )
        a, b = mp.expj(q) / 10, mp.expj(psi) / 10 - mp.mpf(3) / 10
        va, vb = mp.mpc(0, 1) * mp.expj(q) / 10, mp.mpc(0, rate) * mp.expj(psi) / 10
        assert abs(abs(a - b) - mp.mpf(3) / 10) < 1e-14
        turning = (mp.conj(a - b) * (va - vb)).imag / mp.mpf("0.09")
        rods = abs(va / 2) ** 2 + abs(vb / 2) ** 2 + 3 * abs((va + vb) / 2) ** 2
        return rods + mp.mpf("8e-4") * (1 + rate**2) + mp.mpf("225e-4") * turning**2

    @staticmethod
    def potential(q):
        psi = 2 * mp.atan2(-mp.sin(q / 2) / 2, mp.cos(q / 2))
        return mp.mpf("9.81") * (2 * mp.sin(q) + 2 * mp.sin(psi)) / 10

    def torque(self, q, rate=0):
        """The torque that keeps the crank at a constant rate [N m]."""
        step = mp.mpf(10) ** -6
        return mp.diff(self.potential, q, h=step) + rate**2 / 2 * mp.diff(self.inertia, q, h=step)


def test_5_forces_near_a_change_point():
    """The drive of a parallelogram of 10 and 30 cm near 180 deg, where all its links are in one line."""
    model, exact = symgen.build(CASES / "par4.toml"), Antiparallelogram()
    degrees = np.array([170, 179, 179.9, 179.99, 179.999, 179.9999, 180.0001, 180.001, 180.1])
    turn = model.inverse_dynamics(at=np.radians(degrees))
    with mp.workdps(40):
        expected = [float(exact.torque(mp.radians(mp.mpf(x)), 2 * mp.pi)) for x in degrees.tolist()]
    assert turn.variable("q.drive").values == pytest.approx(expected, rel=1e-8)
    assert not any("rounding" in note for note in turn.notes)
    through = model.inverse_dynamics(*np.radians([179.9, 180.1]), samples=57, through=True)
    with mp.workdps(40):
        expected = [float(exact.torque(mp.mpf(x), 2 * mp.pi)) for x in through.coordinate.values]
    known = ~np.isnan(through.variable("q.drive").values)
    assert np.sum(known) > 50
    assert through.variable("q.drive").values[known] == pytest.approx(np.array(expected)[known], rel=1e-8)


def test_5_free_loops_pass_change_points_with_a_note():
    """A released parallelogram swings through 180 deg; by its reduced equation, I q'' + I' q'^2/2 + V' = 0."""
    model, exact = symgen.build(CASES / "free_par.toml"), Antiparallelogram()

    def motion(_, y):
        inertia = float(exact.inertia(mp.mpf(y[0])))
        return [y[1], -float(exact.torque(mp.mpf(y[0]), mp.mpf(y[1]))) / inertia]

    with mp.workdps(40):
        done = solve_ivp(motion, (0, 0.5), [np.radians(120), 6.0], "DOP853", rtol=1e-11, atol=1e-12)
    for rtol in (1e-6, 1e-8, 1e-10, 1e-12):
        run = model.simulate(0.5, rtol=rtol, atol=rtol / 100)
        assert run.final["q"]["value"] == pytest.approx(done.y[0, -1], abs=2e-6)
        assert any("passed 2 losses of rank" in note for note in run.notes)


def test_5_change_points_are_passed_at_every_tolerance():
    """Four of them; energy by the reduced equation, which rounding errors of the poses near them disturb."""
    model, exact = symgen.build(CASES / "free_par.toml"), Antiparallelogram()

    def energy(q, rate):
        return float(exact.inertia(mp.mpf(q))) * rate**2 / 2 + float(exact.potential(mp.mpf(q)))

    start = energy(np.radians(120), 6.0)
    for exponent in np.arange(-5.0, -13.6, -0.2).tolist():
        run = model.simulate(2.0, rtol=10**exponent, samples=2)
        assert any("passed 4 losses of rank" in note for note in run.notes), exponent
        end = run["q"].values[-1], run["q.rate"].values[-1]
        assert energy(*end) == pytest.approx(start, abs=3e-7 + 2 * 10**exponent), exponent


def crank_rocker(motion, lengths=(0.1, 0.4, 0.3, 0.35), **loop):
    """A four-bar linkage with joints O and D = (-0.35, 0); its inputs are written by h, T and w."""
    links = zip(("crank", "coupler", "rocker", "ground"), ("q", "?", "?", "?"), lengths, strict=True)
    rows = [{"joint": "R", "link": n, "theta": x, "a": f"{a} m"} for n, x, a in links]
    parameters = {"h": "2 rad", "T": "2 s", "w": "1 rad/s"}
    return symgen.build(
        symgen.Scene(parameters=parameters, loop={"rows": rows, "inputs": {"q": motion}, **loop})
    )


def rocker(q, side, lengths=(0.1, 0.4, 0.3, 0.35)):
    """The direction of the rocker, from the triangle on the line from D to the end of the crank."""
    crank, coupler, length, ground = lengths
    line = crank * np.exp(1j * q) + ground
    cosine = (np.abs(line) ** 2 + length**2 - coupler**2) / (2 * np.abs(line) * length)
    return np.exp(1j * (np.angle(line) + side * np.arccos(cosine))) * -1.0  # towards D


def check_rocker(turn, q, lengths=(0.1, 0.4, 0.3, 0.35)):
    found = np.exp(1j * sum(turn.variable(n).values for n in ("q", "theta2", "theta3")))
    errors = [np.max(np.abs(found - rocker(q, side, lengths))) for side in (1, -1)]
    assert turn.variable("q").values == pytest.approx(q, abs=1e-14)
    assert min(errors) < 1e-12


@pytest.mark.parametrize("span", [["0 deg", "360 deg"], ["180 deg", "360 deg"]])
def test_4_a_pole_of_the_angles_of_a_ball_is_no_singularity_of_the_loop(span):
    """A slider along the axis of its crank: at 180 deg the rod is on that axis, where its two angles have a pole.

    The end of the crank is 24 in |cos(q/2)| from the slider's line: S = sqrt(50^2 - (24 cos(q/2))^2) in.
    """
    changed = {"alpha4": "180 deg", "a4": "12 in", "loop.range": span}
    model = symgen.build("slider_crank", set=changed)
    turn = in_inches(model.inverse_dynamics(samples=361 if span[0] == "0 deg" else 181))
    q = turn.variable("theta1").values
    crank = np.sqrt(2500.0 - (24.0 * np.cos(q / 2)) ** 2)
    slope = 72.0 * np.sin(q) * 2.0 / crank  # of the root by q
    rate = 50.0 * 2.0 * np.pi / 60.0
    assert turn.variable("S4").values == pytest.approx(crank, abs=1e-11)
    assert turn.variable("S4.rate").values == pytest.approx(slope * rate, abs=1e-6)
    (pole,) = np.flatnonzero(np.abs(q - np.pi) < 1e-9)
    slider = 0.28 * 27.0 / 386.4
    pull = turn.variable("slider.joint3.force").values
    for name in ("crank.joint1.force", "slider.joint3.force", "slider.joint4.moment", "theta1.drive"):
        values = turn.variable(name).values
        assert np.all(np.isfinite(values)), name
    acceleration = 144.0 * np.cos(np.pi) / 50.0 * rate**2
    assert turn.variable("S4.acceleration").values[pole] == pytest.approx(acceleration, rel=1e-8)
    assert np.linalg.norm(pull[pole]) >= slider * abs(acceleration) * (1 - 1e-8)
    assert any("pole, which is no singularity" in note for note in turn.notes)


def offset_slider(a4, angles):
    """The slider's way [in] and the crank's torque [lbf in], alpha4 = 180 deg: two balls in space and a thin rod.

    The crank's end turns about z, the slider moves along z at (-a4, 0). The torque times the speed is the rate of
    the kinetic energy; the spin of the rod about its own line is left out.
    """
    speed, per = 50.0 * 2.0 * np.pi / 60.0, 0.28 / 386.4
    rod, slider = per * np.pi * 50.0, per * 27.0
    across = rod * (3.0 + 50.0**2) / 12.0

    def kinetic(q):
        end = [12 * mp.cos(q), 12 * mp.sin(q), 0]
        rate = [-end[1] * speed, end[0] * speed, 0]
        height = mp.sqrt(2500 - (a4 + end[0]) ** 2 - end[1] ** 2)
        along = [-mp.mpf(a4) - end[0], -end[1], height]
        lift = (along[0] * rate[0] + along[1] * rate[1]) / height
        turn = [-rate[0], -rate[1], lift]
        middle = [r + x / 2 for r, x in zip(rate, turn, strict=True)]
        squares = [sum(x * x for x in v) for v in (middle, turn)]
        return (rod * squares[0] + across * squares[1] / 2500 + slider * lift**2) / 2

    way = [float(np.sqrt(2500.0 - (a4**2 + 144.0 + 24.0 * a4 * np.cos(q)))) for q in angles]
    with mp.workdps(40):
        torque = [float(mp.diff(kinetic, mp.mpf(q))) for q in angles]
    return np.array(way), np.array(torque)


@pytest.mark.parametrize("a4", [12.0000001, 12.001, 12.01, 12.1])
def test_4_a_pole_of_the_angles_of_a_ball_is_passed_at_any_distance(a4):
    angles = np.radians([160.0, 170.0, 175.0, 179.0, 179.99, 180.0, 180.01, 181.0, 185.0, 200.0])
    model = symgen.build("slider_crank", set={"alpha4": "180 deg", "a4": f"{a4!r} in"})
    turn = in_inches(model.inverse_dynamics(at=angles))
    way, torque = offset_slider(a4, angles)
    assert turn.closure < 1e-11
    assert turn.variable("S4").values == pytest.approx(way, abs=1e-10)
    assert turn.variable("theta1.drive").values == pytest.approx(torque, abs=2e-6)


def test_4_no_distance_from_a_pole_of_the_angles_of_a_ball_refuses_a_value():
    angles = np.radians([179.0, 180.0, 181.0])
    for a4 in [12.0, *(12.0 + np.logspace(-9.0, -1.0, 20)).tolist()]:
        model = symgen.build("slider_crank", set={"alpha4": "180 deg", "a4": f"{a4!r} in"})
        turn = in_inches(model.inverse_dynamics(at=angles))
        way, torque = offset_slider(a4, angles)
        assert turn.closure < 1e-11, a4
        assert turn.variable("S4").values == pytest.approx(way, abs=1e-10), a4
        assert turn.variable("theta1.drive").values == pytest.approx(torque, abs=2e-6), a4


@pytest.mark.parametrize(
    ("motion", "value"),
    [
        ("h*(t/T - sin(2*pi*t/T)/(2*pi))", lambda s: s - np.sin(2 * np.pi * s) / (2 * np.pi)),
        ("h*(3*(t/T)**2 - 2*(t/T)**3)", lambda s: 3 * s**2 - 2 * s**3),
    ],
)
def test_7_laws_of_motion_from_rest_to_rest_are_evaluated_over_the_input_and_over_time(motion, value):
    """The rise to its very end, then over time beyond it: the return, or the dwell between two rises."""
    model = crank_rocker(motion, range=["0 rad", "2 rad"])
    turn = model.inverse_dynamics(at=np.linspace(0.0, 2.0, 41))
    check_rocker(turn, np.linspace(0.0, 2.0, 41))
    assert 2.0 * value(turn.time / 2.0) == pytest.approx(np.linspace(0.0, 2.0, 41), abs=1e-14)
    assert np.all(np.diff(turn.time) > 0.0) and turn.time[-1] == pytest.approx(2.0, abs=1e-4)
    moved = model.inverse_dynamics(stop=3.0, over="time", samples=61)
    assert moved.time == pytest.approx(np.linspace(0.0, 3.0, 61))
    check_rocker(moved, 2.0 * value(moved.time / 2.0))
    assert moved.over[1] == "time [s]"


def test_7_the_return_stroke_of_an_input():
    model = crank_rocker("h*sin(pi*t/T)", range=["0 rad", "1 rad"])
    turn = model.inverse_dynamics(stop=4.0, over="time", samples=81)
    check_rocker(turn, 2.0 * np.sin(np.pi * turn.time / 2.0))
    rates = turn.variable("theta3.rate").values
    assert rates[5] == pytest.approx(-rates[35], rel=1e-9)  # the same pose, forth and back


def test_7_times_of_nonlinear_inputs_are_found_together(monkeypatch):
    model = crank_rocker("w*t + 0.1*sin(w*t)")
    model.inverse_dynamics(samples=3)
    calls, plain = [], LoopKernels.__call__
    monkeypatch.setattr(LoopKernels, "__call__", lambda *a: calls.append(a[1]) or plain(*a))
    turn = model.inverse_dynamics(samples=1001)
    assert turn.time + 0.1 * np.sin(turn.time) == pytest.approx(np.linspace(0.0, 2 * np.pi, 1001), abs=1e-14)
    assert len(calls) < 100


def test_7_values_need_no_closure_at_the_beginning_of_the_range():
    """A crank of 0.5 m: its end is out of the reach of the rocker until 70.4 deg."""
    lengths = (0.5, 0.4, 0.3, 0.35)
    model = crank_rocker("w*t", lengths)
    turn = model.inverse_dynamics(at=np.radians([80.0, 120.0]))
    check_rocker(turn, np.radians([80.0, 120.0]), lengths)
    with pytest.raises(SimulationError, match="cannot be followed beyond q = "):
        model.inverse_dynamics()


def test_9_guesses_are_set_without_a_start_table(tmp_path):
    """Parallelogram without a table of guesses: keys of it, or all of it, are set from outside."""
    scene = tmp_path / "bare.toml"
    lines = (CASES / "par4.toml").read_text().splitlines()
    scene.write_text("\n".join(x for x in lines if not x.startswith("start")))
    guesses = {"theta2": "170 deg", "theta3": "10 deg", "theta4": "170 deg"}  # coupler along -x at 10 deg
    one_by_one = [f"--set=loop.start.{name}={value}" for name, value in guesses.items()]
    table = ", ".join(f'{name} = "{value}"' for name, value in guesses.items())
    for options in (one_by_one, [f"--set=loop.start={{ {table} }}"]):
        done = CliRunner().invoke(app, ["run", str(scene), "--at", "45", "--json", *options])
        assert done.exit_code == 0, done.output
        values = json.loads(done.stdout)["outputs"]
        assert {n: values[n]["final"] for n in guesses} == pytest.approx(
            {"theta2": 0.75 * math.pi, "theta3": 0.25 * math.pi, "theta4": 0.75 * math.pi}
        )


@pytest.mark.parametrize(
    "written",
    [
        "[[loop]]\nrows = []\n[[loop]]\nrows = []",
        "[loop]\n[loop]",
        "[loops.a]\nrows = []",
        "[loop.a]\nrows = []",
    ],
)
def test_9_several_loops_are_expressed_by_points_links_and_bodies(written, tmp_path):
    scene = tmp_path / "two.toml"
    scene.write_text(f"symgen = 1\n{written}\n")
    with pytest.raises(SceneError, match=r"single loop.*\[points\] and \[links\], with bodies"):
        symgen.build(scene)


def test_4_runs_under_forces_pass_the_poles_of_ball_angles():
    """Speed of a crank that comes round by itself, from its energy, where the rod misses the poles by 1e-5 of it."""
    offset = 0.30001
    result = (
        symgen.build(CASES / "ball_poles.toml")
        .with_parameters(offset=offset)
        .simulate(rtol=1e-11, atol=1e-12)
    )
    angle = result["theta1"].values
    along = 0.3 * offset * np.sin(angle) / result["S4"].values  # of the slider at unit speed
    pin = 0.3 * np.array([-np.sin(angle), np.cos(angle), 0 * angle])  # and of the crank's end
    end = np.array([0 * angle, 0 * angle, along])
    mass = 2 * 0.3**2 / 3 + (pin * pin + pin * end + end * end).sum(0) + 5 * along**2
    assert angle[-1] > 1.5 * math.pi
    np.testing.assert_allclose(result["theta1.rate"].values, 5 * np.sqrt(mass[0] / mass), rtol=1e-9)
    assert not result.notes


# ----------------------------------------------------------------------------------------- rods and bodies, 10 to 19


@pytest.mark.parametrize("name", ["start_length_planar", "start_length_space", "start_length_space_tunable"])
def test_10_a_length_that_the_drawing_has_through_sines_is_kept(name):
    """The rod starts where it is drawn; a uniform rod about its end has the angular acceleration 3 r x g/(2 l^2)."""
    length, azimuth, elevation = 1.2, 0.7, 0.0 if name.endswith("planar") else -0.5
    level = length * math.cos(elevation)
    drawn = np.array([level * math.cos(azimuth), level * math.sin(azimuth), length * math.sin(elevation)])
    gravity = np.array([0.0, -9.81, 0.0] if name.endswith("planar") else [0.0, 0.0, -9.81])
    expected = np.cross(1.5 * np.cross(drawn, gravity) / length**2, drawn)
    model = symgen.build(CASES / f"{name}.toml", backend="numpy")
    axes = len(model.description.shown_axes)
    np.testing.assert_allclose(model.initial_state().positions["A"], drawn[:axes], atol=1e-15)
    np.testing.assert_allclose(model.accelerations()["A"], expected[:axes], atol=1e-13)


@pytest.mark.parametrize("start", [{}, {"angles": {"OA": "0.3 rad"}}])
def test_10_linkages_are_assembled_from_the_origin_too(start):
    links = {"OA": {"points": ["O", "A"], "mass": "1 kg"} | ({} if start else {"length": "0.9 m"})}
    points = {"O": {"at": ["1 m", "0 m"], "ground": True}, "A": {"at": ["0 m", "0 m"]}}
    scene = symgen.Scene(points=points, links=links, start=start).called("from_the_origin")
    place = symgen.build(scene, backend="numpy").initial_state().positions["A"]
    expected = [1 + math.cos(0.3), math.sin(0.3)] if start else [0.1, 0.0]
    assert place == pytest.approx(expected, abs=1e-15)


def test_10_a_start_is_checked_by_the_equations_as_derived(monkeypatch):
    """With constants folded to noise of one bit, the start is an error that names the link."""

    def to_noise(expression):
        if expression.is_Symbol or expression.is_Rational:
            return expression
        if not expression.free_symbols:
            return expression.evalf(40)
        return expression.func(*map(to_noise, expression.args))

    monkeypatch.setattr(straight_line, "fold", to_noise)
    with pytest.raises(SceneError, match=r"\[links\] rod: the start violates the length of link rod by 0\.1"):
        symgen.build(CASES / "start_length_planar.toml", backend="numpy", set={"parameters.l": "1.2000 m"})


def test_11_a_driven_parallelogram_passes_its_collinear_states():
    """All motion is prescribed: the coupler stays parallel to the ground through seven collinear states."""
    result = symgen.build(CASES / "driven_parallelogram.toml").simulate(max_steps=1000)
    angle = math.atan2(0.24, 0.18) + 10 * result.time
    exact = np.column_stack([3 + 0.3 * np.cos(angle), 0.3 * np.sin(angle)])
    assert result["R.position"].values == pytest.approx(exact, abs=1e-12)


def test_11_a_true_dead_centre_is_still_one():
    """The coupler is 0.1 mm too long for the crank to pass: it stops where coupler and rocker are in line."""
    stop = 2 * math.pi - math.acos((1 + 0.3**2 - (1.0001 - 0.3) ** 2) / (2 * 0.3))
    with pytest.raises(SimulationError, match="dead centre") as caught:
        symgen.build(CASES / "gap.toml").simulate(max_steps=2000)
    assert caught.value.time == pytest.approx((stop - math.pi / 2) / 6, abs=1e-8)


@pytest.mark.parametrize("points", [["H1", "H2", "K"], ["H2", "K", "H1"], ["K", "H2", "H1"]], ids="".join)
def test_13_two_hinges_share_the_axial_force_equally_in_every_order(points):
    """A door on a vertical axis at rest: a couple of horizontal forces, and half its weight in each hinge."""
    mass, arm, height, g = 12.0, 0.45, 1.2, 9.81
    scene = symgen.Scene(
        points={
            "H1": {"at": ["0 m", "0 m", "0 m"], "ground": True},
            "H2": {"at": ["0 m", "0 m", f"{height} m"], "ground": True},
            "K": {"at": ["0.9 m", "0 m", "0.5 m"]},
        },
        links={
            "door": {
                "points": points,
                "mass": f"{mass} kg",
                "centre": [f"{arm} m", "0 m", "0.7 m"],
                "inertia": ["1.5 kg*m^2", "2.1 kg*m^2", "1.1 kg*m^2"],
            }
        },
        gravity={"acceleration": ["0 m/s^2", "0 m/s^2", f"{-g} m/s^2"]},
        analysis={"t_end": "0.1 s", "outputs": ["H1.reaction", "H2.reaction", "door.H1.force"]},
    )
    result = symgen.build(scene, backend="numpy").simulate(samples=2)
    side = mass * g * arm / height
    assert result["H1.reaction"].values[-1] == pytest.approx([side, 0, mass * g / 2], abs=1e-10)
    assert result["H2.reaction"].values[-1] == pytest.approx([-side, 0, mass * g / 2], abs=1e-10)
    assert result["door.H1.force"].values[-1] == pytest.approx([side, 0, mass * g / 2], abs=1e-10)
    assert any("door is held at the ground points" in note for note in result.notes)


def test_13_the_axial_parts_are_equal_in_motion():
    result = symgen.build(CASES / "hinge_split.toml", backend="numpy").simulate(samples=5)
    line = np.array([0.1, 0.0, 1.2])
    lower, upper = result["H1.reaction"].values @ line, result["H2.reaction"].values @ line
    assert lower == pytest.approx(upper, abs=1e-9)


def test_14_angles_of_events_and_outputs_are_continuous_over_revolutions():
    """The crank turns by 0.5 + 6 t: one passage of each angle, none at the jumps of atan2."""
    result = symgen.build(CASES / "event_wrap.toml").simulate(rtol=1e-10)
    found = [(e.name, e.time, e.rising) for e in result.events]
    assert [name for name, _, _ in found] == ["quarter", "past_pi"] and all(rising for _, _, rising in found)
    assert [t for _, t, _ in found] == pytest.approx([(math.pi / 2 - 0.5) / 6, 2.5 / 6], abs=1e-10)
    assert result["r.angle"].values == pytest.approx(0.5 + 6 * result.time, abs=1e-9)


def test_14_an_event_after_two_revolutions():
    changed = {"events.0.value": "13 rad"}
    result = symgen.build(CASES / "event_wrap.toml", set=changed).simulate(rtol=1e-10, samples=4)
    assert [e.time for e in result.events if e.name == "zero"] == pytest.approx([12.5 / 6], abs=1e-10)
    assert result["r.angle"].values == pytest.approx(0.5 + 6 * result.time, abs=1e-9)


WHIRL, FIVE = 20.0, np.linspace(0.0, 20.0, 5)


def _whirling(**options):
    """A uniform rod of 0.5 m that whirls about its end under gravity, its angle recorded alone."""
    scene = symgen.Scene(
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["0.5 m", "0 m"]}},
        links={"arm": {"points": ["O", "A"], "mass": "1 kg"}},
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        start={"rates": {"arm": f"{WHIRL} rad/s"}},
        analysis={"t_end": "20 s", "outputs": ["arm.angle"]},
    )
    return symgen.build(scene, **options)


def _whirled():
    """Its angle at five times, by its own equation."""
    found = solve_ivp(
        lambda t, y: [y[1], -1.5 * 9.81 / 0.5 * math.cos(y[0])],
        (0.0, 20.0), [0.0, WHIRL], method="DOP853", rtol=1e-12, atol=1e-12, t_eval=FIVE,
    )  # fmt: skip
    return found.y[0]


@pytest.mark.parametrize(
    ("built", "run", "within"),
    [
        ({}, {"rtol": 1e-9}, 1e-4),
        ({"backend": "numpy"}, {"rtol": 1e-7}, 1e-3),
        ({}, {"method": "rattle4", "step": 1e-3}, 1e-3),
        ({}, {"method": "rk4", "step": 5e-3}, 0.02),
        ({"precision": "float32"}, {"rtol": 2e-5}, 1.0),
        ({"precision": "longdouble"}, {"rtol": 1e-9}, 1e-4),
    ],
)
def test_14_revolutions_between_samples_are_counted(built, run, within):
    """Five samples of 63 revolutions whose rate is not uniform."""
    found = _whirling(**built).simulate(samples=5, **run)["arm.angle"].values
    assert found == pytest.approx(_whirled(), abs=within)


def test_14_a_resumed_run_goes_on_with_the_revolutions_counted(tmp_path):
    model, kept = _whirling(), tmp_path / "kept"
    with pytest.raises(SimulationError, match="max_steps"):
        model.simulate(samples=5, max_steps=1000, checkpoint=kept, checkpoint_every=0)
    found = model.simulate(samples=5, resume=kept)["arm.angle"].values
    assert found == pytest.approx(_whirled(), abs=1e-3)


@pytest.mark.parametrize("analysis", ["kinematics", "simulate"])
def test_14_driven_links_count_revolutions_between_samples(analysis):
    """A drag-link: its follower stays within half a revolution of its crank, which turns 19 times."""
    crank, coupler, follower, ground = 0.5, math.hypot(0.2, 0.5), math.hypot(0.1, 0.5), 0.2
    scene = symgen.Scene(
        parameters={"w": "6 rad/s"},
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "C": {"at": ["0.2 m", "0 m"], "ground": True},
            "A": {"at": ["0.5 m", "0 m"]},
            "B": {"at": ["0.3 m", "0.5 m"]},
        },
        links={
            "crank": {"points": ["O", "A"], "mass": "1 kg"},
            "coupler": {"points": ["A", "B"], "mass": "1 kg"},
            "follower": {"points": ["C", "B"], "mass": "1 kg"},
        },
        drivers=[{"link": "crank", "angle": "w*t"}],
        analysis={"t_end": "20 s", "outputs": ["follower.angle"]},
    )
    model = symgen.build(scene)
    result = model.kinematics(0.0, 20.0, samples=4) if analysis == "kinematics" else model.simulate(samples=4)
    angle = 6.0 * result.time
    line = crank * np.exp(1j * angle) - ground
    opening = np.arccos((abs(line) ** 2 + follower**2 - coupler**2) / (2 * follower * abs(line)))
    both = [np.angle(line) + side * opening for side in (1, -1)]
    ahead = np.angle(np.exp(1j * (both - angle)))
    found = result["follower.angle"].values
    assert np.min(np.abs(found - angle - ahead), axis=0) == pytest.approx(np.zeros(4), abs=1e-6)
    assert found[0] == pytest.approx(math.atan2(0.5, 0.1), abs=1e-9)


def _arm(**tables):
    """A point of 2 kg on an arm of 0.5 m about the ground, without gravity: I = 0.5 kg m^2."""
    return symgen.Scene(
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["0.5 m", "0 m"]}},
        links={"arm": {"points": ["O", "A"], "mass": "0 kg"}},
        masses=[{"point": "A", "mass": "2 kg"}],
        **tables,
    )


@pytest.mark.parametrize("method", ["dop853", "radau5"])
def test_14_a_torsion_spring_winds_over_revolutions(method):
    """I theta'' = -k (theta - free): a spring that is wound by two revolutions and swings back past its start."""
    stiffness, free, most = 0.5, 0.7, 4 * math.pi
    scene = _arm(
        torsion_springs=[{"link": "arm", "stiffness": "0.5 N*m/rad", "angle": "0.7 rad"}],
        start={"rates": {"arm": f"{most!r} rad/s"}},
        analysis={"t_end": "6.5 s", "outputs": ["arm.angle", "energy", "O.reaction"]},
    )
    result = symgen.build(scene).simulate(method=method, rtol=1e-10, samples=41)
    cos, sin = np.cos(result.time), np.sin(result.time)
    angle = free - free * cos + most * sin
    assert result["arm.angle"].values == pytest.approx(angle, abs=1e-6)
    energy = stiffness * (most**2 + free**2) / 2
    assert result["energy"].values == pytest.approx(energy, rel=1e-7)
    assert result.drift.energy < 1e-7 * energy
    inward, tangent = 2.0 * 0.5 * (free * sin + most * cos) ** 2, -stiffness * (angle - free) / 0.5
    reaction = np.column_stack(
        [-inward * np.cos(angle) - tangent * np.sin(angle), -inward * np.sin(angle) + tangent * np.cos(angle)]
    )
    assert result["O.reaction"].values == pytest.approx(reaction, abs=1e-3)


@pytest.mark.parametrize("name", ["this", "arm"])
def test_14_a_load_written_with_an_angle_winds_over_revolutions(name):
    """I theta'' = k (9 - theta) from rest: theta = 9 (1 - cos t), up to nearly three revolutions."""
    torque = {"link": "arm", "torque": f"k*(9 - {name}.angle)"}
    scene = _arm(
        parameters={"k": "0.5 N*m"}, torques=[torque], analysis={"t_end": "7 s", "outputs": ["arm.angle"]}
    )
    result = symgen.build(scene).simulate(rtol=1e-10, samples=8)
    assert result["arm.angle"].values == pytest.approx(9 * (1 - np.cos(result.time)), abs=1e-6)


def _elastic_drag_link(torque):
    """A drag-link with an elastic coupler, its crank held at 30 rad/s from the direction of A on."""
    return symgen.Scene(
        parameters={"w": "30 rad/s", "k": "0.2 N*m"},
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "C": {"at": ["0.2 m", "0 m"], "ground": True},
            "A": {"at": ["-0.4 m", "0.3 m"]},
            "B": {"at": ["-0.1 m", "0.5 m"]},
        },
        links={
            "crank": {"points": ["O", "A"], "mass": "0.5 kg"},
            "coupler": {
                "points": ["A", "B"],
                "density": "7850 kg/m^3",
                "section": {"width": "20 mm", "thickness": "5 mm"},
                "elastic": {"E": "2.06e11 Pa", "elements": 1},
            },
            "follower": {"points": ["C", "B"], "mass": "0.8 kg"},
        },
        torques=[{"link": "follower", "torque": torque}],
        crank={"link": "crank", "speed": "w"},
    )


def test_14_angles_in_loads_of_elastic_links_count_revolutions():
    """The same torque written with the crank's angle, and with the time; and one that no revolution repeats."""
    run = {"method": "gauss", "revolutions": 2, "steps": 200, "samples": 41}
    start = math.atan2(0.3, -0.4)
    model = symgen.build(_elastic_drag_link("k*crank.angle"))
    by_angle = model.simulate(**run)
    by_time = symgen.build(_elastic_drag_link(f"k*({start!r} + w*t)")).simulate(**run)
    for name in ("coupler.stress", "crank.torque", "coupler.B.force"):
        expected = by_time[name].values
        assert by_angle[name].values == pytest.approx(expected, abs=1e-9 * np.max(np.abs(expected)))
    with pytest.raises(ModelError, match="no revolution repeats"):
        model.periodic()


def test_14_motor_torques_of_elastic_links_count_revolutions():
    """I theta'' = k (9 - theta) of a stiff crank with its flywheel, up to three revolutions."""
    scene = symgen.Scene(
        parameters={"w": "4 rad/s", "k": "2 N*m"},
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["0.3 m", "0 m"]}},
        links={
            "crank": {
                "points": ["O", "A"],
                "density": "7850 kg/m^3",
                "section": {"width": "20 mm", "thickness": "20 mm"},
                "elastic": {"E": "2.06e11 Pa", "elements": 1},
            }
        },
        crank={
            "link": "crank",
            "mode": "motor",
            "speed": "w",
            "torque": "k*(9 - this.angle)",
            "flywheel": "2 kg*m^2",
        },
    )
    model = symgen.build(scene)
    rate = math.sqrt(2 / (2 + 7850 * 4e-4 * 0.3 * 0.3**2 / 3))
    result = model.simulate(revolutions=2, samples=81, steps=400)
    x, y = result["A.position"].values.T
    t = result.time
    expected = 9 - 9 * np.cos(rate * t) + 4 / rate * np.sin(rate * t)
    assert np.unwrap(np.arctan2(y, x)) == pytest.approx(expected, abs=1e-4)
    rods = model.in_segments(3).simulate(4.0, samples=9, rtol=1e-9)
    assert rods["crank__1.angle"].values == pytest.approx(9 - 9 * np.cos(rate * rods.time), abs=1e-2)
    with pytest.raises(SimulationError, match="does not settle"):
        model.periodic()


def test_15_the_weight_of_a_link_between_ground_points_is_in_the_reactions():
    """A beam of 5 kg with 1 kg that hangs at a quarter of it."""
    result = symgen.build(CASES / "rail_weight.toml", backend="numpy").simulate(samples=2)
    assert result["O.reaction"].values[-1] == pytest.approx([0, 9.81 * (5 / 2 + 3 / 4)], abs=1e-10)
    assert result["P.reaction"].values[-1] == pytest.approx([0, 9.81 * (5 / 2 + 1 / 4)], abs=1e-10)
    assert any("beam lies between the ground points" in note for note in result.notes)


def test_15_a_body_on_two_ground_points():
    """Moments about either point give the parts across their line, whatever the line's slope."""
    g, arm = 9.81, 0.5
    scene = symgen.Scene(
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "P": {"at": ["2 m", "1 m"], "ground": True},
            "A": {"at": ["3 m", "1 m"]},
        },
        links={
            "body": {
                "points": ["O", "P"],
                "mass": "1 kg",
                "centre": ["0.5 m", "0.9 m"],
                "inertia": "0.1 kg*m^2",
            },
            "rod": {"points": ["P", "A"], "mass": "1e-9 kg"},
        },
        gravity={"acceleration": ["0 m/s^2", f"{-g} m/s^2"]},
        analysis={"t_end": "0.1 s", "outputs": ["O.reaction", "P.reaction"]},
    )
    result = symgen.build(scene, backend="numpy").simulate(samples=2)
    o, p = result["O.reaction"].values[0], result["P.reaction"].values[0]
    across = np.array([-1.0, 2.0]) / math.sqrt(5)
    assert p @ across == pytest.approx(g * arm / math.sqrt(5), abs=1e-7)
    assert o @ across == pytest.approx(g * (2.0 - arm) / math.sqrt(5), abs=1e-7)
    assert o + p == pytest.approx([0, g], abs=1e-7)


def test_19_loose_links_and_missing_loads_are_noted():
    scene = symgen.Scene(
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "A": {"at": ["1 m", "0 m"]},
            "B": {"at": ["1 m", "0 m"]},
            "C": {"at": ["2 m", "0 m"]},
        },
        links={
            "held": {"points": ["O", "A"], "mass": "1 kg"},
            "loose": {"points": ["B", "C"], "mass": "1 kg"},
        },
        analysis={"t_end": "0.1 s", "outputs": ["C.position"]},
    )
    notes = symgen.build(scene, backend="numpy").simulate(samples=2).notes
    assert [n for n in notes if "link loose is joined to nothing else" in n]
    assert [n for n in notes if "no gravity and no load" in n]
    motor = symgen.build("elastic_four_bar_motor", backend="numpy")
    assert not motor.description.remarks, "its crank has a torque"
    driven = symgen.build(CASES / "event_wrap.toml", backend="numpy").simulate(0.1, samples=2)
    assert not [n for n in driven.notes if "no load" in n], "its motion is prescribed"


def test_angular_velocities_in_hertz_are_noted():
    def notes(speed, angle):
        of = symgen.load_scene("crank_rocker", set={"parameters.speed": speed, "drivers.0.angle": angle})
        return [n for n in resolve(of).remarks if "Hz" in n]

    assert not notes("60 rpm", "speed*t") and not notes("1 Hz", "2*pi*speed*t")
    (note,) = notes("1 Hz", "speed*t")
    assert note.startswith("drivers.0.angle") and "rev/s" in note


def test_19_loose_links_and_missing_loads_of_elastic_scenes_are_noted():
    elastic = {
        "density": "7850 kg/m^3",
        "section": {"width": "20 mm", "thickness": "5 mm"},
        "elastic": {"E": "2.06e11 Pa", "elements": 1},
    }
    points = {"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["0.3 m", "0 m"]}}
    apart = {"B": {"at": ["1 m", "0 m"]}, "C": {"at": ["2 m", "0 m"]}}
    crank = {"link": "crank", "speed": "30 rad/s"}
    bar, loose = {"points": ["O", "A"], **elastic}, {"points": ["B", "C"], "mass": "1 kg"}
    scene = symgen.Scene(points={**points, **apart}, links={"crank": bar, "loose": loose}, crank=crank)
    exact = symgen.build(scene).large_rotation(3, revolutions=0.02, samples=3)
    assert [n for n in exact.notes if "link loose is joined to nothing else" in n]
    held = symgen.Scene(points=points, links={"crank": bar}, crank={**crank, "speed": "0 rad/s"})
    result = symgen.build(held, backend="numpy").quasi_static(samples=2)
    assert [n for n in result.notes if "no gravity and no load" in n]


def test_19_the_mass_of_a_link_between_moving_ground_points_is_refused():
    """What it would load are the reactions."""
    moving = {"at": ["1 m", "1 m"], "ground": True, "motion": ["v*t", "1 m"]}
    scene = symgen.Scene(
        parameters={"v": "1 m/s"},
        points={"O": {"at": ["0 m", "1 m"], "ground": True}, "P": moving, "A": {"at": ["1 m", "0 m"]}},
        links={
            "rail": {"points": ["O", "P"], "mass": "1 kg"},
            "rod": {"points": ["P", "A"], "mass": "1 kg"},
        },
    )
    with pytest.raises(SceneError, match="reactions do not include its inertia"):
        symgen.build(scene)


def planar_rail(t_end):
    """Angle of a rail about O, place of the slider on it and angle of the arm, of the scene guide_direction."""
    arm = math.hypot(0.15, 0.25)

    def rates(t, y):
        (rail, s, angle), (w, v, turning) = y[:3], y[3:]
        along, across = np.array([np.cos(rail), np.sin(rail)]), np.array([-np.sin(rail), np.cos(rail)])
        out, beside = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        slider = np.stack([s * across, along, 0 * along], axis=1)
        centre = slider + np.stack([0 * along, 0 * along, arm / 2 * beside], axis=1)
        of_slider = 2 * v * w * across - s * w**2 * along
        of_centre = of_slider - arm / 2 * turning**2 * out
        mass = 0.4 * slider.T @ slider + 0.5 * centre.T @ centre + np.diag([1 / 3, 0, 0.5 * arm**2 / 12])
        force = np.array([0, -60 * (s - 0.4), 0]) - 0.4 * slider.T @ of_slider - 0.5 * centre.T @ of_centre
        return np.concatenate([y[3:], np.linalg.solve(mass, force)])

    start = [0, 0.5, np.pi / 2, math.hypot(1.5, 2.5), 0, 0]
    return solve_ivp(rates, (0, t_end), start, method="DOP853", rtol=1e-13, atol=1e-14).y[:3, -1]


@pytest.mark.parametrize(
    "options, tolerance",
    [
        ({"rtol": 1e-6}, 1e-6),
        ({"rtol": 1e-9}, 1e-9),
        ({"rtol": 1e-12}, 1e-11),
        ({"method": "rk4", "step": 0.005}, 2e-7),
        ({"method": "rattle4", "step": 0.005}, 2e-8),
        ({"method": "radau5", "rtol": 1e-6}, 1e-6),
    ],
)
def test_12_guides_in_space_have_no_singular_direction(options, tolerance):
    """The motion stays in a plane, where it has three coordinates; the rail passes near (0.36, 0.48, 0.8)."""
    model = symgen.build(CASES / "guide_direction.toml")
    last = model.simulate(2.0, **options).dataset.isel(time=-1)
    rail, s, _ = planar_rail(2.0)
    x, y = np.array([1.0, 0, 0]), np.array([0, 1.5, 2.5]) / math.hypot(1.5, 2.5)
    tip = np.cos(rail) * x + np.sin(rail) * y
    np.testing.assert_allclose(last["A.position"], tip, atol=tolerance)
    np.testing.assert_allclose(last["C.position"], s * tip, atol=tolerance)


def test_12_rails_in_every_direction_give_the_accelerations_of_one_rail():
    """The accelerations of a rail and a slider turn with them, also where two axes are equally far from the rail."""
    model = symgen.build(symgen.Scene(**turned_rail()))
    axis = np.array([0.48, 0.6, 0.64])
    found = []
    ties = np.array([[0, 1, 1], [1, 1, 1], [1, 0, 1], [1, 0, -1], [0, 0, 1], [0, 1, 0]])
    oblique = np.array([[9, 12, 20], [20, -9, 12], [-12, 20, 9], [12, 20, -9]])
    for direction in (*ties, *oblique, *np.random.default_rng(3).standard_normal((20, 3))):
        z = direction / np.linalg.norm(direction)
        x = np.linalg.qr(np.stack([z, axis], axis=1))[0][:, 1]
        turn = np.stack([x, np.cross(z, x), z], axis=1)
        positions = {"A": turn @ [0, 0, 1], "C": turn @ [0, 0, 0.4]}
        velocities = {"A": turn @ [0.3, -0.2, 0], "C": turn @ [0.12, -0.08, 0.7]}
        known = model.accelerations(model.state(positions, velocities))
        found.append([turn.T @ known["A"], turn.T @ known["C"]])
    # w = (0.2, 0.3, 0): the slider at s has s'' = s w^2 and feels 2 s' w x along across; I w' = -2 m s s' w.
    speed, slide = np.array([0.3, -0.2, 0]), -2 * 0.4 * 0.4 * 0.7 / (1 / 3 + 0.4 * 0.16)
    tip = slide * speed - 0.13 * np.array([0, 0, 1])
    slider = 0.4 * slide * speed + 2 * 0.7 * speed
    for a, c in found:
        np.testing.assert_allclose(a, tip, atol=1e-13)
        np.testing.assert_allclose(c, slider, atol=1e-13)


def turned_rail():
    """A uniform rail of 1 m and 1 kg about O with a slider of 0.4 kg, without gravity."""
    return {
        "points": {
            "O": {"at": ["0 m", "0 m", "0 m"], "ground": True},
            "A": {"at": ["0 m", "0 m", "1 m"]},
            "C": {"at": ["0 m", "0 m", "0.4 m"]},
        },
        "links": {"rail": {"points": ["O", "A"], "mass": "1 kg"}},
        "masses": [{"point": "C", "mass": "0.4 kg"}],
        "guides": [{"points": ["C"], "along": "rail"}],
        "analysis": {"motion": "space"},
    }


def test_16_ends_of_a_link_at_one_place_are_named():
    """Drawn so in the scene, or by a parameter."""
    with pytest.raises(SceneError, match=r"\[links.r\] points: O and A are drawn at the same place"):
        symgen.build(CASES / "coincident_points.toml", backend="numpy")
    data = tomllib.loads((CASES / "coincident_points.toml").read_text())
    data["parameters"] = {"x": {"value": "0.5 m", "tunable": True}}
    data["points"]["A"]["at"] = ["x", "0 m"]
    model = symgen.build(symgen.Scene(**data), backend="numpy")
    assert model.initial_state().positions["A"] == pytest.approx([1, 0])
    with pytest.raises(InitialStateError, match="O and A are drawn at the same place: the link r"):
        model.with_parameters(x=0.0).initial_state()


@pytest.mark.parametrize("length", [None, "2.5 m"])
def test_16_the_base_of_a_floating_part_stays_where_it_is_drawn(length):
    """The part turns about the first point of its first link; what hangs on that link follows."""
    data = tomllib.loads((CASES / "floating_start.toml").read_text())
    data["points"] = {
        "A": {"at": ["0.3 m", "-0.2 m"]},
        "B": {"at": ["1.3 m", "-0.2 m"]},
        "C": {"at": ["1.3 m", "0.5 m"]},
    }
    data["links"]["tail"] = {"points": ["B", "C"], "mass": "1 kg"}
    data["start"]["angles"]["tail"] = "0 deg"
    if length:
        data["links"]["rod"]["length"] = length
    places = symgen.build(symgen.Scene(**data), backend="numpy").initial_state().positions
    reach = float(length.split()[0]) if length else 1.0
    for point, place in {"A": (0.3, -0.2), "B": (0.3, reach - 0.2), "C": (1.0, reach - 0.2)}.items():
        np.testing.assert_allclose(places[point], place, atol=1e-14)
    alone = symgen.build(CASES / "floating_start.toml", backend="numpy").initial_state().positions["A"]
    np.testing.assert_allclose(alone, [0, 0], atol=1e-15)


# --------------------------------------------------------------------------- files, processes and calls, 20 to 23, 32, 33


def fake_compiler(folder, monkeypatch, body, limit=0.5):
    """A compiler that prints a version, does what the body says, and else calls the real one; limit [s]."""
    script = folder / "slowcc"
    script.write_text(
        f'#!/bin/sh\n[ "$1" = --version ] && {{ echo "slow 1.0"; exit; }}\n{body}\nexec cc "$@"\n'
    )
    script.chmod(0o755)
    monkeypatch.setenv("CC", str(script))
    monkeypatch.setenv("SYMGEN_CACHE", str(folder / "cache"))
    monkeypatch.setattr(compiler, "_LIMIT", limit)


def runs(pid):
    """Whether a process runs; one that ended and that nobody waited for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are looked up in /proc")
def test_17_a_slow_compiler_is_killed_with_its_children_and_tried_again_without_optimisation(
    tmp_path, monkeypatch
):
    """The driver waits for the compiler proper, as gcc does; both ignore termination."""
    child = tmp_path / "child"
    slow = f"trap '' TERM\ncase \"$*\" in *' -c '*-O0*) ;; *' -c '*) sleep 30 & echo $! > {child}; wait; exit;; esac"
    fake_compiler(tmp_path, monkeypatch, slow, 1.5)  # in which even a busy machine compiles at -O0
    began = time.monotonic()
    with pytest.warns(SlowBackendWarning, match=r"exceeded the limit of 1\.5 s with four_bar_kernel\.c.*-O0"):
        model = symgen.build("four_bar", backend="c")
    assert time.monotonic() - began < 20.0
    assert not runs(child.read_text().strip())
    monkeypatch.delenv("CC")
    assert model.accelerations().as_dict() == symgen.build("four_bar").accelerations().as_dict()


@pytest.mark.parametrize("when", ["*' -c '*", "*-shared*"])
def test_17_the_limit_is_named_where_optimisation_is_not_what_takes_long(tmp_path, monkeypatch, when):
    fake_compiler(tmp_path, monkeypatch, f'case "$*" in {when}) sleep 30 & wait; exit;; esac')
    monkeypatch.setenv("SYMGEN_CFLAGS", "-std=c11 -O0")
    began = time.monotonic()
    with pytest.raises(BuildError, match=r"exceeded the limit of 0\.5 s and was killed: \S*slowcc"):
        symgen.build("four_bar", backend="c")
    assert time.monotonic() - began < 20.0
    assert list((tmp_path / "cache").iterdir()) == []


def test_33_a_compiler_that_does_not_print_its_version_is_ended(tmp_path, monkeypatch):
    fake_compiler(tmp_path, monkeypatch, "")
    (tmp_path / "slowcc").write_text("#!/bin/sh\ntrap '' TERM\nsleep 30 & wait\n")
    monkeypatch.setattr(compiler, "_VERSION_LIMIT", 0.5)
    began = time.monotonic()
    with pytest.raises(BuildError, match=r"exceeded the limit of 0\.5 s .*slowcc --version"):
        symgen.build("four_bar", backend="c")
    assert time.monotonic() - began < 20.0


@pytest.mark.parametrize(
    ("variable", "value", "words"),
    [
        ("CC", 'cc "', r"CC cannot be split into words: No closing quotation"),
        ("SYMGEN_CFLAGS", "-O1 '", r"SYMGEN_CFLAGS cannot be split into words: No closing quotation"),
        ("SYMGEN_CFLAGS", "-E", "wrote no library: .* -E -shared"),
        ("SYMGEN_CFLAGS", "-S", "wrote no library: .* -S -shared"),
        ("SYMGEN_CFLAGS", "-std=c11 --version", "wrote no library"),
        ("CC", "true", "wrote no library"),
    ],
)
def test_33_what_makes_no_library_is_named(tmp_path, monkeypatch, variable, value, words):
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv(variable, value)
    with pytest.raises(BuildError, match=words):
        symgen.build("four_bar", backend="c")


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


#: Builds a scene, and prints which files of the runtime ran code while its entry was made.
WATCHED = """
import sys
from pathlib import Path
from symgen.pipeline import build as pipeline
ran, compile_scene = set(), pipeline.compile_scene
def watched(*arguments):
    sys.setprofile(lambda frame, event, argument: ran.add(frame.f_code.co_filename))
    try:
        return compile_scene(*arguments)
    finally:
        sys.setprofile(None)
pipeline.compile_scene = watched
pipeline.build(sys.argv[1], backend="numpy")
parts = sorted(file.partition("/symgen/runtime/")[2] for file in ran if "/symgen/runtime/" in file)
print(*(part for part in parts if part.endswith(".py")))
"""


@pytest.mark.parametrize(
    ("scene", "decides"),
    [
        ("parallelogram", {"rods/redundancy.py", "integrate/causes.py"}),
        ("rssr", {"closure/closed_form.py", "loop/frames.py"}),
    ],
)
def test_23_an_entry_depends_on_every_module_that_ran_for_it(empty_cache, monkeypatch, scene, decides):
    done = subprocess.run([sys.executable, "-c", WATCHED, scene], capture_output=True, text=True, check=True)
    ran = {*done.stdout.split()}
    assert decides <= ran
    (entry,) = empty_cache.iterdir()
    name, needs = entry.name.rpartition("-")[0], json.loads((entry / "needs.json").read_text())
    ours = {need.removeprefix("symgen:runtime/") for need in needs if need.startswith("symgen:runtime/")}
    assert {part for part in ran - ours if not part.endswith("__init__.py")} == set()
    assert graph.current(Cache(), name)
    for changed in decides:
        with monkeypatch.context() as patched:
            content = graph.content
            patched.setattr(graph, "content", lambda n, f=changed, c=content: "" if n.endswith(f) else c(n))
            assert graph.current(Cache(), name) is None, f"{changed} decides nothing"


def test_23_an_entry_depends_on_the_version(empty_cache, monkeypatch):
    symgen.build("four_bar", backend="numpy")
    graph._of_package.cache_clear()
    monkeypatch.setattr("symgen.version.__version__", "99.0")
    symgen.build("four_bar", backend="numpy")
    graph._of_package.cache_clear()
    assert len([*empty_cache.iterdir()]) == 2


def test_23_what_is_made_from_a_description_depends_on_it(empty_cache):
    """Kernels of an analysis hold start and redundancy of the scene that they were first made for."""
    model = symgen.build("parallelogram", backend="numpy")
    (base,) = empty_cache.iterdir()
    model.equilibrium()
    description = json.loads((base / "description.json").read_text())
    description["title"] = "changed"
    write_entry(base, "description.json", json.dumps(description))
    model = symgen.build("parallelogram", backend="numpy")
    assert model.description.title == "changed"
    assert model.analysis("statics").description.title == "changed"


def write_entry(entry, file, text):
    """Change a file of an entry together with its checksum, as an older version of symgen might have left it."""
    import hashlib

    (entry / file).write_text(text)
    sums = json.loads((entry / "checksums.json").read_text())
    sums[file] = hashlib.sha256(text.encode()).hexdigest()
    (entry / "checksums.json").write_text(json.dumps(sums))


@pytest.mark.parametrize(
    "change",
    [
        lambda d: [],
        lambda d: None,
        lambda d: {**d, "axes": 5},
        lambda d: {**d, "start": ["1"] * len(d["start"])},
        lambda d: {**d, "start": d["start"][:3]},
        lambda d: {**d, "kernels": "none"},
        lambda d: {**d, "kernels": [{**d["kernels"][0], "blocks": [None]}]},
        lambda d: {**d, "links": [1, 2]},
        lambda d: {**d, "labels": None},
        lambda d: {**d, "elastic": 3},
        lambda d: {**d, "parameters": [1]},
        lambda d: {**d, "novel": 1},
        lambda d: {key: value for key, value in d.items() if key != "constraints"},
    ],
)
def test_33_a_description_of_the_wrong_shape_is_made_again(empty_cache, change):
    expected = symgen.build("four_bar", backend="numpy").accelerations().as_dict()
    (entry,) = empty_cache.iterdir()
    text = (entry / "description.json").read_text()
    write_entry(entry, "description.json", json.dumps(change(json.loads(text))))
    assert symgen.build("four_bar", backend="numpy").accelerations().as_dict() == expected
    (again,) = empty_cache.iterdir()
    assert (again / "description.json").read_text() == text


@pytest.fixture
def another_user(monkeypatch):
    """Gives files to another user; where only root could, this process takes itself for another user instead."""
    if not hasattr(os, "geteuid"):
        pytest.skip("there are no POSIX users here")

    def give(path):
        if os.geteuid() == 0:
            os.chown(path, 65534, 65534)
        else:
            monkeypatch.setattr(os, "geteuid", lambda: 4321)

    return give


@pytest.mark.parametrize("file", [".", "kernels.so", "description.json"])
def test_32_an_entry_of_another_user_is_not_loaded(empty_cache, another_user, file):
    symgen.build("four_bar", backend="c")
    (entry,) = empty_cache.iterdir()
    assert Cache().find(entry.name)
    if os.geteuid():  # the folder is own, the entry is not
        pytest.skip("only root can give a file away")
    another_user(entry / file)
    assert Cache().find(entry.name) is None
    symgen.build("four_bar", backend="c")
    assert Cache().find(entry.name), "it is replaced by an own one"
    assert (entry / file).stat().st_uid == os.geteuid()


def test_32_a_link_to_an_entry_elsewhere_is_not_loaded(empty_cache, tmp_path):
    symgen.build("four_bar", backend="c")
    (entry,) = empty_cache.iterdir()
    shutil.move(entry, tmp_path / "elsewhere")
    entry.symlink_to(tmp_path / "elsewhere")
    assert Cache().find(entry.name) is None


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="there are no POSIX users here")
@pytest.mark.parametrize("mode", [0o777, 0o1777, 0o775])
def test_32_a_cache_that_others_can_write_is_refused(empty_cache, monkeypatch, mode):
    """Whether it is new or holds the scene already; a group with others in it is others."""
    symgen.build("four_bar", backend="c")
    assert empty_cache.stat().st_mode & 0o777 == 0o700
    monkeypatch.setattr("symgen.toolchain.ownership._is_private", lambda group, user: False)
    empty_cache.chmod(mode)
    for scene in ("four_bar", "triple_pendulum"):
        with pytest.raises(CacheError, match=r"only you can write, got .*\n.*chmod go-w .*SYMGEN_CACHE"):
            symgen.build(scene, backend="c")
    assert len([*empty_cache.iterdir()]) == 1
    empty_cache.chmod(0o755)
    symgen.build("four_bar", backend="c")


def test_32_a_cache_of_another_user_is_refused(empty_cache, another_user):
    symgen.build("four_bar", backend="c")
    another_user(empty_cache)
    with pytest.raises(CacheError, match=r"it belongs to user \d+, with mode 0700"):
        symgen.build("four_bar", backend="c")


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="there are no POSIX users here")
def test_32_a_cache_that_others_can_replace_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path / "open" / "cache"))
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    with pytest.raises(CacheError, match="everybody can replace it, as .*open has mode 0777"):
        symgen.build("four_bar", backend="c")
    (tmp_path / "open").chmod(0o1777)
    symgen.build("four_bar", backend="c")


def test_20_a_table_named_self_is_an_unknown_key(tmp_path):
    """Names of tables and parameters are data: none of them may meet an argument of a function of Python."""
    scene = tmp_path / "self.toml"
    text = (CASES / "friction.toml").read_text()
    scene.write_text(f"{text}\n[self]\nmass = 1\n")
    with pytest.raises(SceneError, match=r"self"):
        symgen.load_scene(scene)
    scene.write_text(text.replace('"3 N"', '{ value = "3 N", tunable = true }').replace("F", "self"))
    model = symgen.build(scene, backend="numpy").with_parameters(self=0.5)
    assert model.parameters["self"] == 0.5


def test_20_runs_estimate_their_time_and_end_at_max_wall(tmp_path):
    """Uniform rotation, a free loop and an elastic link: the wall time holds, and what was recorded is right."""
    spin = tmp_path / "spin.toml"
    spin.write_text(
        'symgen = 1\n[points]\nO = { at = ["0 m", "0 m"], ground = true }\nA = { at = ["1 m", "0 m"] }\n'
        '[links]\nOA = { points = ["O", "A"], mass = "1 kg" }\n'
        '[start]\nvelocities = { A = ["0 m/s", "2 m/s"] }\n[analysis]\noutputs = ["A.position"]\n'
    )
    for backend, end in (("auto", 1e6), ("numpy", 1e4)):
        model = symgen.build(spin, backend=backend)
        error = ended(lambda model=model, end=end: model.simulate(end, samples=int(end) + 1, max_wall=0.1))
        places = error.partial.variable("A.position").values
        t = np.arange(len(places))
        assert error.partial.time == pytest.approx(t)
        assert 1.0 < error.time < end
        few = slice(0, 20)  # the angle is 2 t
        assert places[few] == pytest.approx(np.stack([np.cos(2 * t), np.sin(2 * t)], axis=1)[few], abs=1e-6)
    model = symgen.build(CASES / "free_par.toml", backend="numpy")
    ended(lambda: model.simulate(1e3, max_wall=0.1))
    model = symgen.build("thesis_four_bar", backend="numpy")
    model.simulate(steps=4, samples=2)  # its equations are derived by the first run
    for options in ({"rtol": 1e-9}, {"method": "dop853", "rtol": 1e-12}):
        ended(lambda options=options: model.simulate(revolutions=1000, max_wall=0.1, **options), set_up=5.0)


def test_20_max_wall_counts_assembling_and_ends_sweeps_and_chains(empty_cache):
    model = symgen.build("thesis_four_bar", backend="numpy")
    speeds = (np.linspace(900, 1000, 400) * np.pi / 30).tolist()
    calls = {
        "rods": lambda limit: model.large_rotation(3, revolutions=50.0, max_wall=limit),
        "speed_response": lambda limit: model.speed_response(speeds, samples=8, rtol=0.5, max_wall=limit),
        "chain": lambda limit: symgen.Chain([1.0, 1.0], [1.0, 1.0]).simulate(
            1e4, 1e-3, [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], max_wall=limit
        ),
    }
    partial = {}
    for name, call in calls.items():
        for limit in (1e-3, 0.1):
            begun = time.perf_counter()
            with pytest.raises(SimulationError, match=rf"ended after max_wall = {limit:g} s") as caught:
                call(limit)
            assert time.perf_counter() - begun < limit + 3.0, name
            partial[name] = caught.value.partial
        with pytest.raises(ModelError, match="expected max_wall to be a finite number above zero"):
            call(-1.0)

    from symgen.runtime.integrate import pace

    def expire(_):
        pace._LIMIT.get().begun -= 600.0

    with pytest.raises(SimulationError, match=r"after max_wall = 600 s(.*\n)*  1 of 400 speeds") as caught:
        model.speed_response(speeds, samples=8, rtol=0.5, max_wall=600.0, progress=expire)
    assert caught.value.partial.speeds == pytest.approx([900.0 * math.pi / 30])
    chain = partial["chain"]
    assert 0.01 < chain.times[-1] < 1e4
    assert np.ptp(chain.energy) < 1e-6


def ended(run, set_up=2.0):
    """Return the error of a run that is limited to 0.1 s of wall time, and was estimated to take longer."""
    begun = time.perf_counter()
    with pytest.raises(
        SimulationError, match=r"ended after max_wall = 0\.1 s of wall time, at t = "
    ) as caught:
        run()
    assert time.perf_counter() - begun < 0.1 + set_up
    return caught.value


def test_20_a_long_run_announces_its_remaining_time_once(monkeypatch):
    from symgen.errors import SlowRunWarning

    monkeypatch.setattr("symgen.runtime.integrate.pace._SPAN", 0.2)
    model = symgen.build("four_bar", backend="numpy")
    begun = time.perf_counter()
    with pytest.warns(SlowRunWarning) as notes, pytest.raises(SimulationError):
        model.simulate(1e5, max_wall=0.6)
    assert time.perf_counter() - begun < 2.5
    (note,) = notes
    assert re.search(
        r"of 100000 s after 0\.\d+ s: about [\d.]+ (hours|days|min) remain at this pace", str(note.message)
    )


def test_21_messages_on_jumps_are_in_the_words_of_the_scene(tmp_path, capsys):
    """A body at rest under friction is refused with the smooth function in full, which then runs."""
    friction = """
symgen = 1
[parameters]
c = "9 N*m"
[points]
O = { at = ["0 m", "0 m"], ground = true }
A = { at = ["0.3 m", "0 m"] }
[links]
rod = { points = ["O", "A"], mass = "1 kg" }
[[torques]]
link = "rod"
torque = "-c*sign(this.rate)"
[gravity]
acceleration = ["0 m/s^2", "-9.81 m/s^2"]
"""
    scene = tmp_path / "friction.toml"
    scene.write_text(friction)
    model = symgen.build(scene, backend="numpy")
    assert model.parameters == {}
    with pytest.raises(SimulationError) as caught:
        model.simulate(0.2)
    said = str(caught.value)
    assert "jump of sign(this.rate) in [[torques]] no. 1" in said
    smooth, width = re.search(
        r"Write (\S+) instead of sign\(this\.rate\), .*: (w = \S+ \S+)\. Run", said
    ).groups()
    scene.write_text(friction.replace("sign(this.rate)", smooth).replace("[points]", f"{width}\n[points]"))
    crept = symgen.build(scene, backend="numpy").simulate(0.2, method="radau5")
    # It creeps at the rate at which friction carries the weight: tanh(rate/w) = weight's moment / c.
    rate = -1e-3 * math.atanh(9.81 * 0.15 / 9.0)
    assert crept.final["A"]["velocity"][1] == pytest.approx(0.3 * rate, rel=1e-3)
    scene.write_text(friction.replace("9 N*m", "0.1 N*m"))
    run = symgen.build(scene, backend="numpy").simulate(1.5)
    assert run.provenance["parameters"] == {}
    assert main_says(["run", str(scene), "--t-end", "1.5", "--backend", "numpy"], capsys)[0].count(
        "sign(this.rate) in [[torques]] no. 1"
    )


@pytest.mark.parametrize(
    ("pulse", "area"),
    [
        ("F*exp(-((t - t1)/w)**2)", math.sqrt(math.pi)),
        ("F/cosh((t - t1)/w)", math.pi),
        ("F/(1 + ((t - t1)/w)**2)", 2 * math.atan(0.5 / 1e-4)),
    ],
)
def test_21_smooth_pulses_shorter_than_a_step_are_not_missed(tmp_path, pulse, area):
    """A mass of 2 kg on a rail takes the impulse of a force of 100 N and 0.1 ms."""
    scene = tmp_path / "pulse.toml"
    scene.write_text(f"""
symgen = 1
[parameters]
F = "100 N"
t1 = "0.5 s"
w = "1e-4 s"
[points]
O = {{ at = ["0 m", "0 m"], ground = true }}
G = {{ at = ["1 m", "0 m"], ground = true }}
A = {{ at = ["0.5 m", "0 m"] }}
[links]
rail = {{ points = ["O", "G"], mass = "0 kg" }}
[[guides]]
points = ["A"]
along = "rail"
[[masses]]
point = "A"
mass = "2 kg"
[[forces]]
point = "A"
force = ["{pulse}", "0 N"]
""")
    model = symgen.build(scene, backend="numpy")
    for options in ({}, {"method": "dopri5"}, {"method": "radau5"}):
        run = model.simulate(1.0, **options)
        assert run.final["A"]["velocity"][0] == pytest.approx(100.0 * 1e-4 * area / 2.0, rel=1e-8)
        assert run.statistics["steps"] < 2000
    periodic = scene.read_text().replace(pulse, "F*cos(t/w)").replace("1e-4 s", "1 s")
    scene.write_text(periodic)
    assert not any("switching" in note for note in symgen.build(scene, backend="numpy").simulate(1.0).notes)


def test_21_references_of_angles_are_no_parameters(tmp_path):
    scene = tmp_path / "spring.toml"
    scene.write_text("""
symgen = 1
[parameters]
k = { value = "2 N*m", tunable = true }
[points]
O = { at = ["0 m", "0 m"], ground = true }
A = { at = ["0.3 m", "0 m"] }
[links]
rod = { points = ["O", "A"], mass = "1 kg" }
[[torques]]
link = "rod"
torque = "-k*this.angle"
""")
    model = symgen.build(scene, backend="numpy")
    assert model.parameters == {"k": 2.0}
    assert model.simulate(0.1).provenance["parameters"] == {"k": 2.0}
    with pytest.raises(ModelError, match="no tunable parameter 'turned_0'"):
        model.with_parameters(turned_0=1.0)


def main_says(arguments, capsys):
    """Run the command line as a process does; return what it prints, and its errors."""
    before, sys.argv = sys.argv, ["symgen", *arguments]
    try:
        main()
    except SystemExit:
        pass
    finally:
        sys.argv = before
    return capsys.readouterr()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--t-end", "nan"], "expected a finite number for --t-end, got nan"),
        (["--t-end=-1"], "expected --t-end to be a finite number above zero, got -1.0"),
        (["--max-wall", "0"], "expected --max-wall to be a finite number above zero, got 0.0"),
        (
            ["--checkpoint", "x", "--checkpoint-every", "inf"],
            "expected a finite number for --checkpoint-every, got inf",
        ),
    ],
)
def test_22_the_command_line_names_its_options(empty_cache, capsys, arguments, said):
    out, error = main_says(["simulate", "four_bar", *arguments, "--backend", "numpy"], capsys)
    assert (out, error.strip()) == ("", f"symgen: {said}")


def test_22_a_length_that_a_parameter_makes_zero_is_named(tmp_path):
    scene = tmp_path / "zero.toml"
    scene.write_text("""
symgen = 1
[parameters]
l = { value = "0.3 m", tunable = true }
w = "10 rad/s"
[points]
O = { at = ["0 m", "0 m"], ground = true }
A = { at = ["0.3 m", "0 m"] }
B = { at = ["0.6 m", "0.1 m"] }
[links]
crank = { points = ["O", "A"], mass = "1 kg", length = "l" }
rod = { points = ["A", "B"], mass = "1 kg", length = "l" }
[[drivers]]
link = "crank"
angle = "w*t"
""")
    model = symgen.build(scene, backend="numpy").with_parameters(l=0.0)
    with pytest.raises(InitialStateError, match="length of link crank needs a length above zero, got 0 m"):
        model.initial_state()


def sliding(tmp_path, force, mass="2 kg"):
    """Build a mass on a guide along x, at rest at 0.5 m, under this force."""
    text = (CASES / "sliding_mass.toml").read_text().replace("-k*A.x - F*sign(A.vx)", force)
    (tmp_path / "slide.toml").write_text(text.replace("2 kg", mass))
    return symgen.build(tmp_path / "slide.toml", backend="numpy")


def test_21_friction_that_sticks_is_refused_early_with_the_smooth_alternative(tmp_path):
    """The mass is at rest at t = 1/3 s and x = 1/6 m; smooth friction of a width of 1e-6 m/s is run by radau5."""
    model = symgen.build(CASES / "friction.toml", backend="numpy")
    for options in ({}, {"method": "dopri5"}, {"step": 1e-3}):
        begun = time.perf_counter()
        with pytest.raises(
            SimulationError, match=r"stays at the jump of abs\(A\.vx.*\n.*tanh\(\(A\.vx.*\)/w\)"
        ) as error:
            model.simulate(1.0, **options)
        assert time.perf_counter() - begun < 5.0
        assert error.value.time == pytest.approx(1 / 3, abs=0.01)
        assert error.value.partial.final["A"]["position"][0] == pytest.approx(1 / 6, abs=1e-6)
    text = (CASES / "friction.toml").read_text().replace("A.vx/abs(A.vx+e)", "tanh(A.vx/e)")
    (tmp_path / "smooth.toml").write_text(text.replace("1e-9", "1e-6"))
    run = symgen.build(tmp_path / "smooth.toml").simulate(1.0, method="radau5")
    assert run.final["A"]["position"][0] == pytest.approx(1 / 6, abs=1e-6)


def test_21_dry_friction_is_exact_between_its_reversals(tmp_path):
    """50 N/m, 2 kg, 3 N: half swings of pi/5 s about 0.06 and -0.06 m in turn; reversals at -0.38, 0.26, -0.14 m."""
    model = sliding(tmp_path, "-k*A.x - F*A.vx/abs(A.vx)")
    expected = 0.06 + 0.2 * np.cos(5 * 1.5 - 2 * np.pi)  # of the third half swing
    for options, tolerance in (({"rtol": 1e-10}, 1e-8), ({"step": 2e-3}, 1e-8)):
        run = model.simulate(1.5, state=model.state({"A": [0.5, 0]}, {"A": [-1e-300, 0]}), **options)
        assert run.final["A"]["position"][0] == pytest.approx(expected, abs=tolerance)
        assert run.statistics["steps"] < 1000


def test_21_pulses_shorter_than_a_step_are_not_missed(tmp_path):
    """3 N for 1e-4 s on 2 kg: 1.5e-4 m/s, from breakpoints in t, and from a smooth pulse by a longest step."""
    rectangle = "F*((t - b)/abs(t - b) - (t - b - w)/abs(t - b - w))/2"
    triangle = "F*(abs(t - b + w) - 2*abs(t - b) + abs(t - b - w))/(2*w)"
    for force in (rectangle, triangle):
        for options in ({}, {"method": "radau5"}, {"step": 1e-2}):
            run = sliding(tmp_path, force).simulate(1.0, **options)
            assert run.final["A"]["velocity"][0] == pytest.approx(1.5e-4, rel=1e-9)
    run = sliding(tmp_path, "F*exp(-((t - b)/w)**2)").simulate(0.31, max_step=1e-3 / 4)
    assert run.final["A"]["velocity"][0] == pytest.approx(1.5e-4 * math.sqrt(math.pi), rel=1e-6)


@pytest.mark.parametrize("option", ["--out", "--plot"])
@pytest.mark.parametrize("command", ["run", "kinematics", "inverse-dynamics", "speed-response", "bench"])
def test_18_files_are_checked_before_anything_else(tmp_path, command, option):
    """Before the scene is even looked for."""
    endings = {"--out": ".json" if command == "bench" else ".nc", "--plot": ".png"}
    arguments = [command, "no_such_scene", *(["--speeds", "60"] if command == "speed-response" else [])]
    file = tmp_path / "nowhere" / f"result{endings[option]}"
    done = CliRunner().invoke(app, [*arguments, option, str(file)])
    assert "there is no folder" in str(done.exception)
    assert isinstance(done.exception, ResultError)


@pytest.mark.parametrize("count", [80, full(1200)])
def test_22_wrong_calls_give_a_named_error(count, tmp_path, monkeypatch):
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    calls = wrong_calls(tmp_path)
    assert len(calls) > 5000
    chosen = sample(calls, count, seed=22)
    outcomes = {str(call): judge(call) for call in chosen}
    assert len({call.callee.name for call in chosen}) > 40
    refused = sum(outcome != "accepted" for outcome in outcomes.values())
    assert refused > 0.85 * len(outcomes)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda m: m.simulate(0.1, method=3), r"Model\.simulate: expected text for method, got 3"),
        (
            lambda m: m.simulate("1 s"),
            r"Model\.simulate: expected a finite number for t_end, got '1 s'",
        ),
        (lambda m: m.simulate(0.1, tol=1e-6), r"Model\.simulate has no argument 'tol'.*'rtol'"),
        (lambda m: m.simulate(0.1, t_end=0.1), r"Model\.simulate got 't_end' twice"),
        (lambda m: m.simulate(0.1, 1e-6), r"Model\.simulate takes t_end by position, got 1e-06 besides"),
        (
            lambda m: m.modes("x"),
            r"Model\.modes: expected an object of type Equilibrium or a finite number for at, got 'x'",
        ),
        (lambda m: m.equilibrium(stable="no"), r"expected True or False for stable, got 'no'"),
        (lambda m: m.accelerations()["Z"], r"there is no point 'Z'"),
        (lambda m: m.with_parameters(rho="x"), r"expected a finite number for rho, got 'x'"),
        (lambda m: symgen.Chain([1.0], [1.0]).simulate(), r"Chain\.simulate needs a finite number for t_end"),
        (lambda m: symgen.Chain([1.0]), r"Chain needs numbers for masses, got no argument"),
        (lambda m: symgen.build(5), r"build: expected an object of type Scene or .*text.* for scene, got 5"),
        (
            lambda m: symgen.build("four_bar", set={1: "x"}),
            r"a mapping from names .* for set, got \{1: 'x'\}",
        ),
        (lambda m: symgen.Scene("four_bar"), r"Scene takes nothing by position, got 'four_bar' besides"),
    ],
)
def test_22_the_argument_is_named(empty_cache, call, words):
    model = symgen.build("four_bar", backend="numpy")
    with pytest.raises(ModelError, match=words):
        call(model)


def test_22_sweeps_and_methods_of_elastic_links(empty_cache):
    model = symgen.build("thesis_four_bar", backend="numpy")
    with pytest.raises(
        ModelError, match=r"Model\.speed_response: expected a list of numbers for speeds, got 'x'"
    ):
        model.speed_response("x")
    with pytest.raises(ModelError, match=r"Model\.simulate: expected text for method, got 3"):
        model.simulate(method=3)
    with pytest.raises(
        ModelError, match=r"Model\.modes: expected an object of type Equilibrium or a finite number for at"
    ):
        model.modes("x")


def test_22_numbers_of_other_types_are_numbers(empty_cache):
    """Those of NumPy, of results, and fractions; not those in text, and not True."""
    model = symgen.build("four_bar", backend="numpy")
    expected = model.simulate(0.5, samples=3)["A.position"].values
    for half in (np.float32(0.5), np.array(0.5), Fraction(1, 2)):
        assert np.array_equal(model.simulate(half, samples=np.int64(3))["A.position"].values, expected)
    for wrong in ("0.5", True, 0.5 + 0j, [0.5], np.array([0.5])):
        with pytest.raises(ModelError, match="for t_end, got"):
            model.simulate(wrong)


def test_18_plot_takes_a_list_in_place_of_names(result):
    with pytest.raises(ModelError, match=r"Result\.plot.*names.*got \[3\]"):
        result.plot([3])
    of_list, of_names = (
        [line.get_label() for line in f.axes[0].lines] for f in (result.plot(["A"]), result.plot("A"))
    )
    assert of_list == of_names


@pytest.fixture
def result(empty_cache):
    return symgen.build("four_bar", backend="numpy").simulate(0.01, samples=3)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["-c", "import symgen; print(symgen.__version__)"], symgen.__version__),
        (["-m", "symgen", "--version"], symgen.__version__),
    ],
)
def test_18_a_folder_named_symgen_is_not_taken_for_the_package(tmp_path, arguments, said):
    """As above a clone of that name: a folder without __init__.py is a namespace package."""
    (tmp_path / "symgen" / "symgen").mkdir(parents=True)
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    done = subprocess.run(
        [sys.executable, *arguments], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert (done.stdout.strip(), done.stderr) == (said, "")


# --------------------------------------------------------------------------------------------- elastic links, 24 to 31


def hanging_bar_axial_force(end, steps=2000):
    """Return the axial force [N] at the middle of the bar of ``elastic_hanging_bar``, rigid, by plain RK4.

    theta'' = -3/(2 L) (a . t), with a the acceleration of the pivot less gravity and t across the bar.
    """
    crank, speed, length, gravity = 0.1, 20 * np.pi / 30, 0.5, np.array([0.0, -9.81])
    mass = 7850 * 0.015 * 0.003 * length

    def felt(t):
        return -crank * speed**2 * np.array([np.cos(speed * t), np.sin(speed * t)]) - gravity

    def rates(t, y):
        return np.array([y[1], -1.5 / length * (felt(t) @ [-np.sin(y[0]), np.cos(y[0])])])

    # The bar begins with the velocities of least kinetic energy: the pivot moves up, the bar along itself.
    y, h, found = np.array([-np.pi / 2, 0.0]), end / steps, []
    for k in range(steps + 1):
        t = k * h
        along = np.array([np.cos(y[0]), np.sin(y[0])])
        found.append(-mass / 2 * (felt(t) @ along - y[1] ** 2 * 0.75 * length))
        k1 = rates(t, y)
        k2 = rates(t + h / 2, y + h / 2 * k1)
        k3 = rates(t + h / 2, y + h / 2 * k2)
        k4 = rates(t + h, y + h * k3)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return np.array(found)


def test_24_coordinates_that_the_crank_does_not_determine():
    """Joint forces of a hanging elastic bar came to four times its weight, with an error estimate of 1e-6."""
    model = symgen.build(CASES / "elastic_hanging_bar.toml")
    for analysis in (lambda: model.simulate(method="newmark"), model.periodic):
        with pytest.raises(
            ModelError, match="does not determine the rigid motion of B.*\n.*symgen large-rotation"
        ):
            analysis()
    with pytest.raises(ModelError, match="rigid motion of B"):
        symgen.build(CASES / "elastic_chain.toml").quasi_static()
    run = model.large_rotation(4, revolutions=0.5, samples=201, rtol=1e-6)
    force = run["bar.axial_strain"].values * 210e9 * 0.015 * 0.003
    expected = hanging_bar_axial_force(float(run.time[-1]))[::10]
    assert np.max(np.abs(force - expected)) < 0.02 * np.max(expected)
    assert np.max(np.abs(run["B.displacement"].values)) < 1e-3


def four_bar_rocker(theta, a, b, c, d):
    """Return B of a four-bar with crank a, coupler b, output c, where circles about A and (d, 0) meet above."""
    x, y = a * math.cos(theta), a * math.sin(theta)
    dx, dy = d - x, -y
    reach = math.hypot(dx, dy)
    along = (b**2 - c**2 + reach**2) / (2 * reach)
    up = math.sqrt(b**2 - along**2)
    return np.array([x + (along * dx - up * dy) / reach, y + (along * dy + up * dx) / reach])


class Turned:
    """A rigid four-bar turned by stall*(1 - rate/free), its output dragged: energies of closed forms, plain RK4."""

    def __init__(self, lengths, inertia, stall, free, drag=0.0, steps=1500):
        a, arm = lengths[0], lengths[2]
        self.steps = steps

        def reduced(theta, h=1e-5):
            va = a * np.array([-math.sin(theta), math.cos(theta)])
            vb = (four_bar_rocker(theta + h, *lengths) - four_bar_rocker(theta - h, *lengths)) / (2 * h)
            return inertia(va, vb), (vb @ vb) / arm**2

        angles = np.linspace(0.0, 2 * math.pi, 2 * steps + 1)
        j, turning = np.array([reduced(x) for x in angles]).T
        slope = np.array([(reduced(x + 1e-3)[0] - reduced(x - 1e-3)[0]) / 2e-3 for x in angles])
        # dw/dtheta at angle i
        self.rate = lambda i, w: (
            (stall * (1 - w / free) - drag * turning[i] * w - slope[i] * w**2 / 2) / (j[i] * w)
        )

    def revolution(self, w):
        """Return its time [s] from the speed w, and the speed after it."""
        h, rate, period = math.pi / self.steps * 2, self.rate, 0.0
        for i in range(0, 2 * self.steps, 2):
            k1 = rate(i, w)
            k2 = rate(i + 1, w + h / 2 * k1)
            k3 = rate(i + 1, w + h / 2 * k2)
            k4 = rate(i + 2, w + h * k3)
            after = w + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            middle = (w + after) / 2 + h / 8 * (k1 - rate(i + 2, after))
            period += h / 6 * (1 / w + 4 / middle + 1 / after)
            w = after
        return period, w

    def steady(self, w):
        """Return the speed [rad/s] that a revolution repeats."""
        for _ in range(60):
            before, w = w, self.revolution(w)[1]
            if abs(w - before) < 1e-13 * w:
                break
        return w


def test_26_steady_state_with_a_motor():
    """The motor sets the speed, not the scene: 45 rpm are given, and the crank settles at 58."""
    wiper = symgen.build(CASES / "wiper.toml", set={"links.rod.elastic.elements": 1})
    run = wiper.periodic(samples=31, rtol=1e-2)
    lengths = 0.04, math.hypot(0.27, 0.07), math.hypot(0.01, 0.07), 0.3
    rod, arm = 7850 * 0.012 * 0.003 * lengths[1], lengths[2]

    def inertia(va, vb):
        blade = (0.05 / arm**2 + 0.1) * (vb @ vb)
        return 0.2 * 0.04**2 / 3 + 0.05 + rod / 3 * (va @ va + va @ vb + vb @ vb) + blade

    rigid = Turned(lengths, inertia, 12.0, 2 * math.pi, 0.3)
    period = rigid.revolution(rigid.steady(45 * math.pi / 30))[0]
    assert np.ptp(run.time) == pytest.approx(period, rel=1e-6)
    assert run.stable is True
    assert np.max(np.abs(run["B.displacement"].values)) < 1e-4
    started = wiper.simulate(revolutions=1.0, samples=31, rtol=1e-2)
    assert np.max(np.abs(started["B.displacement"].values)) < 1e-4


def test_26_speed_recovers_after_a_revolution_as_that_of_the_rigid_machine():
    """The four-bar was "unstable". Of stiff links the largest multiplier is that of the speed of the rigid machine."""
    assert symgen.build("elastic_four_bar_motor").periodic(samples=31, rtol=1e-2).stable is True
    stiff = symgen.build("elastic_four_bar_motor", set={"E": "1.03e11 psi"})
    run = stiff.periodic(samples=11, rtol=1e-2, steps=2048)
    inch, slug, foot = 0.0254, 14.593902937206364, 0.3048
    lengths = tuple(inch * x for x in (7.0, 10.0, 12.0, 11.0))
    crank, coupler, output = (5.292 * slug / foot**3 * inch * 0.125 * inch * x for x in lengths[:3])
    bearing, speed = 0.0040803133 * slug, 95 * math.pi / 30

    def inertia(va, vb):
        bars = coupler / 3 * (va @ va + va @ vb + vb @ vb) + output / 3 * (vb @ vb)
        own = (crank / 3 + bearing) * (va @ va) + bearing * (vb @ vb)
        return 0.5 * slug * foot**2 + own + bars

    rigid = Turned(lengths, inertia, 10 * 4.4482216152605 * foot, speed)
    w = rigid.steady(speed)
    period, _ = rigid.revolution(w)
    faster, slower = (rigid.revolution(w * (1 + by))[1] for by in (1e-4, -1e-4))
    assert np.ptp(run.time) == pytest.approx(period, rel=1e-6)
    assert run.floquet[0].imag == 0.0 and run.stable is True
    assert run.floquet[0].real == pytest.approx((faster - slower) / (2e-4 * w), rel=1e-3)


def test_26_a_crank_that_turns_away_from_its_rigid_motion_is_noted():
    run = symgen.build("elastic_four_bar_free", set={"speed": "95 rpm"}).simulate(revolutions=0.5, samples=31)
    assert any("rad off its rigid motion" in note for note in run.notes)


def test_28_axial_forces_bend_links_at_rest():
    """A cantilever under P < Pcr is a beam-column; beyond Pcr it buckles, into Euler's elastica."""
    model = symgen.build(CASES / "post.toml")
    for load in (0.1, 0.5, 1.0, 2.0):
        k = math.sqrt(load)  # P/EI
        run = model.with_parameters(P=load).quasi_static(samples=2)
        tip, moment = 1e-6 / load * (math.tan(k) / k - 1), 1e-6 * math.tan(k) / k
        assert run["tip.displacement"].values[-1, 1] == pytest.approx(tip, rel=1e-6)
        assert run["beam.torque"].values[-1] == pytest.approx(-moment, rel=1e-6)
    factor = 3.0 / (math.pi / 2) ** 2
    with pytest.raises(SimulationError, match=rf"links buckle at 0 s: .* {factor:.4g} times"):
        model.with_parameters(P=3.0).quasi_static(samples=2)


def test_28_equilibrium_bends_elastic_links():
    """P/Pcr = (2 K/pi)^2, x/L = 2 E/K - 1, y/L = 2 k/K of the elastica clamped at one end."""
    from scipy.optimize import brentq
    from scipy.special import ellipe, ellipk

    m = brentq(lambda m: ellipk(m) - math.sqrt(3.0), 1e-6, 0.9)
    tip = 2 * ellipe(m) / ellipk(m) - 1, 2 * math.sqrt(m) / ellipk(m)
    options = ["equilibrium", str(CASES / "post.toml"), "--set", "P=3 N", "--json"]
    found = json.loads(CliRunner().invoke(app, options).stdout)
    assert found["positions"]["tip"] == pytest.approx(tip, abs=0.01)
    assert found["stability"] == "stable"


@pytest.mark.parametrize(
    "elastic, thickness, tolerance",
    [
        ("elements = 200", 5e-3, 1e-6),
        ('element = "timoshenko", shear = { poisson = 0.3 }, elements = 40', 5e-4, 1e-6),
    ],
)
def test_25_low_frequencies_of_fine_meshes_are_not_called_rigid(tmp_path, elastic, thickness, tolerance):
    """A clamped bar at rest has no rigid motion: cos x cosh x = -1, also where its highest frequency is 1e7 times."""
    shipped = (Path(symgen.__file__).parent / "scenes" / "rotating_cantilever.toml").read_text()
    scene = tmp_path / "cantilever.toml"
    scene.write_text(
        shipped.replace("elements = 4", elastic).replace('thickness = "5 mm"', f'thickness = "{thickness} m"')
    )
    found = symgen.build(str(scene)).modes()
    speed = np.sqrt(210e9 * thickness**2 / 12 / 7850)
    roots = np.array([1.875104068711961, 4.694091132974175, 7.854757438237613])
    # The Timoshenko bar is slower by shear and rotary inertia, of the order of (thickness/length)^2.
    expected = roots**2 * speed / (2 * np.pi)
    shear = 50 * thickness**2 if "timoshenko" in elastic else 0.0
    assert found.frequencies[:3] == pytest.approx(expected, rel=tolerance + shear)
    assert found.rigid == 0


def test_25_the_crank_left_to_itself_is_the_one_rigid_motion(tmp_path):
    """Of thin links that keep their length, on a rigid crank: large stiffnesses cancel in that motion."""
    shipped = (Path(symgen.__file__).parent / "scenes" / "elastic_four_bar_free.toml").read_text()
    text = shipped.replace('elastic = { E = "E" }', 'elastic = { E = "E", axial = false, elements = 20 }')
    crank, elastic = text.index("[links.crank]"), text.index("elastic = {")
    assert crank < elastic
    text = text[:elastic] + text[text.index("\n", elastic) :]
    scene = tmp_path / "free.toml"
    scene.write_text(text.replace('thickness = "0.125 in"', 'thickness = "0.0125 in"'))
    model = symgen.build(str(scene))
    for angle in (0.0, 1.0, 2.0):
        found = model.modes(angle)
        assert found.frequencies[0] == 0.0 and found.frequencies[1] > 1.0
        assert found.rigid == 1


BAR = """
symgen = 1
title = "a bar"
gravity.acceleration = ["0 m/s^2", "{gravity} m/s^2"]
{head}

[points]
O = {{ at = ["0 m", "0 m"], ground = true }}
tip = {{ at = ["1 m", "0 m"] }}
{points}

[links.bar]
points = ["O", "tip"]
density = "7850 kg/m^3"
section = {{ width = "20 mm", thickness = "20 mm" }}
elastic = {{ E = "{modulus}"{elastic} }}

[crank]
link = "bar"
speed = "{speed} rad/s"
angle = "{angle} deg"

[[stations]]
link = "bar"
at = {at}
name = "here"
{more}
"""
BAR_E, BAR_RHO, BAR_AREA, BAR_H = 210e9, 7850.0, 4e-4, 0.01
BAR_I = 0.02**4 / 12


def bar(tmp_path, **given):
    """A bar of 1 m clamped to a shaft."""
    usual = {"gravity": 0, "head": "", "points": "", "modulus": "210 GPa", "elastic": "", "speed": 0}
    scene = tmp_path / "bar.toml"
    scene.write_text(BAR.format(**{**usual, "angle": 0, "at": 0, "more": "", **given}))
    return symgen.build(str(scene))


def test_29_the_error_of_the_elements_is_reported_and_chooses_their_number(tmp_path):
    """A turning bar: the axial strain at its root is rho w^2 L^2 / 2E; one element of linear stretch has a third less."""
    exact = BAR_RHO * 100.0**2 / 2 / BAR_E
    one = bar(tmp_path, speed=100, elastic=", elements = 1").quasi_static(samples=3)
    off = 1 - one["here.axial_strain"][0] / exact
    assert off == pytest.approx(1 / 3, rel=1e-3)
    estimate = one.summary()["statistics"]["mesh_error"]
    assert 0.5 * off < estimate < 2 * off
    assert f"{estimate:.1e} by elements" in one.headline
    default = bar(tmp_path, speed=100).quasi_static(samples=3)
    assert abs(1 - default["here.axial_strain"][0] / exact) < 0.01
    assert default.summary()["statistics"]["mesh_error"] < 0.01


def test_29_loads_on_points_of_a_link_act_at_nodes(tmp_path):
    """A force F at 0.3 m from the clamp: the strain at the clamp is 0.3 F h / E I, and none is beyond the force."""
    model = bar(
        tmp_path,
        points='mid = { on = "bar", fraction = 0.3 }',
        more='[[stations]]\nlink = "bar"\nat = 0.6\nname = "beyond"\n\n'
        '[[forces]]\npoint = "mid"\nforce = ["0 N", "-50 N"]\n',
        head='[analysis]\nt_end = "1 s"',
    )
    found = model.quasi_static(samples=3)
    exact = 50 * 0.3 * BAR_H / (BAR_E * BAR_I)
    assert abs(found["here.bending_strain"][0]) == pytest.approx(exact, rel=1e-9)
    assert np.max(np.abs(found["beyond.bending_strain"])) < 1e-9 * exact


def test_29_peaks_are_refined_between_samples(tmp_path):
    """The weight of a slowly turning bar bends it by a sine of its angle, whose peak lies between two samples."""
    model = bar(tmp_path, gravity=-9.81, speed=0.1, angle=105, elastic=", elements = 2")
    found = model.quasi_static(samples=13)
    exact = BAR_RHO * BAR_AREA * 9.81 / 2 * BAR_H / (BAR_E * BAR_I)
    assert np.max(np.abs(found["here.bending_strain"])) < 0.967 * exact
    assert found.peaks["here.bending_strain"] == pytest.approx(exact, rel=3e-3)


def test_30_effective_damping_ratios_are_printed(tmp_path):
    """A clamped bar whose free modes have 2 %: phi^T C phi / 2w with modes in closed form, integrated here."""
    model = bar(tmp_path, elastic=", elements = 4, damping = { ratio = 0.02 }")
    x = np.linspace(0.0, 1.0, 20001)

    def integral(values):
        return np.sum((values[1:] + values[:-1]) / 2) * (x[1] - x[0])

    b, s = 1.875104068711961, 0.7340955137589128
    clamped = np.cosh(b * x) - np.cos(b * x) - s * (np.sinh(b * x) - np.sin(b * x))
    clamped /= np.sqrt(integral(clamped**2))
    # C = sum of M phi (2 zeta w) phi^T M over the elastic modes phi of the free bar.
    roots = [4.730040744862704, 7.853204624095838] + [(2 * n + 1) * np.pi / 2 for n in range(3, 7)]
    damping = 0.0
    for r in roots:
        k = (np.cosh(r) - np.cos(r)) / (np.sinh(r) - np.sin(r))
        grown = (1 - k) / 2 * np.exp(r * x) + (1 + k) / 2 * np.exp(-r * x)  # cosh - k sinh
        free = grown + np.cos(r * x) - k * np.sin(r * x)
        free /= np.sqrt(integral(free**2))
        damping += 0.04 * r**2 * integral(free * clamped) ** 2
    found = model.modes()
    expected = damping / (2 * b**2)
    assert found.ratios[0] == pytest.approx(expected, rel=0.01)
    assert found.ratios[0] < 0.02
    scene = str(tmp_path / "bar.toml")
    shown = CliRunner().invoke(app, ["modes", scene])
    assert "damping ratio" in shown.stdout and f"{found.ratios[0]:.3g}" in shown.stdout
    ran = CliRunner().invoke(app, ["quasi-static", scene, "--samples", "3"])
    assert re.search(rf"damping ratios +{found.ratios[0]:.2g}", ran.stdout)


def test_30_mean_power_of_the_shaft_is_compared_with_dissipation():
    """A slow crank in gravity with C = b K: mean power b w^2 (q^2 L^5 / 40 E I + q^2 L^3 / 6 E A), q = rho A g."""
    density, modulus, length, width, height, damping, speed = 7850.0, 2.06e11, 0.3, 0.02, 0.005, 1e-3, 3.0
    damped = {"E": f"{modulus} Pa", "elements": 2, "damping": {"stiffness": f"{damping} s"}, "axial": True}
    scene = symgen.Scene(
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": [f"{length} m", "0 m"]}},
        links={
            "crank": {
                "points": ["O", "A"],
                "density": f"{density} kg/m^3",
                "section": {"width": f"{width} m", "thickness": f"{height} m"},
                "elastic": damped,
            }
        },
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        crank={"link": "crank", "speed": f"{speed} rad/s"},
    )
    model = symgen.build(scene)
    area, load = width * height, density * width * height * 9.81
    energy = load**2 * length**5 / (40 * modulus * area * height**2 / 12) + load**2 * length**3 / (
        6 * modulus * area
    )
    result = model.periodic(steps=2048)
    expected = damping * speed**2 * energy
    assert result.statistics["mean_powers_w"] == pytest.approx([expected, expected], rel=2e-3)
    assert result.summary()["statistics"]["mean_powers_w"] == result.statistics["mean_powers_w"]
    # From too few samples, which the power of gravity fills, no mean is taken.
    assert model.periodic(steps=2048, samples=4).statistics["mean_powers_w"] == []
    assert 0.0 < result.statistics["second_order"]["crank"] < 1e-2


def test_31_error_estimates_cover_axial_vibrations_that_steps_do_not_resolve():
    """The cantilever from rest with two runs alone: the estimate is no less than the error against fine steps."""
    model = symgen.build("rotating_cantilever")
    coarse = model.simulate(steps=360, samples=61)
    fine = model.simulate(steps=11520, samples=61)
    error = np.max(np.abs(coarse["root.stress"] - fine["root.stress"])) / np.max(np.abs(fine["root.stress"]))
    assert error > 0.1
    assert coarse.statistics["error"] > 0.9 * error


def test_31_steps_outputs_and_cranks_are_reported(tmp_path):
    """Steps beyond those requested are named, the scene's outputs are selected, a guided crank is in [crank]."""
    model = symgen.build("elastic_slider_crank")
    assert any("7 steps per revolution were requested" in note for note in model.simulate(steps=7).notes)
    found = bar(
        tmp_path, speed=1, head='[analysis]\noutputs = ["here.stress", "tip.position"]'
    ).quasi_static()
    assert [v.name for v in found.variables] == ["here.stress", "tip.position"]
    with pytest.raises(SceneError, match="tip.velocity"):
        bar(tmp_path, speed=1, head='[analysis]\noutputs = ["tip.velocity"]').quasi_static()
    with pytest.raises(SceneError) as refused:
        bar(
            tmp_path,
            speed=1,
            points='R = { at = ["2 m", "0 m"], ground = true }',
            more='[[guides]]\npoints = ["tip"]\nalong = "rail"\n\n[links.rail]\npoints = ["O", "R"]\n',
        )
    assert "crank" in str(refused.value) and "drivers" not in str(refused.value)


def test_31_exact_runs_name_links_that_would_stretch(tmp_path):
    """A soft bar that turns: its root would be strained by rho w^2 L^2 / 2E = 0.3."""
    model = bar(tmp_path, speed=10, modulus=f"{BAR_RHO * 10.0**2 / 2 / 0.3} Pa")
    notes = model.large_rotation(3, revolutions=0.01, samples=3).notes
    assert any("bar: its axial force" in note and "do not stretch" in note for note in notes)
