"""First-order states whose rates depend on the shaft of an elastic crank."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symgen.runtime.arrays import Array, Indices
from symgen.runtime.elastic.large.counted import Counted
from symgen.runtime.elastic.large.links import LargeLink
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.kernels.evaluate import Evaluator


@dataclass(frozen=True, slots=True)
class StatesByShaft:
    """First-order states whose rates depend on the shaft of an elastic crank: its first section's rotation.

    ``places`` are their unknowns, ``shaft`` is that of the rotation; ``coordinates`` and ``constraints`` are
    the numbers of those of the linkage with rigid links, in ``work`` of kernels before angle and rate.
    """

    places: Indices
    shaft: Indices
    coordinates: int
    constraints: int

    @classmethod
    def of(cls, motion: ElasticMotion, crank: LargeLink | None) -> StatesByShaft | None:
        """Return those of a linkage; None without."""
        if crank is None or not motion.joints.has("states"):
            return None
        d, (block, _) = motion.rigid.description, motion.joints.info("states").blocks
        places = d.of_points + np.array([[*d.states].index(name) for name in block.rows], dtype=np.intp)
        return cls(places, crank.places[:1, 2], d.coordinates, len(d.constraints))

    def rates(self, joints: Evaluator, counted: Counted, t: Array, q: Array, v: Array) -> Array:
        """Return their rates, then the slopes of these by their own states, (2, times, states)."""
        n = self.coordinates
        work = np.zeros((len(t), n + self.constraints + 2))
        work[:, -2:] = np.hstack([q[:, self.shaft], v[:, self.shaft]])
        found = counted.many(joints, "states", t, q[:, :n], v[:, :n], work)
        return np.array(np.split(found, 2, axis=1))
