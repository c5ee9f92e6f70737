"""Error estimates of elastic runs, and their steps, against runs with much finer steps."""

from __future__ import annotations

import copy
from functools import cache

import numpy as np
import pytest
from shared.full import full

import symgen
from symgen.errors import SimulationError
from symgen.runtime.elastic import tolerance
from symgen.scene.loading import read_scene

SAMPLES = 91


def stresses(result):
    return {v.name: v.values for v in result.variables if v.name.endswith(".stress")}


@cache
def fine(scene):
    """Return a run with steps far shorter than those of any estimate."""
    return symgen.build(scene).simulate(steps=7200, samples=SAMPLES)


def error(found, exact):
    """Largest error of stresses over their peak."""
    pairs = [(stresses(found)[name], values) for name, values in stresses(exact).items()]
    return max(np.max(np.abs(a - b)) / np.max(np.abs(b)) for a, b in pairs if np.any(b))


@pytest.mark.parametrize(
    ("scene", "method", "tolerances"),
    [
        ("thesis_four_bar", "gauss", (1e-2, 1e-5, 1e-8)),
        ("thesis_four_bar", "gauss4", (1e-3,)),
        ("thesis_four_bar", "newmark", (1e-1,)),
        full("thesis_four_bar", "newmark", (1e-4,)),
        full("elastic_four_bar_free", "gauss", (1e-4,)),
        ("elastic_four_bar_motor", "gauss", (1e-2, 1e-6)),
        ("elastic_slider_crank", "gauss", (1e-3, 1e-8)),
    ],
)
def test_estimate_is_a_few_times_the_true_error(scene, method, tolerances):
    model = symgen.build(scene)
    exact = fine(scene)
    for rtol in tolerances:
        run = model.simulate(method=method, rtol=rtol, samples=SAMPLES)
        assert run.statistics["steps"] < 7200 or method != "gauss"
        estimate, true = run.statistics["error"], error(run, exact)
        assert estimate <= rtol
        assert 3 * true < estimate < 30 * true


@pytest.mark.parametrize("method", ["gauss", "gauss4", "newmark"])
def test_estimate_of_given_steps_is_a_few_times_the_true_error(method):
    model = symgen.build("thesis_four_bar")
    run = model.simulate(method=method, steps=1080, samples=SAMPLES)
    true = error(run, model.simulate(steps=3600, samples=SAMPLES))
    assert 3 * true < run.statistics["error"] < 30 * true


def test_given_steps_to_the_start_alone_have_no_error():
    assert symgen.build("thesis_four_bar").simulate(at=(0.0,), steps=400).statistics["error"] == 0.0


def test_the_most_steps_are_those_that_the_tolerance_adds(monkeypatch):
    """Steps that ``max_step`` or recorded times require are compared, however many they are."""
    model = symgen.build("thesis_four_bar")
    monkeypatch.setattr(tolerance, "MOST_STEPS", 512)
    run = model.simulate(rtol=1e-3, max_step=60 / 373 / 1080, samples=3)
    assert run.statistics["error"] <= 1e-3
    with pytest.raises(SimulationError, match="newmark .* with 512 steps .*\n  Take gauss"):
        model.simulate(method="newmark", samples=3)


@pytest.mark.parametrize("rtol", [full(1e-2), 1e-4, 1e-6])
def test_estimate_of_a_steady_state_is_a_few_times_the_true_error(rtol):
    model = symgen.build("thesis_four_bar")
    run = model.periodic(rtol=rtol, samples=SAMPLES)
    true = error(run, model.periodic(steps=1440, samples=SAMPLES))
    assert run.statistics["error"] <= rtol
    assert 3 * true < run.statistics["error"] < 30 * true


def damped():
    """Four-bar with a rigid crank at 150 rpm, other links of 4 elements with a damping ratio of 0.02."""
    data = copy.deepcopy(dict(read_scene("thesis_four_bar").data))
    data["parameters"]["speed"] = "150 rpm"
    del data["links"]["crank"]["elastic"]
    for link in ("coupler", "output"):
        data["links"][link]["elastic"] |= {"elements": 4, "damping": {"ratio": 0.02}}
    return symgen.build(symgen.Scene(**data))


def test_vibrations_that_decay_are_resolved_while_they_last():
    """Uniform steps need 7200 per revolution; here the first of the samples alone do."""
    part = {"revolutions": 0.25, "samples": SAMPLES}
    run, uniform = damped().simulate(**part), damped().simulate(steps=7200, **part)
    assert run.statistics["steps"] < 900
    assert uniform.statistics["steps"] == 1800
    assert error(run, uniform) < run.statistics["error"] <= 1e-4
