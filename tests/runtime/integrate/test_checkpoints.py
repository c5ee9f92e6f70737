"""Checkpoints: a resumed run is the same to the bit, and refuses those of other runs."""

from __future__ import annotations

import json

import numpy as np
import pytest

import symgen
from symgen.errors import ModelError, ResultError
from symgen.runtime import _core
from symgen.runtime.integrate.checkpoint import memory_of, restore, store, stored
from symgen.runtime.integrate.integrators import INTEGRATORS

EXPLICIT = ["dop853", "dopri5", "rk4"]


@pytest.fixture(scope="module")
def model():
    """A linkage that passes losses of rank, so that all parts of the loop have something to remember."""
    return symgen.build("parallelogram")


def started(model, name="dop853", rtol=1e-8, t_end=2.0):
    method = INTEGRATORS[name]
    state = model.initial_state()
    fixed = not method.adaptive
    return _core.Run(
        model.evaluator.equations(len(model.redundant)),
        method,
        0.0,
        np.concatenate([state.q, state.u, np.zeros(int(model.description.work_of_loads))]),
        t_end,
        0.0 if fixed else rtol,
        0.0 if fixed else 1e-3 * rtol,
        1e-3 if fixed else 0.0,
        np.linspace(0.0, t_end, 51),
    )


def to_the_end(run, status=_core.MORE, chunk=1000):
    while status == _core.MORE:
        status = run.advance(chunk)
    assert status == _core.DONE
    return (
        run.result.tobytes(),
        run.sampled.tobytes(),
        run.steps,
        run.rejected,
        run.energy_drift,
        run.passages,
    )


@pytest.mark.parametrize("name", EXPLICIT)
def test_a_resumed_run_is_the_same_to_the_bit_wherever_it_was_stopped(name, model, tmp_path):
    whole = started(model, name)
    expected = to_the_end(whole, whole.begin())
    assert whole.passages
    for k in np.random.default_rng(1).integers(0, whole.steps, 6).tolist():
        stopped = started(model, name)
        stopped.begin()
        stopped.advance(k)
        store(tmp_path / "run.npz", "mark", stopped.t, 2.5, memory_of(stopped))
        again = started(model, name)
        content, spent = stored(tmp_path / "run.npz", "mark")
        restore(again, content)
        assert spent == 2.5
        assert again.steps == stopped.steps == k
        assert to_the_end(again) == expected
        # The file is a copy: the run it was taken from continues as well.
        assert to_the_end(stopped, chunk=7) == expected


def bits(result):
    return [v.values.tobytes() for v in result.variables], result.final, result.drift, result.notes


def test_the_whole_simulation_resumes(model, tmp_path):
    """The last checkpoint of a run that ended at max_steps, taken up without that limit."""
    file = tmp_path / "kept"
    asked = {"t_end": 2.0, "method": "dop853", "rtol": 1e-8}
    whole = model.simulate(**asked)
    stop = {"max_steps": 40, "checkpoint": file, "checkpoint_every": 0}
    with pytest.raises(symgen.errors.SimulationError, match="max_steps"):
        model.simulate(**asked, **stop)
    resumed = model.simulate(**asked, resume=file)
    assert bits(resumed) == bits(whole)
    assert resumed.statistics | {"wall_s": 0} == whole.statistics | {"wall_s": 0}


def test_events_are_remembered(tmp_path):
    from shared.linkages import G, at, ground, rod

    scene = symgen.Scene(
        points={"O": ground(0, 0), "A": at(1, 0)},
        links={"OA": rod("O", "A")},
        gravity={"acceleration": ["0 m/s^2", f"{-G!r} m/s^2"]},
        events=[{"name": "low", "of": "A.x"}],
    )
    model = symgen.build(scene)
    whole = model.simulate(5.0)
    with pytest.raises(symgen.errors.SimulationError):
        model.simulate(5.0, max_steps=10, checkpoint=tmp_path / "c", checkpoint_every=0)
    again = model.simulate(5.0, resume=tmp_path / "c")
    assert again.events == whole.events and len(whole.events) > 3
    assert bits(again) == bits(whole)


@pytest.mark.parametrize("changed", [{"direction": "rising"}, {"ends_run": True}])
def test_other_events_are_another_run(changed, tmp_path):
    """They are of the same equations."""
    from shared.linkages import GRAVITY, at, ground, rod

    def built(**changed):
        events = [{"name": "low", "of": "A.x", "direction": "falling", **changed}]
        points = {"O": ground(0, 0), "A": at(1, 0)}
        return symgen.build(
            symgen.Scene(points=points, links={"OA": rod("O", "A")}, gravity=GRAVITY, events=events)
        )

    with pytest.raises(symgen.errors.SimulationError):
        built().simulate(5.0, max_steps=10, checkpoint=tmp_path / "c", checkpoint_every=0)
    with pytest.raises(ResultError, match="of another run"):
        built(**changed).simulate(5.0, resume=tmp_path / "c")


@pytest.mark.parametrize(
    "changed",
    [{"rtol": 1e-7}, {"t_end": 3.0}, {"method": "dopri5"}, {"samples": 7}, {"max_drift": 1.0}],
)
def test_another_run_is_refused(changed, model, tmp_path):
    file = tmp_path / "kept"
    asked = {"t_end": 2.0, "rtol": 1e-8, "method": "dop853", "samples": 11}
    with pytest.raises(symgen.errors.SimulationError):
        model.simulate(**asked, max_steps=20, checkpoint=file, checkpoint_every=0)
    with pytest.raises(ResultError, match="of another run, stopped at t = "):
        model.simulate(**{**asked, **changed}, resume=file)
    with pytest.raises(ResultError, match="of another run"):
        symgen.build("four_bar").simulate(**asked, resume=file)


def test_bad_files_are_refused(model, tmp_path):
    broken = tmp_path / "broken"
    broken.write_bytes(b"PK\x03\x04 not a checkpoint")
    with pytest.raises(ResultError, match="broken"):
        model.simulate(1.0, resume=broken)
    broken.write_bytes(b"not even an archive")  # for which NumPy would propose to trust it
    with pytest.raises(ResultError, match="broken: File is not a zip file"):
        model.simulate(1.0, resume=broken)
    with pytest.raises(ResultError, match="there is no checkpoint"):
        model.simulate(1.0, resume=tmp_path / "none")
    with pytest.raises(ResultError, match="there is no folder"):
        model.simulate(1.0, checkpoint=tmp_path / "none" / "file")
    with pytest.raises(ModelError, match="checkpoint_every"):
        model.simulate(1.0, checkpoint=tmp_path / "file", checkpoint_every=-1.0)
    file = tmp_path / "cut"
    with pytest.raises(symgen.errors.SimulationError):
        model.simulate(2.0, max_steps=20, checkpoint=file, checkpoint_every=0)
    file.write_bytes(file.read_bytes()[:-200])
    with pytest.raises(ResultError, match="broken"):
        model.simulate(2.0, resume=file)


@pytest.mark.parametrize("fault", ["bytes", "mark", "short", "missing"])
def test_a_broken_checkpoint_is_told(tmp_path, fault):
    model, file = symgen.build("four_bar"), tmp_path / "c.npz"
    model.simulate(0.2, method="rk4", step=1e-4, checkpoint=file, checkpoint_every=0.0)
    with np.load(file) as stored:
        arrays = dict(stored)
    header = json.loads(str(arrays["header"]))
    if fault == "bytes":
        arrays["run"] = arrays["run"].copy()
        arrays["run"][100] ^= 255
    elif fault == "mark":
        del header["mark"]
    elif fault == "short":
        arrays["run"] = arrays["run"][:-8]
    else:
        del arrays["events"]
    arrays["header"] = np.array(json.dumps(header))
    np.savez(file, **arrays)
    with pytest.raises(ResultError, match="is not a checkpoint of symgen, or is broken"):
        model.simulate(0.2, method="rk4", step=1e-4, resume=file)
