"""Derivatives along runs through losses of rank, against the pendulum that parallel cranks are."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import symgen
from symgen.errors import SimulationError
from symgen.runtime.linearisation import runs
from symgen.scene.loading import read_scene

TIMES = np.linspace(0.1, 2.0, 20)
DIRECTIONS = ["AB.angle", "AB.angle'"]


def pendulum(angle, rate, ratio):
    """Slopes of the cosine of its angle by angle and rate at the start, where rate' = -ratio cos(angle)."""

    def rates(_, y):
        f, w, by_angle, w_by_angle, by_rate, w_by_rate = y
        slope = ratio * np.sin(f)
        return [w, -ratio * np.cos(f), w_by_angle, slope * by_angle, w_by_rate, slope * by_rate]

    start = [angle, rate, 1, 0, 0, 1]
    y = solve_ivp(rates, (0, 2), start, "DOP853", TIMES, rtol=1e-13, atol=1e-13).y
    return -np.sin(y[0]) * y[[2, 4]]


def slopes_of(model, angle, rate, rtol, by=DIRECTIONS, times=TIMES):
    start = model.state({"AB.angle": angle}, {"AB.angle": rate})
    found = model.sensitivity(
        ["B.position.x"], by, at=start, coordinates=["AB.angle"], rtol=rtol, t_eval=times
    )
    return found.derivatives[:, 0], found.notes


def test_stages_next_to_a_loss_of_rank_keep_the_constraints():
    data = read_scene("parallelogram").data
    zeros = [f"T{i}" for i in range(6)]  # enough directions that one output at one time is carried back
    data |= {"parameters": {name: {"value": "0 N*m", "tunable": True} for name in zeros}}
    data["torques"] = [{"link": "AB", "torque": name} for name in zeros]
    angle, model = float(np.arctan2(0.8, 0.6)), symgen.build(symgen.Scene(**data))
    ratio = 9.81 * 4 / (2 / 3 + 3)
    forward, _ = slopes_of(model, angle, 10.0, 1e-10)
    assert np.max(np.abs(forward - pendulum(angle, 10.0, ratio).T)) < 5e-9
    forward, _ = slopes_of(model, angle, 9.5, 1e-8, DIRECTIONS, TIMES[-1:])
    back, _ = slopes_of(model, angle, 9.5, 1e-8, [*DIRECTIONS, *zeros], TIMES[-1:])
    assert np.max(np.abs(back[:, :2] - forward)) < 1e-12


@pytest.mark.parametrize("rtol", [1e-8, 1e-12])
@pytest.mark.parametrize("rate", [9.0, 10.0, 12.0])
def test_the_note_on_a_loss_of_rank_has_the_error(rate, rtol):
    """Forces grow without bound there, as the coupler's centre is not in the middle: errors are up to 2e-4."""
    angle = float(np.arctan2(-0.8, 0.6))
    expected = pendulum(angle, rate, 9.81 * 3.5 / (2 / 3 + 0.34 + 2)).T
    found, notes = slopes_of(symgen.build("double_four_bar"), angle, rate, rtol)
    errors = np.abs(found - expected)
    error = np.max(np.max(errors, axis=0) / np.max(np.abs(expected), axis=0))
    noted = re.search(r"lose rank at t = 0\.\d+ s.* differs by (\S+) of its largest value", notes[0])
    assert error < 5 * float(noted[1])


def test_derivatives_are_kept_where_other_steps_fail(monkeypatch):
    follow, failed = runs.follow, []

    def at_one_tolerance(kernels, tangent, redundant, start, chosen, times):
        if chosen.rtol != 1e-12:
            failed.append(chosen)
            raise SimulationError("the step is too small\n  Take a looser tolerance.", time=0.3)
        return follow(kernels, tangent, redundant, start, chosen, times)

    monkeypatch.setattr("symgen.runtime.rods.model.derivatives.follow", at_one_tolerance)
    angle = float(np.arctan2(-0.8, 0.6))
    expected = pendulum(angle, 10.0, 9.81 * 3.5 / (2 / 3 + 0.34 + 2)).T
    found, (note,) = slopes_of(symgen.build("double_four_bar"), angle, 10.0, 1e-12)
    assert failed
    assert np.max(np.abs(found - expected)) < 1e-3
    assert re.search(r"lose rank at t = .* unknown.* steps of another length \(the step is too small", note)
