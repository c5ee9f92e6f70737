"""Speed beside error: orders, fronts, sweeps, and what symgen bench says of scenes that have none."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from shared.linkages import four_bar
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import ModelError, SimulationError
from symgen.runtime.integrate.integrators import INTEGRATORS
from symgen.study.speed import report
from symgen.study.speed.measures import distance, sizes
from symgen.study.speed.orders import observed_order
from symgen.study.speed.subjects import Rods, subject
from symgen.study.speed.sweeps import Setting, fixed_steps, tolerances, worth_running
from symgen.study.speed.work_precision import WorkPrecision, WorkPrecisionPoint, work_precision

STEPS = [16 << k for k in range(8)]


def test_order_of_a_power_and_of_what_is_not_one():
    errors = [3.0 * n**-4.0 for n in STEPS]
    assert observed_order(STEPS, errors, 0.0, 1.0) == (pytest.approx(4.0, abs=1e-12), tuple(STEPS))
    rng = np.random.default_rng(1)
    assert observed_order(STEPS, (10.0 ** rng.uniform(-9, -3, 8)).tolist(), 0.0, 1.0) == (None, ())


@pytest.mark.parametrize(("uncertainty", "marked"), [(1e-9, (1e-9,)), (1e-14, ())])
def test_a_plot_marks_the_errors_below_the_uncertainty_of_the_reference(uncertainty, marked, monkeypatch):
    """From the least error shown up to it; none if all errors are larger."""
    figures = []
    monkeypatch.setattr(report, "save", lambda figure, file: figures.append(figure))
    points = [
        WorkPrecisionPoint("rk4", "float64", str(k), 10.0**-k, 10.0**-k, k * 1e-3, k * 1e-3, k, k, True)
        for k in (2, 6, 10)
    ]
    report.draw(WorkPrecision("", 1.0, 2, "m", "error", "", uncertainty, tuple(points), (), ()), "b.svg")
    (axes,) = figures[0].axes
    left, right = axes.get_xlim()
    bands = [band.get_extents().transformed(axes.transData.inverted()) for band in axes.patches]
    assert left > 1e-2 and right < 1e-10
    assert [(band.xmin, band.xmax) for band in bands] == [pytest.approx((right, end)) for end in marked]


def test_order_leaves_out_what_comes_before_the_asymptotic_range_and_round_off():
    """Errors h^4 + 1e3 h^7: of order 7 with few steps; then round-off, which more steps do not lower."""
    h = 1.0 / np.array(STEPS)
    errors = h**4 + 1e3 * h**7 + 1e-13
    observed, used = observed_order(STEPS, errors.tolist(), 1e-13, 1.0)
    assert observed == pytest.approx(4.0, abs=0.1)
    assert STEPS[0] not in used and STEPS[-1] not in used
    stalled = [*errors.tolist()[:6], 1e-10, 1e-10]
    assert max(observed_order(STEPS, stalled, 0.0, 1.0)[1], default=0) < STEPS[6]
    assert observed_order(STEPS, [1e-10] * 8, 0.0, 1.0) == (None, ())


def test_sweeps_end_when_they_gain_nothing_more():
    def errors(values):
        given = iter(values)
        return lambda setting: (next(given), 0.0)

    def count(run, goal=0.0, most=1.0):
        return len(list(worth_running(tolerances("m", 1e-14), run, goal, most)))

    assert count(errors(10.0**-k for k in range(30))) == 13
    assert count(errors(10.0**-k for k in range(30)), goal=1e-5) == 6
    assert count(errors([1e-1, 1e-2, 1e-3, *[1e-3] * 9])) == 6
    assert count(errors([math.inf, math.inf, 1e-2, 1e-3, math.nan, *[1e-3] * 9])) == 4
    assert count(lambda setting: (1e-3, 2.0)) == 1
    first, second = list(fixed_steps("m", 2.0))[:2]
    assert first == Setting("m", "16 steps", steps=16, step=0.125) and second.steps == 23


@pytest.fixture(scope="module")
def found():
    return work_precision("peaucellier", t_end=1.0, repeats=1, longest=0.1)


def test_every_integrator_is_measured_with_its_order(found):
    assert {p.method for p in found.points} == set(INTEGRATORS) == {o.method for o in found.orders}
    for order in found.orders:
        assert order.theoretical == INTEGRATORS[order.method].order
        assert order.agrees is not False, order
    assert {o.method for o in found.orders if o.agrees} >= {"dop853", "dopri5", "rk4", "rattle", "rattle4"}
    for p in found.points:
        assert p.best <= p.median and p.end <= p.along and p.steps > 0
    tight = [p for p in found.points if p.method == "dop853" and p.setting == "rtol 1e-10"]
    assert tight[0].along < 1e-11 and tight[0].resolved
    assert found.uncertainty < 1e-13 and "float" in found.reference


def test_the_reference_agrees_with_a_motion_known_in_closed_form():
    """A rod let go level keeps its energy: its speed at the angle it has come to says where it must be."""
    scene = symgen.Scene(
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", "0 m"]}},
        links={"OA": {"points": ["O", "A"], "mass": "1 kg"}},
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        analysis={"t_end": "0.5 s"},
    )
    from scipy.special import ellipj, ellipk

    # theta from the lowest point with k = sin(pi/4): sin(theta/2) = k sn(K - w t, k^2), w^2 = 3 g/(2 l)
    what = subject(scene)
    reference = what.reference()
    t = np.linspace(0.0, 0.5, 21)
    k = math.sin(math.pi / 4)
    half = np.arcsin(k * ellipj(ellipk(k * k) - math.sqrt(1.5 * 9.81) * t, k * k)[0])
    exact = np.stack([np.sin(2 * half), -np.cos(2 * half)], axis=1)[:, None, :]
    assert np.max(distance(reference.along, exact)) < 1e-13
    assert what.size() == pytest.approx(np.ptp(exact, axis=0).max(), rel=1e-3)


def test_a_wrong_order_is_caught(monkeypatch):
    """A method that claims order 4 with one weight off, and one whose claim is one too high."""
    rk4 = INTEGRATORS["rk4"]
    b = rk4.coefficients["b"] + np.array([0.0, 0.01, -0.01, 0.0])
    a = np.array(rk4.coefficients["a"])
    a[4, :4] = b
    monkeypatch.setitem(INTEGRATORS, "rk4", replace(rk4, coefficients={**rk4.coefficients, "b": b, "a": a}))
    monkeypatch.setitem(INTEGRATORS, "rk5", replace(rk4, name="rk5", order=5))
    found = work_precision("peaucellier", t_end=0.5, repeats=1, methods=["rk4", "rk5"])
    assert not any(o.agrees for o in found.orders)
    assert found.orders[1].observed == pytest.approx(4.0, abs=0.2)


def test_errors_below_that_of_the_reference_are_marked(monkeypatch):
    monkeypatch.setattr("symgen.study.speed.subjects.REFERENCE", {"float64": 1e-6})
    found = work_precision("peaucellier", t_end=0.5, repeats=1, methods=["dop853"])
    assert not found.points[-1].resolved and found.points[0].resolved
    assert any("within the uncertainty of the reference" in note for note in found.notes)
    rows = CliRunner().invoke(
        app, ["bench", "peaucellier", "--t-end", "0.5", "--repeats", "1", "--methods", "dop853"]
    )
    assert "~" in rows.stdout


def test_command(tmp_path):
    args = [
        "bench",
        "peaucellier",
        "--t-end",
        "0.3",
        "--repeats",
        "1",
        "--methods",
        "rk4",
        "--longest",
        "1",
    ]
    told = CliRunner().invoke(app, args)
    assert told.exit_code == 0
    assert "Order of convergence" in told.stdout and "yes" in told.stdout
    out, plot = tmp_path / "b.json", tmp_path / "b.svg"
    done = CliRunner().invoke(app, [*args, "--json", "--out", str(out), "--plot", str(plot)])
    data = json.loads(done.stdout)
    assert data["orders"][0]["method"] == "rk4" and data["orders"][0]["agrees"] is True
    assert {"end", "along", "best", "median", "steps", "evaluations"} <= set(data["points"][0])
    assert json.loads(out.read_text())["points"][0]["setting"] == data["points"][0]["setting"]
    assert "</svg>" in plot.read_text()


@pytest.mark.parametrize(
    ("scene", "given", "match"),
    [
        ("rssr", {}, "the inputs of rssr move it: nothing is integrated in time"),
        ("peaucellier", {"methods": ["rk5"]}, "there is no integrator 'rk5'. Did you mean 'rk4'"),
        ("peaucellier", {"repeats": 0}, "expected repeats >= 1"),
    ],
)
def test_bad_requests(scene, given, match):
    with pytest.raises(ModelError, match=match):
        work_precision(scene, **given)


def test_a_horizon_that_the_motion_does_not_reach():
    """A crank driven into the dead centre of a linkage that cannot turn."""
    stuck = four_bar(2.0, 1.0, 1.5, 2.0, 0.4)
    with pytest.raises(SimulationError, match=r"the reference does not reach t_end = 5 s"):
        work_precision(stuck, t_end=5.0)


def test_what_errors_are_measured_over():
    """A quantity over its largest value; one that is only rounding over the largest in its unit."""
    found = sizes(np.array([2.0, 3e-12, 4e-3, 0.0]), ["N", "N", "m", "s"])
    assert found.tolist() == [2.0, 2.0, 4e-3, 1.0]


def test_a_loop():
    """Forces that are zero but for rounding do not hide the errors of others."""
    found = work_precision("cssp", methods=["dopri5"], t_end=0.05, repeats=1)
    assert found.reference == "dop853 at rtol 1e-17, float128" and found.uncertainty < 1e-12
    assert min(x.along for x in found.points) < 1e-11
    assert found.orders[0].agrees
    with pytest.raises(ModelError, match="there is no integrator 'rattle'"):
        work_precision("cssp", methods=["rattle"])


def test_an_event_that_ends_the_run():
    """Runs that end at an event have no common end to compare: a horizon before it has."""
    rod = symgen.Scene(
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", "0 m"]}},
        links={"OA": {"points": ["O", "A"], "mass": "1 kg"}},
        gravity={"acceleration": ["0 m/s^2", "-10 m/s^2"]},
        events=[{"name": "low", "of": "A.position.y", "value": "-0.5 m", "ends_run": True}],
    )
    given = {"methods": ["rk4"], "repeats": 1, "longest": 0.02}
    with pytest.raises(
        SimulationError, match=r"t_end = 1 s: the event 'low' ends the run at t = 0\.26\d+ s\n"
    ):
        work_precision(rod, **given)
    assert work_precision(rod, t_end=0.2, **given).points


def test_elastic_links():
    found = work_precision("thesis_four_bar", methods=["newmark"], t_end=0.02, repeats=1, longest=0.2)
    assert found.unit == "of the peak" and found.points[-1].along < found.points[0].along < 1.0


def test_positions_are_recorded_whatever_the_scene_asks_for():
    what = subject("triple_pendulum", t_end=0.1)
    assert isinstance(what, Rods)
    assert what.read(what.call(Setting("rk4", "", step=0.01))).along.shape == (21, 3, 2)


def test_precisions():
    """Of float32 the error stays above its round-off; the reference is wider than what it judges."""
    given = {"methods": ["dop853"], "precisions": ["float64", "float32"], "t_end": 0.5, "repeats": 1}
    found = work_precision("peaucellier", **given)
    least = {p: min(x.along for x in found.points if x.precision == p) for p in given["precisions"]}
    assert least["float64"] < 1e-13
    assert 1e-9 < least["float32"] < 1e-6
    given |= {"methods": ["gauss"], "t_end": 0.005, "longest": 1.0}
    found = work_precision("elastic_slider_crank", **given)
    least = {p: min(x.along for x in found.points if x.precision == p) for p in given["precisions"]}
    assert least["float64"] < 0.1 * least["float32"]
    with pytest.raises(ModelError, match="there is no precision 'float65'. Did you mean 'float64'"):
        work_precision("peaucellier", precisions=["float65"])
