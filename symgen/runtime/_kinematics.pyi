"""Types of the binding of driven linkages; see ``_kinematics.pyx`` for what things do."""

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.arrays import Array, Indices
from symgen.runtime.kernels.description import Description
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.kernels.library import Library
from symgen.runtime.rods.following.groups import Groups

class Kinematics:
    n: int
    m: int
    def __init__(
        self, evaluator: Evaluator, groups: Groups, length: float, forces: Evaluator | None = None
    ) -> None: ...
    def follow(self, t: float, q: Array, times: Array) -> Array: ...
    def multipliers(self, times: Array, states: Array) -> tuple[Array, Array]: ...

class KinematicLanes:
    lanes: int
    def __init__(
        self,
        motion: tuple[Description, Library],
        lanes: int,
        groups: Groups,
        forces: tuple[Description, Library] | None = None,
    ) -> None: ...
    def follow(
        self, t: float, parameters: Array, q: Array, lengths: Array, times: Array
    ) -> tuple[Array, Array, Indices]: ...
    def extremes(
        self,
        t: float,
        parameters: Array,
        q: Array,
        lengths: Array,
        times: Array,
        recorded: NDArray[np.uint8],
        starts: Indices,
        wanted: NDArray[np.uint8],
        links: Indices,
        turn: float,
    ) -> tuple[Array, Array, NDArray[np.bool_], NDArray[np.bool_]]: ...
