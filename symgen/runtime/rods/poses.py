"""Poses of a linkage at many times, as arrays."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from symgen.runtime.arrays import Array, Indices
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.result.recording import nearest_turn, wound


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
    unknowns
        Accelerations, multipliers and couples by the equations of motion, (poses, unknowns), of linkages
        whose loads depend on them; else None.
    """

    times: Array
    states: Array
    references: Array | None = None
    unknowns: Array | None = None

    def __len__(self) -> int:
        return len(self.times)

    def __getitem__(self, which: Indices) -> Poses:
        """Return some of them, by their numbers."""
        references, unknowns = (x if x is None else x[which] for x in (self.references, self.unknowns))
        return Poses(self.times[which], self.states[which], references, unknowns)

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
        work = self.unknowns if work is None else work
        out = np.empty((len(self), evaluator.info(kernel).out_size))
        for of, rows in self.wound(evaluator):
            memory = None if work is None else work[rows]
            out[rows] = of.many(kernel, self.times[rows], self.q[rows], self.u[rows], memory)
        return out


def counted(evaluator: Evaluator, path: Poses, start: int, references: Array | None) -> Array:
    """Return the angles in loads [rad] along a path over its revolutions, shape (angles, poses).

    At the pose number ``start`` they are those nearest to ``references``, by default within 180 degrees.
    """
    angles = angles_in_loads(evaluator, path)
    first = angles[:, start] if references is None else nearest_turn(angles[:, start], references)
    return continuous(angles, start) + (first - angles[:, start])[:, None]


def angles_in_loads(evaluator: Evaluator, poses: Poses) -> Array:
    """Return the angles in loads [rad] at poses, known up to a revolution, shape (angles, poses)."""
    if not evaluator.description.windings:
        return np.zeros((0, len(poses)))
    blocks = evaluator.many_blocks("events", poses.times, poses.q, poses.u)
    return np.asarray(blocks["windings"].reshape(len(poses), -1).T)


def continuous(angles: Array, start: int) -> Array:
    """Return angles [rad] along the last axis over revolutions, unchanged at the pose number ``start``."""
    whole = np.unwrap(angles)
    return whole + (angles[..., start, None] - whole[..., start, None])
