"""Types of the steps of elastic motions; see ``_beam_steps.pyx`` for what things do."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.runtime._beams import BeamEquations
from symgen.runtime.beam_methods import BeamMethod

Array = NDArray[np.float64]

class BeamSteps:
    steps: int
    def __init__(self, equations: BeamEquations, method: BeamMethod, columns: int) -> None: ...
    def start(self, t: float, s: ArrayLike, v: ArrayLike) -> int: ...
    def advance(self, t0: float, t1: float, steps: int) -> int: ...
    @property
    def displacements(self) -> Array: ...
    @property
    def rates(self) -> Array: ...
