"""Types of the equations of elastic motions; see ``_beams.pyx`` for what things do."""

import numpy as np
from numpy.typing import NDArray

from symgen.runtime._foreign import ForeignEquations
from symgen.runtime._rigid_motion import RigidMotion
from symgen.runtime.beam_layout import Layout

Array = NDArray[np.float64]

class BeamEquations(ForeignEquations):
    motion: RigidMotion
    whole: int
    entries: int
    band: int
    thesis: bool
    rank_tolerance: float
    def __init__(self, motion: RigidMotion, layout: Layout, thesis: bool) -> None: ...
    def matrices(
        self, t: float, resting: bool = False
    ) -> tuple[int, Array, Array, Array, Array, Array | None]: ...
    def sparse(self, t: float, resting: bool = False) -> tuple[int, Array, Array, list[Array]]: ...
    def accelerations(self, t: float, y: Array) -> Array: ...
    def residual(
        self, t: float, s: Array, v: Array, a: Array, resting: bool = False
    ) -> tuple[int, Array, Array]: ...
