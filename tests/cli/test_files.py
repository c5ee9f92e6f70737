"""Files that commands write: checked before anything else, complete, named."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

from symgen.cli import app
from symgen.errors import ResultError


@pytest.mark.parametrize("option", ["--out", "--plot"])
@pytest.mark.parametrize("command", ["run", "kinematics", "inverse-dynamics", "speed-response", "bench"])
def test_files_are_checked_before_anything_else(tmp_path, command, option):
    """Before the scene is even looked for."""
    endings = {"--out": ".json" if command == "bench" else ".nc", "--plot": ".png"}
    arguments = [command, "no_such_scene", *(["--speeds", "60"] if command == "speed-response" else [])]
    file = tmp_path / "nowhere" / f"result{endings[option]}"
    done = CliRunner().invoke(app, [*arguments, option, str(file)])
    assert "there is no folder" in str(done.exception)
    assert isinstance(done.exception, ResultError)
