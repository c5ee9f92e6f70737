"""The first closure of a loop, near to a guess, and the count of the freedoms that its joints leave."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symgen.errors import InitialStateError
from symgen.runtime.arrays import Array
from symgen.runtime.closure.assemblies import search
from symgen.runtime.closure.mobility import not_determined, not_followed, open_loop, scaled_screws
from symgen.runtime.loop.ball_poles import starts_at_pole
from symgen.runtime.loop.kernels import LoopKernels

#: Least pivot of independent screws, over the first.
_RANK = 1e-8
#: Largest part of the input's motion that the loop may fail to follow.
_FOLLOWS = 1e-7
#: Defect of closure that rounding may leave, for angles of one radian.
_ROUNDING = 1e-11


@dataclass(frozen=True, slots=True)
class Closed:
    """A closed loop: the time [s], all variables [rad, m], and the rank of the dependent ones' screws."""

    t: float
    q: Array
    rank: int


def close_near(kernels: LoopKernels, t: float, guess: Array, by: Sequence[int] = ()) -> Closed:
    """Close the loop at a time; of all closures that are found, the nearest to the guess is taken.

    ``by`` are the variables that the distance from the guess is measured by, all dependent ones when absent.

    Raises
    ------
    InitialStateError
        When no closure is found, or the joints leave more or fewer freedoms than the scene counts on.
    """
    result = search(kernels, t, guess, by)
    if not result.closures:
        raise open_loop(kernels, t, result)
    return counted(kernels, t, result.closures[0])


def counted(kernels: LoopKernels, t: float, q: Array) -> Closed:
    """Check the count of freedoms at a closed pose.

    Raises
    ------
    InitialStateError
        When the dependent variables are not determined by closure, or cannot follow the inputs.
    """
    solved = kernels.description.having("dependent")
    screws = scaled_screws(kernels, t, q)[:, solved]
    values = np.linalg.svd(screws, compute_uv=False)
    least = max(_RANK, kernels.tolerance)
    rank = int(np.count_nonzero(values > least * values.max(initial=1e-300)))
    if rank < len(solved):
        if starts_at_pole(kernels, t, q):
            return Closed(t, q, len(solved))
        raise not_determined(kernels, t, q, rank)
    error = not_followed(kernels, t, q, max(_FOLLOWS, 100 * kernels.tolerance))
    if error:
        raise error
    return Closed(t, q, rank)


def check_closed(kernels: LoopKernels, closed: Closed, defect: Array) -> None:
    """Refuse a start that is open by more than rounding, or the assembly tolerance.

    ``defect`` is the closure less the identity, shape (3, 4), evaluated by other means than the closing.
    """
    d = kernels.description
    errors = np.abs(defect) / np.array([1.0, 1.0, 1.0, d.size])
    worst = float(np.max(np.nan_to_num(errors, nan=np.inf)))
    if worst > max(_ROUNDING * max(1.0, float(np.max(np.abs(closed.q)))), 1.01 * kernels.tolerance):
        raise InitialStateError(
            f"at {kernels.value_at(closed.t)} the start leaves the loop open by {worst:.3g} (rotation in "
            f"radians, displacement over {d.size:.4g} m)\n"
            "  Its assembly did not detect this: please report it, with the scene, as a fault of symgen.",
            where="loop.rows",
        )
