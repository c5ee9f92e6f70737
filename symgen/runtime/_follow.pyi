"""Types of following a loop; see ``_follow.pyx`` for what things do."""

import numpy as np
from numpy.typing import NDArray

from symgen.runtime._loop import LoopEquations

Array = NDArray[np.float64]

CLOSURE: int
RATES: int
SOUNDNESS: int
HOLD: int
STATUS: int

class LoopFollower(LoopEquations):
    def follow(
        self,
        t: float,
        q: Array,
        times: Array,
        longest: float,
        states: Array,
        out: Array,
        diagnosis: Array,
    ) -> tuple[int, int, float]: ...
