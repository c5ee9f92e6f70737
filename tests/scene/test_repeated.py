"""Names with a range of numbers: one entry per number."""

from __future__ import annotations

import pytest

import symgen
from symgen.errors import SceneError

ROW = """
symgen = 1
[parameters]
pitch = "1 m"
lean = "0.6 m"
[points]
"A{k=0 to 3}" = { at = ["{k} m", "0 m"], ground = true }
"B{k=0 to 3}" = { at = ["{k}*pitch + lean", "0.8 m"] }
[links]
"crank{k=0 to 3}" = { points = ["A{k}", "B{k}"], mass = "1 kg" }
"coupler{i=1 to 3}" = { points = ["B{i-1}", "B{i}"], mass = "1 kg" }
[start.velocities]
"B{k=0 to 3}" = ["-0.8 m/s", "0.6 m/s"]
"""


def test_a_range_of_numbers_is_one_entry_per_number(tmp_path):
    file = tmp_path / "row.toml"
    file.write_text(ROW)
    short = symgen.load_scene(file)
    points = {f"A{k}": {"at": [f"{k} m", "0 m"], "ground": True} for k in range(4)}
    points |= {f"B{k}": {"at": [f"{k}*pitch + lean", "0.8 m"]} for k in range(4)}
    links = {f"crank{k}": {"points": [f"A{k}", f"B{k}"], "mass": "1 kg"} for k in range(4)}
    links |= {f"coupler{k}": {"points": [f"B{k - 1}", f"B{k}"], "mass": "1 kg"} for k in range(1, 4)}
    velocities = {f"B{k}": ["-0.8 m/s", "0.6 m/s"] for k in range(4)}
    values = {"pitch": "1 m", "lean": "0.6 m"}
    long = symgen.Scene(parameters=values, points=points, links=links, start={"velocities": velocities})
    assert short.model_dump() == long.model_dump()
    assert list(short.links) == list(long.links)
    heavier = symgen.load_scene(file, {"links.crank{k=0 to 3}.mass": "{k+1} kg"})
    assert [heavier.links[f"crank{k}"].mass for k in range(4)] == ["1 kg", "2 kg", "3 kg", "4 kg"]
    assert symgen.build(file).description.coordinates == 8


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("B{k=0 to 3}\" = { at", "B{k=3 to 0}\" = { at", r"range of 1 to 10000 numbers, got '\{k=3 to 0\}'"),
        ("B{k=0 to 3}\" = { at", "B{k=0 to 10000}\" = { at", "range of 1 to 10000 numbers"),
        ("B{k=0 to 3}\" = { at", "A{k=3 to 5}\" = { at", "'A3' occurs twice"),
        ("B{k=0 to 3}\" = { at", "B{k=0 to 3}_{k}\" = { at", r"one range of numbers in a name .*_\{k\}"),
        ("B{k=0 to 3}\" = { at", "B{k=0 to 3}{i=0 to 1}\" = { at", "one range of numbers in a name"),
        ("B{k=0 to 3}\" = { at", "B{k=0 to " + 5000 * "9" + "}\" = { at", r"B\{k=0 to 9+"),
        ("{k}*pitch", "{k+" + 5000 * "9" + "}*pitch", "B0"),
        ("\"B{i}\"", "\"B{k}\"", r"coupler1"),
        ("B{i-1}", "B{i-2}", r"B-1"),
    ],
)  # fmt: skip
def test_faults_are_named(tmp_path, old, new, message):
    file = tmp_path / "row.toml"
    assert old in ROW
    file.write_text(ROW.replace(old, new))
    with pytest.raises(SceneError, match=message):
        symgen.build(file)
