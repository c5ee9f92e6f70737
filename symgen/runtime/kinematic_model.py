"""A driven linkage of which nothing is asked but its motion: no masses, no loads, no forces."""

from __future__ import annotations

import numpy as np

from symgen.runtime.bonds import Bonds
from symgen.runtime.evaluate import Evaluator
from symgen.runtime.initial import Start, pose
from symgen.runtime.linkage_model import LinkageModel


class KinematicModel(LinkageModel):
    """Compiled constraints and places of a scene that asks for kinematics.

    Made by :func:`symgen.build` of a scene with ``kind = "kinematics"`` under ``[analysis]``.
    """

    def with_parameters(self, **values: float) -> KinematicModel:
        """Return the same model with other values of its tunable parameters, in SI units."""
        changed = {**self.parameters, **values}
        return KinematicModel(self.description, self._library, self._derive, changed, typed=self._typed)

    def _found(self) -> Start:
        if self._start is None and self.is_changed:
            self._start = posed(self._evaluator)
        elif self._start is None:
            q, u = np.split(np.array(self.description.start), 2)
            self._start = Start(q, u, ())
        return self._start

    def _kinematics(self) -> Bonds:
        return Bonds(self._evaluator, self._evaluator)


def posed(evaluator: Evaluator) -> Start:
    """Return the pose at the start, with the velocities that the drives give it.

    Raises
    ------
    InitialStateError
        When the linkage cannot be assembled.
    """
    q, bonds = pose(evaluator), Bonds(evaluator, evaluator)
    solved = np.linalg.lstsq(bonds.jacobian(q, 0.0), -bonds.drift(q, 0.0), rcond=None)[0]
    return Start(q, np.asarray(solved, dtype=float), ())
