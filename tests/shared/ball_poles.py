"""The free slider-crank of ``cases/ball_poles.toml`` by two points: its motion from the energy alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.integrate import quad

CRANK, ROD, MASSES, SPEED = 0.3, 1.25, (2.0, 3.0, 5.0), 5.0
CASE = Path(__file__).parents[1] / "cases" / "ball_poles.toml"


class Straight:
    """Two points: the crank's pin on its circle, the slider on its line."""

    def __init__(self, offset: float) -> None:
        self.offset = offset
        self.energy = self.mass(np.pi / 2) * SPEED**2 / 2

    def slider(self, angle):
        """Place of the slider and its first two derivatives by the angle."""
        s = np.sqrt(ROD**2 - CRANK**2 - self.offset**2 - 2 * CRANK * self.offset * np.cos(angle))
        first = CRANK * self.offset * np.sin(angle) / s
        return s, first, (CRANK * self.offset * np.cos(angle) - first**2) / s

    def mass(self, angle):
        """Twice the kinetic energy at unit speed; uniform rods have the energy of their ends alone."""
        along = self.slider(angle)[1]
        pin = np.array([-np.sin(angle), np.cos(angle), 0.0 * angle]) * CRANK
        end = np.array([0.0 * angle, 0.0 * angle, along])
        crank, rod, slider = MASSES
        return (
            crank * CRANK**2 / 3
            + rod / 3 * ((pin * pin).sum(0) + (pin * end).sum(0) + (end * end).sum(0))
            + slider * along**2
        )

    def rate(self, angle):
        return np.sqrt(2 * self.energy / self.mass(angle))

    def time(self, angle):
        return quad(lambda x: 1 / self.rate(x), np.pi / 2, angle, epsabs=1e-12, epsrel=1e-12)[0]

    def acceleration(self, angle, step=1e-3):
        """Acceleration of the slider, from the slope of the squared rate."""
        at = [self.rate(angle + k * step) ** 2 for k in (-2, -1, 1, 2)]
        slope = (at[0] - 8 * at[1] + 8 * at[2] - at[3]) / (24 * step)
        _, first, second = self.slider(angle)
        return first * slope + second * self.rate(angle) ** 2
