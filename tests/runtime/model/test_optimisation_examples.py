"""Shipped examples of optimisation: conditions of optimality by derivatives of 40 digits, Pareto fronts."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import mpmath as mp
import numpy as np
import pytest
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import ModelError
from symgen.runtime.sweeps import pareto
from symgen.runtime.sweeps.optimisation import Optimum

DOCS = Path(__file__).parents[3] / "docs"
GRAVITY = mp.mpf("9.81")


def optimised(scene, *arguments):
    done = CliRunner().invoke(app, ["optimise", str(DOCS / scene), "--json", *map(str, arguments)])
    if done.exception and not isinstance(done.exception, SystemExit):
        raise done.exception
    return json.loads(done.stdout)


def rms(torques):
    """Return the root mean square of samples at equal steps by the trapezoidal rule."""
    squares = [x**2 for x in torques]
    return mp.sqrt((mp.fsum(squares) - (squares[0] + squares[-1]) / 2) / (len(squares) - 1))


def of_lamp(stiffness, free):
    """The torque that holds an arm of 0.5 m is that of the weights less that of the spring."""
    found = []
    for i in range(25):
        angle = (-60 + mp.mpf(120) * i / 24) * mp.pi / 180
        length = mp.sqrt(mp.mpf("0.04") + mp.mpf("0.0625") - mp.mpf("0.1") * mp.sin(angle))
        weight = (mp.mpf("0.8") * mp.mpf("0.5") + mp.mpf("0.6") * mp.mpf("0.25")) * GRAVITY
        found.append((weight - stiffness * (1 - free / length) * mp.mpf("0.05")) * mp.cos(angle))
    return rms(found)


def test_the_spring_of_the_lamp_meets_the_conditions_of_optimality():
    by_command = optimised("lamp.toml")["objective"]
    model = symgen.build(DOCS / "lamp.toml")
    bounds = {"stiffness": (50.0, 500.0), "free": (0.05, 0.2)}
    found = model.optimise(bounds, "arm.torque.rms", samples=25, tolerance=1e-15)
    with mp.workdps(40):
        k, free = (mp.mpf(found.parameters[name]) for name in ("stiffness", "free"))
        assert found.objective == pytest.approx(float(of_lamp(k, free)), rel=1e-7)
        by_stiffness = mp.diff(of_lamp, (k, free), (1, 0)) * 450 / of_lamp(k, free)
        by_length = mp.diff(of_lamp, (k, free), (0, 1)) * mp.mpf("0.15") / of_lamp(k, free)
    assert found.converged and found.gradients == "exact"
    assert by_command == pytest.approx(found.objective, rel=1e-5)
    # The spring is as short as it may be, where a longer one is worse; the stiffness is free.
    assert free == pytest.approx(0.05, abs=1e-12) and by_length > 0.1
    assert abs(by_stiffness) < 1e-5 * by_length


def torques_of_hoist(mass):
    """The motor accelerates the inertia of all masses and carries what the counterweight does not."""
    swing, rate, found = mp.pi / 4, mp.pi, []
    for i in range(41):
        time = mp.mpf(2) * i / 40
        angle, second = -swing * mp.cos(rate * time), swing * rate**2 * mp.cos(rate * time)
        inertia = mp.mpf("1.2") / 4 + mp.mpf("0.9") / 12 + mass / 25
        moment = mp.mpf("0.6") + mp.mpf("0.225") - mass / 5
        found.append(inertia * second + moment * GRAVITY * mp.cos(angle))
    return found


def test_the_counterweight_of_the_hoist_meets_the_conditions_of_optimality():
    found = optimised("hoist.toml")
    with mp.workdps(40):
        mass = mp.mpf(found["parameters"]["counterweight"])
        peak = lambda m: max(map(abs, torques_of_hoist(m)))  # noqa: E731
        slopes = [mp.diff(f, mass) for f in (lambda m: rms(torques_of_hoist(m)), peak)]
        multiplier = -slopes[0] / slopes[1]
        assert found["objective"] == pytest.approx(float(rms(torques_of_hoist(mass))), rel=1e-7)
        assert peak(mass) == pytest.approx(4.3, rel=1e-6)
    runs = symgen.build(DOCS / "hoist.toml").sweep({"counterweight": [1.0, 2.0]}, reduce=["rms"], samples=41)
    exact = [float(rms(torques_of_hoist(m))) for m in (1, 2)]
    assert runs["arm.torque.rms"].values == pytest.approx(
        exact, rel=1e-9
    )  # over the time: the drive turns back
    assert found["converged"] and multiplier > 0.0  # the bound of the peak holds the mass above its best
    # Of one variable every residual is gone where the bound is active with a positive multiplier.
    masses = np.linspace(0.5, 5.0, 226)
    inside = [m for m in masses if peak(mp.mpf(m)) <= 4.3]
    assert found["objective"] <= min(float(rms(torques_of_hoist(mp.mpf(m)))) for m in inside) * (1 + 1e-7)


def test_the_connecting_rod_is_as_thin_as_its_deflection_allows():
    """Against other elements on a grid of thicknesses: all thinner rods deflect more than they may."""
    found = optimised("connecting_rod.toml")
    best = found["parameters"]["thickness"]
    assert found["converged"] and found["objective"] == best
    assert found["constraints"]["rod.deflection.peak"] == pytest.approx(0.25e-3, rel=1e-5)
    assert found["constraints"]["rod.greatest_stress.peak"] < 40e6
    elastic = {"links.rod.elastic.element": "cubic", "links.rod.elastic.elements": 4}
    model = symgen.build(DOCS / "connecting_rod.toml", set=elastic)
    grid = [0.0042, 0.0045, 0.99 * best, 1.01 * best]
    runs = model.sweep({"thickness": grid}, "periodic", outputs=["rod.deflection", "rod.greatest_stress"])
    assert np.all(runs["rod.deflection.peak"].values[:-1] > 0.25e-3)
    assert (
        runs["rod.deflection.peak"].values[-1] < 0.25e-3
        and runs["rod.greatest_stress.peak"].values[-1] < 40e6
    )


def test_the_front_of_torque_and_stiffness_is_a_line():
    """A spring without free length takes stiffness*place*height from the moment of the weight at every angle."""
    model = symgen.build(DOCS / "barrier.toml", set={"free": "0 m"})
    bounds = {"stiffness": (100.0, 400.0), "height": (0.35, 0.8)}
    front = model.pareto(bounds, ["arm.torque.peak", "stiffness"], points=4, samples=7)
    k = front["stiffness"].values
    assert k == pytest.approx(np.linspace(100.0, 400.0, 4), rel=1e-4) and front["converged"].values.all()
    assert front["arm.torque.peak"].values == pytest.approx(8 * 9.81 * 1.5 - k * 0.3 * 0.8, rel=1e-7)
    assert front["height"].values == pytest.approx([0.8] * 4, rel=1e-6)
    for wrong in (["arm.torque.peak"], ["stiffness", "stiffness"]):
        with pytest.raises(ModelError, match="expected two objectives"):
            model.pareto(bounds, wrong, samples=7)
    with pytest.raises(ModelError, match="expected a lower and an upper bound of stiffness"):
        model.pareto(bounds, ["arm.torque.peak", "stiffness"], {"stiffness": None}, samples=7)
    with pytest.raises(ModelError, match="expected an output of the runs"):
        model.optimise(bounds, "stiffness", samples=7)


def test_objectives_without_a_conflict_have_one_best_design():
    model = symgen.build(DOCS / "barrier.toml", set={"free": "0 m"})
    bounds = {"stiffness": (100.0, 400.0), "height": (0.35, 0.8)}
    front = model.pareto(bounds, ["arm.torque.peak", "arm.torque.greatest"], points=3, samples=7)
    assert front.sizes["point"] == 1 and front["stiffness"].item() == pytest.approx(400.0)


def test_a_design_that_breaks_a_constraint_dominates_no_other():
    def found(objective, other, converged):
        parts = {"f": objective}, objective, {"g": other}, {"f": "1", "g": "1"}
        return Optimum(*parts, converged, "", "exact", 1, None)

    tunable = SimpleNamespace(name="f", unit="1")
    model = SimpleNamespace(description=SimpleNamespace(tunable=[tunable], title="", units={}))
    front = pareto.undominated(
        model, [found(0.0, 0.0, False), found(1.0, 2.0, True), found(2.0, 3.0, True)], "f", "g"
    )
    assert front["f"].values.tolist() == [0.0, 1.0] and front["converged"].values.tolist() == [False, True]


def test_two_objectives_of_a_scene_give_a_page(tmp_path):
    page = tmp_path / "front.html"
    two = ['optimise.objective=["arm.torque.peak", "stiffness"]', "optimise.samples=5", "optimise.points=3"]
    scene = [str(DOCS / "barrier.toml"), *(word for one in two for word in ("--set", one))]
    done = CliRunner().invoke(app, ["optimise", *scene, "--page", str(page)])
    assert "Pareto front of arm.torque.peak and stiffness" in done.stdout.replace("\n", " ")
    text = page.read_text(encoding="utf-8")
    assert "data:image/svg+xml" in text and ">stiffness [N/m]</th>" in text
    with pytest.raises(ModelError, match="found by SLSQP"):
        raise CliRunner().invoke(app, ["optimise", *scene, "--method", "trust-constr"]).exception
