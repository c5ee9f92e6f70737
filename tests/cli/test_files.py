"""Files that commands write: checked before anything else, complete, named."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from shared.commands import call, runner

import symgen
from symgen.cli import app
from symgen.errors import ResultError, SymgenError
from symgen.runtime.result.result import Result


@pytest.mark.parametrize("option", ["--out", "--plot"])
@pytest.mark.parametrize("command", ["run", "kinematics", "inverse-dynamics", "speed-response", "bench"])
def test_files_are_checked_before_anything_else(tmp_path, command, option):
    """Before the scene is even looked for."""
    endings = {"--out": ".json" if command == "bench" else ".nc", "--plot": ".png"}
    arguments = [command, "no_such_scene", *(["--speeds", "60"] if command == "speed-response" else [])]
    file = tmp_path / "nowhere" / f"result{endings[option]}"
    done = runner.invoke(app, [*arguments, option, str(file)])
    assert "there is no folder" in str(done.exception)
    assert isinstance(done.exception, ResultError)


@pytest.mark.parametrize("ending", [".nc", ".npz"])
def test_out_saves_what_load_result_reads(tmp_path, ending):
    file = tmp_path / f"run{ending}"
    call("run", "four_bar", "--t-end", "0.5", "--samples", "11", "--out", file)
    run = symgen.load_result(file)
    assert run.time.tolist() == np.linspace(0, 0.5, 11).tolist()
    assert run["A.position"].shape == (11, 2)


def test_plot_writes_a_picture(tmp_path):
    call("run", "four_bar", "--plot", tmp_path / "run.svg")
    assert (tmp_path / "run.svg").read_text().count("<path") > 10


def test_a_plot_of_some_outputs_or_of_a_path(tmp_path, entry, monkeypatch):
    drawn = []
    monkeypatch.setattr(Result, "plot", lambda _, *names, file, xy, **more: drawn.append((names, xy, file)))
    file = tmp_path / "run.svg"
    for words in (["--plot-of", "energy"], ["--plot-of", "A", "--plot-of", "energy"], ["--xy", "B"], []):
        call("run", "four_bar", "--t-end", "0.1", "--plot", file, *words)
    assert drawn == [(("energy",), "", file), (("A", "energy"), "", file), ((), "B", file), ((), "", file)]
    for words in (("--plot-of", "energy"), ("--xy", "B")):
        code, _, said = entry("run", "four_bar", *words)
        assert code == 2 and said == f"symgen: {words[0]} selects the content of a plot: give --plot FILE\n"
    code, _, said = entry("run", "four_bar", "--xy", "B", "--over", "energy", "--plot", file)
    assert code == 2 and "give --xy, or --plot-of and --over, not both" in said


def test_a_plot_compares_with_a_saved_result(tmp_path):
    saved, file = tmp_path / "slow.nc", tmp_path / "both.svg"
    given = "kinematics", "crank_rocker", "--samples", "5", "--of", "B,A.B.C"
    call(*given, "--set", "speed=30 rpm", "--out", saved)
    over = "--over", "A.B.C.transmission_angle", "--compare", saved, "--plot", file
    assert call(*given, *over).splitlines()[-1] == f"wrote {file}"
    assert "<!-- A.B.C.transmission" in file.read_text() and "B.position.y, slow -->" in file.read_text()


def test_files_that_were_written_are_named_behind_the_tables_and_not_in_json(tmp_path):
    files = tmp_path / "run.csv", tmp_path / "run.svg"
    given = "run", "four_bar", "--t-end", "0.1", "--out", files[0], "--plot", files[1]
    assert call(*given).splitlines()[-2:] == [f"wrote {file}" for file in files]
    assert json.loads(call(*given, "--json"))["scene"] == "four_bar"


def test_a_failed_run_saves_what_it_had(tmp_path):
    file = tmp_path / "run.npz"
    with pytest.raises(SymgenError, match="at t ="):
        call("simulate", "triple_pendulum", "--step", "0.4", "--t-end", "20", "--out", file)
    partial = symgen.load_result(file)
    assert 0 < partial.statistics["t"] < 20
    assert np.all(np.isfinite(partial["A.position"].values))


@pytest.mark.parametrize("ending", [".nc", ".npz"])
def test_saved_arrays_are_those_of_the_run(tmp_path, ending):
    file = tmp_path / f"run{ending}"
    call("simulate", "four_bar", "--t-end", "0.4", "--samples", "7", "--step", "0.01", "--out", file)
    saved = symgen.load_result(file)
    fresh = symgen.build("four_bar").simulate(0.4, samples=7, step=0.01)
    assert {v.name for v in saved.variables} == {v.name for v in fresh.variables}
    for variable in fresh.variables:
        assert np.array_equal(saved[variable.name].values, variable.values)
        assert saved[variable.name].attrs["units"] == variable.unit
    assert saved.provenance == fresh.provenance
    assert saved.drift == fresh.drift
    assert [p.name for p in tmp_path.iterdir()] == [file.name]


@pytest.mark.parametrize("option", ["--out", "--plot"])
@pytest.mark.parametrize("file", ["result.xyz", "missing/result.nc", "missing/plot.png"])
def test_a_file_that_cannot_be_written_is_refused_before_the_run(option, file, tmp_path):
    """An endless run into a file that cannot be written fails at once."""
    done = runner.invoke(app, ["run", "peaucellier", "--t-end", "1e9", option, str(tmp_path / file)])
    assert isinstance(done.exception, ResultError)
    assert re.search("file ending in|no folder", str(done.exception))
    assert list(tmp_path.iterdir()) == []
