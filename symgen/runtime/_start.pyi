"""Types of the binding of starts; see ``_start.pyx`` for what things do."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.arrays import Array
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.kernels.library import Library

STARTED: int
ON_THE_WAY: int
UNASSEMBLED: int
TOO_TOLERANT: int
OTHER_SIDE: int
MOST: float

def size_of_points(positions: Array) -> float: ...

class Starter:
    at: float
    q: Array
    def __init__(self, evaluator: Evaluator, share: float, q: Array) -> None: ...
    def advance(self) -> int: ...
    def close(self) -> int: ...
    def velocities(self, redundant: Sequence[int]) -> tuple[Array, Array, Array, float] | None: ...

class StartLanes:
    def __init__(self, like: Starter, library: Library, lanes: int, parameters: int) -> None: ...
    def assembled(self, values: Array) -> tuple[Array, NDArray[np.uint8]]: ...
