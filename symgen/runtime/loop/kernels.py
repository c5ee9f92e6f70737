"""The kernels of a closed loop as functions of NumPy arrays, at one set of parameters."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import RangeError
from symgen.runtime import _core, _loop
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.description import BlockInfo
from symgen.runtime.kernels.evaluate import Kernels
from symgen.runtime.kernels.library import Library
from symgen.runtime.kernels.loop_description import LoopDescription, VariableInfo
from symgen.runtime.kernels.typed import Typed
from symgen.runtime.loop.drive_inverse import first_times

#: Rounding of the input at the time at which it has a requested value.
CLOSE = 4 * float(np.finfo(float).eps)
#: Columns of the link-joint table that are lengths.
_LENGTHS = [False, True, False, False, True]


class LoopKernels(Kernels):
    """Calls the kernels of one loop; ``typed`` are those in another type, for runs."""

    description: LoopDescription

    def __init__(
        self,
        description: LoopDescription,
        library: Library,
        parameters: Sequence[float],
        typed: Typed | None = None,
    ) -> None:
        super().__init__(description, library, parameters)
        self.typed = None if typed is None or typed.is_plain else typed
        self.work_size = max(description.work_size, description.coordinates + 6)
        self.inputs = description.having("input")
        names = [description.variables[i].name for i in self.inputs]
        self.number_of_lead = names.index(description.lead) if description.lead else 0

    def at(self, parameters: Array) -> LoopKernels:
        """Return the same kernels with other parameters."""
        other = super().at(parameters)
        for name in ("_slopes", "pitches", "periodic"):
            other.__dict__.pop(name, None)
        return other

    def __call__(
        self, kernel: str, t: float, q: Array, u: Array, work: Array | None = None
    ) -> dict[str, Array]:
        """Return the results of a kernel by name, shaped."""
        address, sizes, blocks = self._call(kernel)
        memory = np.zeros(self.work_size + 1)
        if work is not None:
            memory[: len(work)] = work
        q, u = np.ascontiguousarray(q, dtype=float), np.ascontiguousarray(u, dtype=float)
        out = _core.evaluate(address, sizes, float(t), q, u, self.parameters, memory)
        return {name: out[where].reshape(shape) for name, where, shape in blocks}

    def many(self, kernel: str, times: Array, rows: Array, work: Array) -> dict[str, Array]:
        """Return the results of a kernel at many states by name, shape (states, entries); as :meth:`rows`."""
        out = self.rows(kernel, times, rows, work)
        blocks = self.info(kernel).blocks
        return {b.name: out[:, b.offset : b.offset + b.shape[0] * b.shape[1]] for b in blocks}

    def blocks(self, kernel: str) -> tuple[BlockInfo, ...]:
        """Return the results of a kernel: names, units, rows; empty if there is no such kernel."""
        info = self.find(kernel)
        return info.blocks if info else ()

    def equations(self, solved: Sequence[int], rank: int, work_of_loads: bool = True) -> _loop.LoopEquations:
        """Return the compiled view of the kernels in double precision: solves for these variables.

        Without ``work_of_loads`` that of loads is not integrated along.
        """
        return self._copied(None, tuple(solved), rank, work_of_loads)

    def stepping(self, solved: Sequence[int], rank: int) -> _loop.LoopEquations:
        """Return the same in the model's own number type, as runs and followed inputs use it."""
        return self._copied(self.typed, tuple(solved), rank, True)

    def _copied(self, *of: Any) -> _loop.LoopEquations:
        first = self._first.get(of)
        if first is None:
            first = self._first[of] = self._first_equations(*of)
        return first.copy()

    def _first_equations(
        self, typed: Typed | None, solved: Sequence[int], rank: int, work_of_loads: bool
    ) -> _loop.LoopEquations:
        d, outputs = self.description, self.find("outputs")
        return _loop.LoopEquations(
            typed.kernels(False) if typed else self.library,
            self.parameter_values,
            self.work_size,
            outputs.out_size if outputs else 0,
            self.lengths.tolist(),
            solved,
            self.inputs,
            [i for i, v in enumerate(d.variables) if v.unknown],
            d.size,
            rank,
            core=typed.stepping if typed else _core.DOUBLE,
            tolerance=self.tolerance,
            balls=[ball.angles for ball in d.balls],
            switches=len(d.switches),
            tables=d.tables,
            work_of_loads=work_of_loads,
            series_rows=d.series_rows,
            series_watched=d.series_watched,
        )

    def empty(self, count: int) -> tuple[Array, Array, Array]:
        """Return arrays for states, outputs and diagnosis of a number of samples of a followed loop."""
        n, info = self.description.coordinates, self.find("outputs")
        size = info.out_size if info else 0
        return np.zeros((count, 3 * n + 7)), np.zeros((count, size + 1)), np.zeros((count, 5))

    @property
    def tolerance(self) -> float:
        """Defect of closure that is tolerated: of rotations, and of lengths over the size of the loop."""
        return self.description.assembly_tolerance / self.description.size

    @cached_property
    def _slopes(self) -> Array:
        """What each variable changes in the link-joint table, shape (variables, rows, 5)."""
        unit = np.eye(self.description.coordinates)
        still = np.zeros(len(unit))
        table = [self("rows", 0.0, q, still)["rows"] for q in (still, *unit)]
        return np.array(table[1:]) - table[0]

    @cached_property
    def pitches(self) -> Array:
        """Translation along a joint for each radian of an angle [m/rad]; zero of all but helical joints."""
        slopes = np.max(np.abs(self._slopes[:, :, _LENGTHS]), axis=(1, 2), initial=0.0)
        return np.where(~self.lengths & (slopes > 1e-14 * self.description.size), slopes, 0.0)

    @cached_property
    def periodic(self) -> NDArray[np.bool_]:
        """Whether a full revolution of a variable leaves all links in place, for every variable."""
        turns = self._slopes[:, :, np.logical_not(_LENGTHS)]
        whole = np.all(np.abs(turns - np.round(turns)) < 1e-14, axis=(1, 2))
        return ~self.lengths & whole & (self.pitches == 0.0)

    def prescribed(self, t: float) -> Array:
        """Return value, rate and acceleration of every input at a time, shape (inputs, 3)."""
        if not self.inputs:
            return np.zeros((0, 3))
        nothing = np.zeros(self.description.coordinates)
        return self("inputs", t, nothing, nothing)["inputs"].reshape(-1, 3)

    @cached_property
    def solved(self) -> tuple[int, ...]:
        """Numbers of the variables that a motion solves for."""
        return tuple(self.description.solved)

    @cached_property
    def lengths(self) -> NDArray[np.bool_]:
        """Of every variable, whether it is a length and not an angle."""
        return np.array([v.is_length for v in self.description.variables], dtype=bool)

    @cached_property
    def scale(self) -> Array:
        """Scale of every variable: the size of the loop for a length, one for an angle."""
        return np.where(self.lengths, self.description.size, 1.0)

    @property
    def lead_scale(self) -> float:
        """The scale of the first input."""
        return float(self.scale[self.inputs[self.number_of_lead]])

    @property
    def lead(self) -> VariableInfo:
        """The first input of the scene."""
        return self.description.variables[self.inputs[self.number_of_lead]]

    def lead_at(self, t: float) -> tuple[float, float, float]:
        """Return value, rate and acceleration of the first input at a time."""
        value, rate, acceleration = self.prescribed(t)[self.number_of_lead].tolist()
        return value, rate, acceleration

    def leads_at(self, times: Array) -> Array:
        """Return value, rate and acceleration of the first input at many times, shape (times, 3)."""
        rows = np.zeros((len(times), 2 * self.description.coordinates + 1))
        jets = self.many("inputs", times, rows, np.zeros((len(times), self.work_size + 1)))["inputs"]
        return jets[:, 3 * self.number_of_lead : 3 * self.number_of_lead + 3]

    def times_of(self, values: Array) -> Array:
        """Return the first times, from 0 on, at which the first input has these values [rad, m].

        Raises
        ------
        RangeError
            When the input is not found to come to one of them.
        """
        start, rate, _ = self.lead_at(0.0)
        if rate:
            times = (values - start) / rate
            input_values = self.leads_at(times)
            met = np.abs(input_values[:, 0] - values) <= CLOSE * np.maximum(1.0, np.abs(values))
            if np.all(met) and np.all(input_values[:, 1] == rate):
                return np.asarray(times)
        times = first_times(self.leads_at, values)
        missed = np.flatnonzero(np.isnan(times))
        if len(missed):
            value = in_words(float(values[missed[0]]), self.lead.is_length, self.description)
            raise RangeError(
                f"{self.lead.name} does not come to {value} by its motion in time\n"
                "  Give the input a motion that reaches it, or evaluate the loop over time "
                '(--t-end, over="time").'
            )
        return times

    def time_of(self, value: float) -> float:
        """Return the first time, from 0 on, at which the first input has a value [rad, m]; see above."""
        return float(self.times_of(np.array([float(value)]))[0])

    def value_at(self, t: float) -> str:
        """Return the first input at a time, in words: ``theta1 = 45 deg``."""
        if not self.inputs:
            return f"t = {t:.9g} s"
        at = in_words(self.lead_at(t)[0], self.lead.is_length, self.description)
        return f"{self.lead.name} = {at}"


def in_words(value: float, is_length: bool, description: LoopDescription) -> str:
    """Return an angle in degrees or a displacement in the scene's unit, as messages give it."""
    if is_length:
        name, size = description.units.get("length", ("m", 1.0))
        return f"{value / size:.9g} {name}"
    return f"{math.degrees(value):.9g} deg"
