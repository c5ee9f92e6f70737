"""Dry friction and pulses as scenes write them: quotients, smooth functions, messages with the remedy."""

from __future__ import annotations

import math
import re
import time
from pathlib import Path

import numpy as np
import pytest

import symgen
from symgen.errors import SimulationError

CASES = Path(__file__).parents[2] / "cases"


def test_messages_on_jumps_are_in_the_words_of_the_scene(tmp_path, entry):
    """A body at rest under friction is refused with the smooth function in full, which then runs."""
    friction = """
symgen = 1
[parameters]
c = "9 N*m"
[points]
O = { at = ["0 m", "0 m"], ground = true }
A = { at = ["0.3 m", "0 m"] }
[links]
rod = { points = ["O", "A"], mass = "1 kg" }
[[torques]]
link = "rod"
torque = "-c*sign(this.rate)"
[gravity]
acceleration = ["0 m/s^2", "-9.81 m/s^2"]
"""
    scene = tmp_path / "friction.toml"
    scene.write_text(friction)
    model = symgen.build(scene, backend="numpy")
    assert model.parameters == {}
    with pytest.raises(SimulationError) as caught:
        model.simulate(0.2)
    said = str(caught.value)
    assert "jump of sign(this.rate) in [[torques]] no. 1" in said
    smooth, width = re.search(
        r"Write (\S+) instead of sign\(this\.rate\), .*: (w = \S+ \S+)\. Run", said
    ).groups()
    scene.write_text(friction.replace("sign(this.rate)", smooth).replace("[points]", f"{width}\n[points]"))
    crept = symgen.build(scene, backend="numpy").simulate(0.2, method="radau5")
    # It creeps at the rate at which friction carries the weight: tanh(rate/w) = weight's moment / c.
    rate = -1e-3 * math.atanh(9.81 * 0.15 / 9.0)
    assert crept.final["A"]["velocity"][1] == pytest.approx(0.3 * rate, rel=1e-3)
    scene.write_text(friction.replace("9 N*m", "0.1 N*m"))
    run = symgen.build(scene, backend="numpy").simulate(1.5)
    assert run.provenance["parameters"] == {}
    assert entry("run", scene, "--t-end", "1.5", "--backend", "numpy")[1].count(
        "sign(this.rate) in [[torques]] no. 1"
    )


@pytest.mark.parametrize(
    ("pulse", "area"),
    [
        ("F*exp(-((t - t1)/w)**2)", math.sqrt(math.pi)),
        ("F/cosh((t - t1)/w)", math.pi),
        ("F/(1 + ((t - t1)/w)**2)", 2 * math.atan(0.5 / 1e-4)),
    ],
)
def test_smooth_pulses_shorter_than_a_step_are_not_missed(tmp_path, pulse, area):
    """A mass of 2 kg on a rail takes the impulse of a force of 100 N and 0.1 ms."""
    scene = tmp_path / "pulse.toml"
    scene.write_text(f"""
symgen = 1
[parameters]
F = "100 N"
t1 = "0.5 s"
w = "1e-4 s"
[points]
O = {{ at = ["0 m", "0 m"], ground = true }}
G = {{ at = ["1 m", "0 m"], ground = true }}
A = {{ at = ["0.5 m", "0 m"] }}
[links]
rail = {{ points = ["O", "G"], mass = "0 kg" }}
[[guides]]
points = ["A"]
along = "rail"
[[masses]]
point = "A"
mass = "2 kg"
[[forces]]
point = "A"
force = ["{pulse}", "0 N"]
""")
    model = symgen.build(scene, backend="numpy")
    for options in ({}, {"method": "dopri5"}, {"method": "radau5"}):
        run = model.simulate(1.0, **options)
        assert run.final["A"]["velocity"][0] == pytest.approx(100.0 * 1e-4 * area / 2.0, rel=1e-8)
        assert run.statistics["steps"] < 2000
    periodic = scene.read_text().replace(pulse, "F*cos(t/w)").replace("1e-4 s", "1 s")
    scene.write_text(periodic)
    assert not any("switching" in note for note in symgen.build(scene, backend="numpy").simulate(1.0).notes)


def test_friction_that_sticks_is_refused_early_with_the_smooth_alternative(tmp_path):
    """The mass is at rest at t = 1/3 s and x = 1/6 m; smooth friction of a width of 1e-6 m/s is run by radau5."""
    model, compiled = (symgen.build(CASES / "friction.toml", backend=b) for b in ("numpy", "c"))
    runs = [(model, options) for options in ({}, {"method": "dopri5"}, {"step": 1e-3})]
    for model, options in [*runs, (compiled, {"method": "taylor"})]:
        begun = time.perf_counter()
        with pytest.raises(
            SimulationError, match=r"stays at the jump of abs\(A\.vx.*\n.*tanh\(\(A\.vx.*\)/w\)"
        ) as error:
            model.simulate(1.0, **options)
        assert time.perf_counter() - begun < 5.0
        assert error.value.time == pytest.approx(1 / 3, abs=0.01)
        assert error.value.partial.final["A"]["position"][0] == pytest.approx(1 / 6, abs=1e-6)
    text = (CASES / "friction.toml").read_text().replace("A.vx/abs(A.vx+e)", "tanh(A.vx/e)")
    (tmp_path / "smooth.toml").write_text(text.replace("1e-9", "1e-6"))
    run = symgen.build(tmp_path / "smooth.toml").simulate(1.0, method="radau5")
    assert run.final["A"]["position"][0] == pytest.approx(1 / 6, abs=1e-6)


def sliding(tmp_path, force, mass="2 kg"):
    """Build a mass on a guide along x, at rest at 0.5 m, under this force."""
    text = (CASES / "sliding_mass.toml").read_text().replace("-k*A.x - F*sign(A.vx)", force)
    (tmp_path / "slide.toml").write_text(text.replace("2 kg", mass))
    return symgen.build(tmp_path / "slide.toml", backend="numpy")


def test_friction_written_as_a_quotient_is_exact_between_its_reversals(tmp_path):
    """50 N/m, 2 kg, 3 N: half swings of pi/5 s about 0.06 and -0.06 m in turn; reversals at -0.38, 0.26, -0.14 m."""
    model = sliding(tmp_path, "-k*A.x - F*A.vx/abs(A.vx)")
    expected = 0.06 + 0.2 * np.cos(5 * 1.5 - 2 * np.pi)  # of the third half swing
    for options, tolerance in (({"rtol": 1e-10}, 1e-8), ({"step": 2e-3}, 1e-8)):
        run = model.simulate(1.5, state=model.state({"A": [0.5, 0]}, {"A": [-1e-300, 0]}), **options)
        assert run.final["A"]["position"][0] == pytest.approx(expected, abs=tolerance)
        assert run.statistics["steps"] < 1000
