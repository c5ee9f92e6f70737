"""Free loops: a limit of the drift that ends a run, and runs that are stopped and resumed."""

from __future__ import annotations

import numpy as np
import pytest
from shared.full import full

import symgen
from symgen.errors import ModelError, ResultError, SimulationError


@pytest.fixture(scope="module")
def model():
    return symgen.build("cssp")


def bits(result):
    return [v.values.tobytes() for v in result.variables], result.final, result.drift, result.notes


def strayed(model, t):
    """The entries of the closure, all in metres, where an unprojected run is at a time."""
    d = model.description
    run = model.simulate(t, method="rk4", step=1e-3, stabilisation="raw")
    q = np.array([run.final[v.name]["value"] for v in d.variables])
    off = model.kernels("position", t, q, np.zeros_like(q))["closure_defect"].copy()
    off[:, :3] *= d.size
    return off


def test_max_drift_ends_a_run_and_names_time_and_component(model):
    whole = model.simulate(method="rk4", step=1e-3, stabilisation="raw")
    limit = whole.drift.constraint / 10
    with pytest.raises(SimulationError, match="the closure of the loop strayed by .* max_drift = ") as caught:
        model.simulate(method="rk4", step=1e-3, stabilisation="raw", max_drift=limit)
    t = caught.value.time
    assert 0 < t < 2 and f"at t = {t:.9g} s" in str(caught.value)
    assert len(caught.value.partial.time) == int(t / 0.01 + 1e-9) + 1
    assert np.max(np.abs(strayed(model, t))) > limit >= np.max(np.abs(strayed(model, t - 1e-3)))
    off = np.abs(strayed(model, t))
    row, column = np.unravel_index(np.argmax(off), off.shape)
    turned = f"(rotation about {'xyz'[3 - row - column]} of frame 1, times {model.description.size:.4g} m)"
    shifted = f"(displacement along {'xyz'[row]} of frame 1)"
    assert (shifted if column == 3 else turned) in str(caught.value)
    assert model.simulate(step=1e-3, max_drift=limit).drift.constraint < 1e-13


def test_errors_of_rotation_are_named(model):
    """With max_drift at the smallest errors of all components, several are named; each as it is found."""
    said = set()
    for limit in np.geomspace(1e-12, 1e-7, 12):
        with pytest.raises(SimulationError) as caught:
            model.simulate(method="rk4", step=1e-3, stabilisation="raw", max_drift=limit)
        off = np.abs(strayed(model, caught.value.time))
        row, column = np.unravel_index(np.argmax(off), off.shape)
        kind = (
            f"(displacement along {'xyz'[row]}"
            if column == 3
            else f"(rotation about {'xyz'[3 - row - column]}"
        )
        assert kind in str(caught.value)
        said.add(kind)
    assert len(said) > 1


@pytest.mark.parametrize(
    ("asked", "precision"),
    [
        ({"rtol": 1e-8}, "float64"),
        ({"method": "dopri5"}, "float64"),
        ({"step": 2e-3}, "float64"),
        ({"step": 2e-3}, "float128"),
        full({"rtol": 1e-8}, "float128"),
        full({"method": "dopri5"}, "float128"),
    ],
)
def test_a_resumed_run_is_the_same_to_the_bit_wherever_it_was_stopped(asked, precision, tmp_path):
    model, file = symgen.build("cssp", precision=precision), tmp_path / "kept"
    whole = model.simulate(0.2, **asked)
    for k in np.random.default_rng(2).integers(1, whole.statistics["steps"], 4).tolist():
        with pytest.raises(SimulationError, match="max_steps"):
            model.simulate(0.2, **asked, max_steps=k, checkpoint=file, checkpoint_every=0)
        again = model.simulate(0.2, **asked, resume=file)
        assert bits(again) == bits(whole)
        assert again.statistics | {"wall_s": 0} == whole.statistics | {"wall_s": 0}


def test_checkpoints_of_other_runs_are_refused(model, tmp_path):
    file, asked = tmp_path / "kept", {"t_end": 0.5, "rtol": 1e-8}
    with pytest.raises(SimulationError):
        model.simulate(**asked, max_steps=5, checkpoint=file, checkpoint_every=0)
    for changed in ({"rtol": 1e-9}, {"t_end": 0.6}, {"samples": 7}, {"max_drift": 1.0}):
        with pytest.raises(ResultError, match="of another run, stopped at t = "):
            model.simulate(**{**asked, **changed}, resume=file)
    with pytest.raises(ResultError, match="of another run"):
        model.with_parameters(stall=11.0).simulate(**asked, resume=file)
    with pytest.raises(ModelError, match="checkpoint_every"):
        model.simulate(checkpoint=file, checkpoint_every=-1)
    with pytest.raises(ModelError, match="loops take projection, or raw"):
        model.simulate(method="rk4", step=1e-3, stabilisation="baumgarte")
