"""Runs through losses of rank: a crank that the closed loop leaves a pendulum, by Jacobi's functions."""

from __future__ import annotations

import numpy as np
import pytest
from shared.pendulum import exact

import symgen


@pytest.fixture(scope="module")
def model():
    return symgen.build("parallelogram")


@pytest.mark.parametrize(
    ("method", "rtol", "bound"), [("dop853", 1e-13, 1e-12), ("taylor", 1e-13, 1e-12), ("dopri5", 1e-9, 1e-7)]
)
def test_errors_do_not_depend_on_where_steps_would_end(model, method, rtol, bound):
    """Released from 100 to 140 degrees: 6 to 8 losses of rank, near one of which a step of some run would end.

    Of the crank, phi'' = -12/11 g sin(phi); of the rod of ``exact``, -3/2 g sin(phi). Rounding errors of rates grow
    with the inverse square of the distance from the loss.
    """
    for start in np.radians(np.linspace(100, 140, 41)).tolist():
        tip = np.array([np.sin(start), -np.cos(start)])
        state = model.state({"B": tip, "C": tip + [3, 0]}, {"B": [0, 0], "C": [0, 0]})
        run = model.simulate(5.0, method=method, rtol=rtol, state=state, samples=2)
        expected = exact(5.0 * np.sqrt(8 / 11), start)[:2]
        assert np.abs(run.final["B"]["position"] - expected).max() < bound, (start, run.notes)
        assert any("losses of rank" in note for note in run.notes)
