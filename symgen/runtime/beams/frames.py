"""Elastic links in a rigid motion over time: their directions, and the weights of their constants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symgen.runtime._beams import MOTION
from symgen.runtime.arrays import Array
from symgen.runtime.beams.elements import integral
from symgen.runtime.beams.links import Beam

#: Constant matrices of a link in its stiffness, by their weights: of axial forces, and of the rotation.
STIFFENING = {
    "stiffness_geometric0": "axial0",
    "stiffness_geometric1": "axial1",
    "stiffness_geometric2": "axial2",
}
TURNING = {"stiffness_centrifugal": "centrifugal", "stiffness_gyroscopic": "gyroscopic"}


@dataclass(frozen=True, slots=True)
class Frames:
    """The direction of one link at many times and the weights of its constants, each field (times,)."""

    cosine: Array
    sine: Array
    damping_gyroscopic: Array
    damping_mass_quarter: Array
    stiffness_centrifugal: Array
    stiffness_damping_quarter: Array
    stiffness_gyroscopic: Array
    stiffness_gyroscopic_quarter: Array
    stiffness_mass_ends: Array
    stiffness_mass_quarter: Array
    load_out: Array
    load_turn: Array
    load_x: Array
    load_y: Array
    stiffness_geometric0: Array
    stiffness_geometric1: Array
    stiffness_geometric2: Array

    def local(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return components along and across the link of vectors on fixed axes."""
        return self.cosine * x + self.sine * y, self.cosine * y - self.sine * x

    def fixed(self, u: Array, w: Array) -> tuple[Array, Array]:
        """Return components on fixed axes of vectors on the link's axes."""
        return self.cosine * u - self.sine * w, self.sine * u + self.cosine * w

    def axial_force(self, beam: Beam, fractions: Array) -> Array:
        """Return the axial force of the rigid motion [N] at fractions of the length, (times, fractions).

        The geometric stiffness has the same weights.
        """
        p = beam.properties
        x = np.asarray(fractions, dtype=float) * p.length
        before = [(lump.mass * (x >= lump.at), lump.mass * lump.at * (x >= lump.at)) for lump in beam.lumps]
        mass = np.array([integral(p.mass, v) for v in x.tolist()]) + sum(m for m, _ in before)
        moment = np.array([integral((0.0, *p.mass), v) for v in x.tolist()]) + sum(s for _, s in before)
        return self.stiffness_geometric0[:, None] + (
            self.stiffness_geometric1[:, None] * mass + self.stiffness_geometric2[:, None] * moment
        )

    def load(self, x: Array, y: Array, out: Array, turn: Array) -> Array:
        """Return the load of the rigid motion by the load vectors of a link, (times, n)."""
        return (
            np.outer(self.load_x, x)
            + np.outer(self.load_y, y)
            + np.outer(self.load_out, out)
            + np.outer(self.load_turn, turn)
        )


def frames(motion: Array) -> Frames:
    """Return the columns of a link's rows of the kernel ``links``, (times, columns), by name."""
    return Frames(**dict(zip(MOTION, np.ascontiguousarray(motion.T), strict=True)))
