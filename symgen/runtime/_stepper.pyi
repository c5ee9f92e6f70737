"""Types of the compiled step loop; see ``_stepper.pyx`` for what things do."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.runtime._core import Equations
from symgen.runtime.integrators.tableau import ExplicitRungeKutta

Array = NDArray[np.float64]

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
