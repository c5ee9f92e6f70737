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

#: The most steps that are doubled.
_MOST = 20_000
#: Part of the samples in which the error of steps is compared with the change from steps of twice the length.
_PROBED = 8
#: Factor of the error there: the finer run has errors too, and later motion may be faster.
_SAFE = 8.0


@dataclass(frozen=True, slots=True)
class Pass:
    """Outputs and counts of a run with ``steps`` steps between two samples.

    ``error`` is the error of stresses by time steps over their peak.
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
            variables, error = outputs(found), math.inf
            if passes:
                pace.restart(0.0)
                part = times[: 1 + math.ceil((len(times) - 1) / _PROBED)]
                finer, _ = moved(system, GAUSS8, part, 2 * steps, pace)
                error = _error(passes[-1].variables, variables, outputs(finer))
            passes.append(Pass(variables, steps, stepper.corrections, error, drift(found)))
            if error <= rtol or steps * (len(times) - 1) > _MOST:
                return
        steps *= 2
        pace.restart(0.0)


def _error(coarse: Sequence[Variable], own: Sequence[Variable], finer: Sequence[Variable]) -> float:
    """Return the estimated error of stresses of a run over their peak.

    It is the change from the coarser run times the ratio of two changes over the first samples: that to a
    finer run over that from the coarser one, times a factor of safety.
    """
    count = len(finer[0].values)
    of_coarse, of_own = ([replace(v, values=v.values[:count]) for v in run] for run in (coarse, own))
    before, after = mesh_error(of_coarse, of_own), _SAFE * mesh_error(of_own, finer)
    change = mesh_error(coarse, own)
    return change * after / before if before else change
