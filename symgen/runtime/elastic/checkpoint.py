"""Checkpoints of elastic motions found by fixed steps: runs one after the other, with more steps each."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.integrate.checkpoint import Checkpoints, Keeping, store, stored

if TYPE_CHECKING:
    from symgen.runtime._beams import BeamSteps

#: Displacements and rates, (times, unknowns) each.
Pair = tuple[Array, Array]


class Stages:
    """Consecutive runs that share one checkpoint and resume from it.

    Finished runs are not repeated: the checkpoint holds their results.

    Parameters
    ----------
    mark
        The hash of all of them by :func:`symgen.runtime.integrate.checkpoint.mark_of_kernels`.
    keeping
        File of the checkpoints, and the one to resume from.

    Raises
    ------
    ResultError
        If the checkpoint to resume from is missing, broken, or of another run.
    """

    def __init__(self, mark: str, keeping: Keeping) -> None:
        self._finished: list[Pair] = []
        self._taken = 0
        self._left: dict[str, Array] | None = None
        spent = 0.0
        if keeping.resume is not None:
            self._left, spent = stored(keeping.resume, mark)
        self._checkpoints = Checkpoints(mark, keeping.file, keeping.every, spent)
        self._begun = time.perf_counter()

    @property
    def spent(self) -> float:
        """Wall time taken before the runs were resumed [s]."""
        return self._checkpoints.spent

    def next(self) -> Pair | None:
        """Begin the next run; return its displacements and rates if it is already finished, else None."""
        self._taken += 1
        if self._left is None or self._taken > len(self._left["displacements"]):
            return None
        place = self._taken - 1
        self._finished.append((self._left["displacements"][place], self._left["rates"][place]))
        return self._finished[-1]

    def resumed(self, steps: BeamSteps, displacements: Array, rates: Array) -> tuple[int, int]:
        """Bring a run that has begun to where it was left, if it was.

        Returns
        -------
        tuple
            How many times were reached by then, and how many steps taken from the last of them.
        """
        if self._left is None:
            return 0, 0
        steps.restore(self._left["steps"].tobytes())
        displacements[:], rates[:] = self._left["now"]
        reached, taken = (int(k) for k in self._left["place"])
        self._left = None
        return reached, taken

    def look(
        self,
        t: float,
        steps: BeamSteps,
        displacements: Array,
        rates: Array,
        place: tuple[int, int],
        last: bool = False,
    ) -> None:
        """Write a checkpoint if it is time, or the last, at a time [s] of the motion.

        ``place`` is as from ``resumed``.
        """
        file = self._checkpoints.file if last else self._checkpoints.due()
        if file is None:
            return
        arrays = {
            "displacements": np.array([pair[0] for pair in self._finished]),
            "rates": np.array([pair[1] for pair in self._finished]),
            "now": np.array([displacements, rates]),
            "place": np.array(place, dtype=float),
            "steps": np.frombuffer(steps.save(), np.uint8),
        }
        wall = self.spent + time.perf_counter() - self._begun
        store(file, self._checkpoints.mark, t, wall, arrays)

    def finished(self, displacements: Array, rates: Array) -> Pair:
        """Record displacements and rates of a finished run, and return them."""
        self._finished.append((displacements, rates))
        return displacements, rates
