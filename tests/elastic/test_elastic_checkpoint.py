"""Runs of elastic links that are stopped and resumed: the same to the bit."""

from __future__ import annotations

import numpy as np
import pytest
from shared.full import full

import symgen
from symgen.errors import ModelError, ResultError, SimulationError
from symgen.runtime.integrate import checkpoint


class Stopped(Exception):
    """What ends a run after a checkpoint."""


def stopped_after(count, monkeypatch):
    """Let a run be stopped when it has written so many checkpoints; return how many it has."""
    written = []
    own = checkpoint.store

    def store(*arguments):
        own(*arguments)
        written.append(arguments)
        if len(written) == count:
            raise Stopped

    monkeypatch.setattr(checkpoint, "store", store)
    monkeypatch.setattr("symgen.runtime.integrate.pace.LOOK", 0.0)
    return written


def bits(result):
    statistics = {**result.statistics, "wall_s": 0}
    return [v.values.tobytes() for v in result.variables], result.time.tobytes(), statistics, result.notes


@pytest.fixture(scope="module")
def models():
    """Built once each; one of links that keep their length, so that unknowns are chosen anew at every step."""
    return {name: symgen.build(name) for name in ("thesis_four_bar", "elastic_slider_crank")}


GAUSS = {"rtol": 0.1, "samples": 20}
RUNS = [
    ("gauss", GAUSS),
    ("gauss4", {"steps": 60, "samples": 7}),
    ("newmark", {"steps": 120, "at": (1.0,)}),
    ("generalized-alpha", {"steps": 60, "at": (1.0, 1.0, 0.0)}),
    ("wilson-theta", {"steps": 60, "samples": 5, "revolutions": 2.0}),
    ("bdf4", {"steps": 60, "samples": 5, "revolutions": 0.5}),
]


@pytest.mark.parametrize(
    ("name", "method", "asked"),
    [
        ("thesis_four_bar", *RUNS[2]),
        ("elastic_slider_crank", *RUNS[0]),
        ("elastic_slider_crank", *RUNS[5]),
        *(full("thesis_four_bar", *run) for run in (*RUNS[:2], *RUNS[3:])),
        *(full("elastic_slider_crank", *run) for run in RUNS[1:5]),
    ],
)
def test_a_resumed_run_is_the_same_to_the_bit_wherever_it_was_stopped(
    name, method, asked, models, tmp_path, monkeypatch
):
    model, file = models[name], tmp_path / "kept"
    whole = model.simulate(method=method, **asked)
    with monkeypatch.context() as patch:
        written = stopped_after(0, patch)
        assert bits(model.simulate(method=method, **asked, checkpoint=file, checkpoint_every=0)) == bits(
            whole
        )
    for count in {1, *np.random.default_rng(3).integers(1, len(written) + 1, 1).tolist(), len(written)}:
        with monkeypatch.context() as patch, pytest.raises(Stopped):
            stopped_after(count, patch)
            model.simulate(method=method, **asked, checkpoint=file, checkpoint_every=0)
        assert bits(model.simulate(method=method, **asked, resume=file)) == bits(whole)


def test_a_run_may_be_stopped_again_and_again(models, tmp_path, monkeypatch):
    """Each time from the last checkpoint, which holds all that was found before, and the time that it took."""
    model, file, asked = models["elastic_slider_crank"], tmp_path / "kept", {"rtol": 1e-4, "samples": 20}
    whole = model.simulate(method="gauss", **asked)
    kept, stops = {"checkpoint": file, "checkpoint_every": 0}, 0
    while True:
        try:
            with monkeypatch.context() as patch:
                stopped_after(29, patch)
                found = model.simulate(method="gauss", **asked, **kept)
            break
        except Stopped:
            kept["resume"] = file
            stops += 1
    assert stops > 3
    assert bits(found) == bits(whole)


@pytest.mark.parametrize("asked", [{"method": "rk4", "steps": 20000}, {"method": "dop853", "rtol": 1e-8}])
@pytest.mark.parametrize("name", ["thesis_four_bar", "elastic_slider_crank"])
def test_explicit_runs_resume(name, asked, models, tmp_path, monkeypatch):
    model, file = models[name], tmp_path / "kept"
    asked = {**asked, "revolutions": 0.3, "samples": 11}
    whole = model.simulate(**asked)
    for count in (1, 7):
        with monkeypatch.context() as patch, pytest.raises(Stopped):
            stopped_after(count, patch)
            model.simulate(**asked, checkpoint=file, checkpoint_every=0)
        assert bits(model.simulate(**asked, resume=file)) == bits(whole)


@pytest.mark.parametrize("asked", [{"method": "gauss", "rtol": 1e-4}, {"method": "dop853", "rtol": 1e-6}])
def test_runs_that_max_wall_ended_are_resumed_without_it(asked, models, tmp_path):
    model, file = models["thesis_four_bar"], tmp_path / "kept"
    asked = {**asked, "revolutions": 0.5, "samples": 11}
    whole = model.simulate(**asked)
    for limit in np.geomspace(1e-3, 10.0, 60):  # the shortest that leaves time for a step
        with pytest.raises(SimulationError, match="max_wall"):
            model.simulate(**asked, max_wall=float(limit), checkpoint=file)
        if file.exists():
            break
    assert bits(model.simulate(**asked, max_wall=60.0, resume=file)) == bits(whole)
    assert bits(model.simulate(**asked, resume=file)) == bits(whole)


def test_in_another_type(tmp_path, monkeypatch):
    model, file = symgen.build("thesis_four_bar", precision="longdouble"), tmp_path / "kept"
    whole = model.simulate(method="gauss", **GAUSS)
    with monkeypatch.context() as patch, pytest.raises(Stopped):
        stopped_after(50, patch)
        model.simulate(method="gauss", **GAUSS, checkpoint=file, checkpoint_every=0)
    assert bits(model.simulate(method="gauss", **GAUSS, resume=file)) == bits(whole)
    with pytest.raises(ResultError, match="of another run"):
        symgen.build("thesis_four_bar").simulate(method="gauss", **GAUSS, resume=file)


def test_checkpoints_of_other_runs_are_refused(models, tmp_path, monkeypatch):
    model, file = models["thesis_four_bar"], tmp_path / "kept"
    for method, asked in (("gauss", GAUSS), ("dop853", {"rtol": 1e-8, "revolutions": 0.2, "samples": 11})):
        with monkeypatch.context() as patch, pytest.raises(Stopped):
            stopped_after(1, patch)
            model.simulate(method=method, **asked, checkpoint=file, checkpoint_every=0)
        changes = {"samples": 9}, {"rtol": 2e-3}, {"revolutions": 0.5}, {"geometric_stiffness": False}
        for changed in (*changes, {"form": "thesis"}):
            with pytest.raises(ResultError, match="of another run, stopped at t = "):
                model.simulate(method=method, **{**asked, **changed}, resume=file)
        with pytest.raises(ResultError, match="of another run"):
            model.simulate(method="gauss4", **asked, resume=file)
        with pytest.raises(ResultError, match="of another run"):
            models["elastic_slider_crank"].simulate(method=method, **asked, resume=file)
    for method in (model.periodic, model.quasi_static):
        with pytest.raises(ModelError, match="checkpoint"):
            method(checkpoint=file)


def test_changed_times_of_nodes_in_a_checkpoint_have_no_effect(models, tmp_path, monkeypatch):
    """They are those of the run; times beyond its end would lead behind its arrays."""
    model, file, times = models["thesis_four_bar"], tmp_path / "kept", [0.0, 0.013, 0.029, 0.031]
    asked = {"method": "newmark", "steps": 60, "t_eval": times}
    whole = model.simulate(**asked)
    with monkeypatch.context() as patch, pytest.raises(Stopped):
        written = stopped_after(1, patch)
        model.simulate(**asked, checkpoint=file, checkpoint_every=0)
    _, mark, t, wall, arrays = written[0]
    memory = arrays["run"].tobytes()
    for time in (1e300, np.nan, 0.0):
        # The times that are recorded come first; they are the same.
        before, nodes, after = memory.rpartition(np.array(times).tobytes())
        assert nodes and np.array(times).tobytes() in before
        changed = before + np.array([*times[:2], time, times[3]]).tobytes() + after
        checkpoint.store(file, mark, t, wall, {**arrays, "run": np.frombuffer(changed, np.uint8)})
        assert bits(model.simulate(**asked, resume=file)) == bits(whole)
