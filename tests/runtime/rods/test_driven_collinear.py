"""Adaptive steps through collinear states of linkages whose motion is prescribed, in whole or in part."""

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from shared.full import full

import symgen
from symgen.errors import SimulationError

CASES = Path(__file__).parents[2] / "cases"

CRANK, GROUND, ROD, G = 0.3, 3.0, 0.5, 9.81
METHODS = ("dop853", "dopri5", "radau5")


@cache
def parallelogram(speed, phase, pendulum):
    x, y = float(CRANK * np.cos(phase)), float(CRANK * np.sin(phase))
    words = {
        "parameters": {"w": f"{speed} rad/s"},
        "points": {
            "A": {"at": ["0 m", "0 m"], "ground": True},
            "C": {"at": [f"{GROUND} m", "0 m"], "ground": True},
            "P": {"at": [f"{x!r} m", f"{y!r} m"]},
            "R": {"at": [f"{GROUND + x!r} m", f"{y!r} m"]},
        },
        "links": {
            "a": {"points": ["A", "P"], "mass": "1 kg"},
            "c": {"points": ["C", "R"], "mass": "1 kg"},
            "rod": {"points": ["P", "R"], "mass": "1 kg"},
        },
        "drivers": [{"link": "a", "angle": f"{phase} + w*t"}],
        "gravity": {"acceleration": ["0 m/s^2", f"{-G} m/s^2"]},
        "analysis": {"t_end": "2 s", "outputs": ["R.position"]},
    }
    if pendulum:
        words["points"]["M"] = {"on": "rod", "fraction": 0.4}
        words["points"]["T"] = {"at": [f"{0.4 * GROUND + x + 0.3!r} m", f"{y - 0.4!r} m"]}
        words["links"]["hanging"] = {"points": ["M", "T"], "mass": "0.7 kg"}
        words["start"] = {"rates": {"hanging": "0 rad/s"}}
        words["analysis"]["outputs"].append("T.position")
    return symgen.build(symgen.Scene(**words))


@cache
def hanging_angle(speed, phase):
    """Angle of a rod on a pivot that goes round a circle, from its own equation of motion."""

    def motion(t, state):
        a = -CRANK * speed**2 * np.array([np.cos(phase + speed * t), np.sin(phase + speed * t)])
        return [state[1], -1.5 / ROD * ((a[1] + G) * np.cos(state[0]) - a[0] * np.sin(state[0]))]

    times = np.linspace(0, 2, 201)
    start = [np.arctan2(-0.4, 0.3), 0.0]
    return solve_ivp(motion, (0, 2), start, method="DOP853", rtol=1e-13, atol=1e-13, t_eval=times).y[0]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("rtol", [1e-3, *map(full, (1e-6, 1e-9, 1e-10, 1e-11, 1e-12)), 3e-14])
@pytest.mark.parametrize(
    ("speed", "phase"), [(10, 0.9272952180016122), (3.7, 0.9272952180016122), (-6.3, 2.1)]
)
def test_all_motion_prescribed(method, rtol, speed, phase):
    result = parallelogram(speed, phase, False).simulate(method=method, rtol=rtol, max_steps=20_000)
    angle = phase + speed * result.time
    assert result["R.position"].values[:, 0] == pytest.approx(GROUND + CRANK * np.cos(angle), abs=1e-12)
    assert any("losses of rank" in note for note in result.notes)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("rtol", [1e-5, full(1e-7), 1e-9, full(1e-11), 1e-12])
@pytest.mark.parametrize(("speed", "phase"), [(10, 2.1), (3.7, 0.4)])
def test_a_pendulum_on_the_coupler(method, rtol, speed, phase):
    """Its motion is free, and feels the coupler's accelerations, which have few digits near the collinear states."""
    result = parallelogram(speed, phase, True).simulate(method=method, rtol=rtol, max_steps=20_000)
    pivot = 0.4 * GROUND + CRANK * np.cos(phase + speed * result.time)
    exact = pivot + ROD * np.cos(hanging_angle(speed, phase))
    # a sample moved away from a loss of rank has another time
    kept = np.isclose(result.time, np.linspace(0, 2, 201), rtol=0, atol=1e-12)
    assert result["T.position"].values[kept, 0] == pytest.approx(exact[kept], abs=max(300 * rtol, 1e-7))


def test_a_driven_parallelogram_of_equal_links():
    """All motion is prescribed: the coupler stays parallel to the ground through seven collinear states."""
    result = symgen.build(CASES / "driven_parallelogram.toml").simulate(max_steps=1000)
    angle = math.atan2(0.24, 0.18) + 10 * result.time
    exact = np.column_stack([3 + 0.3 * np.cos(angle), 0.3 * np.sin(angle)])
    assert result["R.position"].values == pytest.approx(exact, abs=1e-12)


def test_a_dead_centre_next_to_a_collinear_state():
    """The coupler is 0.1 mm too long for the crank to pass: it stops where coupler and rocker are in line."""
    stop = 2 * math.pi - math.acos((1 + 0.3**2 - (1.0001 - 0.3) ** 2) / (2 * 0.3))
    with pytest.raises(SimulationError, match="dead centre") as caught:
        symgen.build(CASES / "gap.toml").simulate(max_steps=2000)
    assert caught.value.time == pytest.approx((stop - math.pi / 2) / 6, abs=1e-8)
