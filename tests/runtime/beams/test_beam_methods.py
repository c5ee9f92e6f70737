"""Methods with fixed steps of elastic motions: order on a linkage, and what long steps do to an oscillator."""

from __future__ import annotations

import numpy as np
import pytest

import symgen
from symgen.runtime.beams.methods import BEAM_METHODS, GAUSS
from symgen.runtime.elastic.steps import step_counts, stepped

FIXED = [m.name for m in BEAM_METHODS.values() if not m.collocated]
#: Steps over period from which a mode counts as not resolved.
LONG = np.geomspace(1e-2, 1e4, 61)


@pytest.fixture(scope="module")
def linkage():
    motion = symgen.build("thesis_four_bar").motion(False)
    equations, times = motion.equations(False), np.array([motion.period / 8])

    def ends(method, per_turn):
        found, _ = stepped(motion, equations, method, times, step_counts(motion, times, per_turn))
        return found[0]

    return ends, ends(GAUSS, 8000)


@pytest.mark.parametrize("name", FIXED)
def test_order_on_a_linkage(linkage, name):
    ends, truth = linkage
    errors = [np.max(np.abs(ends(BEAM_METHODS[name], n) - truth)) for n in (16000, 32000)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(BEAM_METHODS[name].order, abs=0.2)


def amplification(method, x):
    """The map of (S, h S', h^2 S'') over a step h of S'' + w^2 S = 0, with x = w h."""
    at, x2 = method.at, x * x
    new = method.inertia[1] + x2 * method.place[1]
    acceleration = -np.array([x2, x2 * at, method.inertia[0] + x2 * method.place[0]]) / new
    rate = np.array([0, 1, 1 - method.gamma]) + method.gamma * acceleration
    place = np.array([1, 1, 0.5 - method.beta]) + method.beta * acceleration
    return np.array([place, rate, acceleration])


@pytest.mark.parametrize("name", FIXED)
def test_stable_at_any_step(name):
    radii = [np.abs(np.linalg.eigvals(amplification(BEAM_METHODS[name], 2 * np.pi * x))).max() for x in LONG]
    assert max(radii) <= 1 + 1e-6
    at_infinity = {"newmark": 1.0, "generalized-alpha": 0.9, "wilson-theta": wilson_at_infinity(1.4)}[name]
    assert radii[-1] == pytest.approx(at_infinity, abs=1e-3)


def wilson_at_infinity(theta):
    """Where stiffness alone counts, S is a cubic spline whose pieces, drawn on to theta, vanish there."""
    spline = [theta**3, -3 * theta**3 + 3 * theta**2 + 3 * theta + 1, 3 * theta**3 - 6 * theta**2 + 4]
    return np.abs(np.roots([*spline, (1 - theta) ** 3])).max()


def test_wilson_overshoots():
    """From S = 1 at rest, with a step of ten periods: Wilson's method goes far beyond, Newmark's does not.

    G. L. Goudreau, R. L. Taylor, Comput. Methods Appl. Mech. Eng. 2 (1973) 69: it grows with the square of the step.
    """
    x = 20 * np.pi
    largest = {}
    for name in FIXED:
        state, seen = np.array([1.0, 0.0, -x * x]), []
        for _ in range(40):
            state = amplification(BEAM_METHODS[name], x) @ state
            seen.append(abs(state[0]))
        largest[name] = max(seen)
    assert largest["newmark"] <= 1 + 1e-9
    assert largest["generalized-alpha"] < 2
    assert largest["wilson-theta"] > 100


def test_wilson_damps_and_lengthens_periods():
    """Ten steps a period: 8 % less amplitude after one, which is 6 % longer; Newmark's keeps the amplitude."""
    turning = {}
    for name in ("wilson-theta", "newmark"):
        values = np.linalg.eigvals(amplification(BEAM_METHODS[name], 2 * np.pi / 10))
        turning[name] = values[np.argmax(np.abs(values.imag))]
    assert 1 - np.abs(turning["wilson-theta"]) ** 10 == pytest.approx(0.08, abs=0.005)
    assert 2 * np.pi / 10 / abs(np.angle(turning["wilson-theta"])) - 1 == pytest.approx(0.06, abs=0.005)
    assert np.abs(turning["newmark"]) == pytest.approx(1, abs=1e-12)


def test_amplification_is_what_is_compiled():
    """The matrix above against the compiled step, on a strip that stands still: linear, so one step tells it."""
    model = symgen.build("rotating_cantilever").with_parameters(speed=1e-9)
    motion = model.motion(False)
    equations = motion.equations(False)
    _, mass, _, stiffness, _, _ = equations.matrices(0.0, True)
    squares, shapes = np.linalg.eig(np.linalg.solve(mass, stiffness))
    k = int(np.argmin(np.abs(squares)))
    shape, frequency = np.real(shapes[:, k]), float(np.sqrt(np.real(squares[k])))
    start = shape[:, None], np.zeros((len(shape), 1))
    times, counts = np.array([3 * 1.3 / frequency]), np.array([3])
    for name in FIXED:
        (found,), _ = stepped(motion, equations, BEAM_METHODS[name], times, counts, start)
        state = np.array([1.0, 0.0, -(1.3**2)])
        for _ in range(3):
            state = amplification(BEAM_METHODS[name], 1.3) @ state
        assert found == pytest.approx(state[0] * shape, abs=1e-6 * np.max(np.abs(shape)))
