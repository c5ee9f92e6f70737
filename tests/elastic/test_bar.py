"""One clamped bar: errors of its elements, loads between nodes, peaks, damping ratios, power, what runs report."""

from __future__ import annotations

import re

import numpy as np
import pytest
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import SceneError

BAR = """
symgen = 1
title = "a bar"
gravity.acceleration = ["0 m/s^2", "{gravity} m/s^2"]
{head}

[points]
O = {{ at = ["0 m", "0 m"], ground = true }}
tip = {{ at = ["1 m", "0 m"] }}
{points}

[links.bar]
points = ["O", "tip"]
density = "7850 kg/m^3"
section = {{ width = "20 mm", thickness = "20 mm" }}
elastic = {{ E = "{modulus}"{elastic} }}

[crank]
link = "bar"
speed = "{speed} rad/s"
angle = "{angle} deg"

[[stations]]
link = "bar"
at = {at}
name = "here"
{more}
"""


BAR_E, BAR_RHO, BAR_AREA, BAR_H = 210e9, 7850.0, 4e-4, 0.01


BAR_I = 0.02**4 / 12


def bar(tmp_path, **given):
    """A bar of 1 m clamped to a shaft."""
    usual = {"gravity": 0, "head": "", "points": "", "modulus": "210 GPa", "elastic": "", "speed": 0}
    scene = tmp_path / "bar.toml"
    scene.write_text(BAR.format(**{**usual, "angle": 0, "at": 0, "more": "", **given}))
    return symgen.build(str(scene))


def test_the_error_of_the_elements_is_reported_and_chooses_their_number(tmp_path):
    """A turning bar: the axial strain at its root is rho w^2 L^2 / 2E; one element of linear stretch has a third less."""
    exact = BAR_RHO * 100.0**2 / 2 / BAR_E
    one = bar(tmp_path, speed=100, elastic=", elements = 1").quasi_static(samples=3)
    off = 1 - one["here.axial_strain"][0] / exact
    assert off == pytest.approx(1 / 3, rel=1e-3)
    estimate = one.summary()["statistics"]["mesh_error"]
    assert 0.5 * off < estimate < 2 * off
    assert f"{estimate:.1e} by elements" in one.headline
    default = bar(tmp_path, speed=100).quasi_static(samples=3)
    assert abs(1 - default["here.axial_strain"][0] / exact) < 0.01
    assert default.summary()["statistics"]["mesh_error"] < 0.01


def test_loads_on_points_of_a_link_act_at_nodes(tmp_path):
    """A force F at 0.3 m from the clamp: the strain at the clamp is 0.3 F h / E I, and none is beyond the force."""
    model = bar(
        tmp_path,
        points='mid = { on = "bar", fraction = 0.3 }',
        more='[[stations]]\nlink = "bar"\nat = 0.6\nname = "beyond"\n\n'
        '[[forces]]\npoint = "mid"\nforce = ["0 N", "-50 N"]\n',
        head='[analysis]\nt_end = "1 s"',
    )
    found = model.quasi_static(samples=3)
    exact = 50 * 0.3 * BAR_H / (BAR_E * BAR_I)
    assert abs(found["here.bending_strain"][0]) == pytest.approx(exact, rel=1e-9)
    assert np.max(np.abs(found["beyond.bending_strain"])) < 1e-9 * exact


def test_peaks_are_refined_between_samples(tmp_path):
    """The weight of a slowly turning bar bends it by a sine of its angle, whose peak lies between two samples."""
    model = bar(tmp_path, gravity=-9.81, speed=0.1, angle=105, elastic=", elements = 2")
    found = model.quasi_static(samples=13)
    exact = BAR_RHO * BAR_AREA * 9.81 / 2 * BAR_H / (BAR_E * BAR_I)
    assert np.max(np.abs(found["here.bending_strain"])) < 0.967 * exact
    assert found.peaks["here.bending_strain"] == pytest.approx(exact, rel=3e-3)


def test_effective_damping_ratios_are_printed(tmp_path):
    """A clamped bar whose free modes have 2 %: phi^T C phi / 2w with modes in closed form, integrated here."""
    model = bar(tmp_path, elastic=", elements = 4, damping = { ratio = 0.02 }")
    x = np.linspace(0.0, 1.0, 20001)

    def integral(values):
        return np.sum((values[1:] + values[:-1]) / 2) * (x[1] - x[0])

    b, s = 1.875104068711961, 0.7340955137589128
    clamped = np.cosh(b * x) - np.cos(b * x) - s * (np.sinh(b * x) - np.sin(b * x))
    clamped /= np.sqrt(integral(clamped**2))
    # C = sum of M phi (2 zeta w) phi^T M over the elastic modes phi of the free bar.
    roots = [4.730040744862704, 7.853204624095838] + [(2 * n + 1) * np.pi / 2 for n in range(3, 7)]
    damping = 0.0
    for r in roots:
        k = (np.cosh(r) - np.cos(r)) / (np.sinh(r) - np.sin(r))
        grown = (1 - k) / 2 * np.exp(r * x) + (1 + k) / 2 * np.exp(-r * x)  # cosh - k sinh
        free = grown + np.cos(r * x) - k * np.sin(r * x)
        free /= np.sqrt(integral(free**2))
        damping += 0.04 * r**2 * integral(free * clamped) ** 2
    found = model.modes()
    expected = damping / (2 * b**2)
    assert found.ratios[0] == pytest.approx(expected, rel=0.01)
    assert found.ratios[0] < 0.02
    scene = str(tmp_path / "bar.toml")
    shown = CliRunner().invoke(app, ["modes", scene])
    assert "damping ratio" in shown.stdout and f"{found.ratios[0]:.3g}" in shown.stdout
    ran = CliRunner().invoke(app, ["quasi-static", scene, "--samples", "3"])
    assert re.search(rf"damping ratios +{found.ratios[0]:.2g}", ran.stdout)


def test_mean_power_of_the_shaft_is_compared_with_dissipation():
    """A slow crank in gravity with C = b K: mean power b w^2 (q^2 L^5 / 40 E I + q^2 L^3 / 6 E A), q = rho A g."""
    density, modulus, length, width, height, damping, speed = 7850.0, 2.06e11, 0.3, 0.02, 0.005, 1e-3, 3.0
    damped = {"E": f"{modulus} Pa", "elements": 2, "damping": {"stiffness": f"{damping} s"}, "axial": True}
    scene = symgen.Scene(
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": [f"{length} m", "0 m"]}},
        links={
            "crank": {
                "points": ["O", "A"],
                "density": f"{density} kg/m^3",
                "section": {"width": f"{width} m", "thickness": f"{height} m"},
                "elastic": damped,
            }
        },
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        crank={"link": "crank", "speed": f"{speed} rad/s"},
    )
    model = symgen.build(scene)
    area, load = width * height, density * width * height * 9.81
    energy = load**2 * length**5 / (40 * modulus * area * height**2 / 12) + load**2 * length**3 / (
        6 * modulus * area
    )
    result = model.periodic(steps=2048)
    expected = damping * speed**2 * energy
    assert result.statistics["mean_powers_w"] == pytest.approx([expected, expected], rel=2e-3)
    assert result.summary()["statistics"]["mean_powers_w"] == result.statistics["mean_powers_w"]
    # From too few samples, which the power of gravity fills, no mean is taken.
    assert model.periodic(steps=2048, samples=4).statistics["mean_powers_w"] == []
    assert 0.0 < result.statistics["second_order"]["crank"] < 1e-2


def test_steps_outputs_and_cranks_are_reported(tmp_path):
    """Steps beyond those requested are named, the scene's outputs are selected, a guided crank is in [crank]."""
    model = symgen.build("elastic_slider_crank")
    assert any("7 steps per revolution were requested" in note for note in model.simulate(steps=7).notes)
    found = bar(
        tmp_path, speed=1, head='[analysis]\noutputs = ["here.stress", "tip.position"]'
    ).quasi_static()
    assert [v.name for v in found.variables] == ["here.stress", "tip.position"]
    with pytest.raises(SceneError, match="tip.velocity"):
        bar(tmp_path, speed=1, head='[analysis]\noutputs = ["tip.velocity"]').quasi_static()
    with pytest.raises(SceneError) as refused:
        bar(
            tmp_path,
            speed=1,
            points='R = { at = ["2 m", "0 m"], ground = true }',
            more='[[guides]]\npoints = ["tip"]\nalong = "rail"\n\n[links.rail]\npoints = ["O", "R"]\n',
        )
    assert "crank" in str(refused.value) and "drivers" not in str(refused.value)
