"""Poses of a linkage at many times, as arrays."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from symgen.runtime.arrays import Array, Indices
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.result.recording import wound


@dataclass(frozen=True, slots=True)
class Poses:
    """Poses of a linkage over a motion.

    Attributes
    ----------
    times
        Times [s], shape (poses,).
    states
        Coordinates [m] with their two rates, shape (poses, 3, coordinates).
    references
        References of angles in loads [rad], which count revolutions from the start, shape (poses, angles);
        None where all are 0.
    """

    times: Array
    states: Array
    references: Array | None = None

    def __len__(self) -> int:
        return len(self.times)

    def __getitem__(self, which: Indices) -> Poses:
        """Return some of them, by their numbers."""
        references = None if self.references is None else self.references[which]
        return Poses(self.times[which], self.states[which], references)

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

    def wound(self, evaluator: Evaluator) -> Iterator[tuple[Evaluator, Indices]]:
        """Yield kernels with references of angles in loads, and the numbers of the poses that have these."""
        if self.references is None:
            yield evaluator, np.arange(len(self))
            return
        for parameters, rows in wound(evaluator, self.references):
            yield type(evaluator)(evaluator.description, evaluator.library, parameters), rows

    def many(self, evaluator: Evaluator, kernel: str, work: Array | None = None) -> Array:
        """Return the results of a kernel of loads at all poses, (poses, entries), given ``work`` of each."""
        out = np.empty((len(self), evaluator.info(kernel).out_size))
        for of, rows in self.wound(evaluator):
            memory = None if work is None else work[rows]
            out[rows] = of.many(kernel, self.times[rows], self.q[rows], self.u[rows], memory)
        return out


def continuous(angles: Array, start: int) -> Array:
    """Return angles [rad] along the last axis over revolutions, unchanged at the pose number ``start``."""
    whole = np.unwrap(angles)
    return whole + (angles[..., start, None] - whole[..., start, None])
