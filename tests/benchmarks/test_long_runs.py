"""What benchmarks/long_runs.py measures, in a run of a few thousand steps."""

from __future__ import annotations

import numpy as np
import pytest


@pytest.fixture(scope="module")
def runs(load):
    return load("long_runs")


@pytest.fixture(scope="module")
def found(runs):
    return {(n, h, w.name): runs.drift(n, h, w, 4000) for n, h in runs.RUNS for w in runs.WAYS}


def test_the_chain_is_that_of_the_table(runs):
    """Together 1 m and 1 kg, level but for the bends; it turns as a rod of m l^2/3 where it is straight."""
    model, scale = runs.system("chain of 3")
    assert scale == pytest.approx(9.81 / 2)
    state = model.initial_state()
    rods = np.diff(np.array([state.positions[f"P{i}"] for i in range(4)]), axis=0)
    assert np.linalg.norm(rods, axis=1) == pytest.approx([1 / 3] * 3, rel=1e-12)
    assert np.arctan2(rods[:, 1], rods[:, 0]) == pytest.approx([0.0, 0.1, 0.0], abs=1e-12)
    assert model.rhs.energy(0.0, model.rhs.start) == pytest.approx(9.81 * np.sin(0.1) / 3 * (0.5 + 1) / 3)


def test_curves_and_worst_of_all_steps_agree(found):
    """Lengths from the positions recorded, against the drift that the step loop watched."""
    for (_, _, way), d in found.items():
        if not d.died and d.worst_length > 1e-13:
            assert 0.3 * d.worst_length < d.length.max() <= 1.001 * d.worst_length, way
        elif not d.died:
            assert d.length.max() < 1e-14, way
        assert len(d.times) == len(d.energy) == len(d.length)


def test_the_table_in_kind(runs, found):
    """What must hold after a million steps does after a few thousand, but for how far raw lengths are off."""
    for line in runs.required(found):
        assert line.holds or "raw" in line.name, line
    assert found["chain of 3", 5e-3, "raw RK4"].died
    assert found["chain of 2", 1e-3, "RATTLE, order 4"].worst_energy < 1e-2 * abs(
        found["chain of 2", 1e-3, "RATTLE"].worst_energy
    )


def test_what_must_hold_can_fail(runs, found):
    """Lengths that drift under the name of the projection are seen."""
    wrong = dict(found)
    for name in ("chain of 2", "chain of 3", "four-bar"):
        wrong[name, 1e-3, "RK4, projection"] = found[name, 1e-3, "raw RK4"]
        wrong[name, 1e-3, "RATTLE"] = found[name, 1e-3, "raw RK4"]
    assert sum(not line.holds for line in runs.required(wrong)) >= 6


def test_plots(runs, found, tmp_path):
    files = runs.draw(found, tmp_path / "plots")
    assert len(files) == len(runs.RUNS)
    assert all(file.stat().st_size > 10_000 for file in files)
