"""The export and the page of a user-defined system: its kernels by closed forms."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
from html import unescape
from pathlib import Path

import pytest
from typer.testing import CliRunner

from symgen.cli import app
from symgen.errors import ModelError
from symgen.export import export_c

PAGE = (Path(__file__).parents[2] / "docs" / "regeneration.md").read_text()


@pytest.fixture
def pendulum(tmp_path):
    """The example of the documentation, whose parameters are constant from call to call."""
    (code,) = re.findall(r"```python\n(\"\"\"A pendulum by hand.*?)```", PAGE, re.DOTALL)
    file = tmp_path / "my_model.py"
    file.write_text(code.replace('"parameters", (m, l, g))', '"parameters", (m, l, g), per_run=True)'))
    return file


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_exported_kernels_of_a_user_defined_system(pendulum, tmp_path):
    folder = tmp_path / "out"
    names = export_c(pendulum, folder)
    assert "pendulum_kernel.h" in names and not any(name.startswith("core/") for name in names)
    text = (folder / "check.c").read_text()
    q, p, found = (
        [float(x) for x in re.search(rf" {name}\[\] = {{(.*)}}", text)[1].split(",")]
        for name in ("Q", "P", "OF_MOTION")
    )
    m, length, g = p[:3]
    assert found == pytest.approx([m * length**2, -m * g * length * math.sin(q[0])], rel=1e-15)
    for old, new, code in (("", "", 0), ("sin(", "cos(", 1)):
        kernel = folder / "pendulum_kernel.c"
        kernel.write_text(kernel.read_text().replace(old, new) if old else kernel.read_text())
        strict = ("-std=c11", "-Wall", "-Wextra", "-Werror", "-O0", "-ffp-contract=off")
        subprocess.run(
            ["gcc", *strict, "-o", "made", "check.c", "pendulum_kernel.c", "-lm"], cwd=folder, check=True
        )
        assert subprocess.run([folder / "made", "--bits"], capture_output=True).returncode == code


def test_values_cannot_be_set_in_a_user_defined_system(pendulum, tmp_path):
    with pytest.raises(ModelError, match="no values to set"):
        export_c(pendulum, tmp_path / "out", set={"m": "1 kg"})
    done = CliRunner().invoke(app, ["report", str(pendulum), "--set", "m=1 kg"])
    assert isinstance(done.exception, ModelError) and "no values to set" in str(done.exception)


def test_page_of_a_user_defined_system(pendulum, tmp_path):
    file = tmp_path / "page.html"
    assert CliRunner().invoke(app, ["report", str(pendulum), "--out", str(file)]).exit_code == 0
    text = unescape(file.read_text())
    assert "moment of gravity about the pivot" in text and "pendulum_setup(NULL" in text
    assert 'model.evaluate("motion", q=[1.0], p=[1.0, 1.0, 1.0])' in text
    assert 'id="run"' not in text and 'id="mechanism"' not in text
