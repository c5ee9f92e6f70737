"""Poles of the three angles of ball joints: poses at which angles lose rank although the loop does not."""

from __future__ import annotations

import numpy as np

from symgen.runtime import _loop
from symgen.runtime.arrays import Array
from symgen.runtime.closure.mobility import scaled_screws
from symgen.runtime.loop.frames import standing
from symgen.runtime.loop.kernels import LoopKernels

#: Change of the angles by which their effect on the links is judged [rad].
_STEP = 1e-4
#: Motion of the links, over such a change, that counts as zero.
_MOVES = 1e-6
#: Least singular value of angles that are far from a pole, over the largest.
_FAR = 1e-2
#: Motion of the links, over the least singular value, that counts as zero.
_MARGIN = 30.0
#: Least part of a variable that counts.
_TAKES_PART = 1e-3


def in_other_angles(
    kernels: LoopKernels, equations: _loop.LoopEquations, q: Array
) -> tuple[LoopKernels, Array]:
    """Return kernels and variables of a pose at a pole in the angles that ``equations`` use from now on.

    Where no ball near its pole can be written otherwise, they are those of the table.
    """
    turned = equations.turn(q)
    return LoopKernels(kernels.description, kernels.library, equations.parameters.tolist()), turned


def starts_at_pole(kernels: LoopKernels, t: float, q: Array) -> bool:
    """Return whether a loop under forces may start at a pole of the angles of one ball alone."""
    d = kernels.description
    solved = d.having("dependent")
    if {j for ball in d.balls for j in ball.angles} & {*d.having("free")} or not ball_pole(kernels, t, q):
        return False
    turned = in_other_angles(kernels, kernels.equations(solved, min(6, len(solved))), q)
    values = np.linalg.svd(scaled_screws(turned[0], t, turned[1])[:, solved], compute_uv=False)
    return len(values) == len(solved) and bool(values[-1] > _FAR * values[0])


def ball_pole(kernels: LoopKernels, t: float, q: Array) -> list[str]:
    """Return the angles whose split a pole leaves undetermined; none where the loop itself loses rank.

    At a pole the least held combination of the dependent variables moves no link, but for the spin of a link
    about the line of its two balls: it belongs to the angles and not to the mechanism.
    """
    d = kernels.description
    solved = d.having("dependent")
    if "S" not in d.joints or not solved:
        return []
    scale = kernels.scale
    _, values, right = np.linalg.svd(scaled_screws(kernels, t, q)[:, solved])
    least = float(values[-1] / values[0]) if len(values) == len(solved) else 0.0
    if least > _FAR:
        return []
    weakest = np.zeros(len(scale))
    weakest[solved] = right[len(solved) - 1]
    part = np.flatnonzero(np.abs(weakest) > _TAKES_PART * np.max(np.abs(weakest)))
    rows = {d.variables[j].row for j in part}
    is_dependent = all(v.role == "dependent" for v in d.variables if v.row in rows)
    if not is_dependent or any(d.joints[k] != "S" for k in rows):
        return []
    beside = np.array([q + x * scale * weakest for x in (_STEP, -_STEP)])
    ahead, behind = standing(kernels, np.full(2, t), beside)
    moved = float(np.max(np.abs(ahead - behind))) / (2.0 * _STEP)
    return [d.variables[j].name for j in part] if moved < _MOVES + _MARGIN * least else []
