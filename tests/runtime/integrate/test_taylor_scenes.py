"""Power series on random linkages: they agree with a Runge-Kutta method within the tolerances."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from shared.full import full_unless
from shared.invariant_scenes import driven, moving

import symgen
from symgen.errors import SceneError, SimulationError

RTOL, END = 1e-10, 1.0


def drawn(seed, events=False):
    """Return a random linkage in the plane or in space, under all loads, or driven; its start is possible.

    With events, the first moving point passes x = a and y = b; an event without a series is added to some.
    """
    rng = np.random.default_rng([38, seed])
    while True:
        tables = driven(rng) if seed % 5 == 4 else moving(rng, 2 if seed % 5 < 2 else 3)
        del tables["analysis"]
        if events:
            point = next(name for name, p in tables["points"].items() if not p.get("ground"))
            level = {"value": "0 m", "tunable": True}
            tables["parameters"] = tables.get("parameters", {}) | {"level_x": level, "level_y": level}
            tables["events"] = [
                {"name": axis, "of": f"{point}.{axis}", "value": f"level_{axis}"} for axis in "xy"
            ]
            if seed % 2:
                tables["events"].insert(0, {"name": "abs", "of": f"abs({point}.x)", "value": "0.3 m"})
            tables["analysis"] = {"outputs": [f"{point}.position", f"{point}.velocity"]}
        try:
            return symgen.build(symgen.Scene(**tables))
        except SceneError as error:
            assert "[start." in str(error)


def ended(model, method, rtol, **more):
    """Return coordinates and rates at the end, or the time of the dead centre that ends the run."""
    try:
        run = model.simulate(END, samples=2, method=method, rtol=rtol, atol=rtol / 100, **more)
    except SimulationError as error:
        return error.time
    return np.concatenate([np.ravel([x["position"], x["velocity"]]) for x in run.final.values()])


@pytest.mark.parametrize("seed", full_unless(lambda seed: seed < 12, range(500)))
def test_random_scenes_agree(seed):
    """Errors by a run at a tighter tolerance: ten times that of the other method is within the tolerance."""
    model = drawn(seed)
    exact = ended(model, "dop853", RTOL / 1000)
    series, other = ended(model, "taylor", RTOL, max_steps=5000), ended(model, "dop853", RTOL)
    if np.ndim(exact) == 0:
        assert series == pytest.approx(exact, rel=1e-3)
        return
    size = max(1.0, np.max(np.abs(exact)))
    gap = np.max(np.abs(series - exact)) / size
    assert gap < 1e-9 + 10 * np.max(np.abs(other - exact)) / size


@pytest.mark.parametrize("seed", full_unless(lambda seed: seed in (0, 1, 2, 3, 9), range(200)))
def test_events_of_random_scenes(seed):
    """Zeros of cubics through many samples of a run by another method, at levels which the point passes."""
    model, rng = drawn(seed, events=True), np.random.default_rng([39, seed])
    try:
        run = model.simulate(END, samples=4001, method="dop853", rtol=1e-12, atol=1e-14)
    except SimulationError:
        return  # a dead centre
    places, rates = (v.values[:, :2] for v in run.variables)
    levels = [rng.uniform(*np.quantile(x, [0.02, 0.98])) for x in places.T]
    curves = [
        CubicHermiteSpline(run.time, x - a, v) for x, v, a in zip(places.T, rates.T, levels, strict=True)
    ]
    model = model.with_parameters(level_x=levels[0], level_y=levels[1])
    found = model.simulate(END, samples=2, method="taylor", rtol=RTOL, atol=RTOL / 100).events
    for axis, curve in zip("xy", curves, strict=True):
        if np.ptp(curve(run.time)) < 1e-3:
            continue  # hardly any motion
        near = np.min(np.abs(curve(curve.derivative().roots(extrapolate=False))), initial=np.inf)
        if near < 1e-6 or np.min(np.abs(curve([0.0, END]))) < 1e-6:
            continue  # it may touch
        exact = curve.roots(extrapolate=False)
        own = [e for e in found if e.name == axis]
        assert [e.time for e in own] == pytest.approx(exact, abs=1e-7)
        assert [e.rising for e in own] == [bool(v > 0) for v in curve.derivative()(exact)]


def test_third_point_of_a_body_joins_a_rod():
    """Lengths of rods between sums of coordinates are kept by the series: no projection shortens the steps."""
    points = {"C": (-1.04, 0.922), "D": (-0.642, 0.016), "E": (-0.171, 1.378), "F": (-2.112, 1.775)}
    centre, inertia = ["-2.356 m", "1.551 m"], "0.453 kg*m^2"
    body = {"points": ["F", "E", "C"], "mass": "1.7 kg", "centre": centre, "inertia": inertia}
    model = symgen.build(
        symgen.Scene(
            points={p: {"at": [f"{x} m" for x in at]} for p, at in points.items()},
            links={"DC": {"points": ["D", "C"], "mass": "1.6 kg"}, "body": body},
            forces=[{"point": "F", "force": ["5 N", "0 N"]}],
        )
    )
    run = model.simulate(1.0, samples=2, method="taylor", rtol=1e-11, max_steps=100)
    assert run.statistics["steps"] < 20
