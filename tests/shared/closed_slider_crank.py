"""The generalized slider-crank of the source's study: ``crank_vectors`` at constant speed, in double precision.

Inches, pounds of force, seconds, radians. Everything is vectorised over the crank angle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from shared.crank_vectors import Crank, driven
from shared.jets import Real

A1, A2 = 12.0, 50.0
R1, R2, R3 = 1.5, 1.0, 3.0
M1, M2, M3 = map(float, Crank().masses)
SPEED = 50 * 2 * np.pi / 60
#: Moment of inertia of the rod about an axis across it, through its centre.
ACROSS = float(Crank().inertia_of_rod()[1, 1])


@dataclass(frozen=True)
class Offsets:
    """Constant offsets of one scene: a4 [in], alpha4 [deg], S1 [in]."""

    a4: float = 0.0
    alpha4: float = 270.0
    S1: float = 0.0


class Closed:
    """The mechanism at crank angles theta [rad]; vectors have their components in the last axis, in frame {1}."""

    def __init__(self, offsets: Offsets, theta):
        crank = Crank(a4=Real(offsets.a4), alpha4=Real(np.radians(offsets.alpha4)))
        with np.errstate(invalid="ignore"):
            self._motion = crank.motion(*driven(theta, SPEED, offsets.S1, 0))
        motion = self._motion
        self.theta, self.discriminant = np.asarray(theta, dtype=float), _double(motion.discriminant.value)
        self.S4, self.S4_rate, self.S4_acceleration = map(_double, motion.S4.parts)
        self.crank_pin, self.pin_velocity, _ = map(_double, motion.p2.parts)
        self.slider, self.slider_velocity, _ = map(_double, motion.p3.parts)
        self.along, self.along_rate, self.along_acceleration = map(_double, motion.u.parts)

    def _angles(self):
        return [getattr(self._motion, name) for name in ("theta2", "eta2", "theta3", "eta3", "alpha3")]

    def angles(self):
        """Return theta2, eta2, theta3, eta3, alpha3 of table 1, with alpha2 = 0 and alpha3 a variable."""
        return tuple(_double(angle.value) for angle in self._angles())

    def angle_rates(self):
        """Return rates of theta2, eta2, theta3, eta3, alpha3 for constant S1."""
        return tuple(_double(angle.rate) for angle in self._angles())

    def gauge_moment(self):
        """Return the axial moment [lbf in] that the rod would need to spin as frame {3} does."""
        u, v, a = self.along, self.along_rate, self.along_acceleration
        square = u[..., 0] ** 2 + u[..., 1] ** 2
        rate = (u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]) / square
        second = (u[..., 0] * a[..., 1] - u[..., 1] * a[..., 0]) / square
        second = second - 2 * rate * (u[..., 0] * v[..., 0] + u[..., 1] * v[..., 1]) / square
        return M2 * R2**2 / 2 * (second * u[..., 2] + rate * v[..., 2])

    def forces(self, *, torque: float | None = None, load: float = 0.0):
        """Return joint forces with either the crank torque [lbf in] or the slider load [lbf] given.

        F1, T1 frame on crank in {1} about O; F2 rod on crank in {2}; F3 rod on slider in {3}; F4 frame on slider
        in {4}.
        """
        found = self._motion.forces(S4_drive=load, theta1_drive=torque)
        return {name: _double(found[name]) for name in ("F1", "T1", "F2", "F3", "F4")}


def _double(x):
    return np.asarray(x, dtype=float)


def rotation_x(angle):
    c, s = np.cos(angle), np.sin(angle)
    return _matrix(c, [[1, 0, 0], [0, c, -s], [0, s, c]])


def rotation_y(angle):
    c, s = np.cos(angle), np.sin(angle)
    return _matrix(c, [[c, 0, s], [0, 1, 0], [-s, 0, c]])


def rotation_z(angle):
    c, s = np.cos(angle), np.sin(angle)
    return _matrix(c, [[c, -s, 0], [s, c, 0], [0, 0, 1]])


def _matrix(like, rows):
    zero = np.zeros_like(np.asarray(like, dtype=float))
    return np.stack([np.stack([zero + e for e in row], -1) for row in rows], -2)
