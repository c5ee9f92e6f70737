"""Runs in large rotation with more and more steps, until the error by time steps is within its tolerance."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symgen.errors import SimulationError
from symgen.runtime.beams.methods import GAUSS8
from symgen.runtime.elastic.large.collocation import Moment, System, moved
from symgen.runtime.elastic.mesh import mesh_error
from symgen.runtime.integrate.pace import Pace
from symgen.runtime.result.records import Drift, Variable

Array = NDArray[np.float64]

#: The most steps that are doubled.
_MOST = 20_000
#: Change of a run in steps of half the length, over its error after, where no run before tells: with a change
#: by 4 to 256 times, as of the second to the eighth order, the error is 0.3 to 28 times the true one.
_FALLS, _FASTEST = 9.0, 256.0


@dataclass(frozen=True, slots=True)
class Pass:
    """Outputs of a run with so many steps between two samples, and what was counted of it.

    ``change`` is that of the stresses from the run before, over their peak, ``error`` the error by time steps
    that follows from it.
    """

    variables: list[Variable]
    steps: int
    corrections: int
    change: float
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
            variables, change, error = outputs(found), math.inf, math.inf
            if passes:
                change, before = mesh_error(passes[-1].variables, variables), passes[-1].change
                # Where it does not fall, as with vibrations too fast for the steps, small changes are chance.
                falls = before / change if change and math.isfinite(before) else _FALLS + 1
                error = change / (min(falls, _FASTEST) - 1) if falls > 2 else max(change, passes[-1].error)
            passes.append(Pass(variables, steps, stepper.corrections, change, error, drift(found)))
            if error <= rtol or steps * (len(times) - 1) > _MOST:
                return
        steps *= 2
        pace.restart(0.0)
