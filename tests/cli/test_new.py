"""``symgen new`` and ``symgen scenes NAME``."""

import pytest
from typer.testing import CliRunner

from symgen.cli import app
from symgen.errors import ResultError, SceneError
from symgen.scene.loading import MACHINES, SHIPPED, check_scene, machines, read_scene, shipped_scenes


def invoke(*words):
    return CliRunner().invoke(app, words)


def test_a_copy_is_the_shipped_scene_and_overwrites_nothing(tmp_path):
    file = tmp_path / "mine.toml"
    assert invoke("new", str(file), "--from", "crank_rocker").exit_code == 0
    text = (SHIPPED / "crank_rocker.toml").read_text(encoding="utf-8")
    assert file.read_text(encoding="utf-8") == text == invoke("scenes", "crank_rocker").output
    assert check_scene(read_scene(file)).title == "Crank-rocker driven at constant speed"
    again = invoke("new", str(file))
    assert isinstance(again.exception, ResultError) and "exists" in str(again.exception)
    assert file.read_text(encoding="utf-8") == text


@pytest.mark.parametrize("words", [("scenes", "crank_roker"), ("new", "x.toml", "--from", "crank_roker")])
def test_unknown_scenes_are_named(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = invoke(*words)
    assert isinstance(found.exception, SceneError) and "Did you mean 'crank_rocker'?" in str(found.exception)
    assert not list(tmp_path.iterdir())


def test_machines_are_listed_copied_and_run_by_name(tmp_path):
    listed = invoke("scenes").output.partition("Machines of the trades")[2]
    assert all(f"{name} " in listed for name in machines()) and len(machines()) >= 15
    file = tmp_path / "mine.toml"
    assert invoke("new", str(file), "--from", "excavator").exit_code == 0
    assert file.read_text(encoding="utf-8") == (MACHINES / "excavator.toml").read_text(encoding="utf-8")
    assert "12 constraints (1 drive)" in invoke("build", "double_wishbone").output  # a length by the time
    assert read_scene("excavator").name == "excavator" and "excavator" not in shipped_scenes()


def test_units_are_listed_with_their_published_values():
    lines = [line.split() for line in invoke("units").output.splitlines()]
    found = {line[0].rstrip(","): (float(line[-2]), line[-1]) for line in lines[3:-1] if len(line) > 2}
    assert (
        found["in"] == (0.0254, "m") and found["lb"] == (0.45359237, "kg") and found["kgf"] == (9.80665, "N")
    )
    assert found["psi"] == (6894.757293, "Pa")  # NIST SP 811, B.8
    assert found["rpm"] == (0.1047197551, "1/s")
