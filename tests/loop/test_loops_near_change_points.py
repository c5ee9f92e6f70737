"""Driven loops close to change points keep their assembly branch, for any number of samples."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from shared.linkages import circles

import symgen

CASES = Path(__file__).parents[1] / "cases"
A, C, D = 0.3, 0.6, 0.8
BEGIN, END = -0.9, 0.93


def joint(b, q):
    """The joint of coupler and rocker from two circles; the ground point of the rocker is at -D."""
    return circles(A * np.stack([np.cos(q), np.sin(q)], axis=-1), [-D, 0.0], b, C)


def directions(b, q):
    """Directions of coupler and rocker from two circles [rad], q = 0 where all links are nearly in one line."""
    crank, tip = A * np.stack([np.cos(q), np.sin(q)], axis=-1), joint(b, q)
    (x, y), (v, w) = (tip - crank).T, (np.array([-D, 0.0]) - tip).T
    return np.arctan2(y, x), np.arctan2(w, v)


def four_bar(b):
    """The crank q turns through q = 0, where A + D + gap = b + C; the length of the coupler is tunable."""
    coupler, rocker = (float(x[0]) for x in directions(b, np.array([BEGIN])))
    lengths = {"crank": f"{A} m", "coupler": "b", "rocker": f"{C} m", "ground": f"{D} m"}
    return symgen.Scene(
        parameters={"w": "1 rad/s", "b": {"value": f"{b!r} m", "tunable": True}},
        loop={
            "inputs": {"q": f"{BEGIN!r} + w*t"},
            "range": [f"{BEGIN!r} rad", f"{END!r} rad"],
            "rows": [
                {"joint": "R", "link": name, "theta": "q" if name == "crank" else "?", "a": length}
                for name, length in lengths.items()
            ],
            "start": {
                "theta2": f"{coupler - BEGIN!r} rad",
                "theta3": f"{rocker - coupler!r} rad",
                "theta4": f"{-rocker!r} rad",
            },
            "links": {
                name: {"mass": "1 kg", "centre": ["-0.1 m", 0, 0], "inertia": [0, "1 kg*cm^2", "1 kg*cm^2"]}
                for name in ("crank", "coupler", "rocker")
            },
        },
        gravity={"acceleration": [0, "-9.81 m/s^2", 0]},
    )


@pytest.mark.parametrize("gap", [1e-9, 1e-8, 1e-6, 1e-4, 1e-2])
def test_the_assembly_of_two_circles(gap):
    model = symgen.build(four_bar(0.5 + gap), backend="numpy")
    ends = []
    for samples in (3, 13, 61, 360):
        found = model.inverse_dynamics(samples=samples)
        coupler, _ = directions(0.5 + gap, found.coordinate.values)
        off = found["theta2"].values + found.coordinate.values - coupler
        # samples next to the line have the rounding errors of their pose over its distance
        assert np.remainder(off + np.pi, 2 * np.pi) - np.pi == pytest.approx(0.0, abs=1e-11)
        ends.append(found["q.drive"].values[-1])
    assert ends == pytest.approx([ends[0]] * len(ends), rel=1e-10)


def test_variants_in_one_call():
    """Loops in lanes leave them where a step would change the branch."""
    lengths = 0.5 + np.array([1e-9, 1e-7, 1e-5, 1e-3, 1e-8, 1e-6, 1e-4, 1e-2])
    model = symgen.build(four_bar(0.5 + 1e-3))
    several = model.inverse_dynamics_many({"b": lengths}, samples=13, threads=1)
    for b, angles in zip(lengths.tolist(), several["theta2"].values, strict=True):
        q = np.linspace(BEGIN, END, 13)
        off = angles + q - directions(b, q)[0]
        assert np.remainder(off + np.pi, 2 * np.pi) - np.pi == pytest.approx(0.0, abs=1e-10)


def test_a_parallelogram_with_a_longer_ground_link():
    """Its joint stays on one side of the line from crank to ground, also where all links come near a line."""
    crank, coupler, ground = 0.1, 0.3, 0.301
    model = symgen.build(CASES / "par4.toml", set={"loop.rows.3.a": "30.1 cm"})
    for samples in (3, 13, 61, 361):
        found = model.inverse_dynamics(*np.radians([10.0, 350.0]), samples=samples)
        q = found.coordinate.values
        tips, off = crank * np.stack([np.cos(q), np.sin(q)], axis=-1), []
        for side in (1.0, -1.0):
            x, y = circles(tips, [-ground, 0.0], coupler, crank, side).T
            off.append(np.abs(np.sin((found["theta4"].values + np.arctan2(-y, -ground - x)) / 2)))
        assert np.min([np.max(o) for o in off]) < 1e-12
