"""Guides along rails in space, in every direction."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import symgen

CASES = Path(__file__).parents[1] / "cases"


def planar_rail(t_end):
    """Angle of a rail about O, place of the slider on it and angle of the arm, of the scene guide_direction."""
    arm = math.hypot(0.15, 0.25)

    def rates(t, y):
        (rail, s, angle), (w, v, turning) = y[:3], y[3:]
        along, across = np.array([np.cos(rail), np.sin(rail)]), np.array([-np.sin(rail), np.cos(rail)])
        out, beside = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        slider = np.stack([s * across, along, 0 * along], axis=1)
        centre = slider + np.stack([0 * along, 0 * along, arm / 2 * beside], axis=1)
        of_slider = 2 * v * w * across - s * w**2 * along
        of_centre = of_slider - arm / 2 * turning**2 * out
        mass = 0.4 * slider.T @ slider + 0.5 * centre.T @ centre + np.diag([1 / 3, 0, 0.5 * arm**2 / 12])
        force = np.array([0, -60 * (s - 0.4), 0]) - 0.4 * slider.T @ of_slider - 0.5 * centre.T @ of_centre
        return np.concatenate([y[3:], np.linalg.solve(mass, force)])

    start = [0, 0.5, np.pi / 2, math.hypot(1.5, 2.5), 0, 0]
    return solve_ivp(rates, (0, t_end), start, method="DOP853", rtol=1e-13, atol=1e-14).y[:3, -1]


@pytest.mark.parametrize(
    "options, tolerance",
    [
        ({"rtol": 1e-6}, 1e-6),
        ({"rtol": 1e-9}, 1e-9),
        ({"rtol": 1e-12}, 1e-11),
        ({"method": "rk4", "step": 0.005}, 2e-7),
        ({"method": "rattle4", "step": 0.005}, 2e-8),
        ({"method": "radau5", "rtol": 1e-6}, 1e-6),
    ],
)
def test_guides_have_no_singular_direction(options, tolerance):
    """The motion stays in a plane, where it has three coordinates; the rail passes near (0.36, 0.48, 0.8)."""
    model = symgen.build(CASES / "guide_direction.toml")
    last = model.simulate(2.0, **options).dataset.isel(time=-1)
    rail, s, _ = planar_rail(2.0)
    x, y = np.array([1.0, 0, 0]), np.array([0, 1.5, 2.5]) / math.hypot(1.5, 2.5)
    tip = np.cos(rail) * x + np.sin(rail) * y
    np.testing.assert_allclose(last["A.position"], tip, atol=tolerance)
    np.testing.assert_allclose(last["C.position"], s * tip, atol=tolerance)


def test_rails_in_every_direction_give_the_accelerations_of_one_rail():
    """The accelerations of a rail and a slider turn with them, also where two axes are equally far from the rail."""
    model = symgen.build(symgen.Scene(**turned_rail()))
    axis = np.array([0.48, 0.6, 0.64])
    found = []
    ties = np.array([[0, 1, 1], [1, 1, 1], [1, 0, 1], [1, 0, -1], [0, 0, 1], [0, 1, 0]])
    oblique = np.array([[9, 12, 20], [20, -9, 12], [-12, 20, 9], [12, 20, -9]])
    for direction in (*ties, *oblique, *np.random.default_rng(3).standard_normal((20, 3))):
        z = direction / np.linalg.norm(direction)
        x = np.linalg.qr(np.stack([z, axis], axis=1))[0][:, 1]
        turn = np.stack([x, np.cross(z, x), z], axis=1)
        positions = {"A": turn @ [0, 0, 1], "C": turn @ [0, 0, 0.4]}
        velocities = {"A": turn @ [0.3, -0.2, 0], "C": turn @ [0.12, -0.08, 0.7]}
        known = model.accelerations(model.state(positions, velocities))
        found.append([turn.T @ known["A"], turn.T @ known["C"]])
    # w = (0.2, 0.3, 0): the slider at s has s'' = s w^2 and feels 2 s' w x along across; I w' = -2 m s s' w.
    speed, slide = np.array([0.3, -0.2, 0]), -2 * 0.4 * 0.4 * 0.7 / (1 / 3 + 0.4 * 0.16)
    tip = slide * speed - 0.13 * np.array([0, 0, 1])
    slider = 0.4 * slide * speed + 2 * 0.7 * speed
    for a, c in found:
        np.testing.assert_allclose(a, tip, atol=1e-13)
        np.testing.assert_allclose(c, slider, atol=1e-13)


def turned_rail():
    """A uniform rail of 1 m and 1 kg about O with a slider of 0.4 kg, without gravity."""
    return {
        "points": {
            "O": {"at": ["0 m", "0 m", "0 m"], "ground": True},
            "A": {"at": ["0 m", "0 m", "1 m"]},
            "C": {"at": ["0 m", "0 m", "0.4 m"]},
        },
        "links": {"rail": {"points": ["O", "A"], "mass": "1 kg"}},
        "masses": [{"point": "C", "mass": "0.4 kg"}],
        "guides": [{"points": ["C"], "along": "rail"}],
        "analysis": {"motion": "space"},
    }
