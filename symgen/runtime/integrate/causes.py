"""Why a state has no finite accelerations: springs and actuators at zero length."""

from __future__ import annotations

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.kernels.evaluate import Evaluator

#: A spring shorter than this share of the coordinates is at zero length.
NEAR = 1e-12


def without_direction(evaluator: Evaluator, t: float, q: Array, u: Array, reach: float = 0.0) -> str:
    """Name the shortest spring or actuator if its length is zero, or within ``reach`` [m]."""
    if not evaluator.has("line_lengths"):
        return ""
    lengths = evaluator("line_lengths", t, q, u)
    least = int(np.argmin(lengths))  # that of a length that is not a number, if there is one
    if lengths[least] > max(reach, NEAR * float(np.max(np.abs(q), initial=0.0))):
        return ""
    name = evaluator.info("line_lengths").blocks[0].rows[least]
    if np.isnan(lengths[least]):
        return f"{name} has no length: the place of one of its points is not a number"
    return f"{name} is {lengths[least]:.3g} m long: where its points meet, its force has no direction"
