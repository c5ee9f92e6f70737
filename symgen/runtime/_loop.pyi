"""Types of the compiled loop; see ``_loop.pyx`` for what things do."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from symgen.runtime._foreign import ForeignEquations

Array = NDArray[np.float64]

OPEN: int
INCONSISTENT: int
POLE: int
BLIND: int

class LoopEquations(ForeignEquations):
    rank: int
    closure: float
    rates_left: float
    hold: float
    size: float
    iterations: int
    def __init__(
        self,
        addresses: Mapping[str, int],
        p: Sequence[float] | Array,
        work_size: int,
        out_size: int,
        lengths: Sequence[bool],
        solved: Sequence[int],
        inputs: Sequence[int],
        unknown: Sequence[int],
        size: float,
        rank: int,
    ) -> None: ...
    def close(self, t: float, q: Array) -> int: ...
    def closed_screws(self, t: float, q: Array) -> tuple[Array, float]: ...
