"""How elastic links move in a rigid motion, over time: their axes, and the axial force along them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.beam_elements import integral
from symgen.runtime.beams import Beam

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Frames:
    """The axes of one link at many times, each field (times,).

    Attributes
    ----------
    cosine, sine
        Of the direction of the link.
    rate, turn
        Angular velocity [rad/s] and acceleration [rad/s^2].
    along, across
        Acceleration of the first point less gravity, on the link's axes [m/s^2].
    pull
        Axial force before the first point, tension positive [N].
    """

    cosine: Array
    sine: Array
    rate: Array
    turn: Array
    along: Array
    across: Array
    pull: Array

    def local(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return components along and across the link of vectors on fixed axes."""
        return self.cosine * x + self.sine * y, self.cosine * y - self.sine * x

    def fixed(self, u: Array, w: Array) -> tuple[Array, Array]:
        """Return components on fixed axes of vectors on the link's axes."""
        return self.cosine * u - self.sine * w, self.sine * u + self.cosine * w

    def axial_force(self, beam: Beam, fractions: Array) -> Array:
        """Return the axial force of the rigid motion [N] at fractions of the length, (times, fractions)."""
        p = beam.properties
        x = np.asarray(fractions, dtype=float) * p.length
        before = [(lump.mass * (x >= lump.at), lump.mass * lump.at * (x >= lump.at)) for lump in beam.lumps]
        mass = np.array([integral(p.mass, v) for v in x.tolist()]) + sum(m for m, _ in before)
        moment = np.array([integral((0.0, *p.mass), v) for v in x.tolist()]) + sum(s for _, s in before)
        found: Array = self.pull[:, None] + self.along[:, None] * mass - self.rate[:, None] ** 2 * moment
        return found


def frames(motion: Array) -> Frames:
    """Return the axes of a link from its rows of the kernel ``links``, (times, 10)."""
    dx, dy, vx, vy, ax, ay, first_x, first_y, force_x, force_y = motion.T
    length = np.hypot(dx, dy)
    c, s = dx / length, dy / length
    rate = (c * vy - s * vx) / length
    turn = (c * ay - s * ax) / length - 2 * rate * (c * vx + s * vy) / length
    along, across = c * first_x + s * first_y, c * first_y - s * first_x
    return Frames(c, s, rate, turn, along, across, -(c * force_x + s * force_y))
