"""What benchmarks/loop.py measures and compares with: the lambdified route, the vector model, Pinocchio."""

from __future__ import annotations

import numpy as np
import pytest


@pytest.fixture(scope="module")
def benchmark(load):
    return load("loop")


@pytest.fixture(scope="module")
def truth(benchmark):
    return benchmark.turn_of_vectors(12)


def test_symgen_against_the_vector_model(benchmark, truth):
    loop = benchmark.Loop("slider_crank")
    assert benchmark.against_vectors(loop, truth, 12) < 1e-12
    loop.model = loop.model.with_parameters(S1=0.0)
    assert benchmark.against_vectors(loop, truth, 12) > 1e-3


@pytest.mark.parametrize("scene", ["planar_4r", "slider_crank"])
def test_lambdified_route_gives_the_same(benchmark, scene):
    loop = benchmark.Loop(scene)
    route = benchmark.Lambdified(loop, "math")
    angles = loop.angles(37)
    assert benchmark.difference(loop.outputs(angles), route.follow(angles)) < 1e-11
    assert 1.0 < route.steps < 4.0


def test_ratio_counts_only_where_the_time_does_not_hold(benchmark):
    from harness import Timing

    def of(seconds):
        return Timing(seconds, seconds, seconds, seconds)

    timings = {(name, how): of(1e-3) for name in benchmark.SCENES for how in ("numpy", "math")}
    errors = dict.fromkeys([(name, "symgen") for name in benchmark.SCENES], 0.0)
    for ours, holds in ((2e-6, True), (20e-6, True), (50e-6, False)):
        timings |= {(name, "symgen"): of(ours) for name in benchmark.SCENES}
        assert all(r.holds for r in benchmark.required(timings, errors)) is holds
    timings |= {(name, "symgen"): of(2e-6) for name in benchmark.SCENES}
    errors["rccc", "symgen"] = np.nan
    assert not all(r.holds for r in benchmark.required(timings, errors))


def test_pinocchio_is_given_the_same_mechanism(benchmark, truth):
    pin, why = benchmark.peer_module()
    if not pin:
        pytest.skip(why)
    peer = benchmark.Peer(pin, truth)
    assert peer.error() < 1e-12
    peer.run()
