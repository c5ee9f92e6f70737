"""Balance of powers of elastic links in space, against energies that are differentiated over the run."""

from __future__ import annotations

import copy
from functools import cache

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from shared.commands import call
from shared.shipped import IN_SPACE

import symgen
from symgen.errors import SceneError
from symgen.runtime.beams.methods import gauss
from symgen.runtime.elastic.large.collocation import SystemRun
from symgen.runtime.elastic.large.passes import drift_of
from symgen.runtime.elastic.space.linkage import LinkageInSpace
from symgen.scene.loading import override, read_scene

#: Mode whose frequency is that of the revolutions, and revolutions; the speed of the scene is far below.
RATES = {"of the scene": (None, 0.005), "first resonance": (0, 0.1), "second resonance": (1, 0.1)}
ENERGIES = ("kinetic", "strain", "potential")
#: Error that corrections leave, far below that of the steps.
CLOSE = 1e-14


@cache
def modes(scene):
    return symgen.build(scene).modes().frequencies


def at_rate(scene, rate):
    """Return the model with its duration."""
    model = symgen.build(scene)
    mode, revolutions = RATES[rate]
    if mode is not None:
        model = model.with_parameters(rate=2 * np.pi * float(modes(scene)[mode]))
    return model, revolutions * 2 * np.pi / model.parameters["rate"]


def derivative(t, values):
    return make_interp_spline(t, values, k=7).derivative()(t)


def imbalance(run):
    """Return the largest error of the balance, that of its differences, and the largest power [W].

    Differences at twice the interval have 2^7 times the error of splines of degree seven, where they converge;
    a sixteenth of the change is a bound.
    """
    t, energy = run.time, sum(run[f"{name}_energy"].values for name in ENERGIES)
    inner = slice(16, -16)
    rate, coarse = derivative(t, energy), derivative(t[::2], energy[::2])
    power, lost = run["input_power"].values, run["dissipated_power"].values
    largest = max(np.max(np.abs(x)) for x in (rate, power, lost))
    of_differences = np.max(np.abs(rate[::2] - coarse)[8:-8])
    return np.max(np.abs(power - lost - rate)[inner]), of_differences / 16, largest


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("scene", IN_SPACE)
def test_imbalance_of_powers_in_space_is_as_reported(scene, rate):
    """Input power = dissipated power + rate of the energies, within the reported error and that of differences."""
    model, end = at_rate(scene, rate)
    run = model.simulate(end, samples=121, rtol=0.5)
    error, of_differences, largest = imbalance(run)
    reported = run.statistics["power_balance"]
    assert reported < 5e-7
    assert of_differences < 1e-6 * largest
    assert error < 3 * reported * largest + of_differences
    assert np.all(run["dissipated_power"].values >= 0.0)
    power = run["input_power"].values
    # The drive alone; its torque is that of the multipliers and of the joints on the crank.
    assert np.max(np.abs(power - run["crank.power"].values)) < 1e-12 * np.max(np.abs(power))
    assert run.drift.energy < 1e-6 * run.drift.energy_exchanged


@pytest.mark.parametrize(("stages", "counts"), [(2, (4, 8)), (4, (1, 2))])
@pytest.mark.parametrize("scene", IN_SPACE)
def test_order_of_steps_in_space_is_twice_the_number_of_stages(scene, stages, counts):
    """Errors of positions and rates, and the imbalance of energies, by halved steps."""
    model, _ = at_rate(scene, "second resonance")
    # Coarse elements have no vibrations that such steps do not resolve.
    linkage, end = LinkageInSpace(model.rigid, elements=1), 0.1 * 2 * np.pi / model.parameters["rate"]
    times = np.linspace(0.0, end, 6)

    def run(stages, steps):
        found = SystemRun(linkage, gauss("", stages), times, steps, close=CLOSE).run().moments()
        return found[-1].q, found[-1].v, drift_of(linkage, found)[1]

    q, v, _ = run(4, 8)
    runs = [run(stages, steps) for steps in counts]
    errors = np.array([[np.max(np.abs(of[0] - q)), np.max(np.abs(of[1] - v)), of[2]] for of in runs])
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * stages, abs=stages / 4)


@cache
def loaded():
    """A heavy rigid arm on the moving pin carries the elastic rod; a damper, a force over time, and gravity."""
    data = copy.deepcopy(dict(read_scene("spatial_slider_crank").data))
    data["parameters"] |= {"f": "30 N"}
    motion = ["r*sin(rate*t)/sqrt(2)", "r*cos(rate*t) - r", "r*sin(rate*t)/sqrt(2)"]
    data["points"]["A"] |= {"ground": True, "motion": motion}
    data["points"]["Q"] = {"at": ["100 mm", "r", "20 mm"]}
    data["links"]["arm"] = {"points": ["A", "Q"], "mass": "0.5 kg"}
    data["links"]["rod"] |= {"points": ["Q", "P"]}
    for key in ("joints", "drivers"):
        del data[key]
    spring = {"between": ["O", "P"], "stiffness": "100 N/m", "length": "0.2 m", "damping": "20 N*s/m"}
    more = {
        "springs": [spring],
        "forces": [{"point": "Q", "force": ["f*sin(rate*t)", "0 N", "10 N"]}],
        "gravity": {"acceleration": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]},
    }
    model = symgen.build(symgen.Scene(**data | more)).with_parameters(rate=200.0)
    return model.simulate(2e-3, samples=241, rtol=0.5)


def test_power_of_loads_and_of_inertia_at_moving_ground():
    run = loaded()
    error, of_differences, largest = imbalance(run)
    reported = run.statistics["power_balance"]
    assert reported < 1e-8
    assert of_differences < 1e-6 * largest
    assert error < 3 * reported * largest + of_differences


def test_power_at_a_pin_is_that_of_its_reaction():
    """The arm is a rigid rod: its momentum changes by forces at both ends and its weight."""
    run = loaded()
    t, inner, gravity = run.time, slice(8, -8), np.array([0.0, 0.0, -9.81])
    pin, far, slider = (run[f"{p}.position"].values for p in "AQP")
    pin_rate, far_rate, slider_rate = (derivative(t, x) for x in (pin, far, slider))
    pin_rise, far_rise = (derivative(t, x) for x in (pin_rate, far_rate))
    weight = 0.5 * (pin_rise + far_rise) / 2 - 0.5 * gravity
    force = np.stack([30 * np.sin(200 * t), 0 * t, 0 * t + 10], axis=1)
    reaction = weight - (force - run["rod.Q.force"].values)
    damping = 20 * slider_rate[:, 0] ** 2
    expected = np.sum(reaction * pin_rate, axis=1) + np.sum(force * far_rate, axis=1) - damping
    power = run["input_power"].values
    assert np.max(np.abs(power - expected)[inner]) < 1e-5 * np.max(np.abs(power))


def test_a_run_prints_its_balance():
    printed = call("run", "spatial_slider_crank", "--t-end", "1e-3", "--samples", "11")
    assert "power balance" in printed and "of the largest power" in printed


def test_a_scene_selects_any_output_of_a_run_and_no_other():
    scene = read_scene("spatial_four_bar")
    whole = symgen.build(scene).simulate(1e-3, samples=3)
    names = [v.name for v in whole.variables][::-1]
    assert {"input_power", "crank.power", "rocker.D.moment", "coupler.stress_4"} < {*names}
    run = symgen.build(override(scene, {"analysis.outputs": names})).simulate(1e-3, samples=3)
    assert [v.name for v in run.variables] == names
    for name in names:
        assert np.array_equal(run[name].values, whole[name].values)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("nothing", r"outputs\[0\]: there is no output 'nothing'\n  Known: .*input_power.*moment_y"),
        ("rocker.D.momnt", "Did you mean 'moment'"),
        ("rocker.frequencies", r"are in modes\(\)"),
        ("energy", r"no output 'energy'\. Did you mean 'strain_energy'"),
        ("C.velocity", r"no output 'C\.velocity'\. The nearest of \d+ names are "),
    ],
)
def test_refused_outputs(name, words):
    with pytest.raises(SceneError, match=words):
        symgen.build(override(read_scene("spatial_four_bar"), {"analysis.outputs": [name]})).simulate(
            1e-3, samples=3
        )
