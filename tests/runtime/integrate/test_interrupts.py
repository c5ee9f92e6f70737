"""Runs that Ctrl-C ends: the samples until then are those of the whole run."""

import numpy as np
import pytest
from shared.loop_scenes import freed
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import Interrupted
from symgen.runtime.integrate.pace import Pace


def pressed(*_):
    raise KeyboardInterrupt


def of_linkage():
    return "four_bar", symgen.build("four_bar")


def of_free_loop():
    return "", symgen.build(symgen.Scene(**freed("rssr", 0.3, 4.0, [5.0, 0.0, 0.0])))


@pytest.mark.parametrize("of", [of_linkage, of_free_loop])
def test_samples_before_an_interrupt_are_kept(of, tmp_path, monkeypatch):
    out, end, (scene, model) = tmp_path / "run.nc", 40.0, of()
    whole = model.simulate(end, samples=401)
    monkeypatch.setattr(Pace, "spent", pressed)
    with pytest.raises(Interrupted) as stopped:
        model.simulate(end, samples=401)
    partial = stopped.value.partial
    assert 1 < partial.count < whole.count
    for one, kept in zip(whole.variables, partial.variables, strict=True):
        assert np.array_equal(kept.values, one.values[: partial.count]), one.name
    if scene:
        options = ["--t-end", "40", "--samples", "401", "--out", str(out)]
        done = CliRunner().invoke(app, ["simulate", scene, *options])
        assert done.exit_code == 130 and "the samples that are kept are in" in done.output
        assert symgen.load_result(out).count == partial.count
