"""Inputs of driven loops as functions of time: evaluated over the input and over time."""

from __future__ import annotations

import numpy as np
import pytest

import symgen
from symgen.errors import SimulationError
from symgen.runtime.loop.kernels import LoopKernels


def crank_rocker(motion, lengths=(0.1, 0.4, 0.3, 0.35), **loop):
    """A four-bar linkage with joints O and D = (-0.35, 0); its inputs are written by h, T and w."""
    links = zip(("crank", "coupler", "rocker", "ground"), ("q", "?", "?", "?"), lengths, strict=True)
    rows = [{"joint": "R", "link": n, "theta": x, "a": f"{a} m"} for n, x, a in links]
    parameters = {"h": "2 rad", "T": "2 s", "w": "1 rad/s"}
    return symgen.build(
        symgen.Scene(parameters=parameters, loop={"rows": rows, "inputs": {"q": motion}, **loop})
    )


def rocker(q, side, lengths=(0.1, 0.4, 0.3, 0.35)):
    """The direction of the rocker, from the triangle on the line from D to the end of the crank."""
    crank, coupler, length, ground = lengths
    line = crank * np.exp(1j * q) + ground
    cosine = (np.abs(line) ** 2 + length**2 - coupler**2) / (2 * np.abs(line) * length)
    return np.exp(1j * (np.angle(line) + side * np.arccos(cosine))) * -1.0  # towards D


def check_rocker(turn, q, lengths=(0.1, 0.4, 0.3, 0.35)):
    found = np.exp(1j * sum(turn.variable(n).values for n in ("q", "theta2", "theta3")))
    errors = [np.max(np.abs(found - rocker(q, side, lengths))) for side in (1, -1)]
    assert turn.variable("q").values == pytest.approx(q, abs=1e-14)
    assert min(errors) < 1e-12


@pytest.mark.parametrize(
    ("motion", "value"),
    [
        ("h*(t/T - sin(2*pi*t/T)/(2*pi))", lambda s: s - np.sin(2 * np.pi * s) / (2 * np.pi)),
        ("h*(3*(t/T)**2 - 2*(t/T)**3)", lambda s: 3 * s**2 - 2 * s**3),
    ],
)
def test_laws_of_motion_from_rest_to_rest(motion, value):
    """The rise to its very end, then over time beyond it: the return, or the dwell between two rises."""
    model = crank_rocker(motion, range=["0 rad", "2 rad"])
    turn = model.inverse_dynamics(at=np.linspace(0.0, 2.0, 41))
    check_rocker(turn, np.linspace(0.0, 2.0, 41))
    assert 2.0 * value(turn.time / 2.0) == pytest.approx(np.linspace(0.0, 2.0, 41), abs=1e-14)
    assert np.all(np.diff(turn.time) > 0.0) and turn.time[-1] == pytest.approx(2.0, abs=1e-4)
    moved = model.inverse_dynamics(stop=3.0, over="time", samples=61)
    assert moved.time == pytest.approx(np.linspace(0.0, 3.0, 61))
    check_rocker(moved, 2.0 * value(moved.time / 2.0))
    assert moved.over[1] == "time [s]"


def test_the_return_stroke_of_an_input():
    model = crank_rocker("h*sin(pi*t/T)", range=["0 rad", "1 rad"])
    turn = model.inverse_dynamics(stop=4.0, over="time", samples=81)
    check_rocker(turn, 2.0 * np.sin(np.pi * turn.time / 2.0))
    rates = turn.variable("theta3.rate").values
    assert rates[5] == pytest.approx(-rates[35], rel=1e-9)  # the same pose, forth and back


def test_times_of_nonlinear_inputs_are_found_together(monkeypatch):
    model = crank_rocker("w*t + 0.1*sin(w*t)")
    model.inverse_dynamics(samples=3)
    calls, plain = [], LoopKernels.__call__
    monkeypatch.setattr(LoopKernels, "__call__", lambda *a: calls.append(a[1]) or plain(*a))
    turn = model.inverse_dynamics(samples=1001)
    assert turn.time + 0.1 * np.sin(turn.time) == pytest.approx(np.linspace(0.0, 2 * np.pi, 1001), abs=1e-14)
    assert len(calls) < 100


def test_values_need_no_closure_at_the_beginning_of_the_range():
    """A crank of 0.5 m: its end is out of the reach of the rocker until 70.4 deg."""
    lengths = (0.5, 0.4, 0.3, 0.35)
    model = crank_rocker("w*t", lengths)
    turn = model.inverse_dynamics(at=np.radians([80.0, 120.0]))
    check_rocker(turn, np.radians([80.0, 120.0]), lengths)
    with pytest.raises(SimulationError, match="cannot be followed beyond q = "):
        model.inverse_dynamics()
