"""Sweeps: designs, closed forms over them, stores that continue after an interruption, wrong calls refused."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
import xarray
from rich.console import Console
from shared.variants import crank_rocker_with_lengths, pins

import symgen
from symgen.errors import CapabilityError, ModelError, ResultError, SimulationError
from symgen.report.page.study import print_study
from symgen.report.sweeps import summary, sweep_study
from symgen.runtime.result.elastic import beyond_linear_theory
from symgen.runtime.sweeps.designs import Normal, Uniform, design_of
from symgen.runtime.sweeps.stores import Zarr

LENGTHS = {"a": [0.09, 0.1, 0.11], "b": [0.34, 0.36]}
OPTIONS = {"analysis": "kinematics", "outputs": ["A.position", "B.position"], "samples": 21, "of": ["A", "B"]}


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return symgen.build(crank_rocker_with_lengths(tmp_path_factory.mktemp("sweeps")), backend="c")


def files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_a_grid_agrees_with_the_pose_by_two_circles(model):
    names = ["peak", "rms", "least", "greatest", "range", "mean", "final", "history"]
    runs = model.sweep(LENGTHS, reduce=names, **OPTIONS)
    grid = [(a, b) for a in LENGTHS["a"] for b in LENGTHS["b"]]
    assert list(zip(runs["a"].values, runs["b"].values, strict=True)) == grid
    assert not any(runs["error"].values)
    angles = np.linspace(0.0, 2 * math.pi, 21)
    for i, (a, b) in enumerate(grid):
        _, rocker = pins(a, b, 0.3, angles)
        run = runs.isel(run=i)
        assert run["B.position"].values == pytest.approx(rocker, abs=1e-12)
        assert run["A.position.peak"].item() == pytest.approx(a, rel=1e-12)
        assert run["A.position.rms"].item() == pytest.approx(a, rel=1e-12)
        assert run["B.position.greatest"].values == pytest.approx(rocker.max(axis=0), abs=1e-12)
        assert run["B.position.least"].values == pytest.approx(rocker.min(axis=0), abs=1e-12)
        assert run["B.position.range"].values == pytest.approx(np.ptp(rocker, axis=0), abs=1e-12)
        # Over a whole revolution, whose ends are one pose.
        assert run["A.position.mean"].values == pytest.approx([0.0, 0.0], abs=1e-12)
        assert run["B.position.mean"].values == pytest.approx(rocker[1:].mean(axis=0), abs=1e-12)
        assert run["A.position.final"].values == pytest.approx([a, 0.0], abs=1e-12)
    assert runs["B.position"].dims == ("run", "sample", "axis")
    assert runs["B.position.range"].attrs["units"] == runs["a"].attrs["units"] == "m"


def test_many_runs_take_names_of_reductions(model):
    runs = model.kinematics_many({"a": LENGTHS["a"]}, reduce="peak", outputs=["A.position"], samples=9)
    assert runs["A.position.peak"].values == pytest.approx(LENGTHS["a"], rel=1e-12)
    with pytest.raises(ModelError, match="no reduction 'peek'. Did you mean 'peak'"):
        model.kinematics_many({"a": LENGTHS["a"]}, reduce=["peek"])


@pytest.mark.parametrize("chunk", [1, 2, 4])
def test_runs_that_fail_are_entries_with_their_error(model, chunk):
    runs = model.sweep({"a": [2.0, 0.1, 3.0, 4.0]}, chunk=chunk, **OPTIONS)
    assert [bool(error) for error in runs["error"].values] == [True, False, True, True]
    assert "assemble" in runs["error"].values[3]
    assert runs["A.position.peak"].values == pytest.approx([math.nan, 0.1, math.nan, math.nan], nan_ok=True)
    assert runs["a"].values.tolist() == [2.0, 0.1, 3.0, 4.0]


def test_runs_that_end_at_a_dead_centre_are_counted(model):
    """A crank of 30 cm passes 0.3 m + 0.35 m from C, its farthest, at the angle of the cosine law; the first does not."""
    runs = model.sweep({"a": [0.1, 0.3]}, **OPTIONS)
    angles = np.linspace(0.0, 2 * math.pi, 21)
    reach = 0.3**2 + 0.4**2 - 2 * 0.3 * 0.4 * np.cos(angles) < 0.65**2
    assert runs["recorded"].values.tolist() == [21.0, float(np.argmin(reach))]
    assert summary(runs)["ended_early"] == 1 and summary(runs)["failed"] == 0
    of = {"a": Uniform(0.1, 0.3)}
    with pytest.raises(SimulationError, match="1 of 2 runs ended early"):
        model.tolerances(of, method="worst-case", **OPTIONS)
    with pytest.raises(
        SimulationError, match="the optimisation came to a = 0.3 m: the run ended early: dead centre"
    ):
        model.optimise(
            {"a": (0.1, 0.3)}, "A.position.peak", {}, "kinematics", start={"a": 0.3}, samples=21, of=["A"]
        )


def test_stores_have_the_same_bytes_for_any_threads_and_parts(model, tmp_path):
    of = {"a": [0.09, 0.1, 0.11, 0.1, 2.0, 0.1], "b": [0.34, 0.35, 0.36, 0.35, 0.35, 0.34]}  # 2 m is too long
    wanted = {"sampling": "list", "chunk": 2, **OPTIONS}
    one = model.sweep(of, file=tmp_path / "one.zarr", threads=1, **wanted)
    model.sweep(of, file=tmp_path / "two.zarr", threads=2, **wanted)
    for part in ((2, 2), (1, 2)):
        model.sweep(of, file=tmp_path / "parts.zarr", part=part, **wanted)
    assert files(tmp_path / "one.zarr") == files(tmp_path / "two.zarr") == files(tmp_path / "parts.zarr")
    assert [bool(e) for e in one["error"].values] == [False, False, False, False, True, False]
    held = model.sweep(of, **wanted)
    for name, variable in held.variables.items():
        if name != "axis":
            np.testing.assert_array_equal(one[name].values, variable.values)


def test_an_interrupted_sweep_continues_with_the_missing_chunks(model, tmp_path, monkeypatch):
    wanted = {"file": tmp_path / "cut.zarr", "chunk": 2, **OPTIONS}
    model.sweep(LENGTHS, **{**wanted, "file": tmp_path / "whole.zarr"})
    write, written = Zarr.write, []

    def cut(self, first, arrays):
        """End within the second chunk: its arrays are there in part, and are not marked as done."""
        if written:
            self.group["A.position.peak"][first : first + 2] = -1.0
            raise KeyboardInterrupt
        written.append(first)
        write(self, first, arrays)

    monkeypatch.setattr(Zarr, "write", cut)
    with pytest.raises(KeyboardInterrupt):
        model.sweep(LENGTHS, **wanted)
    read = xarray.open_zarr(tmp_path / "cut.zarr", consolidated=False, chunks=None)
    assert read["done"].values.tolist() == [1, 1, 0, 0, 0, 0]
    assert read["A.position.peak"].values[:2] == pytest.approx([0.09, 0.09], rel=1e-12)
    monkeypatch.setattr(Zarr, "write", lambda self, first, a: (written.append(first), write(self, first, a)))
    model.sweep(LENGTHS, **wanted)
    assert written == [0, 2, 4]
    assert files(tmp_path / "cut.zarr") == files(tmp_path / "whole.zarr")


def test_a_store_of_another_sweep_is_refused(model, tmp_path):
    file = tmp_path / "one.zarr"
    model.sweep(LENGTHS, file=file, **OPTIONS)
    for change in ({"samples": 22}, {"outputs": ["A.position"]}, {"reduce": "range"}):
        with pytest.raises(ResultError, match="results of another sweep"):
            model.sweep(LENGTHS, file=file, **{**OPTIONS, **change})
    with pytest.raises(ResultError, match="results of another sweep"):
        model.with_parameters(c=0.31).sweep(LENGTHS, file=file, **OPTIONS)
    (tmp_path / "other.zarr").mkdir()
    with pytest.raises(ResultError, match="is not the store of a sweep"):
        model.sweep(LENGTHS, file=tmp_path / "other.zarr", **OPTIONS)


@pytest.mark.parametrize("sampling", ["sobol", "latin-hypercube", "random"])
def test_samples_depend_on_the_number_of_the_run_and_the_seed_alone(sampling):
    of = {"a": Uniform(2.0, 4.0), "b": Normal(1.0, 0.5)}
    design = design_of(of, sampling, 4096, 7)
    values = design.values(0, 4096)
    assert np.array_equal(design.values(1000, 1500), values[1000:1500])
    assert np.array_equal(design.values(10, 20), values[10:20])
    assert not np.array_equal(design_of(of, sampling, 4096, 8).values(0, 4096), values)
    assert np.all((values[:, 0] >= 2.0) & (values[:, 0] < 4.0))
    near = 4.0 / math.sqrt(4096)
    assert values.mean(axis=0) == pytest.approx([3.0, 1.0], abs=near)
    assert values.std(axis=0) == pytest.approx([2.0 / math.sqrt(12.0), 0.5], abs=near)


def test_a_latin_hypercube_and_a_sobol_sequence_have_one_sample_in_each_interval():
    for sampling in ("latin-hypercube", "sobol"):
        values = design_of({"a": Uniform(0.0, 1.0), "b": Uniform(0.0, 1.0)}, sampling, 64, 0).values(0, 64)
        for column in values.T:
            assert sorted((column * 64).astype(int)) == list(range(64))


@pytest.mark.parametrize(
    ("vary", "more", "words"),
    [
        ({}, {}, "expected parameters to vary"),
        ({"a": "x"}, {}, "expected finite values of a in SI units, or a distribution"),
        ({"a": [0.1, math.nan]}, {}, "expected finite values of a"),
        ({"d": [0.1]}, {}, "no tunable parameter 'd'"),
        ({"a": [0.1]}, {"count": 3}, "omit the count of 3"),
        ({"a": Uniform(0.1, 0.2)}, {}, "expected a number of runs of sobol samples"),
        ({"a": Uniform(0.1, 0.2)}, {"sampling": "grid"}, "a grid needs values of a, got a distribution"),
        ({"a": [0.1, 0.2]}, {"sampling": "random"}, "random samples need a distribution of a"),
        ({"a": [0.1, 0.2], "b": [1, 2, 3]}, {"sampling": "list"}, "expected 3 values of a, one per run"),
        ({"a": [0.1]}, {"sampling": "halton"}, "no sampling 'halton'"),
        ({"a": [0.1]}, {"part": (3, 2), "file": "x.zarr"}, "expected a part from 1 to 2, got 3"),
        ({"a": [0.1]}, {"part": (1, 2)}, "parts of a sweep are written to one store"),
        ({"a": [0.1]}, {"chunk": 0}, "expected a chunk of one run or more"),
        ({"a": [0.1]}, {"analysis": "assemblies"}, "there are no sweeps of 'assemblies'"),
        (
            {"a": [0.1]},
            {"outputs": ["D.position"]},
            r"no output 'D.position'.*\n.*kinematics positions and angles",
        ),
        ({"a": [0.1]}, {"no_such": 1}, "no argument 'no_such'"),
        ({"a": [0.1]}, {"chunk": "x"}, "Model.sweep: expected a whole number for chunk"),
    ],
)
def test_wrong_sweeps_are_refused(model, vary, more, words):
    with pytest.raises(ModelError, match=words):
        model.sweep(vary, **{**OPTIONS, **more})


def test_wrong_names_of_stores_and_unsupported_analyses_are_refused(model, tmp_path):
    with pytest.raises(ResultError, match=r"ending in \.zarr or \.csv for the results"):
        model.sweep(LENGTHS, file=tmp_path / "x.nc", **OPTIONS)
    with pytest.raises(ResultError, match="there is no folder"):
        model.sweep(LENGTHS, file=tmp_path / "no" / "x.zarr", **OPTIONS)
    with pytest.raises(CapabilityError, match="does not support periodic:"):
        model.sweep(LENGTHS, "periodic")
    for wrong in ((1.0, 1.0), (math.nan, 1.0), ("x", 1.0)):
        with pytest.raises(ModelError, match="expected a uniform distribution"):
            Uniform(*wrong)
    with pytest.raises(ModelError, match="standard deviation above zero"):
        Normal(1.0, 0.0)


def test_equilibria_are_swept(tmp_path):
    """A pendulum of tunable length under gravity hangs straight down."""
    scene = {
        "parameters": {"length": {"value": "1 m", "tunable": True}},
        "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "P": {"at": ["0.6 m", "-0.8 m"]}},
        "links": {"rod": {"points": ["O", "P"], "length": "length", "mass": "1 kg"}},
        "gravity": {"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
    }
    model = symgen.build(symgen.Scene(**scene), backend="c")
    runs = model.sweep({"length": [0.5, 2.0]}, "equilibrium", file=tmp_path / "hanging.zarr")
    assert runs["P.position"].values == pytest.approx(np.array([[0.0, -0.5], [0.0, -2.0]]), abs=1e-9)
    assert runs["stability"].values.tolist() == ["stable", "stable"]
    assert json.loads((tmp_path / "hanging.zarr" / ".zgroup").read_text()) == {"zarr_format": 2}
    modes = model.sweep({"length": [0.5, 2.0]}, "modes")  # of a slender rod about its end
    exact = np.sqrt(1.5 * 9.81 / np.array([0.5, 2.0])) / (2 * math.pi)
    assert modes["frequency.1"].values == pytest.approx(exact, rel=1e-9)
    assert modes["frequency.1"].attrs["units"] == "Hz" and "frequency.2" not in modes
    with pytest.raises(ModelError, match="no output 'frequency.2'"):
        model.sweep({"length": [0.5]}, "modes", outputs=["frequency.2"])


def test_a_speed_without_revolutions_is_a_failure_of_its_run():
    """The end of the scene is the time of a revolution."""
    model = symgen.build("elastic_slider_crank")
    runs = model.sweep({"speed": [90.0, 0.0]}, "quasi_static", outputs=["P.position"], samples=5)
    of_moving, of_still = runs["error"].values
    assert of_moving == "" and "t_end of the scene is inf s" in of_still


def test_steady_states_of_a_sweep_have_their_floquet_multiplier():
    """It is the decay of the rod's first mode over a revolution.

    The damping is proportional to the stiffness, with a ratio of 0.01 of the first mode of a beam with free ends,
    whose frequency is that of one on two pins times (4.730/pi)**2.
    """
    model = symgen.build("elastic_slider_crank", backend="c")
    speeds = np.array([900.0, 1200.0]) * math.pi / 30
    runs = model.sweep({"speed": speeds}, "periodic", outputs=["floquet"])
    first = model.sweep({"speed": speeds[:1]}, "modes")["frequency.1"].item()
    ratio = 0.01 * (math.pi / 4.730041) ** 2
    exact = np.exp(-ratio * 2 * math.pi * first * 2 * math.pi / speeds)
    assert runs["floquet"].values == pytest.approx(exact, rel=0.02)
    with pytest.raises(ModelError, match="floquet is one value of a run"):
        model.optimise({"speed": (90.0, 120.0)}, "floquet.peak", analysis="periodic")
    with pytest.raises(ModelError, match="no output 'floquet'"):
        model.sweep({"speed": speeds}, "quasi_static", outputs=["floquet"])


@pytest.mark.parametrize("analysis", ["periodic", "quasi_static", "simulate"])
def test_runs_beyond_linear_theory_say_so(analysis, tmp_path):
    """The rod's compression at the inner dead centre, by hand, over its Euler load: 0.04 and 0.62."""
    model = symgen.build("elastic_slider_crank", backend="c")
    speeds = np.array([900.0, 3600.0]) * math.pi / 30
    r, length, piston, rod = 0.05, 0.2, 0.3, 7850 * 0.012 * 0.004 * 0.2
    crank, slider = r * speeds**2, r * speeds**2 * (1 - r / length)
    euler = math.pi**2 * 210e9 * 0.012 * 0.004**3 / 12 / length**2
    compression = piston * slider + rod * (crank + slider) / 2
    assert [*(compression / euler > 0.5)] == [False, True]
    file = tmp_path / "runs.zarr"
    runs = model.sweep({"speed": speeds}, analysis, outputs=["rod.stress"], file=file)
    good, beyond = map(str, runs["notes"].values)
    assert "linear theory" not in good
    if analysis == "simulate":  # whose rod vibrates
        selected = model.simulate(t_eval=[0.0, 0.01]).notes
        assert any("limits of linear theory" in note for note in selected) and not beyond_linear_theory(
            selected
        )
    else:
        assert f"compression comes to {compression[1]:.4g} N at 0 of its length" in beyond
    assert f"of its Euler load of {euler:.4g} N; linear theory is not to be trusted" in beyond
    assert summary(runs)["beyond_linear_theory"] == 1
    said = "linear theory does not hold in 1 of 2 runs: reasons in notes"
    printed = Console(file=io.StringIO(), width=120)
    study = sweep_study(runs, summary(runs))
    print_study(study, printed)
    assert said in printed.file.getvalue() and said in study.notes
    model.sweep({"speed": speeds}, analysis, outputs=["rod.stress"], file=tmp_path / "runs.csv")
    with (tmp_path / "runs.csv").open(newline="") as stream:
        notes = [row["notes"] for row in csv.DictReader(stream)]
    assert notes == [text.replace("\n", "; ") for text in (good, beyond)] and "\n" in beyond
    assert len((tmp_path / "runs.csv").read_text().splitlines()) == 3  # the names, and a line per run


def test_a_table_has_a_row_per_run_and_is_read_again(model, tmp_path):
    file = tmp_path / "runs.csv"
    model.sweep({"a": [0.1, 2.0]}, reduce=["peak", "greatest"], file=file, **OPTIONS)
    with file.open(newline="") as stream:
        good, failed = csv.DictReader(stream)
    assert (good["run"], good["a [m]"], good["error"]) == ("0", "0.1", "")
    assert float(good["A.position.peak [m]"]) == pytest.approx(0.1, rel=1e-12)
    assert float(good["A.position.greatest.x [m]"]) == pytest.approx(0.1, rel=1e-12)
    assert failed["A.position.peak [m]"] == "nan" and failed["error"]
    with pytest.raises(ModelError, match="one row per run"):
        model.sweep({"a": [0.1]}, reduce=["history"], file=file, **OPTIONS)
    with pytest.raises(ModelError, match="parts of a sweep are written to one store"):
        model.sweep({"a": [0.1]}, part=(1, 2), file=file, **OPTIONS)
    with pytest.raises(ResultError, match="there is no folder"):
        model.sweep({"a": [0.1]}, file=tmp_path / "no" / "x.csv", **OPTIONS)


def test_the_examples_of_the_page_run(monkeypatch):
    monkeypatch.chdir(Path(__file__).parents[3] / "docs")
    page = (Path(__file__).parents[3] / "docs" / "sweeps.md").read_text(encoding="utf-8")
    names: dict[str, object] = {}
    for block in re.findall(r"```python\n(.*?)```", page, re.S):
        exec(block, names)
    runs, samples = names["runs"], names["samples"]
    assert isinstance(runs, xarray.Dataset) and isinstance(samples, xarray.Dataset)
    assert not any(runs["error"].values) and not any(samples["error"].values)
    drive, span = runs["theta1.drive.peak"].values, runs["theta1.drive.range"].values
    assert -1.001 < names["optimum"].constraints["arm.torque.least"] < -0.999
    worst, scatter = (names[n].sel(output="theta1.drive.peak") for n in ("worst", "scatter"))
    assert worst["least"] < scatter["least"] < scatter["mean"] < scatter["greatest"] < worst["greatest"]
    assert np.all((drive > 0.0) & (drive <= span) & (span <= 2 * drive))
