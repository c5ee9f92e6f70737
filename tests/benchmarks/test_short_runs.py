"""Benchmarks that `.ci/run` leaves out, on small cases."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest

from symgen.runtime.integrate.integrators import INTEGRATORS


def test_work_precision_of_symgen_alone(load, monkeypatch, capsys):
    bench = load("work_precision")
    for name, value in {"SIZES": (3,), "LONGEST": {3: 1e-3}, "SHORT_ROUNDS": 2}.items():
        monkeypatch.setattr(bench, name, value)
    monkeypatch.setattr(sys, "argv", ["work_precision.py", "--short", "--json"])
    assert bench.main() == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert rows and {row["method"].partition(",")[0] for row in rows} <= set(INTEGRATORS)
    assert all(0 < row["end"] <= row["along"] < 1 for row in rows)


def test_sweeps_against_numpy(load, monkeypatch):
    sweeps = load("sweeps")
    monkeypatch.setattr(sweeps, "POSES", 37)
    found, reference = sweeps.sweep(None, 8, 1, samples=37), sweeps.Reference()
    peaks = reference.peaks(*(found[name].values for name in sweeps.LENGTHS))
    for output, peak in zip(sweeps.OUTPUTS, peaks, strict=True):
        assert found[f"{output}.peak"].values == pytest.approx(peak, rel=1e-9, abs=1e-9 * max(peak))


def test_coupler_curves(load):
    """The track of a four-bar has its lengths and the chords of its points; linkages through five of them."""
    bench = load("coupler_curves")
    a, b, c, far, angle = own = np.array([0.4, 1.1, 0.9, 0.5, 0.8])
    cranks = np.linspace(0, 2 * np.pi, bench.POSES)[:-1]
    track = bench.curve(own, cranks)
    joint = a * np.exp(1j * cranks)
    end = joint + (track @ [1, 1j] - joint) * np.exp(-1j * angle) * b / far
    assert np.abs(end - 1) == pytest.approx(np.full(len(end), c), rel=1e-12)
    assert bench.missed(track, track[::7]) == pytest.approx(0, abs=1e-12)
    assert bench.missed(track, 3 * np.ones((1, 2))) == pytest.approx(
        np.abs(track @ [1, 1j] - 3 - 3j).min(), rel=1e-3
    )
    error, _ = bench.solved(bench.problems()["five of a curve"])
    assert error < bench.SMALL


def test_synthesis_of_a_task_of_every_kind(load):
    measured = load("synthesis").measured(1)
    assert all(line.holds for line in measured.required), measured.required


def test_states_of_extreme_numbers_do_not_stop_the_core(load):
    sanitized = load("sanitized")
    with np.errstate(all="ignore"):
        assert "calls of kernels" in sanitized.scene("four_bar")


def test_a_state_feedback_of_a_cart_pole(load, monkeypatch):
    control = load("control")
    monkeypatch.setattr(control, "SAMPLES", 40)
    measured = control.measured(2)
    assert all(line.holds for line in measured.required if not line.timed), measured.required
    assert len(measured.rows) >= 9
