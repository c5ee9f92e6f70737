"""Many variants of a driven loop, followed in SIMD lanes, with Python once for each block of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from symgen.runtime._loop import LoopLanes
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.batch import lanes_of
from symgen.runtime.kernels.library import Library
from symgen.runtime.loop.driven import LEAST_RANGE, PARTS, STAGES
from symgen.runtime.loop.kernels import CLOSE, LoopKernels
from symgen.runtime.loop.near_singular import WEAK
from symgen.runtime.many.dataset import BLOCK, Keep, KeptSamples
from symgen.runtime.many.runs import parameters_of_runs
from symgen.runtime.result.records import Coordinate, over_time
from symgen.runtime.result.turn import Turn, variables

#: Components of vectors.
_AXES = ("x", "y", "z")


@dataclass(frozen=True, slots=True)
class DrivenLoops:
    """Variants of a loop with ``parameters`` (runs, parameters), followed from its start.

    Attributes
    ----------
    kernels, batched
        Kernels of one loop, and those that take vectors.
    along, values
        The first input and its increasing values, or None and times.
    names
        Outputs to record.
    """

    kernels: LoopKernels
    batched: Library
    parameters: Array
    along: Coordinate | None
    values: Array
    names: frozenset[str]

    reason: ClassVar[str] = ""

    @property
    def grain(self) -> int:
        """Number of runs that fill all lanes."""
        return lanes_of(self.batched, self.kernels.description.name)[0]

    def most(self, keep: Keep) -> int:
        """Return the number of runs of one call."""
        return BLOCK

    def __call__(self, first: int, last: int, keep: Keep) -> list[KeptSamples | None]:
        """Carry out some runs; None stands for those that are to be carried out singly."""
        kernels, d = self.kernels, self.kernels.description
        defaults, parameter_rows = np.array([p.default for p in d.parameters]), self.parameters[first:last]
        lanes = LoopLanes(kernels.equations(d.having("dependent"), d.rank), self.batched, self.grain)
        times, out, hold, closure, is_done = lanes.follow(
            defaults,
            np.ascontiguousarray(parameter_rows),
            np.array(d.start),
            STAGES,
            d.begin if d.span else None,
            kernels.number_of_lead,
            self.values,
            self.along is not None,
            CLOSE,
            PARTS,
            LEAST_RANGE,
            WEAK,
        )
        is_done &= np.any(parameter_rows != defaults, axis=1)  # the start of the scene's own is stored
        is_done &= ~np.any(np.diff(np.sign(hold), axis=1), axis=1)  # a dead centre between samples
        block_variables = [v for v in variables(d, np.moveaxis(out, 1, 2)) if v.name in self.names]
        runs = np.flatnonzero(is_done)
        if not len(runs):
            return [None] * len(parameter_rows)
        block = [v.of(v.values[runs]) for v in block_variables]
        along, of_time = (over_time(self.values), None) if self.along is None else (self.along, times[runs])
        record = keep(block, along, of_time, {"constraint": closure[runs] * d.size}, _AXES, first + runs)
        return [record if ran else None for ran in is_done.tolist()]


def driven_loops(model: Any, first: Turn, columns: Mapping[str, Array]) -> DrivenLoops | None:
    """Return runs with the samples of a first one; None where each is to be carried out singly."""
    d, kernels, along = model.description, model.kernels, first.coordinate
    solved, count = len(d.having("dependent")), len(d.having("input"))
    if kernels.typed is not None or model.number_type is None or d.switches or not 0 < solved == d.rank <= 6:
        return None
    if (d.rank < 6 and count > 1) or not np.all(np.diff(along.values) > 0.0):
        return None  # an input of several may be held by the closure
    batched = model.number_type.kernels(True)
    if batched.backend != "c" or lanes_of(batched, d.name)[0] < 2:
        return None
    names = frozenset(v.name for v in first.variables)
    return DrivenLoops(
        kernels,
        batched,
        parameters_of_runs(kernels, columns, None),
        None if along.name == "time" else along,
        along.values,
        names,
    )
