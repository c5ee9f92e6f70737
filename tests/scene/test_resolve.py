"""What a scene means is checked before anything is derived: each fault names its table and key."""

from __future__ import annotations

import pytest

import symgen
from symgen.errors import SceneError
from symgen.scene.loading import check_scene, read_scene
from symgen.scene.resolve import resolve

GOOD = """
symgen = 1
[parameters]
l = "1 m"
zero = { value = 0, tunable = true, about = "  " }
[points]
O = { at = ["0 m", "0 m"], ground = true }
E = { at = ["3 m", "0 m"], ground = true }
A = { at = ["1 m", "0 m"] }
B = { at = ["1 m", "0 m"] }
[links]
OA = { points = ["O", "A"], mass = "1 kg" }
EB = { points = ["E", "B"], mass = "1 kg" }
"""

CASES = {
    # Names that symgen gives itself.
    "A_x": ("[points]", 'A_x = { value = 1, tunable = true }\n[points]', "parameters.A_x", "of the point A"),
    "A_vy": ("[points]", 'A_vy = { value = 1, tunable = true }\n[points]', "parameters.A_vy", "of the point A"),
    "OA_dx": ("[points]", 'OA_dx = { value = 1, tunable = true }\n[points]', "parameters.OA_dx", "of the link OA"),
    "OA_dy_rate": (
        "[points]", 'OA_dy_rate = { value = 1, tunable = true }\n[points]', "parameters.OA_dy_rate", "the link OA",
    ),
    "OA_lambda": (
        "[points]", 'OA_lambda = { value = 1, tunable = true }\n[points]', "parameters.OA_lambda", "multiplier",
    ),
    "spring_0_length": (
        "[points]", 'spring_0_length = { value = 1, tunable = true }\n[points]', "parameters.spring_0_length", "spring",
    ),
    "lambda": ("[points]", 'lambda = "1 m"\n[points]', "parameters.lambda", "a word of Python"),
    "sqrt": ("[points]", 'sqrt = "1 m"\n[points]', "parameters.sqrt", "already has a meaning"),
    "link spring_0": ("OA =", "spring_0 =", "links.spring_0", "reserved for a spring"),
    "link guide_1_A": ("OA =", "guide_1_A =", "links.guide_1_A", "a guide"),
    "link called like a drive": (
        "[links]",
        '[[drivers]]\nlink = "OA"\nangle = "0"\n[links]\nOA_drive = { points = ["A", "B"], mass = "1 kg" }',
        "links.OA_drive", "a drive",
    ),
    # Values that are none.
    "division by a parameter that is zero": ('mass = "1 kg"', 'centre = "1/zero", mass = "1 kg"', "links.OA.centre", "finite"),
    "root of a negative": ('A = { at = ["1 m"', 'A = { at = ["l*sqrt(zero - 1)"', "points.A.at.0", "finite"),
    "logarithm of zero": ("[points]", 'w = { value = "log(zero)", tunable = true }\n[points]', "parameters.w.value", "finite"),
    "force without value at the start": (
        "[links]", '[[forces]]\npoint = "A"\nforce = ["f*s/t", "0 N"]\n[links]', "forces.0.force.0", "t = 0",
        ("[points]", 'f = "1 N"\ns = "1 s"\n[points]'),
    ),
    "integer beyond a double": ('mass = "1 kg"', f'centre = {"1" * 400}, mass = "1 kg"', "links.OA.centre", "double precision"),
    "quantity beyond a double": ('mass = "1 kg"', 'mass = "1e308 Gg"', "links.OA.mass", "double precision"),
    # Values that are not physical.
    "negative stiffness": (
        "[links]", '[[springs]]\nbetween = ["O", "A"]\nstiffness = "-1 N/m"\nlength = "1 m"\n[links]',
        "springs.0.stiffness", "at least zero",
    ),
    "negative damping": (
        "[links]",
        '[[springs]]\nbetween = ["O", "A"]\nstiffness = "1 N/m"\nlength = "1 m"\ndamping = "-1 N*s/m"\n[links]',
        "springs.0.damping", "at least zero",
    ),
    "stiffness of another dimension": (
        "[links]", '[[springs]]\nbetween = ["O", "A"]\nstiffness = "1 N"\nlength = "1 m"\n[links]',
        "springs.0.stiffness", "a stiffness",
    ),
    "spring between points at one place": (
        "[links]", '[[springs]]\nbetween = ["A", "B"]\nstiffness = "1 N/m"\nlength = "1 m"\n[links]',
        "springs.0.between", "no direction",
    ),
    "gravity of another dimension": (
        "[links]", '[gravity]\nacceleration = ["0 m/s^2", "-9.81 m/s"]\n[links]',
        "gravity.acceleration.1", "a velocity",
    ),
    "negative point mass": ("[links]", '[[masses]]\npoint = "A"\nmass = "-1 kg"\n[links]', "masses.0.mass", "at least zero"),
    "end of the run at zero": ("[links]", '[analysis]\nt_end = "0 s"\n[links]', "analysis.t_end", "above zero"),
    "length of a rail": (
        "[links]", '[links]\nOE = { points = ["O", "E"], length = "2 m" }', "links.OE.length", "their distance",
    ),
    "negative length": ('mass = "1 kg"', 'length = "-1 m", mass = "1 kg"', "links.OA.length", "above zero"),
    # Motions that have no acceleration.
    "drive by abs": ("[links]", '[[drivers]]\nlink = "OA"\nangle = "abs(t/s)"\n[links]', "drivers.0.angle", "abs",
        ("[points]", 's = "1 s"\n[points]')),
    "drive by a root": ("[links]", '[[drivers]]\nlink = "OA"\nangle = "sqrt(t/s)"\n[links]', "drivers.0.angle", "t = 0",
        ("[points]", 's = "1 s"\n[points]')),
    "ground moved by a root": (
        'O = { at = ["0 m", "0 m"], ground = true',
        'O = { at = ["0 m", "0 m"], ground = true, motion = ["0 m", "l*sqrt((t/s)**3)"]',
        "points.O.motion.1", "t = 0", ("[points]", 's = "1 s"\n[points]'),
    ),
    # Nonsense.
    "torque against itself": (
        "[links]", '[[torques]]\nlink = "OA"\ntorque = "1 N*m"\nagainst = "OA"\n[links]', "torques.0.against", "itself",
    ),
    "guide that names a point twice": (
        "[links]", '[[guides]]\npoints = ["B", "B"]\nalong = "OA"\n[links]', "guides.0.points", "once",
    ),
    "guide of its own point": (
        "[links]", '[[guides]]\npoints = ["A"]\nalong = "OA"\n[links]', "guides.0.points", "already",
    ),
    "velocity of the ground": (
        "[links]", '[start]\nvelocities = { O = ["1 m/s", "0 m/s"] }\n[links]', "start.velocities.O", "does not move",
    ),
    "rate of a link that is not there": ("[links]", '[start]\nrates = { AO = "1 rad/s" }\n[links]', "start.rates.AO", "no link called 'AO'"),
    "parameter that is not there": ("[points]", 'a = "2*bb"\nb = "1 m"\n[points]', "parameters.a.value", "unknown name 'bb'"),
    "parameters in a ring": (
        "[points]", 'a = "2*bb"\nbb = "c + l"\nc = "a"\n[points]', "parameters.a.value", "by each other: a by bb by c by a",
    ),
    "parameter of itself": ("[points]", 'a = "2*a"\n[points]', "parameters.a.value", "each other: a by a"),
    "fault in a parameter further down": (
        "[points]", 'a = "2*bb"\nbb = "1 kgg"\n[points]', "parameters.bb.value", "not a unit",
    ),
    "power by ^": ("[points]", 'a = "l^2"\n[points]', "parameters.a.value", "Write ** for a power"),
    "powers of a difference by ^": ("[points]", 'a = "sqrt(l^2 - 4*l^2)"\n[points]', "parameters.a.value", "Write ** for a power"),
    "least of a length and a number": ("[points]", 'a = "min(1, l)"\n[points]', "parameters.a.value", "gives min a plain number"),
    "angular velocity in hertz": ("[links]", '[start]\nrates = { OA = "2 Hz" }\n[links]', "start.rates.OA", '"2 rev/s"'),
    "point called this": ("B = { at", "this = { at", "points.this", "name of a load in its own expressions", ('"B"', '"this"')),
    "link called this": ("EB =", "this =", "links.this", "name of a load in its own expressions"),
    "value by its parameter": (
        'mass = "1 kg"', 'mass = "mm - 2*mm"', "links.OA.mass", "'mm - 2*mm', which is -3 kg", ("[points]", 'mm = "3 kg"\n[points]'),
    ),
}  # fmt: skip


def scene_of(text, folder):
    (folder / "bad.toml").write_text(text, encoding="utf-8")
    return check_scene(read_scene(folder / "bad.toml"))


def test_the_good_scene_is_good(tmp_path):
    linkage = resolve(scene_of(GOOD, tmp_path))
    assert [p.name for p in linkage.points] == ["O", "E", "A", "B"]
    assert linkage.parameters[0].quantity.description == "parameter zero"


@pytest.mark.parametrize("case", CASES)
def test_faults_name_table_and_key(case, tmp_path):
    old, new, where, words, *more = CASES[case]
    text = GOOD
    for a, b in [(old, new), *more]:
        assert a in text
        text = text.replace(a, b, 1)
    scene = scene_of(text, tmp_path)
    with pytest.raises(SceneError) as caught:
        resolve(scene)
    assert caught.value.where == where
    assert caught.value.file == "bad.toml"
    assert words in str(caught.value)


@pytest.mark.parametrize("name", ["x_A", "crank_length", "k1", "s0", "b0", "A_z", "OA_x", "work", "q", "int"])
def test_other_parameters_keep_their_names(name, tmp_path):
    """A folded parameter never collides, and a tunable one only with what this scene makes."""
    text = GOOD.replace("[points]", f"{name} = {{ value = 1, tunable = true }}\n[points]", 1)
    if name == "A_z":
        text = text.replace("tunable = true }\n[points]", "tunable = false }\n[points]")
    scene = scene_of(text, tmp_path)
    assert name in scene.parameters
    assert resolve(scene).dimension == 2


FILES = {
    "deep tables": (GOOD + ".".join(["a"] * 2000) + " = 1\n", "nested at most"),
    "deep lists": (GOOD + "a = " + "[" * 30 + "]" * 30, "nested at most"),
    "deeper lists": (GOOD + "a = " + "[" * 9000 + "]" * 9000, "not valid TOML"),
    "an integer of too many digits": (GOOD + "a = " + "9" * 5000, "not valid TOML"),
    "twice": (GOOD + "[points]\n", "not valid TOML"),
    "not UTF-8": (GOOD.encode() + b"# \xff", "not valid TOML(.|\n)*UTF-8"),
    "large": (GOOD + "#" * 4_000_001, "at most 4000000 bytes"),
}


@pytest.mark.parametrize("case", FILES)
def test_files_that_are_refused(case, tmp_path):
    content, words = FILES[case]
    (tmp_path / "bad.toml").write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(SceneError, match=words) as caught:
        symgen.load_scene(tmp_path / "bad.toml")
    assert caught.value.file == "bad.toml"


@pytest.mark.parametrize("version", ["true", "1.0", "'1'", "[1]", "2"])
def test_the_version_is_the_integer_one(version, tmp_path):
    with pytest.raises(SceneError, match="expected the format version") as caught:
        scene_of(GOOD.replace("symgen = 1", f"symgen = {version}"), tmp_path)
    assert caught.value.where == "symgen"


@pytest.mark.parametrize("content", [GOOD.replace("\n", "\r\n"), "\ufeff" + GOOD], ids=["CRLF", "BOM"])
def test_files_of_other_systems_are_read(content, tmp_path):
    (tmp_path / "odd.toml").write_bytes(content.encode("utf-8"))
    assert set(symgen.load_scene(tmp_path / "odd.toml").points) == set("OEAB")


@pytest.mark.parametrize(
    "stem, name", [("2-bars", "scene_2_bars"), ("für", "f_r"), ("a" * 90, "a" * 40), ("four_bar", "four_bar")]
)
def test_names_made_from_files(stem, name, tmp_path):
    (tmp_path / f"{stem}.toml").write_text(GOOD)
    assert symgen.load_scene(tmp_path / f"{stem}.toml").name == name


def test_parameters_are_read_after_those_they_use(tmp_path):
    """The order of the kernels' arguments stays that of the scene."""
    added = (
        'a = { value = "b + c", tunable = true }\nb = "2*c"\nc = { value = "3 m", tunable = true }\n[points]'
    )
    linkage = resolve(scene_of(GOOD.replace("[points]", added, 1), tmp_path))
    assert [p.quantity.name for p in linkage.parameters] == ["zero", "a", "c"]
    assert [p.default for p in linkage.parameters] == [0, 9, 3]


def test_a_place_in_a_list_is_written_like_one():
    error = SceneError("wrong", where="points.A.at.0", file="x.toml")
    assert str(error) == "x.toml: [points.A] at[0]: wrong"
    assert str(SceneError("wrong", where="forces.2.force.1")) == "[forces.2] force[1]: wrong"
    assert str(SceneError("wrong", where="springs.0")) == "[springs] 0: wrong"


@pytest.mark.parametrize("text", ["2 rad/s", "2 rev/s", "120 rpm", "2 1/s"])
def test_angular_velocities_are_read(text, tmp_path):
    scene = scene_of(GOOD.replace("[links]", f'[start]\nrates = {{ OA = "{text}" }}\n[links]', 1), tmp_path)
    assert len(resolve(scene).start.rates) == 1
