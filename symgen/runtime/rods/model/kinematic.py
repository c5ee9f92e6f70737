"""A driven linkage restricted to kinematics: no masses, loads and forces."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from symgen.calls import checked
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.rods.constraints import Constraints
from symgen.runtime.rods.model.linkage import LinkageModel
from symgen.runtime.rods.start import Start, pose


@checked
class KinematicModel(LinkageModel):
    """Compiled constraints and positions of a scene restricted to kinematics.

    :func:`symgen.build` returns it for a scene with ``kind = "kinematics"`` under ``[analysis]``.
    """

    MISSING: ClassVar[Mapping[str, str]] = {
        "": 'its scene requests kinematics only, so that it has no forces\n  Write kind = "dynamics" under '
        "[analysis], or give --set analysis.kind=dynamics."
    }

    @property
    def mobility(self) -> tuple[str, ...]:
        """Numbers of coordinates and constraints, as a line of text."""
        return (f"{self.description.extent}: drives prescribe the motion",)

    def _begun(self) -> Start:
        return posed(self.evaluator)

    def constraints(self) -> Constraints:
        """Return the constraints and drives, with the kernels by which they are followed."""
        return Constraints(self.evaluator, self.evaluator)


def posed(evaluator: Evaluator) -> Start:
    """Return the pose at the start, with the velocities that the drives prescribe.

    Raises
    ------
    InitialStateError
        When the linkage cannot be assembled.
    """
    q, constraints = pose(evaluator), Constraints(evaluator, evaluator)
    solved = np.linalg.lstsq(constraints.jacobian(q, 0.0), -constraints.drift(q, 0.0), rcond=None)[0]
    return Start(q, np.asarray(solved, dtype=float), (), evaluator.description.rank_tolerance)
