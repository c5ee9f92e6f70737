"""Types of the rigid motion; see ``_rigid_motion.pyx`` for what things do."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.runtime._core import Equations

Array = NDArray[np.float64]

class RigidMotion:
    count: int
    t: float
    stride: float
    def __init__(
        self,
        equations: Equations,
        motion: Mapping[str, int],
        joints: Mapping[str, int],
        sizes: Sequence[int],
        t: float,
        y: ArrayLike,
        stride: float,
    ) -> None: ...
    def evaluate(self, t: float) -> tuple[int, Array, Array, Array, Array, Array]: ...
    def along(self, times: Array) -> tuple[int, Array, Array, Array]: ...
    def solution(self) -> Array: ...
