"""Tables that ``symgen run`` prints: they fit a terminal, and hold the range of every output."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rich.console import Console
from shared.commands import call

from symgen.cli import carrying
from symgen.report.extremes import Components
from symgen.runtime.result.records import Variable

WIDE = 400


def printed(scene, width, monkeypatch):
    """Return the output of ``symgen run`` on a terminal of this width, without the wall time."""
    monkeypatch.setattr(carrying, "console", lambda: Console(width=width, highlight=False))
    lines = call("run", scene).splitlines()
    return "\n".join(line for line in lines if not line.startswith("wall time"))


@pytest.mark.parametrize("scene", ["slider_crank", "peaucellier", "elastic_four_bar"])
def test_tables_fit_80_columns(scene, monkeypatch):
    """At 80 columns the same numbers and words follow each other as on a terminal of any width."""
    narrow, wide = (printed(scene, width, monkeypatch) for width in (80, WIDE))
    assert max(map(len, narrow.splitlines())) <= 80
    words = [[w for w in text.split() if set(w) != {"─"}] for text in (narrow, wide)]
    assert words[0] == words[1] and len(words[0]) > 50
    assert "E.position" not in narrow and "\nO " not in narrow


def columns(text):
    return [line.split() for line in text.splitlines()]


def show(table, width=80):
    console = Console(width=width, highlight=False)
    with console.capture() as capture:
        console.print(table)
    return columns(capture.get())


def test_least_and_greatest_values_and_where_they_are():
    angle = np.radians(np.arange(0, 361, 5))
    values = np.column_stack([3 * np.cos(angle), 1e-16 * np.sin(7 * angle)])
    outputs = Components(
        [
            Variable("P.position", "m", "", ("x", "y"), values),
            Variable("s", "1", "", (), np.sin(angle) + 1 / 3),
            Variable("turn", "rad", "", (), 1e-14 * np.cos(angle)),
            Variable("pole", "N", "", (), 1 / np.where(angle == math.pi, np.nan, np.cos(angle / 2))),
        ],
        len(angle),
        missing="pole",
    )
    rows = show(outputs.extremes("a title", np.degrees(angle), "deg", end=True))
    assert rows[1] == [
        "output",
        "unit",
        "at",
        "the",
        "end",
        "least",
        "at",
        "[deg]",
        "greatest",
        "at",
        "[deg]",
    ]
    assert rows[3:6] == [
        ["P.position.x", "m", "3", "-3", "180", "3", "0"],
        ["P.position.y", "m", "0", "0", "0", "0", "0"],
        ["s", "1", "0.333333", "-0.666667", "270", "1.33333", "90"],
    ]
    assert rows[6] == ["turn", "rad", "0", "0", "0", "0", "0"]
    # 1/cos(87.5 deg) = 22.9256
    assert rows[7] == ["pole", "N", "-1", "-22.9256", "185", "22.9256", "175"]
    first, second = (
        outputs.values("values", ["a", "b", "c", "d"])[:1],
        outputs.values("values", list("abcd"))[1:],
    )
    assert len(first) == len(second) == 1
    assert show(first[0])[3] == [
        "P.position.x",
        "m",
        *(f"{3 * math.cos(math.radians(a)):.6g}" for a in (0, 5, 10)),
    ]
    assert show(second[0])[1] == ["output", "unit", "d"]


MOVING_GROUND = """
symgen = 1
[points]
O = { at = ["0 m", "0 m"], ground = true, motion = ["v*t", "0 m"] }
A = { at = ["0.6 m", "0.8 m"] }
Q = { at = ["2 m", "0 m"], ground = true }
B = { at = ["2 m", "-1 m"] }
[parameters]
v = "1 cm/s"
[links]
OA = { points = ["O", "A"], mass = "1 kg" }
QB = { points = ["Q", "B"], mass = "1 kg" }
[gravity]
acceleration = ["0 m/s^2", "-9.81 m/s^2"]
[analysis]
t_end = "0.5 s"
"""


def test_ground_that_moves_is_shown(tmp_path, monkeypatch):
    """A pendulum from a point that moves to one side, and one at rest below a point that rests."""
    file = tmp_path / "moving.toml"
    file.write_text(MOVING_GROUND)
    table = {row[0]: row[1:] for row in columns(printed(file, 80, monkeypatch)) if row}
    assert table["O"] == ["0.005", "0", "0.01", "0"]
    assert table["B"] == ["2", "-1", "0", "0"] and "Q" not in table
