"""States and inputs are real numbers: complex numbers, None, dates, text and flags are refused, never converted."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import symgen
from symgen.errors import ModelError
from symgen.runtime.result.state import State

OTHERS = {
    "complex": lambda y: y + 1e-20j,
    "list of complex": lambda y: [*(y + 1e-20j)],
    "None": lambda y: [None] * len(y),
    "dates": lambda y: np.zeros(len(y), "datetime64[s]"),
    "durations": lambda y: np.zeros(len(y), "timedelta64[s]"),
    "text": lambda y: [str(value) for value in y],
    "bytes": lambda y: y.astype("S"),
    "flags": lambda y: y > 0,
    "rows of unequal length": lambda y: [[value] * (i + 1) for i, value in enumerate(y)],
}


@pytest.fixture(scope="module")
def model():
    return symgen.build("triple_pendulum")


@pytest.mark.parametrize("other", OTHERS)
def test_other_values_are_refused(model, other):
    rhs = model.rhs
    y, n = OTHERS[other](rhs.start), len(rhs.start) // 2
    begin = model.initial_state()
    calls = [
        lambda: rhs(0.0, y),
        lambda: rhs.project(0.0, y),
        lambda: rhs.energy(0.0, y),
        lambda: rhs(0.0, rhs.start, y),
        lambda: model.batch("accelerations", 0.0, [y[:n]]),
        lambda: model.record([0.0, 1.0], [y, y]),
        lambda: model.state(dict(zip(model.description.free, np.reshape(y[:n], (-1, 2)), strict=True))),
        lambda: model.accelerations(State(0.0, y[:n], begin.u, {}, {})),
        lambda: model.simulate(0.1, state=State(0.0, begin.q, y[n:], {}, {})),
        lambda: model.simulate_many({}, states=[State(0.0, y[:n], begin.u, {}, {})]),
    ]
    if other == "rows of unequal length":
        calls = [*calls[:4], *calls[7:]]
    for call in calls:
        with pytest.raises(ModelError, match="expected"):
            call()


def test_real_numbers_of_every_kind_are_accepted(model):
    rhs = model.rhs
    exact = np.round(4 * rhs.start) / 4
    expected = rhs(0.0, exact)
    for y in (
        exact.astype(np.float32),
        exact.astype(np.longdouble),
        exact[::-1].copy()[::-1],
        exact.tolist(),
        [Fraction(value) for value in exact.tolist()],
        (4 * exact).astype(int) / 4,
    ):
        assert np.array_equal(rhs(0.0, y), expected)
    n = len(exact) // 2
    begin = State(0.0, exact[:n].tolist(), exact[n:].astype(np.float32), {}, {})
    assert np.array_equal(np.concatenate([begin.q, begin.u]), exact)
