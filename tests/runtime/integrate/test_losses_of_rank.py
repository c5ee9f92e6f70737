"""Runs through losses of rank: a crank that the closed loop leaves a pendulum, by Jacobi's functions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
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


@pytest.mark.parametrize("method", ["dop853", "taylor"])
@pytest.mark.parametrize("apart", [-0.05, -1e-2, -1e-3, 1e-3, 1e-2, 0.05, 0.2])
def test_a_run_that_begins_or_ends_next_to_a_loss_of_rank(model, method, apart):
    """The crank is horizontal there; the run names the loss if, and only if, it is within the run."""
    factor, start = np.sqrt(8 / 11), np.radians(125)

    def at(t):
        tip, rate = np.split(exact(t * factor, start), 2)
        return model.state({"B": tip, "C": tip + [3, 0]}, {"B": rate * factor, "C": rate * factor})

    loss = brentq(lambda t: exact(t * factor, start)[1], 0.3, 0.7, xtol=1e-14)
    chosen = {"method": method, "rtol": 1e-11, "samples": 2}
    until = model.simulate(loss + apart, state=at(0.0), **chosen)
    assert any("rank" in note for note in until.notes) == (apart > 0)
    for length in (0.03, 0.3):
        since = model.simulate(length, state=at(loss + apart), **chosen)
        assert any("rank" in note for note in since.notes) == (-length < apart < 0)
