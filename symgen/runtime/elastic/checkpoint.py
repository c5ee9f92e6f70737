"""Checkpoints of elastic motions found by fixed steps: runs one after the other, with more steps each."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.integrate.checkpoint import Checkpoints, Keeping

if TYPE_CHECKING:
    from symgen.runtime._beams import BeamSteps

#: Displacements and rates, (times, unknowns) each.
Pair = tuple[Array, Array]


class Stages(Checkpoints):
    """Checkpoints of consecutive runs, which resume from it.

    Finished runs are not repeated: the checkpoint holds their results.
    """

    def __init__(self, mark: str, keeping: Keeping) -> None:
        super().__init__(mark, keeping)
        self._finished: list[Pair] = []
        self._taken = 0

    def next(self, shape: tuple[int, ...]) -> Pair | None:
        """Begin the next run; return displacements and rates of this shape if it is finished, else None."""
        self._taken += 1
        with self.reading():
            if not self.left or self._taken > len(self.left["displacements"]):
                return None
            place = self._taken - 1
            pair = self.left["displacements"][place], self.left["rates"][place]
            if not pair[0].shape == pair[1].shape == shape:
                raise ValueError(f"expected displacements and rates of shape {shape}, got {pair[0].shape}")
        self._finished.append(pair)
        return pair

    def resumed(self, steps: BeamSteps, displacements: Array, rates: Array) -> tuple[int, int]:
        """Bring a run that has begun to where it was left, if it was.

        Returns
        -------
        tuple
            How many times were reached by then, and how many steps taken from the last of them.
        """
        if not self.left:
            return 0, 0
        with self.reading():
            steps.restore(self.left["steps"].tobytes())
            displacements[:], rates[:] = self.left["now"]
            reached, taken = (int(k) for k in self.left["place"])
            if not (0 <= reached <= len(displacements) and taken >= 0):
                raise ValueError(f"expected up to {len(displacements)} times reached, got {reached}")
        self.left = {}
        return reached, taken

    def keep(
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
        if not self.due(last):
            return
        arrays = {
            "displacements": np.array([pair[0] for pair in self._finished]),
            "rates": np.array([pair[1] for pair in self._finished]),
            "now": np.array([displacements, rates]),
            "place": np.array(place, dtype=float),
            "steps": np.frombuffer(steps.save(), np.uint8),
        }
        self.write(t, arrays)

    def finished(self, displacements: Array, rates: Array) -> Pair:
        """Record displacements and rates of a finished run, and return them."""
        self._finished.append((displacements, rates))
        return displacements, rates
