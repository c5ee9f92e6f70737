"""Optimisations where some designs have no run, and trust-constr against closed forms on a dense grid."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from shared.full import full
from shared.linkages import at, ground, rod

import symgen
from symgen.errors import SimulationError

EXAMPLE = Path(__file__).parents[3] / "docs" / "barrier.toml"
RANGE = {"stiffness": (100.0, 4000.0), "height": (0.35, 0.8)}
OPTIONS = {"analysis": "kinematics", "samples": 7, "of": ["A"]}


def four_bar(a="10 cm", b="35 cm", c="30 cm"):
    """A four-bar on ground points 40 cm apart, whose crank turns at 60 rpm for a second."""
    lengths = {"a": a, "b": b, "c": c}
    return symgen.build(
        symgen.Scene(
            parameters={"w": "60 rpm"} | {k: {"value": x, "tunable": True} for k, x in lengths.items()},
            points={"O": ground(0, 0), "A": at(0.1, 0), "B": at(0.32, 0.27), "C": ground(0.4, 0)},
            links={
                "crank": rod("O", "A", length="a"),
                "coupler": rod("A", "B", length="b"),
                "rocker": rod("C", "B", length="c"),
            },
            drivers=[{"link": "crank", "angle": "w*t"}],
            analysis={"t_end": "1 s"},
        )
    )


@pytest.fixture(scope="module")
def model():
    return four_bar()


def torques(stiffness, height):
    """The motor's torque at 16 angles: that of the weight less that of the spring, at 0.3 m, of 0.2 m."""
    k, h = (np.asarray(v)[..., None] for v in (stiffness, height))
    angles = np.linspace(0.0, math.pi / 2, 16)
    length = np.sqrt(0.3**2 + h**2 - 0.6 * h * np.sin(angles))
    return (8 * 9.81 * 1.5 - k * (length - 0.2) / length * 0.3 * h) * np.cos(angles)


def rms(values):
    weights = np.ones(16)
    weights[[0, -1]] = 0.5
    return np.sqrt(values**2 @ weights / 15)


OBJECTIVES = {
    "rms": rms,
    "peak": lambda values: np.max(np.abs(values), axis=-1),
    "range": lambda v: np.ptp(v, axis=-1),
}


@pytest.mark.parametrize(
    ("objective", "least"),
    [
        ("rms", -1.0),
        ("peak", None),
        *(full(x, y) for x, y in (("range", None), ("peak", -1.0), ("range", -2.0))),
    ],
)
def test_trust_constr_comes_to_the_least_of_a_dense_grid(objective, least):
    """The grid of the closed form is refined about its best design until its steps are below 1e-6 of the range."""
    model = symgen.build(EXAMPLE)
    limits = {} if least is None else {"arm.torque.least": (least, None)}
    found = model.optimise(RANGE, f"arm.torque.{objective}", limits, samples=16, method="trust-constr")
    low, high = np.array([*RANGE.values()]).T
    centre, half = (low + high) / 2, (high - low) / 2
    while np.max(half / (high - low)) > 1e-6:
        axes = (
            np.clip(np.linspace(c - h, c + h, 41), *ends)
            for c, h, ends in zip(centre, half, RANGE.values(), strict=True)
        )
        stiffness, height = np.meshgrid(*axes, indexing="ij")
        values = torques(stiffness, height)
        goal = OBJECTIVES[objective](values)
        if least is not None:
            goal = np.where(np.min(values, axis=-1) < least - 1e-9, np.inf, goal)
        best = np.unravel_index(np.argmin(goal), goal.shape)
        centre, half = np.array([stiffness[best], height[best]]), half / 1.5
    assert found.converged
    assert found.objective == pytest.approx(goal[best], rel=1e-4)
    assert list(found.parameters.values()) == pytest.approx(centre, rel=1e-4)
    if least is not None:
        assert found.constraints["arm.torque.least"] >= least - 1e-6


def test_trust_constr_with_a_bound_on_a_variable():
    """The Hessian of a linear constraint is zero; the unconstrained optimum, 681.7 N/m, is inside."""
    model = symgen.build(EXAMPLE)
    both = [
        model.optimise(RANGE, "arm.torque.rms", {"stiffness": (None, 700.0)}, samples=16, method=method)
        for method in ("SLSQP", "trust-constr")
    ]
    assert all(one.converged for one in both)
    assert both[1].objective == pytest.approx(both[0].objective, rel=1e-5)


@pytest.mark.parametrize("seed", [1, *(full(seed) for seed in (0, 2, 3, 4, 5, 6, 7))])
def test_evolution_starts_from_designs_that_cannot_be_assembled(seed):
    """The least range of B with transmission angles above 40 degrees, by the crank and rocker triangle."""
    model = four_bar()
    bounds = {"b": (0.2, 0.6), "c": (0.2, 0.6)}
    least = math.radians(40)
    found = model.optimise(
        bounds,
        "B.position.range.x",
        {"A.B.C.transmission_angle.least": (least, None)},
        analysis="kinematics",
        samples=31,
        of=["B", "A.B.C"],
        method="differential-evolution",
        seed=seed,
        iterations=30,
    )
    b, c = found.parameters["b"], found.parameters["c"]
    crank = np.linspace(0.0, 2 * math.pi, 31)
    diagonal = np.sqrt(0.1**2 + 0.4**2 - 0.08 * np.cos(crank))
    angle = np.arccos((b**2 + c**2 - diagonal**2) / (2 * b * c))
    transmission = np.min(np.minimum(angle, math.pi - angle))
    assert found.constraints["A.B.C.transmission_angle.least"] == pytest.approx(transmission, abs=1e-9)
    assert transmission >= least - 1e-9


def test_a_failing_run_never_counts_as_feasible(model):
    """Cranks above 25 cm do not turn (0.3 + 0.35 - 0.4 m); a bound on a variable alone is met by some of them."""
    found = model.optimise(
        {"a": (0.2, 0.3)},
        "A.position.least.x",
        {"a": (None, 0.29)},
        method="differential-evolution",
        iterations=8,
        **OPTIONS,
    )
    assert found.objective == pytest.approx(-0.25, rel=0.02)
    with pytest.raises(
        SimulationError, match=r"the optimisation came to a = .*: the run ended early: dead centre"
    ):
        model.optimise({"a": (0.26, 0.3)}, "A.position.least.x", method="differential-evolution", **OPTIONS)


@pytest.mark.parametrize("method", ["SLSQP", full("trust-constr")])
def test_steps_to_a_dead_centre_are_shortened(model, method):
    """The longest crank that turns is 0.3 + 0.35 - 0.4 = 0.25 m; the bound, 0.3 m, has a dead centre."""
    options = {"method": method, "iterations": 20 if method == "SLSQP" else 60, **OPTIONS}
    found = model.optimise({"a": (0.05, 0.3)}, "A.position.least.x", **options)
    assert 0.2 < found.parameters["a"] <= 0.25


def test_the_default_start_is_moved_where_its_run_fails():
    """A crank of 30 cm, which the bounds of the range move to 28 cm, does not turn; the shortest does."""
    model = four_bar("30 cm")
    found = model.optimise({"a": (0.2, 0.28)}, "A.position.peak", **OPTIONS)
    assert found.objective == pytest.approx(0.2, rel=1e-9)
    with pytest.raises(SimulationError, match=r"came to a = 0\.28 m: the run ended early"):
        model.optimise({"a": (0.2, 0.28)}, "A.position.peak", start={"a": 0.28}, **OPTIONS)
    with pytest.raises(SimulationError, match=r"came to a = 0\.3 m: the run ended early"):
        model.optimise({"a": (0.26, 0.3)}, "A.position.peak", **OPTIONS)


@pytest.mark.parametrize(("bounds", "start"), [((0.2499999, 0.35), 0.2499999), ((0.2, 0.2500001), 0.2)])
def test_a_start_on_a_bound_next_to_a_dead_centre(model, bounds, start):
    """Cranks above 25 cm do not turn: at the first bound no difference can be taken, at the second one can."""
    if start == 0.2:
        found = model.optimise({"a": bounds}, "A.position.peak", start={"a": start}, **OPTIONS)
        assert found.parameters["a"] == pytest.approx(0.2, abs=1e-9)
    else:
        with pytest.raises(
            SimulationError, match=r"came to a = 0\.250\d* m: the run ended early: dead centre"
        ):
            model.optimise({"a": bounds}, "A.position.least.x", start={"a": start}, **OPTIONS)
