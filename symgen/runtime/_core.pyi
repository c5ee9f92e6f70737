"""Types of the compiled core; see ``_core.pyx`` for what things do."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DONE: int
MORE: int
NOT_FINITE: int
STEP_TOO_SMALL: int
SINGULAR: int
PROJECTION_FAILED: int
CONTRADICTED: int

def call(address: int, t: Array, q: Array, u: Array, p: Array, work: Array, out: Array) -> None: ...
def call_many(
    address: int,
    t: Array,
    y: Array,
    n: int,
    p: Array,
    work: Array,
    out: Array,
) -> None: ...
def call_repeatedly(
    address: int, times: int, y: Array, n: int, p: Array, work: Array, out: Array
) -> None: ...

class Equations:
    n: int
    m: int
    extra: int
    dim: int
    evaluations: int
    factorisations: int
    weakest: int
    soundness: float
    lost: int
    missed: float
    redundant: int
    def __init__(
        self,
        addresses: Mapping[str, int],
        n: int,
        m: int,
        extra: int,
        p: Sequence[float] | Array,
        work_size: int,
        first_pivot: int,
        rank_tolerance: float,
        redundant: int,
        slack: float,
    ) -> None: ...
    def solutions(self, t: Array, y: Array) -> Array: ...
    def lost_rows(self) -> list[int]: ...
    def check(self, t: float, y: Array) -> int: ...
