"""Ranges and units of values on the command line."""

from __future__ import annotations

import json
import math
from pathlib import Path
from types import SimpleNamespace

import pytest

import symgen
from symgen.errors import ModelError
from symgen.inspection.values import crank_speeds, of_crank, of_drive, of_input, of_pose, of_times

RPM = math.pi / 30
SLIDER = SimpleNamespace(
    description=SimpleNamespace(
        variables=[SimpleNamespace(name="S1", is_length=True)],
        having=lambda _: [0],
        units={"length": ("in", 0.0254)},
    )
)


@pytest.mark.parametrize(
    ("texts", "degrees"),
    [
        (["0:90:4"], [0, 30, 60, 90]),
        (["90:0:3", "7"], [90, 45, 0, 7]),
        (["-10:10 deg:2,0.5 rev"], [-10, 10, 180]),
        (["1/3 rev"], [120]),
    ],
)
def test_ranges_of_angles(texts, degrees):
    assert of_crank(None, texts, "--at")[0] == pytest.approx([math.radians(x) for x in degrees])


def test_ranges_of_other_values():
    assert of_drive(None, ["0.1 s:0.3 s:3"], "--at") == (pytest.approx([0.1, 0.2, 0.3]), "time")
    assert of_input(SLIDER, ["1:3:3,10 mm"], "--at") == (
        pytest.approx([0.0254, 0.0508, 0.0762, 0.01]),
        "input",
    )
    assert crank_speeds("60,2 rad/s:4 rad/s:2,1/2 rev/s") == pytest.approx([60 * RPM, 2, 4, math.pi])


def test_values_of_a_driven_length_need_a_unit():
    """A bare number is no angle there: 180 was 3.14 m."""
    lift = symgen.build(Path(__file__).parents[1] / "cases" / "lift_table.toml")
    assert of_drive(lift, ["1.1 m,1120 mm"], "--at") == (pytest.approx([1.1, 1.12]), "input")
    assert of_drive(lift, ["0.5"], "--from") == ([0.5], "time")
    for text in ("180", "30 deg"):
        with pytest.raises(ModelError, match='expected lengths after --at, such as "20 mm", or times'):
            of_drive(lift, [text], "--at")
    assert of_drive(symgen.build("crank_rocker"), ["180"], "--at") == ([math.pi], "input")


@pytest.mark.parametrize(
    "text",
    ["0:90:1", "0:90:-2", "0:90", "0:90:4:5", "0:90:4.0", "0:90:" + "9" * 5000, "0:inf:3", "0:1 m:3", ":9:3"],
)
def test_faulty_ranges(text):
    with pytest.raises(ModelError, match='expected angles after --at, such as "45"'):
        of_crank(None, [text], "--at")


@pytest.mark.parametrize("text", ["2 Hz", "0", "60:0:2", "3 m/s", "fast"])
def test_faulty_speeds(text):
    with pytest.raises(ModelError, match="expected crank speeds after --speeds, such as"):
        crank_speeds(text)


def test_times_of_poses_in_space_need_a_unit():
    """Bare numbers are degrees after ``--at`` of other modes: 60 would be 60 s."""
    assert of_pose(None, ["0 s,20 ms"], "--at") == (pytest.approx([0.0, 0.02]), "time")
    with pytest.raises(ModelError, match="expected times after --at, such as \"0.3 s\".*got '60'"):
        of_pose(None, ["60"], "--at")


def test_ranges_of_times():
    assert of_times(["0:0.3 s:4,1 s"], "--at") == pytest.approx([0.0, 0.1, 0.2, 0.3, 1.0])


@pytest.mark.parametrize("line", ["sensitivity crank_rocker --outputs crank.torque", "equilibrium four_bar"])
def test_times_need_a_unit(entry, line):
    """45 is in degrees after ``--at`` of kinematics."""
    code, _, said = entry(*line.split(), "--at", "45")
    assert code == 2 and said.endswith("got '45'\n  A time needs a unit: \"45 s\".\n")
    with pytest.raises(ModelError, match=r"time after --at.*got 'noon'$"):
        of_times(["noon"], "--at", "a time")


def test_times_and_angles_are_not_mixed():
    with pytest.raises(ModelError, match="times or values of the input, not both"):
        of_drive(None, ["0:0.3 s:3"], "--at")


@pytest.mark.parametrize("command", ["run", "animate"])
def test_the_end_that_a_command_gives_decides_whether_a_drive_jumps(command, tmp_path, entry):
    """A table by straight lines that ends with a rate at 1.6 s, where the scene ends at 2 s."""
    scene, out = tmp_path / "arm.toml", tmp_path / "arm.html"
    scene.write_text(
        """symgen = 1
tables.law = { x = ["0 s", "1.6 s"], y = [0, 2] }
points.O = { at = [0, 0], ground = true }
points.P = { at = ["1 m", 0] }
links.arm = { points = ["O", "P"], mass = "1 kg" }
drivers = [{ link = "arm", angle = "law(t)" }]
analysis.t_end = "2 s"
""",
        "utf-8",
    )
    options = ["--json"] if command == "run" else ["--samples", "3", "--out", str(out)]
    code, shown, said = entry(command, str(scene), *options, "--t-end", "1.2")
    assert (code, said) == (0, "")
    if command == "run":
        final = json.loads(shown)["outputs"]["P.position.x"]["final"]
        assert final == pytest.approx(math.cos(1.5), abs=1e-9)
    for end in ([], ["--t-end", "1.8"]):
        code, _, said = entry(command, str(scene), *options, *end)
        assert code == 3 and "at t = 1.6 s, the last point of the table law" in said
        assert "end the motion before, by analysis.t_end" in said
        assert 'build(..., set={"analysis.t_end": "2 s"})' in " ".join(said.split())
    model = symgen.build(scene, set={"analysis.t_end": "1.2 s"})
    assert model.simulate()["P.position"].values[-1, 0] == pytest.approx(math.cos(1.5), abs=1e-9)


def test_the_end_that_a_command_gives_hides_no_wrong_end_of_the_scene(entry):
    code, _, said = entry("run", "four_bar", "--set", "analysis.t_end=3 m", "--t-end", "1")
    assert code == 3 and "[analysis] t_end: expected a time" in said
