"""Types of the binding of driven linkages; see ``_kinematics.pyx`` for what things do."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.kernels.evaluate import Evaluator

Array = NDArray[np.float64]

class Kinematics:
    n: int
    def __init__(
        self, evaluator: Evaluator, analysis: Evaluator, rows: Sequence[int], length: float
    ) -> None: ...
    def follow(self, t: float, q: Array, times: Array) -> Array: ...
