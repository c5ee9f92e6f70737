"""Times to record, dense output, and CSV files."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import symgen
from symgen.errors import ModelError, ResultError

CASES = Path(__file__).parents[2] / "cases"
TIMES = np.array([0.013, 0.1, 0.1001, 0.37])


def falling(times, angle):
    """Angle of a uniform rod of 1 m that swings from rest about its end, by another integrator [rad]."""
    return solve_ivp(
        lambda t, y: [y[1], -1.5 * 9.81 * np.cos(y[0])], (0.0, times[-1]), [angle, 0.0], "DOP853",
        t_eval=times, rtol=1e-12, atol=1e-13,
    ).y[0]  # fmt: skip


@pytest.fixture(scope="module")
def pendulum():
    scene = {
        "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["0.8 m", "0.6 m"]}},
        "links": {"rod": {"points": ["O", "A"], "mass": "1 kg"}},
        "gravity": {"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        "analysis": {"t_end": "0.5 s", "outputs": ["A.position"]},
    }
    return symgen.build(symgen.Scene(symgen=1, title="Swing", **scene))


def error(run, times):
    angle = falling(times, math.atan2(0.6, 0.8))
    place = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.max(np.abs(run.variable("A.position").values - place))


def test_a_run_is_recorded_at_the_times_given(pendulum):
    run = pendulum.simulate(t_eval=TIMES, rtol=1e-11)
    assert run.time.tolist() == TIMES.tolist() and run.statistics["t"] == 0.5
    assert error(run, TIMES) < 1e-9
    whole = pendulum.simulate(rtol=1e-11)
    assert run.statistics["steps"] == whole.statistics["steps"] and run.drift == whole.drift
    assert pendulum.simulate(t_eval=[0.0, 0.5]).time.tolist() == [0.0, 0.5]


@pytest.mark.parametrize("method", ["dop853", "dopri5", "rk4", "radau5", "rattle4"])
def test_dense_output_has_the_accuracy_of_the_method(pendulum, method):
    """Two samples of the run tell nothing of the motion in between; dense output does."""
    fixed = method in ("rk4", "rattle4")
    options = {"step": 1e-3} if fixed else {"rtol": 1e-10}
    run = pendulum.simulate(method=method, samples=2, **options)
    assert error(run.at(TIMES), TIMES) < (1e-8 if fixed else 1e-7)
    assert run.at(run.time).variables[0].values.tobytes() == run.variables[0].values.tobytes()
    assert run.at(0.1).time.tolist() == [0.1]
    assert run.at(TIMES).variables[0].values[1].tolist() == run.at(0.1).variables[0].values[0].tolist()


@pytest.mark.parametrize("times", [[], [0.1, 0.1], [0.2, 0.1], [-0.1, 0.2], [0.1, 0.6], [math.nan], ["0.1"]])
def test_other_times_are_refused(pendulum, times):
    with pytest.raises(ModelError, match=r"t_eval"):
        pendulum.simulate(t_eval=times)


def test_times_or_samples(pendulum):
    with pytest.raises(ModelError, match="samples or t_eval, not both"):
        pendulum.simulate(t_eval=[0.1], samples=3)
    with pytest.raises(ModelError, match="does not accept t_eval|unknown|t_eval"):
        symgen.build("slider_crank").inverse_dynamics(t_eval=[0.1])


def test_a_loop_under_forces():
    model = symgen.build("cssp")
    whole = model.simulate(0.3, samples=31, rtol=1e-9)
    some = model.simulate(0.3, t_eval=whole.time[[3, 7, 20]], rtol=1e-9)
    dense = model.simulate(0.3, samples=2, rtol=1e-9).at(whole.time[[3, 7, 20]])
    for name in whole:
        expected = whole.variable(name).values[[3, 7, 20]]
        for run in (some, dense):
            np.testing.assert_array_equal(run.variable(name).values, expected)


def test_elastic_links():
    model = symgen.build("elastic_slider_crank")
    period = 2 * math.pi / model.crank_speed
    at = np.array([0.1, 0.25, 0.6]) * period
    run = model.simulate(samples=21, rtol=1e-4)
    fine = model.simulate(t_eval=at, steps=4096)
    assert fine.time.tolist() == at.tolist()
    peak = run.peaks["rod.bending_strain"]
    found = run.at(at).variable("rod.bending_strain").values
    assert np.max(np.abs(found - fine.variable("rod.bending_strain").values)) < 1e-3 * peak
    with pytest.raises(ModelError, match="at or t_eval"):
        model.simulate(t_eval=at, at=[0.1])
    with pytest.raises(ModelError, match="expected increasing times"):
        model.simulate(t_eval=[2 * period])


def test_only_runs_of_this_process_have_values_in_between(pendulum, tmp_path):
    run = pendulum.simulate(samples=3)
    again = symgen.load_result(run.save(tmp_path / "run.npz"))
    for result in (again, symgen.build("slider_crank").inverse_dynamics(samples=3)):
        with pytest.raises(ResultError, match=r"only runs by simulate\(\)"):
            result.at(0.1)
    with pytest.raises(ModelError, match="expected increasing times"):
        run.at(0.6)


def test_a_checkpoint_belongs_to_its_times(pendulum, tmp_path):
    file = tmp_path / "kept"
    options = {"step": 1e-4, "checkpoint": file, "checkpoint_every": 1e-6}
    pendulum.simulate(t_eval=TIMES, **options)
    resumed = pendulum.simulate(t_eval=TIMES, step=1e-4, resume=file)
    whole = pendulum.simulate(t_eval=TIMES, step=1e-4)
    assert resumed.variables[0].values.tobytes() == whole.variables[0].values.tobytes()
    with pytest.raises(ResultError):
        pendulum.simulate(t_eval=TIMES + 0.01, step=1e-4, resume=file)


@pytest.mark.parametrize("kind", ["run", "loop", "speed_response"])
def test_csv_has_every_number_with_its_unit(kind, tmp_path, speed_response):
    if kind == "run":
        result = symgen.build("four_bar").simulate(0.1, samples=5)
    elif kind == "loop":
        result = symgen.build("slider_crank", set={"loop.drives.theta1": "100 lbf*in", "loop.drives.S4": "?"})
        result = result.inverse_dynamics(at=[0.5, math.pi / 2])
    else:
        result = speed_response
    with result.save(tmp_path / "a.csv").open(newline="") as stream:
        head, *rows = csv.reader(stream)
    columns = dict(zip(head, np.array(rows, dtype=float).T, strict=True))
    along = result.coordinate
    assert head[0] == f"{along.name} [{along.unit}]" and columns[head[0]].tolist() == along.values.tolist()
    assert ("time [s]" in head) == (kind != "speed_response")
    for v in result.variables:
        for i, component in enumerate(v.components or ("",)):
            name = f"{v.name}.{component}" if component else v.name
            values = v.values if v.values.ndim == 1 else v.values[:, i]
            np.testing.assert_array_equal(columns.pop(f"{name} [{v.unit}]"), values)
    assert set(columns) <= {head[0], "time [s]"}
    with pytest.raises(ResultError, match=r"ending in \.nc or \.npz"):
        symgen.load_result(tmp_path / "a.csv")


def test_the_summary_of_a_run_in_plain_numbers(pendulum):
    """A pendulum from rest falls: its greatest height is at the start, its least at the end of a short run."""
    summary = json.loads(json.dumps(pendulum.simulate(0.2).summary(), allow_nan=False))
    angle = falling(np.array([0.0, 0.2]), math.atan2(0.6, 0.8))
    low = {"unit": "m", "final": math.sin(angle[1]), "minimum": math.sin(angle[1]), "minimum_at": 0.2}
    height = {**low, "maximum": 0.6, "maximum_at": 0.0}
    assert summary["outputs"]["A.position.y"] == pytest.approx(height, abs=1e-8)
    along = {"name": "time", "unit": "s", "count": 201, "first": 0.0, "last": 0.2}
    assert summary["coordinate"] == pytest.approx(along, abs=1e-15)
    assert summary["version"] == 1 and summary["title"] == "Swing" and summary["kind"] == "run"
