"""Cranks whose angle is a function of the time: a beam that is spun up, by modes of an independent assembly."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

import symgen
from symgen.errors import ModelError
from symgen.runtime.beams.methods import GAUSS8
from symgen.runtime.elastic.large.collocation import SystemRun
from symgen.runtime.elastic.large.linkage import LargeLinkage

#: The beam of T. R. Kane, R. R. Ryan and A. K. Banerjee, J. Guidance 10 (1987), 139, as published for programs with
#: stretching: E A, E I, mass per length, length, time of the spin-up, and speed after it.
EA, EI, MU, LENGTH, UNTIL, SPEED = 2.8e7, 1.4e4, 1.2, 10.0, 15.0, 6.0
SCENE = {
    "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "tip": {"at": ["10 m", "0 m"]}},
    "links": {
        "beam": {
            "points": ["O", "tip"],
            "density": "3000 kg/m^3",
            "section": {"area": "4e-4 m^2", "second_moment": "2e-7 m^4", "fibre": "1 cm"},
            "elastic": {"E": "70 GPa", "elements": 3},
        }
    },
    "crank": {
        "link": "beam",
        "angle": "speed/T*(t**2/2 + (T/(2*pi))**2*(cos(2*pi*t/T) - 1))",
    },
    "parameters": {"T": "15 s", "speed": "6 rad/s"},
    "analysis": {"t_end": "15 s"},
}


def spun_up(times, count=12, modes=6):
    """Deflections of the tip [m] across the rotating beam by its lowest modes, with the axial force of rotation."""
    h = LENGTH / count
    x, weights = np.polynomial.legendre.leggauss(6)
    x, weights = (x + 1) / 2, weights / 2
    shape = np.array(
        [1 - 3 * x**2 + 2 * x**3, h * (x - 2 * x**2 + x**3), 3 * x**2 - 2 * x**3, h * (x**3 - x**2)]
    )
    slope = (
        np.array([6 * x**2 - 6 * x, h * (1 - 4 * x + 3 * x**2), 6 * x - 6 * x**2, h * (3 * x**2 - 2 * x)]) / h
    )
    bent = np.array([12 * x - 6, h * (6 * x - 4), 6 - 12 * x, h * (6 * x - 2)]) / h**2
    mass, stiffness, stiffening = np.zeros((3, 2 * count + 2, 2 * count + 2))
    load = np.zeros(2 * count + 2)
    for e in range(count):
        own, at = slice(2 * e, 2 * e + 4), h * (e + x)
        mass[own, own] += MU * h * (shape * weights) @ shape.T
        stiffness[own, own] += EI * h * (bent * weights) @ bent.T
        stiffening[own, own] += MU * h * (slope * weights * (LENGTH**2 - at**2) / 2) @ slope.T
        load[own] += MU * h * shape @ (weights * at)
    squares, found = eigh(stiffness[2:, 2:], mass[2:, 2:], subset_by_index=(0, modes - 1))
    by_square = found.T @ (stiffening[2:, 2:] - mass[2:, 2:]) @ found
    by_rate = found.T @ load[2:]

    def rate(t, state):
        q, v = np.split(state, 2)
        omega = SPEED / UNTIL * (t - UNTIL / (2 * np.pi) * np.sin(2 * np.pi * t / UNTIL))
        turning = SPEED / UNTIL * (1 - np.cos(2 * np.pi * t / UNTIL))
        return np.concatenate([v, -squares * q - omega**2 * by_square @ q - turning * by_rate])

    run = solve_ivp(rate, (0, UNTIL), np.zeros(2 * modes), "DOP853", times, rtol=1e-7, atol=1e-9)
    return found[-2] @ run.y[:modes]


@pytest.mark.parametrize("analysis", ["simulate", "quasi_static", "large_rotation"])
def test_revolutions_of_a_prescribed_crank_are_refused(analysis):
    model = symgen.build(symgen.Scene(title="spin-up", **SCENE))
    with pytest.raises(ModelError, match=r"function of the time; expected no revolutions, got 2.*\n  Leave"):
        getattr(model, analysis)(revolutions=2)


def test_directions_and_frequencies_of_a_prescribed_crank():
    """At rest the beam has no stiffening: 1.8751^2 sqrt(E I/mu L^4)/2 pi."""
    model = symgen.build(symgen.Scene(title="spin-up", **SCENE))
    with pytest.raises(ModelError, match="give t_eval"):
        model.simulate(at=[0.1])
    expected = 1.875104069**2 * np.sqrt(EI / (MU * LENGTH**4)) / (2 * np.pi)
    assert model.lowest_frequency == pytest.approx(expected, rel=1e-3)


def test_spin_up():
    model = symgen.build(symgen.Scene(title="spin-up", **SCENE))
    result = model.simulate(samples=301)
    times = np.asarray(result.coordinate.values)
    assert result.coordinate.name == "time"
    angle = (
        SPEED / UNTIL * (times**2 / 2 + (UNTIL / (2 * np.pi)) ** 2 * (np.cos(2 * np.pi * times / UNTIL) - 1))
    )
    x, y = result["tip.displacement"].values.T
    across = np.cos(angle) * y - np.sin(angle) * x
    expected = spun_up(times)
    assert np.abs(across - expected).max() < 2e-4 * np.abs(expected).max()
    # Centrifugal force at full speed: w^2 mu L^3/(3 E A), 5.14e-4 m as published.
    assert float(result["beam.length_change"].values[-1]) == pytest.approx(
        SPEED**2 * MU * LENGTH**3 / (3 * EA), rel=2e-3
    )
    with pytest.raises(symgen.errors.ModelError, match="angle of the crank is a function of the time"):
        model.periodic()


def test_spin_up_in_large_rotation():
    """Halfway the tip lags most, by 0.57 m as published."""
    motion = symgen.build(symgen.Scene(title="spin-up", **SCENE)).motion(True)
    times = np.linspace(0.0, UNTIL / 2, 9)
    found = SystemRun(LargeLinkage(motion, 2), GAUSS8, times, 60).run().moments()
    angle = motion.angle_at(times)
    across = [-np.sin(a) * m.q[0] + np.cos(a) * m.q[1] for a, m in zip(angle, found, strict=True)]
    expected = spun_up(times)
    assert np.abs(across - expected).max() < 2e-2 * np.abs(expected).max()
    assert np.min(across) == pytest.approx(-0.57, abs=0.01)
