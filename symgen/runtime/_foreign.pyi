"""Types of equations written in Cython; see ``_foreign.pyx`` for what things do."""

import numpy as np
from numpy.typing import NDArray

from symgen.runtime._core import Integrable

Array = NDArray[np.float64]

class ForeignEquations(Integrable):
    n: int
    m: int
    extra: int
    dim: int
    evaluations: int
    factorisations: int
    weakest: int
    soundness: float
    rank_tolerance: float
    lost: int
    missed: float
    redundant: int
    def solutions(self, t: Array, y: Array) -> Array: ...
    def check(self, t: float, y: Array) -> int: ...
