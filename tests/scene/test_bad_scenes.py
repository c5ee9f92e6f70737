"""Bad scenes: one clear error that names file, table and key, exit code 2, nothing left behind."""

from __future__ import annotations

from pathlib import Path

import pytest
from shared.commands import call

import symgen
from symgen.errors import SceneError

GOOD = """
symgen = 1
[points]
O = { at = ["0 m", "0 m"], ground = true }
A = { at = ["1 m", "0 m"] }
B = { at = ["2 m", "1 m"] }
C = { at = ["3 m", "0 m"], ground = true }
[links]
OA = { points = ["O", "A"], mass = "1 kg" }
AB = { points = ["A", "B"], mass = "1 kg" }
BC = { points = ["B", "C"], mass = "1 kg" }
[analysis]
t_end = "0.1 s"
"""

GOOD_LOOP = """
symgen = 1
[parameters]
w = { value = "60 rpm", tunable = true }
[loop]
inputs = { theta1 = "w*t" }
rows = [
  { joint = "R", link = "crank", theta = "theta1", a = "10 cm" },
  { joint = "S", link = "rod", theta = "?", eta = "?", a = "45 cm" },
  { joint = "S", link = "rocker", theta = "?", eta = "?", alpha = "?", a = "30 cm" },
  { joint = "R", link = "ground", theta = "?", S = "10 cm", alpha = "60 deg", a = "-35 cm" },
]
start = { theta2 = "10 deg", eta2 = "40 deg", theta3 = "-150 deg", eta3 = "-25 deg", alpha3 = "60 deg", theta4 = "105 deg" }
[loop.links]
crank = { mass = "1 kg" }
rod = { mass = "1 kg", centre = ["-20 cm", 0, 0], inertia = [0, "0.01 kg*m^2", "0.01 kg*m^2"] }
rocker = { mass = "1 kg" }
[analysis]
outputs = ["theta4", "theta1.drive", "rod.joint2.force"]
"""

#: The same for the loop.
LOOP_CASES = {
    "loop: unknown key": ('theta = "theta1", a', 'theta = "theta1", b', ["[loop.rows.0] b", "unknown key"]),
    "loop: points as well": ("[loop]", '[points]\nO = { at = ["0 m", "0 m"] }\n[loop]', ["[points]", "or a loop"]),
    "loop: wrong unit": ('a = "45 cm"', 'a = "45 kg"', ["[loop.rows.1] a", "a length", "a mass"]),
    "loop: too many variables": (
        '{ joint = "R", link = "ground", theta = "?", S = "10 cm"',
        '{ joint = "C", link = "ground", theta = "?", S = "?"',
        ["[loop] rows", "7 dependent variables for the 6 equations of closure", "S4"],
    ),
    "loop: spins idly": ('eta = "?", a = "45 cm"', 'eta = "?", alpha = "?", a = "45 cm"', ["[loop.rows.1] alpha", "rod", "spins idly"]),
    "loop: too few variables": (
        '{ joint = "S", link = "rocker", theta = "?", eta = "?", alpha = "?"',
        '{ joint = "U", link = "rocker", theta = "?", eta = "?", alpha = "60 deg"',
        ["[loop.rows.1] alpha", "universal joint, U"],
    ),
    "loop: cannot follow": (
        '{ joint = "S", link = "rod", theta = "?", eta = "?", a = "45 cm" }',
        '{ joint = "U", link = "rod", theta = "?", eta = "?", a = "45 cm" }',
        ["[loop", "rank"],
        ('theta = "?", eta = "?", alpha = "?", a = "30 cm"', 'theta = "?", eta = "?", a = "30 cm"'),
        ('{ joint = "S", link = "rocker"', '{ joint = "U", link = "rocker"'),
        (', alpha3 = "60 deg"', ""),
    ),
    "loop: cannot be assembled": ('a = "45 cm"', 'a = "4.5 m"', ["[loop", "theta1 = 0"]),
    "loop: a link without mass": ('rocker = { mass = "1 kg" }', "", ["[loop.links.rocker] mass", "row 3", "theta1.drive"]),
    "loop: output unknown": ('"theta4"', '"theta4.speed"', ["[analysis] outputs[0]", "theta4.speed"]),
    "loop: force at a joint elsewhere": ("rod.joint2.force", "rod.joint4.force", ["[analysis] outputs[2]", "rod.joint4.force"]),
    "loop: drives do not count": ("[loop.links]", '[loop.drives]\ntheta4 = "?"\n[loop.links]', ["[loop] drives", "got 2 (theta1, theta4)"]),
    "loop: call of open": ('"w*t"', "\"open('stolen.txt', 'w')\"", ["[loop.inputs] theta1", "calls 'open'"]),
}  # fmt: skip

#: What is changed in the good scene, and what the message must say.
CASES = {
    "unknown key": ('OA = { points = ["O", "A"], mass', 'OA = { points = ["O", "A"], mas', ["[links.OA] mas", "'mass'"]),
    "unknown table": ("[analysis]", "[analisys]", ["[analisys]", "'analysis'"]),
    "wrong unit": ('["A", "B"], mass = "1 kg"', '["A", "B"], mass = "3 s"', ["[links.AB] mass", "a mass", "a time"]),
    "no unit": ('["A", "B"], mass = "1 kg"', '["A", "B"], mass = 3', ["[links.AB] mass", '"1.5 kg"']),
    "unknown unit": ('["A", "B"], mass = "1 kg"', '["A", "B"], mass = "3 kgg"', ["[links.AB] mass", "not a unit"]),
    "zero length": ('A = { at = ["1 m", "0 m"] }', 'A = { at = ["0 m", "0 m"] }', ["[links.OA] points", "zero length"]),
    "one point twice": ('points = ["O", "A"]', 'points = ["O", "O"]', ["[links.OA] points", "zero length"]),
    "one point": ('points = ["O", "A"]', 'points = ["O"]', ["[links.OA] points", "at least 2 entries in the list, got ['O']"]),
    "not a truth value": ('A = { at = ["1 m", "0 m"] }', 'A = { at = ["1 m", "0 m"], ground = "yes" }', ["[points.A] ground", "true or false, got 'yes'"]),
    "not a text": ("symgen = 1", "symgen = 1\ntitle = 3", ["[title]", "a text in quotation marks, got 3"]),
    "point on no link": ("[links]", 'X = { at = ["5 m", "5 m"] }\n[links]', ["[points] X", "on no link"]),
    "unassemblable loop": (
        'AB = { points = ["A", "B"], mass',
        'AB = { points = ["A", "B"], length = "9 m", mass',
        ["[links] AB", "cannot be assembled", "AB by"],
    ),
    "drives that do not go together": (
        "[analysis]",
        "[[drivers]]\nlink = \"OA\"\nangle = \"0.5\"\n[[drivers]]\nlink = \"BC\"\nangle = \"-1.2\"\n[analysis]",
        ["[drivers] 1", "1 freedom and 2 drives", "the drive of link BC"],
    ),
    "negative inertia": (
        'AB = { points = ["A", "B"], mass',
        'AB = { points = ["A", "B"], inertia = "-1 kg*m^2", mass',
        ["[links.AB] inertia", "at least zero", "'-1 kg*m^2'"],
    ),
    "negative mass": ('["A", "B"], mass = "1 kg"', '["A", "B"], mass = "-1 kg"', ["[links.AB] mass", "'-1 kg'"]),
    "call of open": (
        'A = { at = ["1 m"',
        'A = { at = ["open(\'stolen.txt\', \'w\')"',
        ["[points.A] at[0]", "calls 'open'"],
    ),
    "dunder": ('A = { at = ["1 m"', 'A = { at = ["().__class__"', ["[points.A] at[0]", "Attribute"]),
    "nan text": ('A = { at = ["1 m"', 'A = { at = ["nan m"', ["[points.A] at[0]", "finite", "'nan m'"]),
    "nan number": ('["A", "B"], mass', '["A", "B"], centre = nan, mass', ["[links.AB] centre", "finite"]),
    "infinity": ('["A", "B"], mass', '["A", "B"], centre = inf, mass', ["[links.AB] centre", "finite"]),
    "misspelled point": ('points = ["B", "C"]', 'points = ["B", "c"]', ["[links.BC] points", "'c'", "'C'"]),
    "misspelled link of a joint": (
        "[analysis]",
        '[[joints]]\npoint = "O"\nlinks = ["OAA"]\nkind = "revolute"\naxis = [0, 0, 1]\n[analysis]',
        ["[joints.0] links", "no link called 'OAA'", "'OA'"],
    ),
    "joint in the plane": (
        "[analysis]",
        '[[joints]]\npoint = "O"\nlinks = ["OA"]\nkind = "revolute"\naxis = [0, 0, 1]\n[analysis]',
        ["[joints] 0", "both in space; got a revolute joint of OA at O", "remove it"],
    ),
    "no mass": ('points = ["A", "B"], mass = "1 kg"', 'points = ["A", "B"]', ["[links] AB", "no mass"]),
    "massless end": (
        'BC = { points = ["B", "C"], mass = "1 kg" }',
        'BC = { points = ["B", "C"], mass = "0 kg" }\nBX = { points = ["B", "X"], mass = "0 kg" }',
        ["[points] X", "carries no mass"],
        ("[links]", 'X = { at = ["4 m", "4 m"] }\n[links]'),
    ),
    "wrong version": ("symgen = 1", "symgen = 7", ["[symgen]", "it says 7"]),
    "no version": ("symgen = 1", "", ["[symgen]", "no such key"]),
    "not TOML": ("[points]", "[points", ["not valid TOML"]),
    "mixed plane and space": ('B = { at = ["2 m", "1 m"] }', 'B = { at = ["2 m", "1 m", "0 m"] }', ["[points]", "space"]),
    "contradicting start": (
        "[analysis]",
        '[start]\nrates = { OA = "1 rad/s", BC = "1 rad/s", AB = "9 rad/s" }\n[analysis]',
        ["[start.rates]", "contradict"],
    ),
    "output unknown": ("t_end", 'outputs = ["B.postion"]\nt_end', ["[analysis] outputs[0]", "'B.position'"]),
    "tension of no link": ("t_end", 'outputs = ["energy", "AX.tension"]\nt_end', ["[analysis] outputs[1]", "no output 'AX.tension'"]),
    "parameter called like a coordinate": (
        "[points]",
        '[parameters]\nA_x = { value = "1 m", tunable = true }\n[points]',
        ["[parameters] A_x", "the point A"],
    ),
    "value that is none at the start": (
        "[analysis]",
        '[parameters]\nf = "1 N"\ns = "1 s"\n[[forces]]\npoint = "A"\nforce = ["f*s/t", "0 N"]\n[analysis]',
        ["[forces.0] force[0]", "finite real value", "t = 0"],
    ),
    "no end of a power": (
        '["A", "B"], mass = "1 kg"',
        '["A", "B"], mass = "1 kg^9**9**9**9"',
        ["[links.AB] mass", "not a unit"],
    ),
    "reaction of a moving point": ("t_end", 'outputs = ["B.reaction"]\nt_end', ["[analysis] outputs[0]", "not a ground"]),
    "rigid and redundant": (
        "[analysis]",
        '[links.AC]\npoints = ["A", "C"]\nmass = "1 kg"\n[links.OB]\npoints = ["O", "B"]\nmass = "1 kg"\n[analysis]',
        ["constraints", "rank"],
    ),
    "bad name": ("B = { at", '"B 2" = { at', ["[points]", "letters, digits"]),
    "gravity in space": ("[analysis]", '[gravity]\nacceleration = ["0 m/s^2", "0 m/s^2", "1 m/s^2"]\n[analysis]', ["[gravity]"]),
    "parameter called t": ("[points]", '[parameters]\nt = "1 s"\n[points]', ["[parameters] t", "already has a meaning"]),
    "sum of unlike": (
        "[points]",
        '[parameters]\na = "1 m"\nb = "1 s"\nc = "a + b"\n[points]',
        ["[parameters.c] value", "adds a length and a time"],
    ),
    **LOOP_CASES,
    "nothing moves": ("ground = true", "ground = true", ["every point is ground"], ('"] }', '"], ground = true }')),
}  # fmt: skip


def written(case, folder):
    """Write the bad scene of a case into a folder of its own."""
    old, new, _, *more = CASES[case]
    text = GOOD_LOOP if case in LOOP_CASES else GOOD
    for a, b in [(old, new), *more]:
        assert a in text
        text = text.replace(a, b, -1 if case == "nothing moves" else 1)
    folder.mkdir(parents=True)
    (folder / "bad.toml").write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize("case", CASES)
def test_bad_scene(case, tmp_path, monkeypatch, entry):
    folder, cache = written(case, tmp_path / "work"), tmp_path / "cache"
    monkeypatch.setenv("SYMGEN_CACHE", str(cache))
    monkeypatch.chdir(folder)
    code, out, said = entry("run", "bad.toml", "--json")
    assert (code, out) == (3, ""), said
    assert "Traceback" not in said
    assert said.startswith("symgen: bad.toml: ")
    assert said.count("symgen: ") == 1
    for words in CASES[case][2]:
        assert words in said
    assert [p.name for p in folder.iterdir()] == ["bad.toml"]
    assert not cache.exists() or not list(cache.iterdir())


@pytest.mark.parametrize("text", [GOOD, GOOD_LOOP], ids=["points and links", "loop"])
def test_the_good_scene_is_good(text, tmp_path):
    scene = tmp_path / "good.toml"
    scene.write_text(text, encoding="utf-8")
    call("run", scene, "--json")


def test_empty_and_missing_files(tmp_path, monkeypatch, entry):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty.toml").write_text("")
    for name, words in (
        ("empty.toml", "no such key"),
        ("missing.toml", "no scene and no file"),
        (".", "cannot read"),
    ):
        code, _, said = entry("run", name)
        assert code == 3
        assert words in said
        assert "Traceback" not in said


@pytest.mark.parametrize(
    "written",
    [
        "[[loop]]\nrows = []\n[[loop]]\nrows = []",
        "[loop]\n[loop]",
        "[loops.a]\nrows = []",
        "[loop.a]\nrows = []",
    ],
)
def test_several_loops_are_expressed_by_points_links_and_bodies(written, tmp_path):
    scene = tmp_path / "two.toml"
    scene.write_text(f"symgen = 1\n{written}\n")
    with pytest.raises(SceneError, match=r"single loop.*\[points\] and \[links\], with bodies"):
        symgen.build(scene)


def test_a_table_named_self_is_an_unknown_key(tmp_path):
    """Names of tables and parameters are data: none of them may meet an argument of a function of Python."""
    scene = tmp_path / "self.toml"
    text = (Path(__file__).parents[1] / "cases" / "friction.toml").read_text()
    scene.write_text(f"{text}\n[self]\nmass = 1\n")
    with pytest.raises(SceneError, match=r"self"):
        symgen.load_scene(scene)
    scene.write_text(text.replace('"3 N"', '{ value = "3 N", tunable = true }').replace("F", "self"))
    model = symgen.build(scene, backend="numpy").with_parameters(self=0.5)
    assert model.parameters["self"] == 0.5
