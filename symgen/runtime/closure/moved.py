"""A loop moved from its start to other values of its variables."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from symgen.errors import SimulationError
from symgen.runtime import _core
from symgen.runtime.closure.start import Closed
from symgen.runtime.loop.kernels import LoopKernels

Array = NDArray[np.float64]

#: Longest step of a variable, and its change that is a jump: angles [rad], lengths over the size of the loop.
_STEP, _JUMP = 0.05, 0.5
#: Most steps.
_MOST = 10_000


def moved_to(kernels: LoopKernels, begin: Closed, wanted: Array, t: float, at_once: bool = False) -> Closed:
    """Return the loop closed at values of its free variables and a time.

    Parameters
    ----------
    wanted
        All variables; those of inputs do not matter, and dependent ones are guesses ``at_once``.
    at_once
        Close the loop there, instead of following it from its start.

    Raises
    ------
    SimulationError
        When it does not close, or leaves its assembly on the way.
    """
    d = kernels.description
    scale = np.array([d.size if v.is_length else 1.0 for v in d.variables])
    equations = kernels.equations(d.having("dependent"), begin.rank)
    free = d.having("free")
    steps = 1
    if not at_once:
        inputs = kernels.prescribed(t)[:, 0] - kernels.prescribed(begin.t)[:, 0]
        ways = np.abs(
            np.concatenate([(wanted - begin.q)[free] / scale[free], inputs / scale[kernels.inputs]])
        )
        steps = min(_MOST, max(1, math.ceil(float(np.max(ways)) / _STEP)))
    q = np.append(wanted if at_once else begin.q, 0.0)
    for part in np.linspace(0.0, 1.0, steps + 1)[1:]:
        now, before = begin.t + part * (t - begin.t), q.copy()
        q[free] = (1.0 - part) * begin.q[free] + part * wanted[free]
        failed = equations.close(now, q) != _core.DONE
        if failed or (not at_once and np.max(np.abs(q - before)[:-1] / scale) > _JUMP):
            values = ", ".join(f"{d.variables[i].name} = {q[i]:.6g} {d.variables[i].unit}" for i in free)
            reason = "does not close" if failed else "leaves its assembly"
            raise SimulationError(
                f"{d.name} {reason} at {values}"
                + ("" if at_once else ", on the way from its start")
                + "\n  Give other values, or those of its dependent variables as guesses as well.",
                time=now,
            )
    return Closed(t, q[:-1].copy(), begin.rank)
