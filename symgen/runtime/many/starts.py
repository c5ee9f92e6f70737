"""Arguments of the compiled starts of many variants of a linkage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from symgen.runtime import _core
from symgen.runtime._start import Starter
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.integrate.causes import NEAR
from symgen.runtime.integrate.redundancy import ASSEMBLED
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.rods.start import CONSISTENT, ROUNDING

if TYPE_CHECKING:
    from symgen.runtime.loop.kernels import LoopKernels
    from symgen.runtime.result.state import State


def parameters_of_runs(
    evaluator: Evaluator | LoopKernels, columns: Mapping[str, Array], states: Sequence[State] | None
) -> Array:
    """Return the parameters of each run, (runs, parameters)."""
    count = len(next(iter(columns.values()))) if states is None else len(states)
    rows = np.tile(evaluator.parameter_values, (count, 1))
    names = [p.name for p in evaluator.description.tunable]
    for name, values in columns.items():
        rows[:, names.index(name)] = values
    return rows


def is_stored(evaluator: Evaluator, rows: Array, states: object) -> NDArray[np.bool_]:
    """Return a flag for each run: true with the parameters of the scene, whose start is stored."""
    stored: NDArray[np.bool_] = np.all(rows == [p.default for p in evaluator.description.tunable], axis=1)
    return stored & (states is None)


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
