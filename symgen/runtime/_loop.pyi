"""Types of the binding of closed loops; see ``_loop.pyx`` for what things do."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from symgen.runtime._core import Core, Integrable
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.library import Library

OPEN: int
INCONSISTENT: int
POLE: int
RATES_UNDETERMINED: int
CLOSURE: int
RATES: int
SOUNDNESS: int
HOLD: int
STATUS: int

class LoopEquations(Integrable):
    rank: int
    size: float
    closure: float
    rates_left: float
    hold: float
    iterations: int
    def __init__(
        self,
        library: Library,
        p: Sequence[float] | Array,
        work_size: int,
        out_size: int,
        lengths: Sequence[bool],
        solved: Sequence[int],
        inputs: Sequence[int],
        unknown: Sequence[int],
        size: float,
        rank: int,
        *,
        core: Core = ...,
        tolerance: float = 0.0,
        balls: Sequence[Sequence[int]] = (),
        switches: int = 0,
        tables: int = 0,
        work_of_loads: bool = True,
        series_rows: int = 0,
        series_watched: int = 0,
    ) -> None: ...
    def close(self, t: float, q: Array) -> int: ...
    def assemble(self, t: float, q: Array) -> tuple[int, int]: ...
    def closed_screws(self, t: float, q: Array) -> tuple[Array, float]: ...
    def turn(self, q: Array) -> Array: ...
    def follow(
        self,
        t: float,
        q: Array,
        times: Array,
        longest: float,
        states: Array,
        out: Array,
        diagnosis: Array,
    ) -> tuple[int, int, float]: ...
    def undetermined(self, times: Array, states: Array, least: float, part: float) -> NDArray[np.bool_]: ...

class LoopLanes:
    def __init__(self, like: LoopEquations, library: Library, lanes: int) -> None: ...
    def follow(
        self,
        own: Array,
        parameters: Array,
        start: Array,
        stages: Array,
        begin: float | None,
        lead: int,
        samples: Array,
        of_input: bool,
        close: float,
        longest: float,
        apart: float,
        least: float,
    ) -> tuple[Array, Array, Array, Array, NDArray[np.bool_]]: ...
