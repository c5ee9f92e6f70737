"""Types of the right-hand side; see ``_rhs.pyx`` for what things do."""

from typing import Any

from numpy.typing import ArrayLike

from symgen.runtime._core import Integrable
from symgen.runtime.arrays import Array

class Rhs:
    start: Array
    inputs: tuple[str, ...]
    def __init__(
        self, equations: Integrable, start: Array, inputs: tuple[str, ...] = (), first: int = 0
    ) -> None: ...
    def __call__(self, t: float, y: ArrayLike, u: ArrayLike | None = None) -> Array: ...
    def project(self, t: float, y: ArrayLike) -> Array: ...
    def energy(self, t: float, y: ArrayLike) -> float: ...
    low_level: Any
