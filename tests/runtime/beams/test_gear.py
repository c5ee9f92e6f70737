"""Gear's method of elastic links: order, the recursion of one vibration, and the band in which it is unstable."""

from __future__ import annotations

import numpy as np
import pytest

import symgen
from symgen.errors import SimulationError
from symgen.runtime.beams.methods import BEAM_METHODS
from symgen.runtime.elastic.steps import stepped

#: Coefficients of the steps backwards (E. Hairer, S. P. Norsett, G. Wanner, Solving ODEs I, III.1.22').
BACKWARD = {
    2: (3 / 2, -2, 1 / 2),
    3: (11 / 6, -3, 3 / 2, -1 / 3),
    4: (25 / 12, -4, 3, -4 / 3, 1 / 4),
    5: (137 / 60, -5, 5, -10 / 3, 5 / 4, -1 / 5),
}


@pytest.fixture(scope="module")
def vibration():
    """The fastest vibration of a strip that stands still: steps, and its shape and frequency.

    Round-off excites others, and those faster than the one that the steps resolve would grow.
    """
    motion = symgen.build("rotating_cantilever").with_parameters(speed=1e-9).motion(False)
    equations = motion.equations(False)
    _, mass, _, stiffness, _, _ = equations.matrices(0.0, True)
    squares, shapes = np.linalg.eig(np.linalg.solve(mass, stiffness))
    fastest = int(np.argmax(np.real(squares)))
    shape, frequency = np.real(shapes[:, fastest]), float(np.sqrt(np.real(squares[fastest])))
    shape /= np.max(np.abs(shape))

    def states(order, times, counts):
        start = shape[:, None], np.zeros((len(shape), 1))
        found, rates = stepped(
            motion,
            equations,
            BEAM_METHODS[f"bdf{order}"],
            np.array(times) / frequency,
            np.array(counts),
            start,
        )
        part = shape / (shape @ shape)
        assert np.max(np.abs(found - np.outer(found @ part, shape))) < 1e-6
        return found @ part, rates @ part / frequency

    return states


@pytest.mark.parametrize("order", BACKWARD)
def test_order_with_steps_of_two_lengths(vibration, order):
    """Against cos(w t); the step becomes half as long again at a recorded time, and the past is kept."""
    ends = [2.0, 5.0]
    errors = []
    for n in (40, 80):
        places, rates = vibration(order, ends, [n, n])
        errors.append(np.max(np.abs([places - np.cos(ends), rates + np.sin(ends)])))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.3)


@pytest.mark.parametrize("order", BACKWARD)
def test_steps_are_those_of_the_recursion(vibration, order):
    """For z = S' / w + i S the motion is z' = i w z; the first steps are Pade's approximation of order 6."""
    x, count = 0.3, 12
    z = 1j * x
    up = 1 + z / 2 + z**2 / 10 + z**3 / 120
    past = [1j * (up / up.conjugate()) ** k for k in range(order)]
    newest, *others = BACKWARD[order]
    while len(past) <= count:
        past.append(-sum(a * p for a, p in zip(others, reversed(past), strict=False)) / (newest - z))
    places, rates = vibration(order, x * np.arange(1, count + 1), [1] * count)
    assert places + 1j * rates == pytest.approx(np.imag(past[1:]) + 1j * np.real(past[1:]), abs=1e-7)


def test_vibrations_within_a_band_grow():
    """Fastest vibration of the four-bar: 4584 Hz. With 2250 steps w h = 2.1; order 5 multiplies it by 1.37 there."""
    model = symgen.build("thesis_four_bar")
    kept = model.simulate(method="bdf2", steps=2250, samples=9)
    assert np.isfinite(kept["crank.stress"].values).all()
    with pytest.raises(SimulationError, match="grows without bound: the step is too long for bdf5"):
        model.simulate(method="bdf5", steps=2250, samples=9)


@pytest.mark.parametrize("order", BACKWARD)
def test_order_on_a_linkage_with_a_guide(order):
    """With constraints, whose independent unknowns change, and damped modes; against collocation."""
    model = symgen.build("elastic_slider_crank")
    asked = {"samples": 19, "revolutions": 0.25}
    truth = model.simulate(method="gauss", steps=20000, **asked)["rod.bending_strain"].values
    runs = (model.simulate(method=f"bdf{order}", steps=n, **asked) for n in (18000, 36000))
    errors = [np.max(np.abs(run["rod.bending_strain"].values - truth)) for run in runs]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.3)
