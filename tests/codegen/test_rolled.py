"""Kernels as loops over tables, and the sparse start of large linkages."""

import numpy as np
import pytest

import symgen
from symgen.codegen import rolled
from symgen.lowering import program
from symgen.runtime.rods import start
from symgen.runtime.rods.redundancy import redundant_constraints


def runs(name, folder, monkeypatch):
    """Return accelerations at the start, redundant constraints and the motion of a scene."""
    monkeypatch.setenv("SYMGEN_CACHE", str(folder))
    model = symgen.build(name)
    motion = model.simulate(t_end=0.2)
    found = model.accelerations()
    return model, [found[p] for p in model.description.free], [motion[v] for v in motion.dataset.data_vars]


@pytest.mark.parametrize("name", ["two_four_bars", "parallelogram"])
def test_loops_give_the_bits_of_straight_line_code(name, tmp_path, monkeypatch):
    """Of a linkage that starts near lost rank, and of one with a redundant constraint, found by its pivot."""
    plain, *expected = runs(name, tmp_path / "plain", monkeypatch)
    monkeypatch.setattr(rolled, "STRAIGHT", 0)
    monkeypatch.setattr(rolled, "LEAST", 0)
    monkeypatch.setattr(program, "ALL_ZEROS", 0)
    model, *found = runs(name, tmp_path / "rolled", monkeypatch)
    source = next((tmp_path / "rolled").rglob("*_rolled.c")).read_text()
    assert all(f"{name}_{k.name}(" in source for k in model.description.kernels)
    assert model.description.redundant == plain.description.redundant
    for kernel in plain.description.kernels:
        assert model.description.kernel(kernel.name).out_size == kernel.out_size
    for of_loops, straight in zip(found, expected, strict=True):
        for a, b in zip(of_loops, straight, strict=True):
            np.testing.assert_array_equal(np.asarray(a), np.asarray(b))


@pytest.mark.parametrize("name", ["two_four_bars", "parallelogram", "four_bar"])
def test_sparse_velocities_are_those_of_the_dense_start(name):
    evaluator = symgen.build(name).evaluator
    starter = start._posed(evaluator)
    redundant = redundant_constraints(evaluator, starter.q)
    expected, found = starter.velocities(redundant), start.least_velocities(evaluator, starter.q, redundant)
    assert expected is not None
    np.testing.assert_allclose(found[0], expected[0], rtol=0, atol=1e-12 * expected[3])
    assert max(np.max(missed, initial=0.0) for missed in found[1:3]) <= 1e-13 * expected[3]
    assert found[3] == expected[3]
