"""Closure of loops: the pose nearest to the guess, loops that close by a tolerance, redundant constraints."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from shared.full import full

import symgen
from symgen.errors import SceneError
from symgen.runtime.closure.start import close_near

CASES = Path(__file__).parents[2] / "cases"


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


@pytest.mark.parametrize("lead", [full(400.0), full(4.0), 0.5])
def test_whole_revolutions_of_a_screw_carry_their_translation(lead):
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


def test_idle_freedoms_are_named():
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


def test_the_closure_nearest_to_the_guess_is_followed():
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


def test_an_assembly_tolerance_closes_overconstrained_loops():
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


def test_errors_name_the_input_and_the_closest_pose():
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


def test_undetermined_force_components_are_found_at_every_pose():
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
