"""Tolerances of a driven pendulum, whose peak torque is the product m*g*L/2: closed forms of all methods."""

from __future__ import annotations

import math

import numpy as np
import pytest

import symgen
from symgen.errors import ModelError, SimulationError
from symgen.runtime.sweeps.designs import Normal, Uniform

G = 9.81
OF = {"length": Uniform(0.4, 0.6), "mass": Uniform(1.0, 4.0)}
OPTIONS = {"outputs": ["rod.torque"], "samples": 5}


@pytest.fixture(scope="module")
def model():
    scene = {
        "parameters": {
            "length": {"value": "0.5 m", "tunable": True},
            "mass": {"value": "2 kg", "tunable": True},
            "speed": "1 rad/s",
        },
        "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "P": {"at": ["0.5 m", "0 m"]}},
        "links": {"rod": {"points": ["O", "P"], "length": "length", "mass": "mass"}},
        "gravity": {"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        "drivers": [{"link": "rod", "angle": "speed*t"}],
        "analysis": {"t_end": "6.283185307179586 s"},
    }
    return symgen.build(symgen.Scene(**scene), backend="c")


def moments(distribution):
    """Return mean and variance of a uniform distribution."""
    return (distribution.low + distribution.high) / 2, (distribution.high - distribution.low) ** 2 / 12


def test_the_worst_case_is_at_the_corners(model):
    found = model.tolerances(OF, method="worst-case", **OPTIONS).sel(output="rod.torque.peak")
    assert found["least"].item() == pytest.approx(0.4 * 1.0 * G / 2, rel=1e-12)
    assert found["greatest"].item() == pytest.approx(0.6 * 4.0 * G / 2, rel=1e-12)
    assert found["greatest_at"].values.tolist() == [0.6, 4.0]
    assert found["unit"].item() == "N*m"
    normal = model.tolerances({"mass": Normal(2.0, 0.1)}, method="worst-case", **OPTIONS)
    assert normal["greatest"].item() == pytest.approx(2.3 * 0.5 * G / 2, rel=1e-12)


def test_monte_carlo_has_the_moments_of_a_product_and_repeats_to_the_bit(model):
    one, two, other = (
        model.tolerances(OF, count=256, seed=s, threads=t, **OPTIONS) for s, t in ((5, 1), (5, 2), (6, 1))
    )
    assert one.equals(two) and not one.equals(other)
    (a, v), (b, w) = moments(OF["length"]), moments(OF["mass"])
    found = one.sel(output="rod.torque.peak")
    mean, variance = a * b * G / 2, (a**2 * w + b**2 * v + v * w) * (G / 2) ** 2
    assert found["error"].item() == pytest.approx(math.sqrt(variance / 256), rel=0.15)
    assert found["mean"].item() == pytest.approx(mean, abs=4 * math.sqrt(variance / 256))
    assert found["deviation"].item() == pytest.approx(math.sqrt(variance), rel=0.15)
    low, median, high = found["quantile"].values
    assert 0.4 * G / 2 < low < median < high < 0.6 * 4.0 * G / 2


def test_monte_carlo_of_the_slider_crank_repeats_to_the_bit():
    of = {"a4": Uniform(0.0, 0.02), "S1": Normal(0.01, 0.002), "rpm": Normal(5.2, 0.05)}
    options = {
        "count": 40,
        "outputs": ["S4", "slider.joint4.force"],
        "reduce": ["range", "peak"],
        "samples": 9,
    }
    slider = symgen.build("slider_crank")
    one, two, other = (
        slider.tolerances(of, seed=s, threads=t, **options) for s, t in ((5, 1), (5, 2), (6, 1))
    )
    assert one.identical(two) and not one.equals(other)
    stroke = one.sel(
        output="S4.range"
    )  # of a crank of 12 in on a line through its axis; offsets change it little
    assert stroke["mean"].item() == pytest.approx(2 * 12 * 0.0254, rel=1e-3)


def test_sobol_indices_of_a_product(model):
    found = model.tolerances(OF, method="sobol", count=128, **OPTIONS).sel(output="rod.torque.peak")
    (a, v), (b, w) = moments(OF["length"]), moments(OF["mass"])
    variance = a**2 * w + b**2 * v + v * w
    first, total = (
        np.array([b**2 * v, a**2 * w]) / variance,
        np.array([b**2 + w, a**2 + v]) * [v, w] / variance,
    )
    assert np.all(np.abs(found["first"].values - first) <= 2 * found["first_error"].values)
    assert np.all(np.abs(found["total"].values - total) <= 2 * found["total_error"].values)
    assert np.all(found["first_error"].values < 0.3)
    assert not np.allclose(first, total, atol=1e-3)


def test_wrong_tolerances_are_refused(model):
    for of, more, words in (
        ({}, {}, "expected a distribution of a parameter"),
        ({"mass": [1.0, 2.0]}, {}, "expected a distribution of mass"),
        (OF, {"method": "guess"}, "no tolerances by 'guess'"),
        (OF, {"outputs": []}, "expected an output to measure"),
        (OF, {"count": 10**30}, "expected a number of runs of random samples"),
        (OF, {"count": 10**11}, "too large for memory: take fewer"),
        (OF, {"reduce": "history"}, "tolerances are of reductions"),
        (OF, {"method": "sobol", "count": 100}, "power of two"),
        ({f"p{i}": Uniform(0, 1) for i in range(17)}, {"method": "worst-case"}, "at most 16 parameters"),
    ):
        with pytest.raises(ModelError, match=words):
            model.tolerances(of, **{**OPTIONS, **more})
    with pytest.raises(SimulationError, match="1 of 2 runs failed"):
        model.tolerances({"length": Uniform(0.0, 0.5)}, method="worst-case", **OPTIONS)
