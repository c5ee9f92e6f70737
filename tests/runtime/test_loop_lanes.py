"""Driven loops in SIMD lanes: bits of single ones, a closed form, dead centres, failures."""

from __future__ import annotations

import numpy as np
import pytest

import symgen
from symgen.runtime.many.compiled import compiled_runs
from symgen.runtime.many.dataset import Keep
from symgen.toolchain import compiler

pytestmark = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")

INCH = 0.0254
OUTPUTS = ["theta1.drive", "S4", "S4.acceleration", "S4.drive", "crank.joint2.force"]
#: Offsets of the slider's line, and one that is out of reach.
OFFSETS, BEYOND = np.linspace(0.0, 0.3, 10), 3.0


@pytest.fixture(scope="module")
def loop():
    changed = {"S1": "3.5 in", "loop.drives.theta1": "100 lbf*in", "loop.drives.S4": "?"}
    return symgen.build("slider_crank", set={**changed, "analysis.outputs": OUTPUTS})


def single_runs(model, analysis, offsets, **arguments):
    return [getattr(model.with_parameters(a4=a4), analysis)(**arguments) for a4 in offsets]


@pytest.mark.parametrize(
    ("analysis", "arguments"),
    [
        ("inverse_dynamics", {"start": 0.3, "stop": 1.3, "samples": 9}),
        ("inverse_dynamics", {"start": -1.0, "stop": 3.0, "samples": 5}),  # with a dead centre
        ("kinematics", {"over": "time", "samples": 4}),
    ],
)
def test_loops_in_lanes_have_the_bits_of_single_ones(loop, analysis, arguments):
    found = getattr(loop, f"{analysis}_many")({"a4": OFFSETS}, **arguments)
    for i, alone in enumerate(single_runs(loop, analysis, OFFSETS, **arguments)):
        for v in alone.variables:
            assert np.array_equal(found[v.name].values[i], v.values, equal_nan=True), (i, v.name)
        times = found["time"].values
        assert np.array_equal(times if times.ndim == 1 else times[i], alone.time)
        assert found["constraint_drift"].values[i] == alone.drift.constraint
    assert not any(found["error"].values)


def test_a_loop_that_does_not_close_is_an_entry(loop):
    found = loop.kinematics_many({"a4": [0.1, BEYOND, 0.2]}, at=1.0)
    assert [bool(error) for error in found["error"].values] == [False, True, False]
    assert "cannot be assembled" in found["error"].values[1] and np.isnan(found["S4"].values[1]).all()


def test_the_offset_slider_stays_at_the_end_of_its_rod_in_lanes(loop):
    arguments = {"start": 0.3, "stop": 1.3, "samples": 9}
    compiled = compiled_runs(loop, loop.inverse_dynamics(**arguments), {"a4": OFFSETS[1:]}, None, arguments)
    runs = compiled(0, len(OFFSETS) - 1, Keep(["S4"], None))
    assert None not in runs  # none is left to a single loop
    angle, places = runs[0].along.values, np.array([k.samples[0].values[k.row] for k in runs])
    across = 12 * INCH * np.cos(angle) + OFFSETS[1:, None]
    squares = (places - 12 * INCH * np.sin(angle)) ** 2 + across**2 + (3.5 * INCH) ** 2
    assert squares == pytest.approx(np.full_like(squares, (50 * INCH) ** 2), abs=1e-14, rel=0)


def test_outputs_of_lanes_are_reduced(loop):
    found = loop.inverse_dynamics_many({"a4": OFFSETS}, outputs=["S4"], reduce=np.max, samples=9)
    alone = single_runs(loop, "inverse_dynamics", OFFSETS, samples=9)
    assert np.array_equal(found["S4"], [np.max(run["S4"].values) for run in alone])
