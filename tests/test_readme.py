"""What the README shows runs as it stands."""

from __future__ import annotations

import math
import re
import tomllib
from pathlib import Path

import pytest

import symgen
from symgen.scene.loading import read_scene

README = Path(__file__).parent.parent / "README.md"


@pytest.fixture(scope="module")
def blocks():
    return re.findall(r"```(\w+)\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)


def test_the_scene_runs(blocks, tmp_path):
    text, loop, bent = (body for language, body in blocks if language == "toml")
    scene = tmp_path / "slider.toml"
    scene.write_text(text, encoding="utf-8")
    result = symgen.build(scene).simulate()
    assert result.final["B"]["position"] == pytest.approx([0.25, 0.0], abs=1e-9)
    assert {v.name for v in result.variables} >= {"crank.torque", "B.acceleration"}
    shipped = read_scene("slider_crank").data["loop"]
    shown = tomllib.loads(loop)["loop"]
    assert {key: shown[key] for key in ("units", "rows", "drives")} == {
        key: shipped[key] for key in ("units", "rows", "drives")
    }
    data, words = read_scene("elastic_four_bar").data, tomllib.loads(bent)
    data["links"] |= words["links"]
    model = symgen.build(symgen.Scene(**(data | {"crank": words["crank"]})))
    assert model.crank_speed == pytest.approx(95 * math.pi / 30)
    # One node more, in the coupler: two displacements, a rotation, a curvature.
    assert model.unknowns == symgen.build("elastic_four_bar").unknowns + 4


def test_the_python_runs(blocks, tmp_path, monkeypatch):
    (text,) = (body for language, body in blocks if language == "python")
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(text, names)
    assert names["run"].drift.constraint < 1e-15
    assert (tmp_path / "run.nc").exists()


def test_every_file_it_names_is_there():
    text = README.read_text(encoding="utf-8")
    for name in re.findall(r"\]\((?!http)([^)#]+)\)", text) + re.findall(
        r"`((?:symgen|templates)/[\w./]+)`", text
    ):
        assert (README.parent / name).exists(), name
