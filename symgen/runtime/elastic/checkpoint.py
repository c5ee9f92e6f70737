"""Checkpoints of elastic motions: runs one after the other, with more steps each."""

from __future__ import annotations

from typing import Any

import numpy as np

from symgen.runtime._beams import BeamEquations
from symgen.runtime._core import Run
from symgen.runtime.arrays import Array
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.integrate.checkpoint import (
    CheckpointOptions,
    Checkpoints,
    mark_of_kernels,
    memory_of,
    restore,
)
from symgen.runtime.kernels.typed import library_of_runs


def stages_of(
    motion: ElasticMotion, equations: BeamEquations, keeping: CheckpointOptions, *identity: object
) -> ConsecutiveCheckpoints:
    """Return the checkpoints of the runs of a motion, which ``identity`` distinguishes from others."""
    library = library_of_runs(motion.rigid.evaluator.library, motion.rigid.typed)
    return ConsecutiveCheckpoints(
        mark_of_kernels(motion.rigid.evaluator, library, equations, *identity, *motion.identity), keeping
    )


class ConsecutiveCheckpoints(Checkpoints):
    """Checkpoints of consecutive runs, which resume from it.

    Finished runs are not repeated: the checkpoint holds their results.
    """

    def __init__(self, mark: str, keeping: CheckpointOptions) -> None:
        super().__init__(mark, keeping)
        self._finished: list[Array] = []

    def next(self, shape: tuple[int, ...]) -> Array | None:
        """Return displacements and rates of the next run, of this shape, if it is finished, else None."""
        count = len(self._finished)
        with self.reading():
            if not self.left or count == len(self.left["finished"]):
                return None
            states: Array = self.left["finished"][count]
            if states.shape != shape:
                raise ValueError(f"expected displacements and rates of shape {shape}, got {states.shape}")
        self.finished(states)
        return states

    def resume(self, run: Run) -> None:
        """Bring a run that has not begun to where it was left, if it was."""
        if self.left:
            with self.reading():
                restore(run, self.left)
        self.left = {}

    def content(self, run: Run) -> dict[str, Any]:
        """Return the arrays of a checkpoint of a run, with the results of those before it."""
        return {**memory_of(run), "finished": np.array(self._finished)}

    def finished(self, states: Array) -> None:
        """Record displacements and rates of a finished run."""
        self._finished.append(states)
