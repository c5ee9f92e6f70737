"""Types of the binding of elastic links; see ``_beams.pyx`` for what things do."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.runtime._core import Integrable
from symgen.runtime.beam_layout import Layout
from symgen.runtime.beam_methods import BeamMethod

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

class RigidMotion:
    equations: Integrable
    @property
    def t(self) -> float: ...
    def __init__(
        self,
        equations: Integrable,
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

class BeamEquations(Integrable):
    motion: RigidMotion
    whole: int
    thesis: bool
    def __init__(self, motion: RigidMotion, layout: Layout, thesis: bool) -> None: ...
    def matrices(
        self, t: float, resting: bool = False
    ) -> tuple[int, Array, Array, Array, Array, Array | None]: ...
    def sparse(self, t: float, resting: bool = False) -> tuple[int, Indices, Indices, list[Array]]: ...
    def accelerations(self, t: float, y: ArrayLike) -> Array: ...
    def residual(
        self, t: float, s: ArrayLike, v: ArrayLike, a: ArrayLike, resting: bool = False
    ) -> tuple[int, Array, Array]: ...

class BeamSteps:
    steps: int
    def __init__(self, equations: BeamEquations, method: BeamMethod, columns: int) -> None: ...
    def start(self, t: float, s: ArrayLike, v: ArrayLike) -> int: ...
    def advance(self, t0: float, t1: float, steps: int) -> int: ...
    @property
    def displacements(self) -> Array: ...
    @property
    def rates(self) -> Array: ...
