"""A planar pendulum of rigid rods with torsion springs, by Lagrange's equations in the directions of the rods."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp


class ChainPendulum:
    """Uniform rods in a row from a pin at the origin, with a mass at the tip and a spring at every joint.

    ``lengths`` and ``masses`` of the rods, ``springs`` [N m] at their first ends, the first against the ground.
    """

    def __init__(self, lengths, masses, springs, tip, gravity, couples=None):
        self.lengths, self.springs = np.array(lengths), np.array(springs)
        self.gravity, self.couples = gravity, couples
        masses, n = np.array(masses), len(lengths)
        # Mass beyond each rod, and the arms of the kinetic energy by pairs of rates.
        beyond = tip + np.append(np.cumsum(masses[::-1])[::-1][1:], 0.0)
        self.static = self.lengths * (masses / 2 + beyond)
        last = np.maximum.outer(np.arange(n), np.arange(n))
        self.arms = np.minimum.outer(self.lengths, self.lengths) * 0.0
        for i in range(n):
            for j in range(n):
                k = last[i, j]
                own = masses[k] / 2 + beyond[k] if i != j else masses[k] / 3 + beyond[k]
                self.arms[i, j] = self.lengths[i] * self.lengths[j] * own

    def accelerations(self, t, angles, rates):
        apart = angles[:, None] - angles[None]
        bent = np.diff(angles, prepend=0.0) * self.springs
        force = -self.gravity * self.static * np.cos(angles) - bent + np.append(bent[1:], 0.0)
        if self.couples:
            force = force + self.couples(t, angles, rates)
        force = force - (self.arms * np.sin(apart)) @ rates**2
        return np.linalg.solve(self.arms * np.cos(apart), force)

    def run(self, angles, times):
        """Return the directions [rad] at times, from rest, (times, rods)."""
        n = len(angles)

        def slope(t, y):
            return np.append(y[n:], self.accelerations(t, y[:n], y[n:]))

        start = np.append(angles, np.zeros(n))
        found = solve_ivp(slope, times[[0, -1]], start, "DOP853", times, rtol=1e-9, atol=1e-11)
        return found.y[:n].T

    def tip(self, angles):
        """Return the place of the tip [m] by directions (times, rods), (times, 2)."""
        return np.stack([np.cos(angles) @ self.lengths, np.sin(angles) @ self.lengths], axis=1)


def extrapolated(values):
    """Return the limit of two results with n and 2n rods, whose errors fall as 1/n^2."""
    coarse, fine = values
    return fine + (fine - coarse) / 3
