"""Types of the binding of elastic links; see ``_beams.pyx`` for what things do."""

from collections.abc import Mapping

from numpy.typing import ArrayLike

from symgen.runtime._core import Integrable
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.beams.layout import BeamLayout
from symgen.runtime.elastic.path import RigidMotionTable
from symgen.runtime.kernels.library import Library

MOTION: tuple[str, ...]
APPLIED: tuple[str, ...]
BLOCKS: tuple[str, ...]
MATRICES: tuple[str, ...]
VECTORS: tuple[str, ...]
SPREAD: tuple[str, ...]
IN_MOTION: int
AT_REST: int
QUASI_STATIC: int

class RigidMotion:
    equations: Integrable
    t: float
    def __init__(
        self,
        equations: Integrable,
        motion: Library,
        joints: Library,
        sizes: Mapping[str, int],
        t: float,
        y: ArrayLike,
        stride: float,
        path: RigidMotionTable | None = None,
    ) -> None: ...
    def save(self) -> bytes: ...
    def restore(self, memory: bytes) -> None: ...
    def evaluate(self, t: float) -> tuple[int, Array, Array, Array, Array, Array]: ...
    def along(self, times: Array) -> tuple[int, Array, Array, Array, Array]: ...

class BeamEquations(Integrable):
    motion: RigidMotion
    whole: int
    thesis: bool
    def __init__(self, motion: RigidMotion, layout: BeamLayout, thesis: bool) -> None: ...
    def carry(self, times: Array, weights: Array, rows: Indices, columns: Indices, values: Array) -> None: ...
    def matrices(
        self, t: float, analysis: int = ...
    ) -> tuple[int, Array, Array, Array, Array, Array | None]: ...
    def sparse(self, t: float, analysis: int = ...) -> tuple[int, Indices, Indices, list[Array]]: ...
    def full_stiffness(self) -> tuple[Indices, Indices, Array]: ...
    def unbalanced(self, s: ArrayLike, analysis: int = ...) -> Array: ...
    def residual(
        self, times: ArrayLike, s: ArrayLike, v: ArrayLike, a: ArrayLike, analysis: int = ...
    ) -> tuple[int, Array, Array]: ...

class BeamBatch(Integrable):
    single: BeamEquations
    def __init__(self, equations: BeamEquations, columns: int) -> None: ...
