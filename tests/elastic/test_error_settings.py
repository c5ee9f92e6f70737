"""Error estimates of runs of elastic links in random settings, against runs with finer steps and elements."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from shared.full import full

import symgen
from symgen.scene.loading import read_scene

SCENES = ("thesis_four_bar", "elastic_slider_crank", "rotating_cantilever", "elastic_four_bar_motor")
#: Elements of the reference over those of a setting, and its steps.
FINER, SHORTER = 4, 3
#: Errors below it are round-off.
ROUND_OFF = 1e-11
SEEDS = range(100, 150)
#: Those that take a second or two each.
QUICK = (104, 117)
#: In 404 halved elements need more steps than the run.
LARGE, QUICK_LARGE = range(400, 420), (401, 404)


def drawn(seed):
    """Scene, number of elements, whether a steady state is sought, and options of the run."""
    draw = np.random.default_rng(seed)
    data = copy.deepcopy(dict(read_scene(SCENES[draw.integers(len(SCENES))]).data))
    element, elements = str(draw.choice(["beam8", "cubic", "beam9", "rayleigh"])), int(draw.integers(1, 4))
    damping = {"stiffness": f"{10 ** draw.uniform(-6, -4):.3e} s"} if draw.random() < 0.7 else {}
    data.pop("modal_damping", None)
    for link in (link for link in data["links"].values() if "elastic" in link):
        for key in ("reduction", "shear"):
            link["elastic"].pop(key, None)
        link["elastic"] |= {"element": element, "elements": elements, "damping": damping}
    method = str(draw.choice(["gauss", "gauss4"], p=[0.7, 0.3]))
    revolutions, steady = float(draw.choice([0.125, 0.25])), draw.random() < 0.3
    rtol, factor = 10 ** -draw.uniform(2, 5), draw.uniform(0.6, 1.3)
    value, unit = data["parameters"]["speed"]["value"].split()
    data["parameters"]["speed"]["value"] = f"{float(value) * factor:.6g} {unit}"
    return data, elements, steady, {"rtol": rtol}, {"method": method, "revolutions": revolutions}


def built(data, elements):
    for link in data["links"].values():
        if "elastic" in link:
            link["elastic"]["elements"] = elements
    return symgen.build(symgen.Scene(**data))


def difference(found, exact):
    """Largest difference of stresses at any time over their peak at the station."""
    pairs = [(found[v.name].values, v.values) for v in exact.variables if v.name.endswith(".stress")]
    return max(np.max(np.abs(a - b)) / np.max(np.abs(b)) for a, b in pairs if np.any(b))


@pytest.mark.parametrize("seed", [k if k in QUICK else full(k) for k in SEEDS])
def test_estimates_are_near_the_true_errors(seed):
    data, elements, steady, tolerance, options = drawn(seed)
    model = built(data, elements)
    if steady:
        run = model.periodic(samples=46, **tolerance)
        steps = {"steps": SHORTER * run.statistics["steps"], "samples": 46}
        fine, finer = model.periodic(**steps), built(data, FINER * elements).periodic(**steps)
    else:
        run = model.simulate(samples=46, **tolerance, **options)
        part = options["revolutions"]
        # References have order 12: a third of the steps of order 4 is fine.
        more = SHORTER if options["method"] == "gauss" else 1 / SHORTER
        steps = {"steps": int(more * run.statistics["steps"] / part), "revolutions": part, "samples": 46}
        fine, finer = model.simulate(**steps), built(data, FINER * elements).simulate(**steps)
    by_steps, by_elements = difference(run, fine), difference(fine, finer)
    if by_steps > ROUND_OFF:
        assert 0.3 < run.statistics["error"] / by_steps < 30
    assert 0.3 < run.mesh_error / by_elements < 30


@pytest.mark.parametrize(
    "options", [{"method": "dop853", "rtol": 1e-4}, {"method": "rk4", "steps": 30_000}], ids=str
)
@pytest.mark.parametrize("scene", ["elastic_slider_crank", full("thesis_four_bar"), full("elastic_four_bar")])
def test_estimates_of_explicit_methods_are_near_the_true_errors(scene, options):
    model, part = symgen.build(scene), {"revolutions": 0.125, "samples": 46}
    run = model.simulate(**options, **part)
    by_steps = difference(run, model.simulate(rtol=1e-9, **part))
    assert 0.8 < run.statistics["error"] / by_steps < 1.2


@pytest.mark.parametrize("seed", [k if k in QUICK_LARGE else full(k) for k in LARGE])
def test_estimates_in_large_rotation_are_near_the_true_errors(seed):
    data, elements, _, tolerance, options = drawn(seed)
    model = built(data, elements)
    part = {"revolutions": options["revolutions"], "samples": 46}
    run = model.large_rotation(elements=elements, **part, **tolerance)
    shorter = {"rtol": 0.9, "max_step": run.times[-1] / (SHORTER * run.statistics["steps"])}
    fine, finer = (model.large_rotation(elements=k * elements, **part, **shorter) for k in (1, FINER))
    assert 0.5 < run.statistics["error"] / difference(run, fine) < 1.5
    assert 0.5 < run.mesh_error / difference(fine, finer) < 1.5


def test_error_estimates_cover_axial_vibrations_that_steps_do_not_resolve():
    """The cantilever from rest with two runs alone: the estimate is no less than the error against fine steps."""
    model = symgen.build("rotating_cantilever")
    coarse = model.simulate(steps=360, samples=61)
    fine = model.simulate(steps=11520, samples=61)
    error = np.max(np.abs(coarse["root.stress"] - fine["root.stress"])) / np.max(np.abs(fine["root.stress"]))
    assert error > 0.1
    assert coarse.statistics["error"] > 0.9 * error
