"""The flexible slider-crank of the Test Set for Initial Value Problem Solvers (F. Mazzia, C. Magherini).

B. Simeon, Modelling a flexible slider crank mechanism by a mixed system of DAEs and PDEs, Math. Modelling of
Systems 2 (1996) 1-18: a crank at constant speed, and a rod that bends in sines and stretches in a parabola about
the line between its ends. The longitudinal mass matrix of the test set is 15 times too large: it has 8, 1, 2 in
place of 8/15, 1/15, 2/15.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

import symgen

CRANK, ROD, SPEED = 0.15, 0.30, 150.0
WIDTH, DENSITY, YOUNG, SLIDER = 0.008, 7870.0, 0.2e12, 0.075552
#: Initial accelerations of both amplitudes of bending, and of the elongations of middle and end [m/s^2].
PUBLISHED = [0.0, 0.0, 1.924342105263158e2, 1.273026315789474e3]


class FloatingFrame:
    """The rod with its fields on the line between its ends, by Lagrange's equation at Gauss points.

    ``ghost``: additional mass, over that of the rod, of longitudinal motions alone, which the misprint adds.
    """

    def __init__(self, sines, ghost):
        points, weights = np.polynomial.legendre.leggauss(24)
        x, weights = (1 + points) / 2, weights / 2
        k = np.pi * np.arange(1, sines + 1)
        none = np.zeros((len(x), sines))
        self.x, self.weights, self.ghost = ROD * x, weights * DENSITY * WIDTH**2 * ROD, ghost
        self.along = np.column_stack([none, 4 * x * (1 - x), x * (2 * x - 1)])
        self.across = np.column_stack([np.sin(np.outer(x, k)), 0 * x, 0 * x])
        strain = np.column_stack([none, 4 - 8 * x, 4 * x - 1]) / ROD
        curvature = np.column_stack([-np.sin(np.outer(x, k)) * k**2, 0 * x, 0 * x]) / ROD**2
        by = weights[:, None] * ROD * YOUNG
        self.stiffness = WIDTH**2 * strain.T @ (by * strain)
        self.stiffness += WIDTH**4 / 12 * curvature.T @ (by * curvature)

    def rotation(self, t, end, speed):
        """Return the angle of the rod, its rate, and its second rate less the part by that of the elongation."""
        length, height = ROD + end, CRANK * np.sin(SPEED * t)
        height_rate, height_second = CRANK * SPEED * np.cos(SPEED * t), -(SPEED**2) * height
        angle = -np.arcsin(height / length)
        by = 1 / (length * np.cos(angle))
        rate = -(height_rate + speed * np.sin(angle)) * by
        bias = -(height_second + 2 * speed * rate * np.cos(angle) - length * np.sin(angle) * rate**2) * by
        return angle, rate, bias, -np.sin(angle) * by

    def accelerations(self, t, q, v):
        angle, rate, bias, slope = self.rotation(t, q[-1], v[-1])
        u, w, u_t, w_t = (field @ y for y in (q, v) for field in (self.along, self.across))
        turns = np.zeros(len(q))
        turns[-1] = slope  # of the angle by the coordinates
        hub = -CRANK * SPEED**2 * np.array([np.cos(SPEED * t), np.sin(SPEED * t)])
        c, s = np.cos(angle), np.sin(angle)
        hub = np.array([c * hub[0] + s * hub[1], c * hub[1] - s * hub[0]])
        mass, load = np.zeros((len(q), len(q))), -self.stiffness @ q
        # The material, then the ghost, which has neither place nor bending.
        for real, weights in ((1.0, self.weights), (0.0, self.ghost * self.weights)):
            x, y, y_t = real * self.x + u, real * w, real * w_t
            jacobians = self.along - np.outer(y, turns), real * self.across + np.outer(x, turns)
            felt = (
                real * hub[0] - bias * y - rate**2 * x - 2 * rate * y_t,
                real * hub[1] + bias * x - rate**2 * y + 2 * rate * u_t,
            )
            for jacobian, own in zip(jacobians, felt, strict=True):
                mass += jacobian.T @ (weights[:, None] * jacobian)
                load -= jacobian.T @ (weights * own)
        length = ROD + q[-1]
        moved = np.zeros(len(q))
        moved[-1] = c - length * s * slope  # of the slider by the coordinates
        own = -CRANK * SPEED**2 * np.cos(SPEED * t) - 2 * v[-1] * rate * s - length * (bias * s + rate**2 * c)
        mass += SLIDER * np.outer(moved, moved)
        load -= SLIDER * moved * own
        return np.linalg.solve(mass, load)

    def run(self, times, rtol):
        n = self.along.shape[1]
        return solve_ivp(
            lambda t, y: np.concatenate([y[n:], self.accelerations(t, y[:n], y[n:])]),
            (0.0, times[-1]), np.zeros(2 * n), method="DOP853", t_eval=times, rtol=rtol, atol=1e-14,
        ).y[:n].T  # fmt: skip


def test_published_start_has_the_misprint():
    still = np.zeros(4)
    printed, true = (FloatingFrame(2, ghost).accelerations(0.0, still, still) for ghost in (14.0, 0.0))
    assert np.abs(printed - PUBLISHED).max() < 1e-9
    assert np.all(np.abs(true[2:]) > 3 * np.abs(printed[2:]))


def test_deflections_of_the_rod():
    """With the true mass and more sines; linear theory differs by terms of second order."""
    times = np.linspace(0.0, 0.01, 51)
    model = FloatingFrame(4, 0.0)
    q = model.run(times, 1e-6)
    scene = symgen.Scene(
        title="Flexible slider-crank",
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "R": {"at": ["1 m", "0 m"], "ground": True},
            "A": {"at": [f"{CRANK} m", "0 m"]},
            "P": {"at": [f"{CRANK + ROD} m", "0 m"]},
        },
        links={
            "rail": {"points": ["O", "R"]},
            "crank": {"points": ["O", "A"], "mass": "0.36 kg"},
            "rod": {
                "points": ["A", "P"],
                "density": f"{DENSITY} kg/m^3",
                "section": {"width": "8 mm", "thickness": "8 mm"},
                "elastic": {"E": f"{YOUNG} Pa", "elements": 4, "geometric_stiffness": False},
            },
        },
        masses=[{"point": "P", "mass": f"{SLIDER} kg"}],
        guides=[{"points": ["P"], "along": "rail"}],
        crank={"link": "crank", "speed": f"{SPEED} rad/s"},
        stations=[{"link": "rod", "at": 0.25, "name": "quarter"}, {"link": "rod", "at": 0.5, "name": "half"}],
    )
    run = symgen.build(scene).simulate(t_end=0.01, t_eval=times, rtol=1e-4)
    sines = np.pi * np.arange(1, 5)
    for name, at in (("quarter", 0.25), ("half", 0.5)):
        expected = q[:, :4] @ np.sin(at * sines)
        apart = np.abs(run[f"{name}.deflection"].values - expected).max()
        assert apart < 1e-3 * np.abs(expected).max()
