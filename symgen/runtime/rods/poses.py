"""Poses of a linkage at many times, as arrays."""

from __future__ import annotations

from dataclasses import dataclass

from symgen.runtime.arrays import Array, Indices


@dataclass(frozen=True, slots=True)
class Poses:
    """Times [s], shape (poses,), and coordinates [m] with their two rates, shape (poses, 3, coordinates)."""

    times: Array
    states: Array

    def __len__(self) -> int:
        return len(self.times)

    def __getitem__(self, which: Indices) -> Poses:
        """Return some of them, by their numbers."""
        return Poses(self.times[which], self.states[which])

    @property
    def q(self) -> Array:
        """Coordinates [m]."""
        return self.states[:, 0]

    @property
    def u(self) -> Array:
        """Velocities [m/s]."""
        return self.states[:, 1]

    @property
    def accelerations(self) -> Array:
        """Accelerations [m/s^2]."""
        return self.states[:, 2]
