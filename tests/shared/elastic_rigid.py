"""The rigid four-bar of the thesis by plain NumPy, in ft, slug, s, lbf and rad: motion and forces.

Every array of vectors has the crank angles before the components. Numbers of the linkage may be complex, so
that the imaginary part of a result is its derivative along a tiny imaginary part of a number.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass
from functools import cached_property

import numpy as np

RPM = 2 * math.pi / 60


@dataclass(frozen=True)
class FourBar:
    """The rig of the thesis: lengths, masses per length, stiffnesses, masses of the bearings at A and at B."""

    a: float = 7 / 12
    b: float = 10 / 12
    c: float = 1.0
    d: float = 11 / 12
    speed: float = 373 * RPM
    m: float = 5.292 * 1.0 * 0.125 / 144
    EI: float = 10.3e6 * 0.125**3 / 12 / 144
    EA: float = 10.3e6 * 0.125
    bearing: float = 0.13128 / 32.174
    half: float = 0.0625 / 12

    @property
    def period(self) -> float:
        return 2 * math.pi / self.speed

    def motion(self, crank) -> Motion:
        return Motion(self, np.atleast_1d(np.asarray(crank, dtype=float)))


def unit(angle):
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def left(vector):
    return np.stack([-vector[..., 1], vector[..., 0]], axis=-1)


def direction(vector):
    x, y = vector[..., 0], vector[..., 1]
    along = np.arctan2(y.real, x.real)
    if not np.iscomplexobj(vector):
        return along
    return along + 1j * (x.real * y.imag - y.real * x.imag) / (x.real**2 + y.real**2)


def dot(one, two):
    return np.einsum("...i,...i->...", one, two)


class Motion:
    """The rigid linkage at constant speed of the crank: angles, rates, accelerations, forces."""

    def __init__(self, bar: FourBar, t1: np.ndarray):
        self.bar, self.t1, w1 = bar, t1, bar.speed
        self.type = complex if any(isinstance(x, complex) for x in astuple(bar)) else float
        A, Q = bar.a * unit(t1), np.array([bar.d, 0.0])
        # two circles: B is left of the line from A to Q
        gap = Q - A
        reach2 = dot(gap, gap)
        along = (bar.b**2 - bar.c**2 + reach2) / 2
        across = np.sqrt(bar.b**2 * reach2 - along**2)
        B = A + (gap * along[:, None] + left(gap) * across[:, None]) / reach2[:, None]
        t2, t3 = direction(B - A), direction(B - Q)
        turn = np.sin(t2 - t3)
        w2 = bar.a * w1 * np.sin(t3 - t1) / (bar.b * turn)
        w3 = bar.a * w1 * np.sin(t2 - t1) / (bar.c * turn)
        # b al2 n2 - c al3 n3 = a w1^2 e1 + b w2^2 e2 - c w3^2 e3, by its components along e3 and e2
        inward = (
            bar.a * w1**2 * unit(t1)
            + (bar.b * w2**2)[:, None] * unit(t2)
            - (bar.c * w3**2)[:, None] * unit(t3)
        )
        al2 = -dot(inward, unit(t3)) / (bar.b * turn)
        al3 = -dot(inward, unit(t2)) / (bar.c * turn)
        none = np.zeros_like(t2)
        self.angles, self.rates = np.stack([t1, t2, t3]), np.stack([none + w1, w2, w3])
        self.accelerations = np.stack([none, al2, al3])
        self.A, self.B, self.aA = A, B, -(w1**2) * A
        self.aB = -(w3**2)[:, None] * (B - Q) + al3[:, None] * left(B - Q)

    @property
    def lengths(self):
        return (self.bar.a, self.bar.b, self.bar.c)

    @cached_property
    def directions(self):
        """Of the links from first to second point: M to A, A to B, B to Q."""
        return np.stack([self.angles[0], self.angles[1], self.angles[2] + math.pi])

    @cached_property
    def origins(self):
        """Accelerations of the links' first points."""
        return np.stack([np.zeros_like(self.A), self.aA, self.aB])

    @cached_property
    def forces(self):
        """Forces of joints on the links' first points, of Q on the output, and the torque on the crank.

        The bearing at a joint is a particle of its own between the links.
        """
        bar, n = self.bar, len(self.t1)
        m, own = bar.m, np.array(self.lengths)
        e = unit(self.directions)
        centre = [
            self.origins[k]
            + (own[k] / 2)
            * (self.accelerations[k][:, None] * left(e[k]) - (self.rates[k] ** 2)[:, None] * e[k])
            for k in range(3)
        ]
        turning = [m * own[k] ** 3 / 12 * self.accelerations[k] for k in range(3)]
        # unknown: A on coupler, B on coupler, Q on output
        matrix, right = np.zeros((n, 6, 6), self.type), np.zeros((n, 6), self.type)
        matrix[:, :2, :2] = matrix[:, :2, 2:4] = np.eye(2)
        right[:, :2] = m * own[1] * centre[1]
        lever = left(e[1]) * own[1] / 2
        matrix[:, 2, :2], matrix[:, 2, 2:4], right[:, 2] = -lever, lever, turning[1]
        matrix[:, 3:5, 2:4], matrix[:, 3:5, 4:] = -np.eye(2), np.eye(2)
        right[:, 3:5] = m * own[2] * centre[2] + bar.bearing * self.aB
        lever = left(e[2]) * own[2] / 2
        matrix[:, 5, 2:4], matrix[:, 5, 4:] = lever, lever
        right[:, 5] = turning[2] - dot(lever, bar.bearing * self.aB)
        found = np.linalg.solve(matrix, right[..., None])[..., 0]
        on_coupler, b_coupler, q_output = found[:, :2], found[:, 2:4], found[:, 4:]
        a_crank = -on_coupler - bar.bearing * self.aA
        b_output = -b_coupler - bar.bearing * self.aB
        m_crank = m * own[0] * centre[0] - a_crank
        lever = left(e[0]) * own[0] / 2
        torque = turning[0] - dot(lever, a_crank - m_crank)
        return {
            "Q": q_output,
            "first": np.stack([m_crank, on_coupler, b_output]),
            "torque": torque,
        }
