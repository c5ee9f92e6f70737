"""Notes on starts that lengths and drives move off the drawing."""

from __future__ import annotations

import math

import pytest
from shared.in_numpy import build
from shared.linkages import at, ground

import symgen

POINTS = {"O": ground(0, 0), "G": ground(0, -1), "A": at(1, 0)}
CYLINDER = {"points": ["G", "A"], "length": "s", "mass": "0 kg"}


def notes_of(s, **tables):
    """Notes of a crank OA of 1 m, drawn along x, on a cylinder GA of the length s from a point below O."""
    scene = {
        "points": POINTS,
        "links": {"crank": {"points": ["O", "A"], "mass": "1 kg"}, "cylinder": CYLINDER},
        "parameters": {"s": {"value": s, "tunable": True}},
        "analysis": {"t_end": "0.1 s"},
    }
    model = build(symgen.Scene(**scene | tables))
    return model, [n for n in model.simulate(0.01).notes if "as drawn" in n]


def moved(s):
    """The chord of the crank's rotation: |GA|^2 = 2 + 2 sin(angle)."""
    return 2 * math.sin(abs(math.asin((s**2 - 2) / 2)) / 2)


def test_a_cylinder_off_the_drawing_is_noted_with_the_point_and_its_distance():
    model, (note,) = notes_of("1.6 m", units={"length": "mm"})
    assert "lengths or drives at t = 0 move A the farthest, by" in note
    number, unit = note.split()[-2:]
    assert unit == "mm" and float(number) == pytest.approx(1000 * moved(1.6), rel=1e-5)
    other = model.with_parameters(s=1.7).simulate(0.01).notes
    assert any(f"{1000 * moved(1.7):.6g} mm" in n for n in other)
    assert not any("as drawn" in n for n in model.with_parameters(s=2**0.5).simulate(0.01).notes)


def test_a_start_nearly_as_drawn_has_no_note():
    assert moved(1.42) < 0.01 and notes_of("1.42 m")[1] == []


def test_a_drive_off_the_drawing_is_noted_and_a_start_angle_is_not():
    one = {"points": {n: POINTS[n] for n in "OA"}, "links": {"crank": {"points": ["O", "A"], "mass": "1 kg"}}}
    driven = {"drivers": [{"link": "crank", "angle": "1 + 0*t/s"}], "parameters": {"s": "1 s"}}
    _, (note,) = notes_of("1 m", **one, **driven)
    assert f"move A the farthest, by {2 * math.sin(0.5):.6g} m" in note
    assert notes_of("1 m", **one, start={"angles": {"crank": 1}})[1] == []
