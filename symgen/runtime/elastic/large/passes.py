"""Runs in large rotation with more and more steps, until the error by time steps is within its tolerance."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from symgen.errors import SimulationError
from symgen.runtime.beams.methods import GAUSS8
from symgen.runtime.elastic.large.collocation import Moment, System, moved
from symgen.runtime.elastic.mesh import mesh_error
from symgen.runtime.integrate.pace import Pace
from symgen.runtime.result.records import Drift, Variable

Array = NDArray[np.float64]

#: Error by time steps over the peak stress of a station, where ``rtol`` is not given.
RTOL = 2e-3
#: The most steps of a reported run that ``rtol`` adds.
_MOST = 20_000


@dataclass(frozen=True, slots=True)
class Pass:
    """Outputs and counts of a run with ``steps`` steps between two samples.

    ``error`` is the error of stresses by time steps over their peak; infinite as long as it is not known.
    """

    variables: list[Variable]
    steps: int
    corrections: int
    error: float
    drift: Drift


def refine(
    passes: list[Pass],
    system: System,
    outputs: Callable[[Sequence[Moment]], list[Variable]],
    drift: Callable[[Sequence[Moment]], Drift],
    times: Array,
    least: float,
    rtol: float,
    pace: Pace,
    progress: Callable[[float], None] | None,
) -> None:
    """Append runs with twice the steps each to ``passes``, from ``least`` on, until the error is ``rtol``.

    The error of a run is the change of its stresses with twice the steps: 1 - 2^-8 of the error, by the order
    of the method. The last run with twice the steps is not appended.

    Raises
    ------
    SimulationError
        Where Newton's method does not converge, however short the steps.
    OutOfTime
        When the wall time is spent.
    """
    steps = math.ceil(least / (len(times) - 1))
    while True:
        try:
            found, stepper = moved(system, GAUSS8, times, steps, pace, progress)
        except SimulationError:
            if passes or steps * (len(times) - 1) > _MOST:
                raise
        else:
            variables = outputs(found)
            if passes:
                passes[-1] = replace(passes[-1], error=mesh_error(passes[-1].variables, variables))
                if passes[-1].error <= rtol or steps * (len(times) - 1) > _MOST:
                    return
            passes.append(Pass(variables, steps, stepper.corrections, math.inf, drift(found)))
        steps *= 2
        pace.restart(0.0)
