"""Types of the compiled core; see ``_core.pyx`` for what things do."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.runtime.integrators.tableau import ExplicitRungeKutta

Array = NDArray[np.float64]

DONE: int
MORE: int
NOT_FINITE: int
STEP_TOO_SMALL: int
SINGULAR: int
PROJECTION_FAILED: int

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
    ) -> None: ...
    def solutions(self, t: Array, y: Array) -> Array: ...
    def lost_rows(self) -> list[int]: ...
    def check(self, t: float, y: Array) -> int: ...

class Stepper:
    t: float
    t_end: float
    h: float
    recorded: int
    moved: int
    steps: int
    rejected: int
    position_drift: float
    velocity_drift: float
    energy_drift: float
    kinetic_min: float
    kinetic_max: float
    potential_min: float
    potential_max: float
    passages: list[tuple[float, float, int]]
    def __init__(
        self,
        equations: Equations,
        tableau: ExplicitRungeKutta,
        t0: float,
        y0: ArrayLike,
        t_end: float,
        rtol: float,
        atol: float,
        step: float,
        times: Array,
    ) -> None: ...
    @property
    def result(self) -> Array: ...
    @property
    def sampled(self) -> Array: ...
    @property
    def state(self) -> Array: ...
    def begin(self) -> int: ...
    def advance(self, most: int) -> int: ...
