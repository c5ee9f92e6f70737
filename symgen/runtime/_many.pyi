"""Types of the binding of many runs; see ``_many.pyx`` for what things do."""

import numpy as np
from numpy.typing import NDArray

from symgen.runtime._core import KernelEquations
from symgen.runtime._start import Starter
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.integrate.integrators.method import Integrator
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.kernels.library import Library

def over_variants(evaluator: Evaluator, kernel: str, variants: Array, times: Array, rows: Array) -> Array: ...

class Lanes:
    lanes: int
    def __init__(self, library: Library, equations: KernelEquations, lanes: int) -> None: ...

class Starts:
    def __init__(
        self,
        evaluator: Evaluator,
        equations: KernelEquations,
        starter: Starter,
        ends: Indices,
        rounding: float,
        consistent: float,
        near: float,
    ) -> None: ...
    def poses(
        self, variants: Array, ahead: tuple[Array, NDArray[np.uint8]] | None = None
    ) -> tuple[NDArray[np.bool_], Array, Array]: ...

class LinkageRuns(Starts):
    alone: int
    def __init__(
        self,
        evaluator: Evaluator,
        equations: KernelEquations,
        starter: Starter,
        ends: Indices,
        rounding: float,
        consistent: float,
        near: float,
        method: Integrator,
        t0: float,
        t_end: float,
        rtol: float,
        atol: float,
        step: float,
        times: Array,
        *,
        stabilisation: int,
        max_drift: float,
        max_step: float,
        places_only: bool,
        most: int,
        lanes: Lanes | None = None,
    ) -> None: ...
    def carry_out(
        self, variants: Array, states: Array | None = None
    ) -> tuple[NDArray[np.bool_], Array, Array, Array]: ...
