"""The code of the README and of the tour runs as it stands."""

from __future__ import annotations

import math
import re
import shlex
import tomllib
from pathlib import Path

import pytest
from shared.commands import runner

import symgen
from symgen.cli import app
from symgen.scene.loading import read_scene

README = Path(__file__).parent.parent / "README.md"
TOUR = README.parent / "docs" / "tour.md"


def blocks(page, language):
    """Return the code blocks of a page in a language."""
    found = re.findall(r"```(\w+)\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    return [body for word, body in found if word == language]


def test_the_scenes_run(tmp_path):
    (text,), (loop, bent) = blocks(README, "toml"), blocks(TOUR, "toml")
    scene = tmp_path / "slider.toml"
    scene.write_text(text, encoding="utf-8")
    result = symgen.build(scene).simulate()
    assert result.final["B"]["position"] == pytest.approx([0.25, 0.0], abs=1e-9)
    assert {v.name for v in result.variables} >= {"crank.torque", "B.acceleration"}
    shipped, shown = read_scene("slider_crank").data, tomllib.loads(loop)
    assert shown["units"] == shipped["units"]
    for key in ("rows", "drives"):
        assert shown["loop"][key] == shipped["loop"][key]
    data, words = read_scene("thesis_four_bar").data, tomllib.loads(bent)
    data["links"] |= words["links"]
    model = symgen.build(symgen.Scene(**(data | {"crank": words["crank"]})))
    assert model.crank_speed == pytest.approx(95 * math.pi / 30)
    # One node more, in the coupler: two displacements, a rotation, a curvature.
    assert model.unknowns == symgen.build("thesis_four_bar").unknowns + 4


def test_the_first_run_prints_the_numbers_shown():
    """All but the wall time, and errors of round-off, which depend on the machine."""
    text = README.read_text(encoding="utf-8")
    (command,) = re.findall(r"&& symgen (run .*)$", text, re.MULTILINE)
    shown = text[text.index("\nPeaucellier straight-line generator: at") :].partition("```")[0]
    done = runner.invoke(app, command.split(), env={"COLUMNS": "100"})
    printed = [line.split() for line in done.stdout.splitlines()]
    values = {" ".join(line[:2]): line[2:] for line in printed}
    lines = [line.split() for line in shown.splitlines() if line.strip(" .─")]
    assert len(lines) == 11
    for line in lines:
        label = " ".join(line[:2])
        if label in ("constraint drift", "energy drift"):
            assert float(line[2]) < 1e-14 > float(values[label][0])
        elif label != "wall time":
            assert line in printed


@pytest.mark.parametrize(
    ("task", "page", "unit", "rows"),
    [
        ("Peaucellier", "performance", 1e-6, ("generated C", "NumPy, one state per call")),
        ("chain of 100", "chains", 1e-6, ("plane, symgen | 100", "plane, Pinocchio | 100")),
        ("crank angle", "performance", 1, ("slider_crank | symgen", "slider_crank | lambdify, math")),
        ("elastic four-bar", "performance", 1, ("symgen, gauss | steps 450 | 450",
                                                "lambdify (math), SciPy DOP853 | rtol 1e-05 | 1473")),
    ],
)  # fmt: skip
def test_times_are_those_that_benchmarks_write(task, page, unit, rows):
    """Those of two digits, in tables in seconds or in the unit of the README."""
    text = README.read_text(encoding="utf-8")
    (shown,) = re.findall(rf"^\|[^|]*{task}[^|]*\| ([0-9.]+) .s \| ([0-9.]+) .s, ", text, re.MULTILINE)
    table = (README.parent / "docs" / f"{page}.md").read_text(encoding="utf-8")
    measured = [re.search(rf"^\| {re.escape(row)} \| ([^ ]+) \|", table, re.MULTILINE)[1] for row in rows]
    assert [float(x) * unit for x in shown] == pytest.approx([float(x) for x in measured], rel=0.05)


@pytest.mark.parametrize("page", [README, TOUR], ids=lambda p: p.stem)
def test_the_python_runs(page, tmp_path, monkeypatch):
    (text,) = blocks(page, "python")
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(text, names)
    assert names["run"].drift.constraint < 1e-14
    assert (tmp_path / "run.nc").exists()


@pytest.mark.full
def test_the_commands_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (lines,) = (block for block in blocks(README, "sh") if block.count("\nsymgen ") > 2)
    for line in lines.strip().splitlines():
        done = runner.invoke(app, shlex.split(line, comments=True)[1:])
        assert done.exit_code == 0, line


def test_readme_is_short():
    assert len(README.read_bytes()) <= 8000


@pytest.mark.parametrize("page", [README, TOUR], ids=lambda p: p.stem)
def test_every_file_it_names_is_there(page):
    text = page.read_text(encoding="utf-8")
    for name in re.findall(r"\]\((?!http)([^)#]+)\)", text) + re.findall(
        r"`((?:symgen|templates)/[\w./]+)`", text
    ):
        assert (page.parent / name).exists() or (README.parent / name).exists(), name
