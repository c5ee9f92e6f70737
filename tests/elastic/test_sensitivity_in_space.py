"""What derivatives of elastic links in space accept; test_exact_slopes compares them with 40 digits."""

from __future__ import annotations

import json

import numpy as np
import pytest
from shared.commands import call

import symgen
from symgen.cli import app
from symgen.errors import ModelError, ResultError, SimulationError
from symgen.methods import method_of


@pytest.fixture(scope="module")
def model():
    return symgen.build("spatial_slider_crank")


def test_outputs_of_a_run_have_derivatives(model):
    """Of forces, strains and energies against differences of two runs with the same steps."""
    asked = {"samples": 3, "max_step": 2e-5, "rtol": 0.5}
    run = model.simulate(1e-3, **asked)
    names = ["rod.A.force", "rod.stress", "rod.torque", "kinetic_energy", "strain_energy"]
    names += ["dissipated_power", "input_power"]
    found = run.gradient(names)
    assert found.derivatives.shape == (3, 9, 1) and found.t.tolist() == run.time.tolist()
    step = 1e-4
    moved = [model.with_parameters(rate=60.0 + s * step).simulate(1e-3, **asked) for s in (1, -1)]
    differences = [(a - b) / (2 * step) for a, b in zip(*(_columns(x, names) for x in moved), strict=True)]
    for k, expected in enumerate(differences):
        size = np.max(np.abs(expected)) + 1e-9
        assert np.max(np.abs(found.derivatives[1:, k, 0] - expected[1:])) < 1e-3 * size, found.outputs[k]
    assert found["rod.stress", "rate"].shape == (3,) and found.units["rod.stress"] == "Pa"


def test_the_command_prints_frequencies(model):
    asked = ["--outputs", "frequencies", "--at", "0.01 s", "--json"]
    printed = json.loads(call("sensitivity", "spatial_slider_crank", *asked))
    found = model.sensitivity(["frequencies"], at=0.01)
    assert printed["parameters"] == {"rate": "rad/s"} and [*printed["outputs"]] == [*found.outputs]
    for name, entry in printed["outputs"].items():
        assert entry["by"]["rate"] == found[name, "rate"]


def test_every_analysis_that_is_a_command_can_be_printed(model):
    known = {command.callback.__name__ for command in app.registered_commands}
    assert known.intersection(model.capabilities) <= {*method_of(model).commands}


def _columns(run, names):
    return [column for name in names for column in np.reshape(run[name].values, (3, -1)).T]


def test_what_has_no_derivatives_is_refused(model):
    with pytest.raises(ModelError, match="expected frequencies in a pose, got P.position"):
        model.sensitivity(["P.position"])
    run = model.simulate(1e-4, samples=2)
    with pytest.raises(ModelError, match=r"no derivatives of 'P\.speed' of a run of elastic links in space"):
        run.gradient(["P.speed"])
    with pytest.raises(ResultError, match="if it accepts t_eval"):
        run.at([5e-5])
    other = model.with_parameters(rate=50.0)
    with pytest.raises(ModelError, match="expected a run of this model for at"):
        other.sensitivity(["P.position"], at=run)
    with pytest.raises(ModelError, match="got none"):
        model.sensitivity([], at=run)
    with pytest.raises(SimulationError) as ended:
        model.simulate(max_wall=1e-9)
    with pytest.raises(ModelError, match="expected a whole run for at, got one that max_wall ended"):
        model.sensitivity(["P.position"], at=ended.value.partial)
    with pytest.raises(ModelError, match="expected 1 independent coordinate of spatial_four_bar"):
        symgen.build("spatial_four_bar").sensitivity(["frequencies"])
