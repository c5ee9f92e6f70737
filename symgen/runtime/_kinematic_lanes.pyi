"""Types of the binding of driven linkages in lanes; see ``_kinematic_lanes.pyx`` for what things do."""

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.arrays import Array
from symgen.runtime.kernels.description import Description
from symgen.runtime.kernels.library import Library
from symgen.runtime.rods.following.groups import Groups

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
    ) -> tuple[Array, Array, NDArray[np.intp]]: ...
    def extremes(
        self,
        t: float,
        parameters: Array,
        q: Array,
        lengths: Array,
        times: Array,
        recorded: NDArray[np.uint8],
        starts: NDArray[np.intp],
        wanted: NDArray[np.uint8],
        links: NDArray[np.intp],
        turn: float,
    ) -> tuple[Array, Array, NDArray[np.bool_], NDArray[np.bool_]]: ...
