"""Explanations of the keys of scene files, found for every key that a shipped scene has."""

from __future__ import annotations

import tomllib

import pytest
from typer.testing import CliRunner

from symgen.cli import app
from symgen.errors import SceneError
from symgen.inspection.explanation import explained, keys_of
from symgen.scene.loading import shipped_scene, shipped_scenes
from symgen.scene.schema import Scene

KEYS = keys_of(Scene.model_json_schema())


def written(data, path=""):
    """Yield the paths of all keys of tables, and of tables in lists."""
    for key, value in data.items() if isinstance(data, dict) else enumerate(data):
        if isinstance(value, dict) or (isinstance(value, list) and value and isinstance(value[0], dict)):
            yield from written(value, f"{path}.{key}")
        elif isinstance(data, dict):
            yield f"{path}.{key}".strip(".")


@pytest.mark.parametrize("name", shipped_scenes())
def test_every_key_of_a_shipped_scene_is_explained(name):
    for path in written(tomllib.loads(shipped_scene(name))):
        last = path.rpartition(".")[2]
        assert explained(KEYS, path)[0].path.rpartition(".")[2] in (last, "NAME"), path


def test_a_table_comes_with_its_keys():
    table, *inside = explained(KEYS, "[[drivers]]")
    assert table.path == "drivers" and table.form == "list: table"
    assert {k.path: k.default for k in inside}["drivers.angle"] == "required"
    assert {k.path for k in explained(KEYS, "against")} >= {"drivers.against", "bushings.against"}


def test_the_command_prints_what_a_key_means():
    shown = CliRunner().invoke(app, ["schema", "--explain", "links.crank.mass"]).stdout
    assert "links.NAME.mass" in shown and "quantity or expression" in shown
    with pytest.raises(SceneError, match="no key 'massx'\\n.*mass"):
        raise CliRunner().invoke(app, ["schema", "--explain", "massx"]).exception
