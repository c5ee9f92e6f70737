"""Rainflow counting of stress histories: the example of the standard, cosines, and a steady state."""

from __future__ import annotations

import numpy as np
import pytest

import symgen
from symgen.errors import ModelError
from symgen.runtime.result.elastic import rainflow


def counted(history):
    found: dict[float, float] = {}
    for size, _, count in rainflow(np.array(history, dtype=float)):
        found[size] = found.get(size, 0.0) + count
    return found


def test_example_of_the_standard():
    """ASTM E1049-85, Fig. 6."""
    assert counted([-2, 1, -3, 5, -1, 3, -4, 4, -2]) == {3: 0.5, 4: 1.5, 6: 0.5, 8: 1.0, 9: 0.5}
    # Points between the peaks, and values that stay, change nothing.
    assert counted([-2, 0, 1, 1, -3, 5, 2, -1, 3, 3, -4, 4, -2]) == {3: 0.5, 4: 1.5, 6: 0.5, 8: 1.0, 9: 0.5}


def test_few_values():
    assert counted([]) == counted([1]) == counted([1, 1]) == {}
    assert counted([1, 4]) == {3: 0.5}


def test_ripples_on_a_slow_cosine():
    """Three periods 10 cos(t), each with a ripple of range 2 on its way down, that closes there."""
    history = []
    for _ in range(3):
        history += [10, 1, 3, -10]
    found = counted([*history, 10])
    assert found == {20: 3.0, 2: 3.0}


@pytest.fixture(scope="module")
def steady():
    return symgen.build("elastic_slider_crank").periodic(samples=181)


def test_cycles_of_a_steady_state(steady):
    """All cycles close, the largest has the whole range, and the sum of ranges is the path of the stress."""
    name = next(v.name for v in steady.variables if v.name.endswith(".stress"))
    cycles, values = steady.fatigue_cycles(name), steady[name].values
    assert cycles["range"].values[0] == pytest.approx(values.max() - values.min())
    assert cycles["mean"].values[0] == pytest.approx((values.max() + values.min()) / 2)
    assert cycles["count"].values[0] == 1.0
    path = 2 * float((cycles["range"] * cycles["count"]).sum())
    assert path == pytest.approx(np.abs(np.diff(values)).sum(), rel=1e-4)
    assert cycles["range"].attrs["units"] == "Pa"


def test_the_last_of_some_angles_counts(steady):
    """Of a steady state at three angles, without the end of the revolution."""
    some = symgen.build("elastic_slider_crank").periodic(at=[0.0, 0.5, 4.0])
    cycles, values = some.fatigue_cycles("rod.stress"), some["rod.stress"].values
    assert values[-1] in (values.min(), values.max())
    assert cycles["range"].values.tolist() == pytest.approx([np.ptp(values)])
    assert cycles["count"].values.tolist() == [1.0]


def test_outputs_without_cycles(steady):
    with pytest.raises(ModelError, match="one number over increasing times"):
        steady.fatigue_cycles("A.displacement")
