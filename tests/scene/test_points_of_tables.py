"""Tables, profiles and remainders as a scene writes them: what is read, and what is refused where."""

from __future__ import annotations

import numpy as np
import pytest

import symgen
from symgen.errors import SceneError, SimulationError
from symgen.runtime import _core
from symgen.symbolic.switch import WHICH_PIECE

SCENE = """
symgen = 1
[tables]
TABLE
[parameters]
T = "2 s"
N = "1 N"
k = { value = "1 N", tunable = true }
[points]
O = { at = ["0 m", "0 m"], ground = true }
A = { at = ["1 m", "0 m"] }
[links]
bar = { points = ["O", "A"], mass = "1 kg" }
[[forces]]
point = "A"
force = ["FORCE", "0 N"]
"""
LINES = 'law = { x = ["0 s", "1 s"], y = ["0 N", "2 N"] }'


def resolved(folder, table=LINES, force="law(t)", more=""):
    (folder / "scene.toml").write_text(SCENE.replace("TABLE", table).replace("FORCE", force) + more)
    return symgen.build(folder / "scene.toml", backend="numpy")


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ('law = { x = ["0 s", "1 s"], y = ["0 N"] }', r"\[tables.law\] y.*at least 2"),
        ('law = { x = ["0 s", "1 s", "2 s"], y = ["0 N", "1 N"] }', r"\[tables.law\] y: expected as many values as"),
        ('law = { x = ["0 s", "2 s", "1 s"], y = ["0 N", "1 N", "1 N"] }', r"\[tables.law\] x\[2\].*rising order"),
        ('law = { x = ["0 s", "1 m"], y = ["0 N", "1 N"] }', r"x\[1\]: expected a time as the first, got '1 m'"),
        ('law = { x = ["0 s", "1 s"], y = ["0 N", "k"] }', r"y\[1\].*tunable parameter k(.|\n)*Multiply the table"),
        ('law = { x = ["0 s", "1 s"], y = ["0 N", "1 N"], period = "0.5 s" }', r"period: .*covers the points"),
        ('law = { x = ["0 s", "1 s"], y = ["0 N", "1 N"], period = "2 m" }', r"period: expected a time as x"),
        ('law = { x = ["0 s", "1 s"], y = ["0 N", "1 N"], period = "1 s" }', r"y\[1\]: .*same value at both ends"),
        ('law = { x = ["0 s", "1 s"], y = ["0 N", "1 N"], kind = "spline" }', r"\[tables.law\] kind"),
        ('sin = { x = ["0 s", "1 s"], y = ["0 N", "1 N"] }', r"\[tables\] sin: .*meaning in expressions"),
        ('T = { x = ["0 s", "1 s"], y = ["0 N", "1 N"] }', r"\[tables\] T: 'T' is a parameter"),
    ],
)  # fmt: skip
def test_faults_of_a_table_name_its_key(table, message, tmp_path):
    with pytest.raises(SceneError, match=message):
        resolved(tmp_path, table)


@pytest.mark.parametrize(
    ("force", "message"),
    [
        ("law(A.x)", r"gives the table law a length instead of a time"),
        ("law(t, t)", r"gives law 2 arguments instead of 1"),
        ("k*lav(t)", r"Did you mean 'law'\?"),
        ("k*profile.poly34(t/T)", r"'profile.poly34', which is not a profile(.|\n)*poly345"),
        ("k*profile.poly345(t)", r"expects one plain number(.|\n)*divide the time by a duration"),
        ("law(mod(t, t))", r"divides in mod by what is not a number above zero"),
        ("law(mod(t, t))", r"For a tunable period T write mod\(t/T, 1\)\*T in place of mod\(t, T\)"),
    ],
)
def test_faults_of_a_call_are_named(force, message, tmp_path):
    with pytest.raises(SceneError, match=message):
        resolved(tmp_path, force=force)


@pytest.mark.parametrize(
    ("angle", "accepted"),
    [
        ("turn(t)", True), ("jagged(t)", False), ("mod(t, T)/T", False), ("smooth(t)", True),
        ("profile.trapezoid(t/T)", True), ("profile.poly345(mod(t, T)/T)", False),
        ("profile.cycloidal(2*mod(t, T)/T) - profile.cycloidal(2*mod(t, T)/T - 1)", True),
        ("jagged(T*profile.poly345(t/T))", False),
        ("max(t - T, 0*T)**2/T**2", True), ("max(t - k*T/N, 0*T)**2/T**2", True),
        ("abs(t - T)*(t - T)/T**2", True), ("abs(t - T)*(t - k*T/N)/T**2", False),
        ("sign(t - T)*(t - T)**2/T**2", True), ("sign(t - T)*(t - T)/T", False),
        ("max(sin(t/T), 0)**2", True), ("max(sin(t/T), 0)", False), ("max(t**2/T**2 - 2, 0)**2", True),
        ("abs(mod(t, T) - T/2)*(mod(t, T) - T/2)*mod(t, T)*(T - mod(t, T))/T**4", True),
        ("profile.poly345((t - 2*T)/T)*abs(sin(t/T))", False),
        ("profile.poly345((t - 2*T)/T)*abs(sin(t/T))*sin(t/T)", True),
        ("max(smooth(t), 0.5)", False), ("smooth(max(t - T, 0*T))", True), ("jagged(max(t - T, 0*T))", False),
    ],
)  # fmt: skip
def test_a_prescribed_motion_may_not_jump_in_its_rate(angle, accepted, tmp_path):
    tables = """
turn = { x = ["0 s", "1 s", "3 s"], y = [0, 1, 0.5], kind = "cubic", period = "4 s" }
jagged = { x = ["0 s", "1 s", "3 s"], y = [0, 1, 0.5], period = "4 s" }
smooth = { x = ["0 s", "1 s", "2 s"], y = [0, 1, 0], kind = "pchip", period = "2 s" }
"""
    drive = f'\n[[drivers]]\nlink = "bar"\nangle = "{angle}"\n'
    if accepted:
        resolved(tmp_path, tables, "0 N", drive)
    else:
        with pytest.raises(SceneError, match=r"\[drivers.0\] angle: .*jumps"):
            resolved(tmp_path, tables, "0 N", drive)


@pytest.mark.parametrize(
    ("x", "y", "message"),
    [
        (["1 s", "2 s"], [0, 3], r"its rate jumps from 0 to 3 rad/s at t = 1 s, the first point of the table law\n.*pchip"),
        (["0 s", "2 s"], [0, 3], r"from 1.5 to 0 rad/s at t = 2 s, the last point of the table law\n  Give it a period"),
        (["0 s", "1 s", "2 s"], [0, 0, 3], r"from 0 to 3 rad/s at t = 1 s, with law\(t\)\n  Write kind"),
    ],
)  # fmt: skip
def test_a_table_that_ends_with_a_rate_is_named_with_its_end(x, y, message, tmp_path):
    table = f"law = {{ x = {x}, y = {y} }}".replace("'", '"')
    with pytest.raises(SceneError, match=message) as caught:
        resolved(tmp_path, table, "0 N", '\n[[drivers]]\nlink = "bar"\nangle = "law(t)"\n')
    assert '"k*(law(t) - P.y)"' in str(caught.value)


def test_a_table_that_ends_with_a_rate_behind_the_run_is_accepted(tmp_path):
    """At 2 s; longer runs end there with an error, and do not pass it."""
    drive = '\n[[drivers]]\nlink = "bar"\nangle = "law(t)"\n[analysis]\nt_end = "2 s"\n'
    model = resolved(tmp_path, 'law = { x = ["0 s", "2 s"], y = [0, 3] }', "0 N", drive)
    assert model.simulate(samples=3).final["A"]["position"][0] == pytest.approx(np.cos(3.0), abs=1e-9)
    for longer in (
        lambda: model.simulate(2.5),
        lambda: model.kinematics(over="time", stop=2.5),
        lambda: model.inverse_dynamics(over="time", stop=2.5),
    ):
        with pytest.raises(SimulationError, match="the prescribed motion, or its rate, jumps .* at t = 2 s"):
            longer()


def test_a_table_may_end_with_a_rate_of_zero(tmp_path):
    """As the message says: by two equal values and pchip."""
    table = 'law = { x = ["0 s", "1 s", "2 s", "3 s"], y = [0, 0, 1, 1], kind = "pchip" }'
    run = resolved(tmp_path, table, "0 N", '\n[[drivers]]\nlink = "bar"\nangle = "law(t)"\n').simulate(
        4.0, samples=9
    )
    assert run["A.position.x"].values[-1] == pytest.approx(0.5403023058681398, rel=1e-12)  # cos(1)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_points_of_a_file_are_those_of_its_columns(separator, tmp_path):
    rows = [("time [s]", "force [kN]"), ("0", "0"), ("1", "2e-3")]
    (tmp_path / "law.csv").write_text("\n".join(separator.join(row) for row in rows) + "\n")
    table = 'law = { file = "law.csv", x = "time [s]", y = "force [kN]" }'
    by_file = resolved(tmp_path, table).simulate(1.5, samples=2)
    by_points = resolved(tmp_path).simulate(1.5, samples=2)
    assert by_file["energy"].values.tolist() == by_points["energy"].values.tolist()


@pytest.mark.parametrize(
    ("content", "x", "message"),
    [
        (
            "a [s],b [N]\n0,0\n1,x\n",
            "a [s]",
            r"\[tables.law\] y: expected a number in line 3 of 'b \[N\]', got 'x'",
        ),
        (
            "a [s],b [N]\n0,0\n1,1\n",
            "a",
            r"\[tables.law\] x: expected the title of a column(.|\n)*Did you mean 'a \[s\]'",
        ),
        ("a [s],b [N]\n", "a [s]", r"at least two of points in .*law.csv"),
        (None, "a [s]", r"\[tables.law\] file: cannot read the points of '/.*/law.csv': No such file"),
    ],
)
def test_faults_of_a_file_of_points_are_named(content, x, message, tmp_path):
    if content is not None:
        (tmp_path / "law.csv").write_text(content)
    with pytest.raises(SceneError, match=message):
        resolved(tmp_path, f'law = {{ file = "law.csv", x = "{x}", y = "b [N]" }}')


PYTHON = {
    "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", "0 m"]}},
    "links": {"bar": {"points": ["O", "A"], "mass": "1 kg"}},
    "torques": [{"link": "bar", "torque": "law(t)"}],
}
TITLES = {"x": "time [s]", "y": "torque [N*m]"}


def written(path, torque):
    path.write_text(f"time [s],torque [N*m]\n0,{torque}\n1,{torque}\n")
    return path


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"file": "law.csv", **TITLES}, r"\[tables.law\] file: cannot read the points of '/.*/law.csv'"),
        ({"file": 3, **TITLES}, r"\[tables.law\] file: expected the name of a file, got 3"),
    ],
)
def test_faults_of_a_table_in_python_name_it(table, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SceneError, match=message):
        symgen.Scene(tables={"law": table}, **PYTHON)


def test_files_of_a_scene_lie_beside_it_and_those_of_set_in_the_working_directory(tmp_path, monkeypatch):
    """A uniform torque of 1, 2 or 4 N m about the end of a rod of 1 kg and 1 m: an acceleration of 3, 6 or 12."""
    beside, here = tmp_path / "beside", tmp_path / "here"
    beside.mkdir(), here.mkdir()
    monkeypatch.chdir(here)
    written(beside / "law.csv", 1), written(here / "law.csv", 2)
    (here / "other.csv").write_text("s [s];T [N*m]\n0;4\n1;4\n")
    scene = beside / "scene.toml"
    scene.write_text(
        'symgen = 1\n[tables]\nlaw = { file = "law.csv", x = "time [s]", y = "torque [N*m]" }\n'
        '[points]\nO = { at = ["0 m", "0 m"], ground = true }\nA = { at = ["1 m", "0 m"] }\n'
        '[links]\nbar = { points = ["O", "A"], mass = "1 kg" }\n'
        '[[torques]]\nlink = "bar"\ntorque = "law(t)"\n[analysis]\noutputs = ["bar.angular_acceleration"]\n'
    )
    other = {"tables.law.file": "other.csv", "tables.law.x": "s [s]", "tables.law.y": "T [N*m]"}
    for changes, expected in (
        ({}, 3), ({"title": "law"}, 3), ({"tables.law.file": "law.csv"}, 6), (other, 12),
        ({"tables.law.y.1": "3 N*m"}, 3), ({"tables.law.file": str(beside / "law.csv")}, 3),
    ):  # fmt: skip
        run = symgen.build(scene, backend="numpy", set=changes).simulate(0.1, samples=2)
        assert float(run["bar.angular_acceleration"][0]) == pytest.approx(expected, rel=1e-12)
    with pytest.raises(
        SceneError, match=rf"scene.toml: \[tables.law\] file: .* '{here}/no.csv': No such file"
    ):
        symgen.load_scene(scene, set={"tables.law.file": "no.csv"})
    with pytest.raises(SceneError, match=r"\[tables.law\] x: expected the title(.|\n)*Titles: s \[s\], T"):
        symgen.load_scene(scene, set={"tables.law.file": "other.csv", "tables.law.x": ["0 s", "1 s"]})
    assert float(symgen.build(scene, set={"tables.law.file": written(here / "x.csv", 4)}, backend="numpy")
                 .simulate(0.1, samples=2)["bar.angular_acceleration"][0]) == pytest.approx(12)  # fmt: skip


def test_a_table_is_asked_by_one_number():
    """Kernels know it from the derivation, runs from the core."""
    assert WHICH_PIECE == _core.WHICH_PIECE
