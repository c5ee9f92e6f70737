"""Types of the binding of driven linkages; see ``_kinematics.pyx`` for what things do."""

from symgen.runtime.arrays import Array
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.rods.following.groups import Groups

class Kinematics:
    n: int
    m: int
    def __init__(
        self, evaluator: Evaluator, groups: Groups, length: float, forces: Evaluator | None = None
    ) -> None: ...
    def follow(self, t: float, q: Array, times: Array) -> Array: ...
    def multipliers(self, times: Array, states: Array) -> tuple[Array, Array]: ...
