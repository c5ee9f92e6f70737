"""Derivatives along runs of loops: against Lagrange's equations, linkages of points, and runs in long double."""

from __future__ import annotations

import math
import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from shared.exact_slopes import stored
from shared.floating_crank import (
    scene,
)

import symgen
from symgen.errors import ModelError
from symgen.scene.loading import shipped_scene

NAMES = ["stall", "top", "pump", "k", "d", "rod", "F", "theta1", "S1", "theta1'", "S1'"]
OUTPUTS = ["theta1", "S1", "S4", "theta1.acceleration"]


@pytest.fixture(scope="module")
def model():
    return symgen.build(scene())


@pytest.mark.parametrize("outputs", [["S4"], [*OUTPUTS]])
def test_along_power_series(model, outputs):
    """Derivatives of the end against those stored of Lagrange's equations, forward and backward through the run."""
    reference = stored("cssp")
    by = [*reference["by"]] if len(outputs) == 1 else [*reference["by"]][:2]
    found = model.sensitivity(outputs, by, t_end=reference["times"][1], rtol=1e-12, method="taylor")
    exact = np.array([[float(x) for x in reference["by"][name][1]] for name in by]).T
    rows = [OUTPUTS.index(name) for name in outputs]
    assert found.derivatives[0] == pytest.approx(exact[rows], rel=1e-9)


def test_one_output_by_many_parameters_goes_backwards_through_the_run(model):
    reference = stored("cssp")
    transposed = model.sensitivity(["S4"], [*reference["by"]], t_end=reference["times"][1], rtol=1e-12)
    expected = [float(rows[1][2]) for rows in reference["by"].values()]
    assert transposed.derivatives[0, 0] == pytest.approx(expected, rel=1e-9)
    assert transposed.units["theta1'"] == "rad/s"


def test_without_an_end_they_are_those_at_the_state(model):
    state = model.state({"theta1": 1.2, "S1": 0.02}, {"theta1": 3.0, "S1": -0.1})
    found = model.sensitivity(["S4", "S4.acceleration"], ["F", "theta1", "S1'"], at=state)
    space = model.linearise(state, ["F"], ["S4", "S4.acceleration"])
    columns = np.column_stack([space.D[:, 0], space.C[:, 0], space.C[:, 3]])
    assert isinstance(found.t, float) and found.derivatives == pytest.approx(columns, rel=1e-12, abs=1e-14)


def test_a_parameter_that_is_named_twice_has_its_derivative_twice(model):
    name = model.parameters and next(iter(model.parameters))
    once = model.sensitivity(["S4"], [name], t_end=0.05).derivatives
    assert np.array_equal(
        model.sensitivity(["S4"], [name, name], t_end=0.05).derivatives, np.repeat(once, 2, axis=-1)
    )


def test_runs_that_end_before_their_state_are_refused(model):
    later = model.state({"theta1": 1.2}, {"theta1": 3.0}, t=0.4)
    with pytest.raises(ModelError, match="expected t_end after the start at t = 0.4 s, got 0.2 s"):
        model.simulate(0.2, state=later)


def test_a_loop_with_redundant_closure_has_the_derivatives_of_its_points_and_links():
    written = tomllib.loads(shipped_scene("planar_4r"))
    written["loop"] |= {"inputs": {}, "free": {"theta1": {"at": "40 deg", "rate": "2 rad/s"}}}
    written["parameters"] |= {"length": {"value": "0.35 m", "tunable": True}, "coupler": "length"}
    loop = symgen.build(symgen.Scene(**written, analysis={"t_end": "1 s"}))
    x, y = 0.1 * math.cos(math.radians(40)), 0.1 * math.sin(math.radians(40))
    rods = symgen.build(
        symgen.Scene(
            parameters={"rho": "1 kg/m", "length": {"value": "0.35 m", "tunable": True}},
            points={
                "O": {"at": [0, 0], "ground": True},
                "A": {"at": [f"{x} m", f"{y} m"]},
                "B": {"at": ["0.3 m", "0.3 m"]},
                "C": {"at": ["0.4 m", 0], "ground": True},
            },
            links={
                "crank": {"points": ["O", "A"], "length": "0.1 m", "mass": "0.1 kg"},
                "coupler": {"points": ["A", "B"], "length": "length", "mass": "rho*length"},
                "rocker": {"points": ["C", "B"], "length": "0.3 m", "mass": "0.3 kg"},
            },
            gravity={"acceleration": [0, "-9.81 m/s^2"]},
            start={"angles": {"crank": "40 deg"}, "rates": {"crank": "2 rad/s"}},
        )
    )
    found = loop.sensitivity(
        ["theta1", "theta1.acceleration"], ["length", "theta1", "theta1'"], t_eval=[0.1, 0.3], rtol=1e-12
    )
    of_points = rods.sensitivity(
        ["crank.angle", "crank.angle''"],
        ["length", "crank.angle", "crank.angle'"],
        coordinates=["crank.angle"],
        t_eval=[0.1, 0.3],
        rtol=1e-12,
    )
    assert found.derivatives == pytest.approx(of_points.derivatives, rel=1e-9)


@pytest.mark.parametrize(
    ("precision", "rtol", "exact"),
    [("float64", 1e-12, 1e-6), pytest.param("longdouble", 1e-15, 1e-9, marks=pytest.mark.full)],
)
def test_prescribed_motions_change_with_their_parameters(precision, rtol, exact):
    """The crank is moved along its axis; derivatives against extrapolated differences of runs."""
    written = tomllib.loads(shipped_scene("cssp"))
    written["parameters"] |= {
        "way": {"value": "1 cm", "tunable": True},
        "speed": {"value": "20 rad/s", "tunable": True},
    }
    del written["loop"]["free"]["S1"], written["loop"]["drives"]["S1"]
    written["loop"]["inputs"] = {"S1": "way*cos(speed*t)"}
    moved = symgen.Scene(**written)
    found = symgen.build(moved).sensitivity(
        ["theta1", "S4", "theta1.acceleration"], ["way", "speed"], t_end=0.1, rtol=1e-12
    )
    every = [*symgen.build(moved).parameters, "theta1'"]  # of one output: steps are transposed
    transposed = symgen.build(moved).sensitivity(["S4"], every, t_end=0.1, rtol=1e-12)
    fine = symgen.build(moved, precision=precision)

    def end(**given):
        run = fine.with_parameters(**given).simulate(0.1, rtol=rtol, atol=rtol / 1e3, samples=2)
        return np.array([run[name].values[-1] for name in found.outputs])

    for j, (name, value) in enumerate((("way", 0.01), ("speed", 20.0))):
        ways = [value * 4e-3 / 2**i for i in range(3)]
        slopes = [(end(**{name: value + h}) - end(**{name: value - h})) / (2 * h) for h in ways]
        for k in (1, 2):
            slopes = [(4**k * b - a) / (4**k - 1) for a, b in pairwise(slopes)]
        assert found.derivatives[0, :, j] == pytest.approx(slopes[0], rel=exact)
        assert transposed["S4", name][0] == pytest.approx(slopes[0][1], rel=exact)


def test_runs_without_derivatives_are_refused_by_name(model):
    with pytest.raises(ModelError, match="give t_end or t_eval for derivatives"):
        model.sensitivity(["S4"], at=0.1)
    with pytest.raises(ModelError, match="no tunable parameter 'S4'"):
        model.sensitivity(["S4"], ["S4"], t_end=0.1)
    with pytest.raises(ModelError, match="expected increasing times for t_eval, at least one, got none"):
        model.sensitivity(["S4"], t_eval=[])
    with pytest.raises(ModelError, match="not available for radau5\n  Choose dop853, taylor"):
        model.sensitivity(["S4"], t_end=0.1, method="radau5")
    rubbing = {"loop.drives.S4": "-pump*abs(S4.rate)"}
    with pytest.raises(ModelError, match=r"not available for loads that jump: abs\(S4"):
        symgen.build("cssp", set=rubbing).sensitivity(["S4"], ["k"], t_end=0.1)
    with pytest.raises(ModelError, match="so that there is no run: give a time for at"):
        symgen.build("slider_crank").sensitivity(["S4"], ["a4"], t_end=0.1)


@pytest.mark.full
def test_runs_through_a_pole_of_a_ball_are_refused():
    case = Path(__file__).parents[1] / "cases" / "ball_poles.toml"
    with pytest.raises(ModelError, match="a ball joint (have a pole there|come near to a pole)"):
        symgen.build(case).sensitivity(["theta1"], t_end=5.0)
