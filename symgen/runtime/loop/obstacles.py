"""Why a driven loop cannot be followed to a value of its input."""

from __future__ import annotations

import numpy as np

from symgen.runtime import _core, _loop
from symgen.runtime.arrays import Array
from symgen.runtime.closure.mobility import not_followed, scaled_screws
from symgen.runtime.loop.ball_poles import ball_pole
from symgen.runtime.loop.kernels import LoopKernels

#: Least singular value, of the largest, that explains why a loop cannot be followed.
_WEAK = 1e-3


def why_stopped(
    kernels: LoopKernels, equations: _loop.LoopEquations, status: int, t: float, q: Array, target: float
) -> str:
    """Return the cause, the value of the input at which the loop stopped, and a remedy."""
    d = kernels.description
    solved = d.having("dependent")
    at, target_value = kernels.value_at(t), kernels.value_at(target)
    if status == _core.NOT_FINITE:
        return (
            f"an input, an effort or a load has no finite value, or no finite rate, beyond {at}\n"
            "  Look at their expressions there."
        )
    columns = scaled_screws(kernels, t, q)[:, solved]
    _, values, right = np.linalg.svd(columns)
    weakest = d.row(solved[int(np.argmax(np.abs(right[len(values) - 1])))])
    least = values[len(solved) - 1] / values[0]
    if status == _loop.INCONSISTENT:
        error = not_followed(kernels, t, q, 1e-7)
        if error:
            return str(error)
        return (
            f"the loop closes at {at} but cannot move there: dependent variables cannot follow the inputs "
            f"(residual of the rates: {equations.rates_left:.1e})\n  The table has too few variables."
        )
    if names := ball_pole(kernels, t, q):
        return (
            f"the loop cannot be followed beyond {at} towards {target_value}: the angles {', '.join(names)} "
            "of a "
            "ball joint have a pole near it, a property of these angles and not of the loop\n"
            "  Evaluate values on either side of it, or turn the axes of the rows next to the ball (theta, "
            "alpha) so that its pole lies elsewhere."
        )
    reason = (
        "its screws lose rank there, at a dead centre or at the limit of the range in which it can be "
        f"assembled; {weakest} is least constrained (smallest singular value: {least:.1e} of the largest)"
        if least < _WEAK
        else "no closure of the same branch was found"
    )
    return (
        f"the loop cannot be followed beyond {at} towards {target_value}: {reason}\n"
        "  Stay below this value, continue past a turning point of the input (--through, through=True), "
        "change the lengths, or choose another input."
    )
