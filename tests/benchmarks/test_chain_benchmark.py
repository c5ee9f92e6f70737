"""The exact solution that benchmarks/chain.py measures errors by, and its calls of Pinocchio."""

from __future__ import annotations

import numpy as np
import pytest


@pytest.fixture(scope="module")
def benchmark(load):
    return load("chain")


@pytest.mark.parametrize("where", ["plane", "space"])
def test_exact_solution_is_that_of_the_whole_system(benchmark, where):
    state = benchmark.State(where, 6)
    found = state.exact()
    state.check(found)
    motion = state.chain.accelerations(along=state.along, rates=state.rates)
    assert benchmark.relative_error(motion.accelerations, found) < 1e-14
    found[3][0] += 1e-20
    with pytest.raises(ArithmeticError, match="differ"):
        state.check(found)


@pytest.mark.parametrize("where", ["plane", "space"])
def test_kernels_and_lanes_find_it(benchmark, where):
    state = benchmark.State(where, 6)
    for kernel in (benchmark.Kernel(state), benchmark.Batch(state)):
        kernel.times = 2
        kernel.run()
        assert kernel.error(state.exact()) < 1e-14


def test_pinocchio_is_given_the_same_chain(benchmark):
    pin = pytest.importorskip("pinocchio", reason="the extra 'peers' is not installed")
    state = benchmark.State("plane", 6)
    peer = benchmark.Peer(pin, state)
    assert peer.error() < 1e-13
    peer.run()
    angle = np.cumsum(peer.q)
    assert np.allclose(state.along, np.stack([np.cos(angle), -np.sin(angle)], axis=1), atol=1e-14)
