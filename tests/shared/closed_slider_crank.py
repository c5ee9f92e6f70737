"""The generalized slider-crank in closed form, by vectors: no dual numbers, no iteration.

Positions from the quadratic of the rod's length, joint forces from Newton's laws of three bodies. Inches, pounds of
force, seconds, radians. Everything is vectorised over the crank angle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

A1, A2 = 12.0, 50.0
R1, R2, R3 = 1.5, 1.0, 3.0
DENSITY, STANDARD_GRAVITY = 0.28, 386.4
M1 = np.pi * R1**2 * A1 * DENSITY / STANDARD_GRAVITY
M2 = np.pi * R2**2 * A2 * DENSITY / STANDARD_GRAVITY
M3 = R3**3 * DENSITY / STANDARD_GRAVITY
SPEED = 50 * 2 * np.pi / 60
#: Moment of inertia of the rod about an axis across it, through its centre: a cylinder.
ACROSS = M2 * (R2**2 / 4 + A2**2 / 12)


@dataclass(frozen=True)
class Offsets:
    """Offsets of one scene: a4 [in], alpha4 [deg], S1 [in], constant over the turn."""

    a4: float = 0.0
    alpha4: float = 270.0
    S1: float = 0.0


class Closed:
    """The mechanism at crank angles theta [rad]; vectors have their components in the last axis, in frame {1}."""

    def __init__(self, offsets: Offsets, theta):
        theta = np.asarray(theta, dtype=float)
        self.offsets, self.theta = offsets, theta
        a4, S1, w, A = offsets.a4, offsets.S1, SPEED, np.radians(offsets.alpha4)
        c, s, sA, cA = np.cos(theta), np.sin(theta), np.sin(A), np.cos(A)
        zero = np.zeros_like(theta)
        # |p3 - p2| = a2 with p3 = -(a4, 0, 0) - S4 k4 is S4^2 + 2 b S4 + q = 0.
        b, b1, b2 = A1 * s * sA + S1 * cA, A1 * w * c * sA, -A1 * w**2 * s * sA
        q = (a4 + A1 * c) ** 2 + (A1 * s) ** 2 + S1**2 - A2**2
        q1, q2 = -2 * a4 * A1 * w * s, -2 * a4 * A1 * w**2 * c
        self.discriminant = b**2 - q
        with np.errstate(invalid="ignore"):
            self.S4 = -b + np.sqrt(self.discriminant)
        self.S4_rate = -(b1 * self.S4 + q1 / 2) / (self.S4 + b)
        self.S4_acceleration = -(self.S4_rate**2 + 2 * b1 * self.S4_rate + b2 * self.S4 + q2 / 2) / (
            self.S4 + b
        )
        self.k4 = np.array([0.0, sA, cA])
        self.crank_pin = np.stack([A1 * c, A1 * s, zero + S1], -1)
        self.pin_velocity = A1 * w * np.stack([-s, c, zero], -1)
        self.pin_acceleration = -A1 * w**2 * np.stack([c, s, zero], -1)
        self.slider = np.array([-a4, 0, 0]) - self.S4[..., None] * self.k4
        self.slider_velocity = -self.S4_rate[..., None] * self.k4
        self.slider_acceleration = -self.S4_acceleration[..., None] * self.k4
        self.along = (self.slider - self.crank_pin) / A2
        self.along_rate = (self.slider_velocity - self.pin_velocity) / A2
        self.along_acceleration = (self.slider_acceleration - self.pin_acceleration) / A2

    def angles(self):
        """Return theta2, eta2, theta3, eta3, alpha3 of table 1, with alpha2 = 0 and alpha3 a variable."""
        u, A = self.along, np.radians(self.offsets.alpha4)
        theta23, eta2 = np.arctan2(u[..., 1], u[..., 0]), -np.arcsin(u[..., 2])
        frame3 = rotation_z(theta23) @ rotation_y(eta2)
        R = np.swapaxes(frame3, -1, -2) @ rotation_x(-A)
        theta3, eta3 = np.arctan2(R[..., 1, 0], R[..., 0, 0]), -np.arcsin(R[..., 2, 0])
        alpha3 = np.arctan2(R[..., 2, 1], R[..., 2, 2])
        return theta23 - self.theta, eta2, theta3, eta3, alpha3

    def angle_rates(self):
        """Return rates of theta2, eta2, theta3, eta3, alpha3 for constant S1."""
        theta2, eta2, theta3, eta3, alpha3 = self.angles()
        c2, s2, ce2, se2 = np.cos(theta2), np.sin(theta2), np.cos(eta2), np.sin(eta2)
        c3, s3, ce3, se3, ca, sa = (
            np.cos(theta3),
            np.sin(theta3),
            np.cos(eta3),
            np.sin(eta3),
            np.cos(alpha3),
            np.sin(alpha3),
        )
        ky, kz = s3 * se3 * ca - c3 * sa, ce3 * ca
        theta2_rate = -SPEED - (A1 * SPEED * c2 + self.S4_rate * ky) / (A2 * ce2)
        eta2_rate = (A1 * SPEED * s2 * se2 + self.S4_rate * kz) / A2
        # Angular velocity of frame {3} in {3}; the slider does not turn, so the rates of the last ball cancel it.
        wx, wy, wz = -(SPEED + theta2_rate) * se2, eta2_rate, (SPEED + theta2_rate) * ce2
        alpha3_rate = -(wx * c3 + wy * s3) / ce3
        return theta2_rate, eta2_rate, -wz + alpha3_rate * se3, wx * s3 - wy * c3, alpha3_rate

    def gauge_moment(self):
        """Return the axial moment [lbf in] that the rod would need to spin as frame {3} does."""
        u, v, a = self.along, self.along_rate, self.along_acceleration
        square = u[..., 0] ** 2 + u[..., 1] ** 2
        rate = (u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]) / square
        second = (u[..., 0] * a[..., 1] - u[..., 1] * a[..., 0]) / square
        second = second - 2 * rate * (u[..., 0] * v[..., 0] + u[..., 1] * v[..., 1]) / square
        return M2 * R2**2 / 2 * (second * u[..., 2] + rate * v[..., 2])

    def forces(self, *, torque: float | None = None, load: float | None = None):
        """Return joint forces with either the crank torque [lbf in] or the slider load [lbf] given.

        Keys: F1, T1 frame on crank in {1} about O; F2 rod on crank in {2}; F3 rod on slider in {3}; F4 frame on
        slider in {4}; T1k, F4k, F1k alone.
        """
        u = self.along
        centre = (self.pin_acceleration + self.slider_acceleration) / 2
        # Force and moment equations of the rod between two balls: the difference of the two end forces across it ...
        across = self.along_acceleration - dot(self.along_acceleration, u)[..., None] * u
        difference = 2 * ACROSS / A2 * across
        both = M2 * centre
        # ... leaves one unknown, the force along the rod at the slider's ball: on_slider_end = known + x u.
        known = (both + difference) / 2
        known = known - dot(known, u)[..., None] * u
        if load is not None:
            # Slider along its line: m3 a = -(force on the rod's end) + load.
            x = (load - dot(M3 * self.slider_acceleration + known, self.k4)) / dot(u, self.k4)
        else:
            # Crank about its axis at constant speed: torque = moment of the force on the rod's other end.
            at_pin = both - known
            x = (moment_z(self.crank_pin, at_pin) - torque) / moment_z(self.crank_pin, u)
        slider_end = known + x[..., None] * u
        pin_end = both - slider_end
        F4 = M3 * self.slider_acceleration + slider_end
        crank_acceleration = self.pin_acceleration / 2
        F1 = M1 * crank_acceleration + pin_end
        crank_centre = self.crank_pin * [0.5, 0.5, 1.0]
        T1 = np.cross(crank_centre, M1 * crank_acceleration) + np.cross(self.crank_pin, pin_end)
        theta2, eta2, *_ = self.angles()
        frame2 = rotation_z(self.theta)
        frame3 = rotation_z(self.theta + theta2) @ rotation_y(eta2)
        frame4 = rotation_x(-np.radians(self.offsets.alpha4))
        return {
            "F1": F1,
            "T1": T1,
            "F2": into(frame2, -pin_end),
            "F3": into(frame3, -slider_end),
            "F4": into(frame4, F4),
        }


def dot(a, b):
    return np.sum(a * b, axis=-1)


def moment_z(r, f):
    return r[..., 0] * f[..., 1] - r[..., 1] * f[..., 0]


def into(frame, vector):
    """Components in a frame whose axes are the columns."""
    return np.einsum("...ji,...j->...i", frame, vector)


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
