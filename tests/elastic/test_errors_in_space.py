"""Error estimates of links in space in random settings, against runs with finer steps and elements."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from shared.full import full

import symgen
from symgen.runtime.beams.methods import GAUSS8
from symgen.runtime.elastic.large.collocation import SystemRun
from symgen.runtime.elastic.space.linkage import LinkageInSpace
from symgen.runtime.elastic.space.model import outputs
from symgen.scene.loading import read_scene

#: Elements of the reference over those of a setting, and its steps.
FINER, SHORTER = 8, 4
SEEDS = range(400, 420)
#: Those that take half a second each.
QUICK = (400, 401)


def drawn(seed):
    """Scene with its elements, speed and samples; duration in revolutions and tolerance."""
    draw = np.random.default_rng(seed)
    data = copy.deepcopy(dict(read_scene(draw.choice(["spatial_slider_crank", "spatial_four_bar"])).data))
    elements = int(draw.integers(1, 6))
    for link in (link for link in data["links"].values() if "elastic" in link):
        link["elastic"] |= {"elements": elements}
    speed = float(data["parameters"]["rate"]["value"].split()[0]) * draw.uniform(0.4, 2.0)
    data["parameters"]["rate"]["value"] = f"{speed} rad/s"
    return data, draw.uniform(0.05, 0.4) * 2 * np.pi / speed, 10 ** draw.uniform(-5, -1.5)


def stresses(linkage, times, steps):
    found = SystemRun(linkage, GAUSS8, times, steps).run().moments()
    return np.array([v.values for v in outputs(linkage, found) if v.name.endswith(".stress")])


def largest(one, other):
    """Return the largest difference of stresses over the peak of their station."""
    return np.max(np.max(np.abs(one - other), axis=1) / np.max(np.abs(other), axis=1))


@pytest.mark.parametrize("seed", [k if k in QUICK else full(k) for k in SEEDS])
def test_estimates_in_space_are_near_the_true_errors(seed):
    data, end, rtol = drawn(seed)
    model = symgen.build(symgen.Scene(**data))
    run = model.simulate(end, rtol=rtol, samples=31)
    times, steps = np.linspace(0.0, end, 31), run.statistics["steps"] // 30
    own = stresses(LinkageInSpace(model.rigid), times, steps)
    by_steps = largest(own, stresses(LinkageInSpace(model.rigid), times, SHORTER * steps))
    by_elements = largest(own, stresses(LinkageInSpace(model.rigid, divided=FINER), times, steps))
    assert 0.5 < run.statistics["error"] / by_steps < 1.5
    assert 0.5 < run.mesh_error / by_elements < 1.5
