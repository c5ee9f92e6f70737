"""Steady states over the crank speed: results, files and errors."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from scipy.optimize import brentq
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import ModelError, SimulationError, SlowRunWarning, SymgenError
from symgen.runtime.integrate import pace
from symgen.scene.loading import read_scene

RPM = math.pi / 30


@pytest.fixture(scope="module")
def model():
    return symgen.build("thesis_four_bar")


@pytest.fixture(scope="module")
def swept(model):
    return model.speed_response([s * RPM for s in (150, 160, 170)], samples=91)


def test_each_speed_is_the_periodic_run_there(model, swept):
    alone = model.with_parameters(speed=160 * RPM).periodic(samples=91)
    for name, peak in alone.peaks.items():
        assert swept.variable(name).values[1] == pytest.approx(peak, rel=1e-12)
    assert swept.variable("floquet").values[1] == pytest.approx(abs(alone.floquet[0]), rel=1e-12)


def test_resonance_and_instability(model, swept):
    """A third of the lowest frequency of the held crank's structure, some 8 to 23 Hz over the turn."""
    assert swept.resonances == pytest.approx((160.0 * RPM,))
    assert 160.0 * RPM in [pytest.approx(s) for s in swept.unstable]
    lowest = min(model.modes(math.radians(a)).frequencies[0] for a in range(0, 360, 15))
    assert swept.first_critical == pytest.approx(2 * math.pi * lowest, rel=1e-12)


def test_a_long_response_announces_its_remaining_time(model, monkeypatch):
    monkeypatch.setattr(pace, "SPAN", 0.0)
    monkeypatch.setattr(pace, "LONG", 1e-9)
    with pytest.warns(SlowRunWarning, match=r"1 of 2 crank speeds after .* s: about .* remain at this pace"):
        model.speed_response([400 * RPM, 500 * RPM], samples=8, rtol=0.5)


def test_saved_and_read_back(swept, tmp_path):
    swept.save(tmp_path / "sweep.nc")
    again = symgen.load_result(tmp_path / "sweep.nc")
    assert type(again) is type(swept)
    assert again.summary() == swept.summary()
    again.plot("crank", file=tmp_path / "sweep.png")
    assert (tmp_path / "sweep.png").stat().st_size > 1000


def test_command_line(tmp_path):
    quick = ["--rtol", "1e-2", "--samples", "11"]
    done = CliRunner().invoke(
        app, ["speed-response", "elastic_slider_crank", *quick, "--speeds", "60:90:2", "--json"]
    )
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    ends = {"first": 60 * RPM, "last": 90 * RPM}
    assert found["coordinate"] == pytest.approx({"name": "speed", "unit": "rad/s", "count": 2, **ends})
    assert all(np.isfinite(v["maximum"]) for v in found["outputs"].values())
    assert found["statistics"]["error"] <= 1e-2
    shown = CliRunner().invoke(app, ["speed-response", "elastic_slider_crank", *quick, "--speeds", "60,90"])
    assert "first critical speed" in shown.output


def test_speed_that_no_parameter_sets():
    data = read_scene("rotating_cantilever").data
    data["parameters"]["speed"]["tunable"] = False
    with pytest.raises(ModelError, match="no tunable parameter that the speed of the crank"):
        symgen.build(symgen.Scene(**data)).speed_response([60 * RPM])


@pytest.mark.parametrize(
    ("scene", "speeds", "said"),
    [
        ("four_bar", "60,90", "no elastic links"),
        ("thesis_four_bar", "60:90", "from, to, count"),
        ("thesis_four_bar", "60:90:1", "from, to, count"),
        ("thesis_four_bar", "0,90", "none of them zero"),
        ("thesis_four_bar", "nan", "none of them zero"),
    ],
)
def test_refused(scene, speeds, said):
    done = CliRunner().invoke(app, ["speed-response", scene, "--speeds", speeds])
    assert isinstance(done.exception, SymgenError), done.output
    assert said in str(done.exception)


def test_a_vibration_that_repeats_after_each_turn_leaves_no_single_steady_state():
    model = symgen.build("rotating_cantilever")

    def misfit(speed):
        changed = model.with_parameters(speed=speed)
        return changed.modes(moving=True).frequencies[0] * 2 * math.pi / speed - 2

    resonant = brentq(misfit, 0.8 * model.crank_speed, 1.2 * model.crank_speed, xtol=1e-14, rtol=1e-14)
    with pytest.raises(SimulationError, match="no unique steady state"):
        model.with_parameters(speed=resonant).periodic(steps=256)
    model.with_parameters(speed=1.01 * resonant).periodic(steps=256)
