"""Optimisation of a barrier that a spring balances, against its closed form on a dense grid."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import trapezoid
from shared.variants import crank_rocker_with_lengths

import symgen
from symgen.errors import ModelError, SimulationError
from symgen.runtime.sweeps.problem import OptimisationArguments, Problem, ReducedOutput
from symgen.scene.loading import SceneText, check_scene, read_scene

EXAMPLE = Path(__file__).parents[3] / "docs" / "barrier.toml"
#: Angles of the arm; place of the spring on it, its free length [m]; moment of the weight [N m].
ANGLES, PLACE, FREE, MOMENT = np.linspace(0.0, math.pi / 2, 16), 0.3, 0.2, 8 * 9.81 * 1.5
RANGE = {"stiffness": (100.0, 4000.0), "height": (0.35, 0.8)}


@pytest.fixture(scope="module")
def model():
    return symgen.build(EXAMPLE, backend="c")


def torque(stiffness, height):
    """Return the torque of the motor at all angles: that of the weight less that of the spring."""
    k, h = (np.asarray(v)[..., None] for v in (stiffness, height))
    length = np.sqrt(PLACE**2 + h**2 - 2 * PLACE * h * np.sin(ANGLES))
    return (MOMENT - k * (length - FREE) / length * PLACE * h) * np.cos(ANGLES)


def grid(count=160):
    axes = (np.linspace(*RANGE[name], count) for name in RANGE)
    return np.meshgrid(*axes, indexing="ij")


def test_the_least_peak_torque_is_that_of_a_dense_grid(model):
    found = model.optimise(RANGE, "arm.torque.peak", samples=16)
    assert repr(found).startswith(f"<Optimum {found.objective:.6g} at ")
    k, h = grid()
    peaks = np.max(np.abs(torque(k, h)), axis=-1)
    at = np.unravel_index(np.argmin(peaks), peaks.shape)
    assert found.converged and found.gradients == "exact"
    assert found.objective == pytest.approx(np.max(np.abs(torque(*found.parameters.values()))), rel=1e-9)
    assert found.objective <= peaks[at] * (1 + 1e-9)
    assert found.parameters["stiffness"] == pytest.approx(k[at], abs=2 * (k[1, 0] - k[0, 0]))
    near = (
        np.clip(np.linspace(x - 0.01 * (high - low), x + 0.01 * (high - low), 101), low, high)
        for x, (low, high) in zip(found.parameters.values(), RANGE.values(), strict=True)
    )
    around = np.max(np.abs(torque(*np.meshgrid(*near, indexing="ij"))), axis=-1)
    assert found.objective <= np.min(around) * (1 + 1e-6)
    assert found.model.parameters["height"] == found.parameters["height"]
    assert found.objective < 0.2 * np.max(np.abs(torque(500.0, 0.4)))


@pytest.mark.parametrize(
    ("analysis", "bound", "length"),
    [
        ("modes", {"frequency.1.final": (None, 0.5)}, 9.81 / math.pi**2),
        ("equilibrium", {"A.position.final.y": (None, -1.5)}, 1.5),
    ],
)
def test_frequencies_and_equilibria_may_be_bounds(analysis, bound, length):
    """The shortest pendulum of a frequency, sqrt(g/L)/(2 pi), or that hangs low enough."""
    scene = symgen.Scene(
        parameters={"L": {"value": "2 m", "tunable": True}},
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["0 m", "-L"]}},
        links={"rod": {"points": ["O", "A"], "mass": "0 kg"}},
        masses=[{"point": "A", "mass": "1 kg"}],
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
    )
    found = symgen.build(scene).optimise({"L": (0.3, 4.0)}, "L", bound, analysis=analysis)
    assert found.converged and found.gradients == "exact"
    assert found.parameters["L"] == pytest.approx(length, rel=1e-9)


def test_evolution_passes_designs_that_do_not_close():
    coupler = {"links.coupler.length": "b", "parameters.b": {"value": "35 cm", "tunable": True}}
    found = symgen.build("crank_rocker", set=coupler).optimise(
        {"b": (0.1, 0.5)}, "crank.torque.rms", method="differential-evolution", samples=19, iterations=2
    )
    assert np.isfinite(found.objective) and 0.2 < found.parameters["b"] < 0.5


def mean(values):
    """Return the mean over the range of samples at equal steps."""
    return trapezoid(values, axis=-1) / (values.shape[-1] - 1)


def test_constraints_hold_and_bind(model):
    """A motor that cannot brake: the torque may not change its sign."""
    found = model.optimise(RANGE, "arm.torque.rms", {"arm.torque.least": (-1.0, None)}, samples=16)
    k, h = grid()
    values = torque(k, h)
    rms = np.where(np.min(values, axis=-1) >= -1.0, np.sqrt(mean(values**2)), np.inf)
    assert found.converged
    assert found.constraints["arm.torque.least"] == pytest.approx(-1.0, abs=1e-4)
    assert found.objective <= np.min(rms)
    assert found.objective == pytest.approx(np.min(rms), rel=0.2)


def problem_of(model, bounds, quantity, samples):
    search = OptimisationArguments(model, bounds, {}, None, {}, 1e-8, 200, None, {"samples": samples})
    return Problem(bounds, [quantity], search)


def test_exact_gradients_are_those_of_the_closed_form(model):
    bounds, x = {"stiffness": RANGE["stiffness"], "height": RANGE["height"]}, np.array([0.2, 0.4])
    k, h = (low + (high - low) * y for (low, high), y in zip(bounds.values(), x, strict=True))
    step = 1e-6
    slopes = [
        (torque(k + step * k, h) - torque(k - step * k, h)) / (2 * step * k) * 3900.0,
        (torque(k, h + step) - torque(k, h - step)) / (2 * step) * 0.45,
    ]
    values, size = torque(k, h), np.abs(torque(k, h))
    expected = {
        "peak": [s[np.argmax(size)] * np.sign(values[np.argmax(size)]) for s in slopes],
        "least": [s[np.argmin(values)] for s in slopes],
        "range": [s[np.argmax(values)] - s[np.argmin(values)] for s in slopes],
        "mean": [mean(s) for s in slopes],
        "rms": [mean(s * values) / np.sqrt(mean(values**2)) for s in slopes],
    }
    for reduction, expectation in expected.items():
        quantity = ReducedOutput.named(f"arm.torque.{reduction}")
        for exact in (False, True):
            problem = problem_of(model, bounds, quantity, 16)
            problem.at(x)
            problem.exact = exact
            slope = quantity.value(*problem.quantity(quantity, x), problem.weights(x))[1]
            assert slope == pytest.approx(expectation, rel=1e-5), (reduction, exact)


ROD = """
symgen = 1
[parameters]
m = { value = "2 kg", tunable = true }
[points]
O = { at = ["0 m", "0 m"], ground = true }
P = { at = ["0.5 m", "0 m"] }
[links]
rod = { points = ["O", "P"], mass = "m" }
[[torques]]
link = "rod"
torque = "1 N*m"
[analysis]
t_end = "0.5 s"
outputs = ["rod.angle"]
"""


def test_gradients_of_whole_runs_are_exact(tmp_path):
    """A constant torque M turns a rod of mass m and length L by 3*M*t^2/(2*m*L^2)."""
    file = tmp_path / "rod.toml"
    file.write_text(ROD)
    rod = symgen.build(file)
    problem = problem_of(rod, {"m": (1.0, 3.0)}, ReducedOutput.named("rod.angle.final"), 6)
    problem.choose_gradients(np.array([0.5]))
    assert problem.exact
    angles = 1.5 * np.linspace(0.0, 0.5, 6) ** 2 / 0.5**2 / 2.0
    assert problem.slopes(np.array([0.5]))["rod.angle"][0, :, 0] == pytest.approx(
        -angles / 2.0 * 2.0, rel=1e-9
    )
    given = {"samples": 6}, {"t_eval": [0.2, 0.5]}
    for sampled in given:
        found = rod.optimise({"m": (1.0, 3.0)}, "m", {"rod.angle.final": (None, 0.6)}, **sampled)
        assert found.gradients == "exact" and found.parameters["m"] == pytest.approx(1.5 / 0.6, rel=1e-9)


def test_a_spring_of_no_free_length_balances_the_arm_exactly():
    text = read_scene(EXAMPLE)
    parameters = {**text.data["parameters"], "free": "0 m"}
    data = {k: v for k, v in text.data.items() if k != "optimise"} | {"parameters": parameters}
    model = symgen.build(check_scene(SceneText("balanced", "", data)), backend="c")
    found = model.optimise({"stiffness": (100.0, 4000.0)}, "arm.torque.rms", samples=11, tolerance=1e-12)
    assert found.parameters["stiffness"] == pytest.approx(MOMENT / (PLACE * 0.4), rel=1e-4)
    evolved = model.optimise(
        {"stiffness": (100.0, 4000.0)},
        "arm.torque.peak",
        method="differential-evolution",
        samples=3,
        iterations=8,
        tolerance=1e-3,
    )
    assert evolved.parameters["stiffness"] == pytest.approx(MOMENT / (PLACE * 0.4), rel=0.05)
    assert evolved.gradients == "none"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (({}, "arm.torque.peak"), "expected variables with their bounds"),
        (({"stiffness": (2.0, 1.0)}, "arm.torque.peak"), "a lower and an upper bound of stiffness"),
        (({"stiffness": "x"}, "arm.torque.peak"), "a lower and an upper bound of stiffness"),
        (({"mass": (1.0, 2.0)}, "arm.torque.peak"), "no tunable parameter 'mass'"),
        ((RANGE, "arm.torque"), "expected OUTPUT.REDUCTION"),
        ((RANGE, "arm.torque.peek"), "expected OUTPUT.REDUCTION.*Did you mean 'peak'"),
        ((RANGE, "leg.torque.peak"), "no output 'leg.torque'"),
        ((RANGE, "arm.torque.peak", {"arm.torque.least": (None, None)}), "None for one without a bound"),
        ((RANGE, "arm.torque.peak.x"), "has no component 'x'"),
    ],
)
def test_wrong_problems_are_refused(model, arguments, words):
    with pytest.raises(ModelError, match=words):
        model.optimise(*arguments, samples=5)


def test_wrong_options_are_refused(model):
    for more, words in (
        ({"method": "Newton"}, "no method 'Newton'"),
        ({"tolerance": 0.0}, "tolerance above 0"),
        ({"start": {"free": 1.0}}, "no tunable parameter 'free'"),
    ):
        with pytest.raises(ModelError, match=words):
            model.optimise(RANGE, "arm.torque.peak", samples=5, **more)


def test_a_run_that_fails_ends_the_descent_and_not_the_evolution(tmp_path):
    """The crank-rocker cannot be assembled with a crank of 2 m; its pin A is one crank length away from O."""
    model = symgen.build(crank_rocker_with_lengths(tmp_path), backend="c")
    options = {"analysis": "kinematics", "samples": 3, "of": ["A"]}
    with pytest.raises(SimulationError, match=r"the optimisation came to a = 2 m: .*assemble"):
        model.optimise({"a": (0.1, 2.0)}, "A.position.peak", start={"a": 2.0}, **options)
    found = model.optimise(
        {"a": (0.05, 0.3)},
        "A.position.peak",
        {"A.position.range.x": (0.12, None)},
        method="differential-evolution",
        iterations=4,
        **options,
    )
    assert found.objective == pytest.approx(0.06, rel=0.1)
    with pytest.raises(ModelError, match="of the vector A.position needs a component: x, y"):
        model.optimise({"a": (0.05, 0.2)}, "A.position.least", **options)
