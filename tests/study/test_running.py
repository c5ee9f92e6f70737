"""Running studies: what is written, that nothing is written when something fails, and the command line."""

from __future__ import annotations

import csv
import io
import json
import subprocess
import sys
import tomllib

import numpy as np
import pytest

import symgen
from symgen.errors import ModelError, ResultError, SceneError
from symgen.scene.loading import SHIPPED
from symgen.study import run_studies
from symgen.study.plots import _broken, draw

SOURCE = (SHIPPED / "slider_crank.toml").read_text()
OWN = SOURCE[: SOURCE.index("[[studies]]")]
STUDY = """
[[studies]]
name = "twist"
about = "Twist of the slider's line"
vary = { alpha4 = ["250 deg", "270 deg"] }
set = { a4 = "30 in", "loop.drives.theta1" = "100 lbf*in", "loop.drives.S4" = "?" }
plots = ["S4", "slider.joint4.force"]
"""


@pytest.fixture
def scene(tmp_path):
    file = tmp_path / "crank.toml"
    file.write_text(OWN + STUDY)
    return file


def changed(scene, old, new):
    text = scene.read_text()
    assert old in text
    scene.write_text(text.replace(old, new))


def everything(folder):
    return {p.name: p.read_bytes() for p in sorted(folder.iterdir())}


def test_what_is_written(scene, tmp_path):
    told = []
    report = run_studies(scene, tmp_path / "out", progress=told.append)
    files = ["twist-S4.png", "twist-slider.joint4.force.png", "twist.csv", "index.md"]
    assert list(report.files) == files and sorted(everything(tmp_path / "out")) == sorted(files)
    assert told == sorted(told) and told[-1] == 1.0
    assert not list(tmp_path.glob(".*"))

    page = (tmp_path / "out" / "index.md").read_text()
    assert "`loop.drives.theta1 = 100 lbf*in`" in page and "![S4](twist-S4.png)" in page
    assert (
        "118.938528 deg, 322.136354 deg" in page
    )  # poles of the planar case, see the method's golden numbers
    assert "slider.joint4.force.z | lbf | unbounded | unbounded" in page

    with (tmp_path / "out" / "twist.csv").open() as stream:
        head, *rows = csv.reader(stream)
    assert head[0] == "theta1 [deg]" and head[1] == "S4 [in] alpha4 = 250 deg" and len(rows) == 361
    model = symgen.build(scene).with_parameters(a4=30 * 0.0254, alpha4=np.radians(250))
    assert [float(r[1]) for r in rows] == pytest.approx(
        model.inverse_dynamics().variable("S4").values / 0.0254, rel=1e-12
    )
    assert [float(r[0]) for r in rows] == pytest.approx(np.arange(361), abs=1e-12)


def test_the_same_again(scene, tmp_path):
    run_studies(scene, tmp_path / "one")
    run_studies(scene, tmp_path / "two")
    one, two = everything(tmp_path / "one"), everything(tmp_path / "two")
    assert one == two


def test_a_folder_that_is_there_keeps_other_files(scene, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "mine.txt").write_text("mine")
    (out / "index.md").write_text("old")
    run_studies(scene, out)
    assert (out / "mine.txt").read_text() == "mine" and "# Generalized" in (out / "index.md").read_text()


@pytest.mark.parametrize("there", [False, True])
def test_nothing_is_written_when_something_fails(scene, tmp_path, there):
    changed(scene, '"slider.joint4.force"]\n', '"slider.joint5.force"]\n')
    out = tmp_path / "out"
    if there:
        out.mkdir()
    with pytest.raises(ResultError, match=r"no 'slider.joint5.force'. Did you mean 'slider.joint4.force'"):
        run_studies(scene, out)
    assert out.exists() == there and not (there and list(out.iterdir()))
    assert sorted(p.name for p in tmp_path.iterdir()) == (["crank.toml", "out"] if there else ["crank.toml"])


def test_nothing_is_left_when_writing_fails(scene, tmp_path, monkeypatch):
    from pathlib import Path

    def full(self, content):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(ResultError, match="cannot write the studies .* No space left on device"):
        run_studies(scene, tmp_path / "out")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["crank.toml"]


def test_folders_that_cannot_be_written_are_refused_before_the_work(scene, tmp_path):
    with pytest.raises(ResultError, match="expected a folder for the studies, got the file"):
        run_studies(scene, scene)
    with pytest.raises(ResultError, match="there is no folder"):
        run_studies(scene, tmp_path / "no" / "out")


def test_a_case_without_a_whole_range_is_told_and_the_others_drawn(scene, tmp_path):
    changed(scene, 'vary = { alpha4 = ["250 deg", "270 deg"] }', 'vary = { S1 = ["40 in", "3 in"] }')
    report = run_studies(scene, tmp_path / "out")
    bad, good = report.studies[0].cases
    assert bad.turn is None and "cannot be assembled at theta1 = 0 deg" in bad.problem and good.turn
    page = (tmp_path / "out" / "index.md").read_text()
    assert "| 40 in | - | - | the loop C S S P cannot be assembled" in page
    summary = report.summary()["studies"]["twist"]
    assert summary[0]["closure"] is None and summary[1]["closure"] < 1e-13


def test_no_case_with_a_whole_range(scene, tmp_path):
    changed(scene, 'vary = { alpha4 = ["250 deg", "270 deg"] }', 'vary = { S1 = ["40 in"] }')
    report = run_studies(scene, tmp_path / "out")
    assert report.files == ("index.md",)


def test_what_a_study_sets_is_checked(scene, tmp_path):
    changed(scene, 'set = { a4 = "30 in"', 'set = { a4 = "30 lbf"')
    with pytest.raises(SceneError, match="parameters.* a4"):
        run_studies(scene, tmp_path / "out")
    changed(scene, 'set = { a4 = "30 lbf"', 'set = { b4 = "30 in"')
    with pytest.raises(SceneError, match="there is no parameter and no key 'b4' to set"):
        run_studies(scene, tmp_path / "out")


def test_a_limit_without_a_start_names_its_case(scene, tmp_path):
    limits = 'limits = [{ parameter = "S1", start = "40 in", stop = "0 in" }]'
    changed(scene, 'plots = ["S4", "slider.joint4.force"]', limits)
    with pytest.raises(
        ModelError, match="study 'twist', alpha4 = 250 deg: the search for a limit of S1 starts at 40 in"
    ):
        run_studies(scene, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_only_driven_loops(tmp_path):
    file = tmp_path / "bar.toml"
    file.write_text(
        (SHIPPED / "four_bar.toml").read_text() + '\n[[studies]]\nname = "x"\nplots = ["energy"]\n'
    )
    with pytest.raises(ModelError, match="studies are for driven loops"):
        run_studies(file, tmp_path / "out")


def test_curves_are_broken_at_poles():
    x, y = _broken(np.arange(4.0), np.ones(4), [1.5, 3.0])
    assert x.tolist() == [0, 1, 1.5, 2, 3, 3] and np.isnan(y).tolist() == [0, 0, 1, 0, 1, 0]


def test_a_plot_is_a_png(scene, tmp_path):
    report = run_studies(scene, tmp_path / "out")
    picture = draw("slider.joint4.force", "Title", report.studies[0].cases)
    assert picture.startswith(b"\x89PNG") and picture != draw("S4", "Title", report.studies[0].cases)


def symgen_study(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "symgen", "study", *map(str, arguments)], capture_output=True, text=True
    )


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_progress_on_a_terminal(scene, tmp_path, monkeypatch, capsys):
    from symgen.cli.studying import study

    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    study(scene=str(scene), folder=tmp_path / "out")
    assert "studies of crank" in terminal.getvalue() and "%" in terminal.getvalue()
    shown = capsys.readouterr().out
    assert "alpha4 = 250 deg" in shown and "begin with" in shown and "%" not in shown


def test_the_command(scene, tmp_path):
    done = symgen_study(scene, tmp_path / "out", "--json")
    assert done.returncode == 0 and done.stderr == ""
    assert [c["values"] for c in json.loads(done.stdout)["studies"]["twist"]] == [
        {"alpha4": "250 deg"},
        {"alpha4": "270 deg"},
    ]
    done = symgen_study(scene, tmp_path / "other", "--at", "45")
    assert done.returncode == 2 and "No such option: --at" in done.stderr
    assert not (tmp_path / "other").exists()


def test_the_shipped_scene_says_what_the_source_studied():
    studies = {s["name"]: s for s in tomllib.loads(SOURCE)["studies"]}
    assert studies["offset"]["vary"] == {"a4": ["0 in", "10 in", "20 in", "30 in"]}
    assert studies["shift"]["vary"] == {"S1": ["0 in", "3 in", "3.5 in", "6 in", "9 in"]}
    assert studies["twist"]["vary"] == {"alpha4": ["232 deg", "270 deg", "310 deg"]}
