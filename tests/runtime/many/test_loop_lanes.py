"""Driven loops in SIMD lanes: bits of single ones, closed forms, dead centres, failures."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import trapezoid
from shared.full import full

import symgen
from symgen.runtime.loop.many.driven import driven_loops
from symgen.runtime.many.dataset import Keep
from symgen.toolchain import compiler

pytestmark = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")

INCH = 0.0254
#: Angles between the shafts of the cardan joint.
ANGLES = np.linspace(0.1, 1.0, 10)
#: Offsets of the slider's line, and one that is out of reach.
OFFSETS, BEYOND = np.linspace(0.0, 0.3, 10), 3.0
VARIED = {"cardan": {"beta": ANGLES}, "slider_crank": {"a4": OFFSETS}}


@pytest.fixture(scope="module")
def loops():
    changed = {"S1": "3.5 in", "loop.drives.theta1": "100 lbf*in", "loop.drives.S4": "?"}
    outputs = ["theta1.drive", "S4", "S4.acceleration", "S4.drive", "crank.joint2.force"]
    offset = {**changed, "analysis.outputs": outputs}
    built = {"cardan": symgen.build("cardan")}

    def loop(scene):
        return built.get(scene) or built.setdefault(scene, symgen.build(scene, set=offset))

    return loop


def in_lanes(loop, columns, **arguments):
    """Return the coordinate, and samples of all runs by name, none of which is left to a single loop."""
    compiled = driven_loops(loop, loop.inverse_dynamics(**arguments), columns)
    runs = compiled(0, len(next(iter(columns.values()))), Keep(None, None))
    assert None not in runs
    return runs[0].along.values, {v.name: v.values for v in runs[0].samples}


@pytest.mark.parametrize(
    ("scene", "analysis", "arguments"),
    [
        ("cardan", "inverse_dynamics", {"start": 0.3, "stop": 1.3, "samples": 9}),
        ("cardan", "kinematics", {"over": "time", "samples": 4}),
        full("slider_crank", "inverse_dynamics", {"start": 0.3, "stop": 1.3, "samples": 9}),
        full("slider_crank", "inverse_dynamics", {"start": -1.0, "stop": 3.0, "samples": 5}),  # a dead centre
        full("slider_crank", "kinematics", {"over": "time", "samples": 4}),
    ],
)
def test_loops_in_lanes_have_the_bits_of_single_ones(loops, scene, analysis, arguments):
    loop = loops(scene)
    [(name, values)] = VARIED[scene].items()
    found = getattr(loop, f"{analysis}_many")({name: values}, **arguments)
    for i, value in enumerate(values):
        alone = getattr(loop.with_parameters(**{name: value}), analysis)(**arguments)
        for v in alone.variables:
            assert np.array_equal(found[v.name].values[i], v.values, equal_nan=True), (i, v.name)
        times = found["time"].values
        assert np.array_equal(times if times.ndim == 1 else times[i], alone.time)
        assert found["constraint_drift"].values[i] == alone.drift.constraint
    assert not any(found["error"].values)


def test_shafts_of_the_cardan_joint_turn_by_its_closed_form(loops):
    angle, samples = in_lanes(loops("cardan"), VARIED["cardan"], start=0.3, stop=1.3, samples=9)
    product = np.tan(angle) * np.tan(samples["theta4"])
    assert product == pytest.approx(np.outer(np.cos(ANGLES), np.ones(9)), abs=1e-13, rel=0)


def test_outputs_of_lanes_are_reduced(loops):
    loop, arguments = loops("cardan"), {"start": 0.3, "stop": 1.3, "samples": 9}
    found = loop.inverse_dynamics_many(VARIED["cardan"], outputs=["theta4"], reduce=np.max, **arguments)
    alone = [loop.with_parameters(beta=beta).inverse_dynamics(**arguments) for beta in ANGLES]
    assert np.array_equal(found["theta4"], [np.max(run["theta4"].values) for run in alone])
    names = ["peak", "mean", "rms", "final"]
    found = loop.inverse_dynamics_many(VARIED["cardan"], outputs=["theta4"], reduce=names, **arguments)
    for i, run in enumerate(alone):
        v = run["theta4"].values
        mean, square = (trapezoid(x) / (len(x) - 1) for x in (v, v**2))
        expected = [np.max(np.abs(v)), mean, np.sqrt(square), v[-1]]
        assert [found[f"theta4.{name}"].values[i] for name in names] == pytest.approx(expected, rel=1e-15)
        assert found["constraint_drift"].values[i] == run.drift.constraint


def test_means_do_not_depend_on_a_run_that_fails():
    loop = symgen.build("rssr")
    arguments = {"outputs": ["theta4"], "reduce": "mean", "start": 0.0, "stop": 3.0, "samples": 19}
    found = loop.kinematics_many({"speed": [0.0, 12.0, 13.0]}, **arguments)
    assert [bool(error) for error in found["error"].values] == [True, False, False]
    alone = loop.kinematics_many({"speed": [13.0]}, **arguments)
    assert found["theta4.mean"].values[2] == pytest.approx(alone["theta4.mean"].values[0], rel=1e-14)


@pytest.mark.full
def test_a_loop_that_does_not_close_is_an_entry(loops):
    found = loops("slider_crank").kinematics_many({"a4": [0.1, BEYOND, 0.2]}, at=1.0)
    assert [bool(error) for error in found["error"].values] == [False, True, False]
    assert "cannot be assembled" in found["error"].values[1] and np.isnan(found["S4"].values[1]).all()


@pytest.mark.full
def test_the_offset_slider_stays_at_the_end_of_its_rod_in_lanes(loops):
    arguments = {"start": 0.3, "stop": 1.3, "samples": 9}
    angle, samples = in_lanes(loops("slider_crank"), {"a4": OFFSETS[1:]}, **arguments)
    across = 12 * INCH * np.cos(angle) + OFFSETS[1:, None]
    squares = (samples["S4"] - 12 * INCH * np.sin(angle)) ** 2 + across**2 + (3.5 * INCH) ** 2
    assert squares == pytest.approx(np.full_like(squares, (50 * INCH) ** 2), abs=1e-14, rel=0)
