"""Arguments of the compiled starts of many variants of a linkage."""

from __future__ import annotations

import numpy as np

from symgen.runtime import _core
from symgen.runtime._start import Starter
from symgen.runtime.arrays import Indices
from symgen.runtime.integrate.causes import NEAR
from symgen.runtime.integrate.redundancy import ASSEMBLED
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.rods.start import CONSISTENT, ROUNDING


def start_of(
    evaluator: Evaluator, rate: float = 0.0
) -> tuple[Evaluator, _core.KernelEquations, Starter, Indices, float, float, float]:
    """Return the arguments of :class:`~symgen.runtime._many.Starts`, for equations with a stabilisation rate.

    Each thread of work needs its own.
    """
    d = evaluator.description
    number = {name: i for i, name in enumerate(d.points)}
    ends = [[number[p] for p in points[:2]] for points in d.links.values()]
    return (
        evaluator,
        evaluator.equations(stabilisation=rate),
        Starter(evaluator, ASSEMBLED, np.zeros(d.coordinates)),
        np.array(ends, dtype=np.intp).reshape(-1, 2),
        ROUNDING,
        CONSISTENT,
        NEAR,
    )
