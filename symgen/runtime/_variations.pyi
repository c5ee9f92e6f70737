"""Types of the binding of derivatives of runs; see ``_variations.pyx`` for what things do."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from symgen.runtime._core import Integrable, KernelEquations
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.integrators.method import Integrator
from symgen.runtime.kernels.description import LoopDescription
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.kernels.library import Library

class Variations:
    columns: int
    sums: Array
    def forward(
        self, t: Array, y: Array, references: Array, moved: Array, summed: Array
    ) -> tuple[int, int]: ...
    def backward(
        self, t: Array, y: Array, references: Array, seed: Array, weights: Array, gradient: Array
    ) -> tuple[int, int]: ...
    def parts(
        self, t: Array, y: Array, references: Array, rtol: float, atol: float, parts: Array
    ) -> tuple[int, int]: ...
    def fill(self, t: Array, y: Array, references: Array, known: NDArray[np.int8]) -> None: ...

class LinkageVariations(Variations):
    def __init__(
        self,
        equations: KernelEquations,
        method: Integrator,
        evaluator: Evaluator,
        places: Sequence[NDArray[np.int_]],
        columns: int,
    ) -> None: ...

class LoopVariations(Variations):
    def __init__(
        self,
        equations: Integrable,
        method: Integrator,
        description: LoopDescription,
        library: Library,
        width: int,
        directions: Sequence[int],
    ) -> None: ...
