"""The kernels of a closed loop as functions of NumPy arrays, at one set of parameters."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime import _core, _loop
from symgen.runtime.description import LoopDescription, VariableInfo
from symgen.runtime.evaluate import as_taken, part
from symgen.runtime.library import Library
from symgen.runtime.typed import Typed

Array = NDArray[np.float64]

#: Steps in which a value of the input is looked for: parts of the straight way, growing.
_PARTS, _STEPS, _GROWTH = 64, 4000, 1.01
_CLOSE = 4 * float(np.finfo(float).eps)


class LoopKernels:
    """Calls the kernels of one loop; ``typed`` are those in another type, for runs."""

    def __init__(
        self,
        description: LoopDescription,
        library: Library,
        parameters: Sequence[float],
        typed: Typed | None = None,
    ) -> None:
        self.description, self.library = description, library
        self.typed = None if typed is None or typed.is_plain else typed
        self.given = np.array(parameters, dtype=float)
        self.parameters = as_taken(library, self.given)
        self.work_size = max(description.work_size, description.coordinates + 6)
        self.inputs = description.having("input")
        names = [description.variables[i].name for i in self.inputs]
        self._lead = names.index(description.lead) if description.lead else 0

    def __call__(
        self, kernel: str, t: float, q: Array, u: Array, work: Array | None = None
    ) -> dict[str, Array]:
        """Return the results of a kernel by name, shaped."""
        info = self.description.kernel(kernel)
        if info is None:
            raise ModelError(f"{self.description.name} has no kernel {kernel!r}")
        out, memory = np.zeros(info.out_size + 1), np.zeros(self.work_size + 1)
        if work is not None:
            memory[: len(work)] = work
        address = self.library.addresses[kernel]
        _core.call(
            address, np.array([float(t)]), np.append(q, 0.0), np.append(u, 0.0), self.parameters, memory, out
        )
        return {b.name: part(out, b) for b in info.blocks}

    def has(self, kernel: str) -> bool:
        """Tell whether the loop has this kernel."""
        return kernel in self.library.addresses

    def equations(self, solved: Sequence[int], rank: int) -> _loop.LoopEquations:
        """Return the compiled view of the kernels in double precision: solves for these variables."""
        return self._made_of(self.library, _core.DOUBLE, solved, rank)

    def stepping(self, solved: Sequence[int], rank: int) -> _loop.LoopEquations:
        """Return the same in the type that was asked for: what follows inputs and runs."""
        if self.typed is None:
            return self.equations(solved, rank)
        return self._made_of(self.typed.kernels(False), self.typed.stepping, solved, rank)

    def _made_of(
        self, library: Library, core: _core.Core, solved: Sequence[int], rank: int
    ) -> _loop.LoopEquations:
        arguments = self._arguments(solved, rank)
        return _loop.LoopEquations(library.addresses, *arguments, core=core, derived=library.derived)

    def _arguments(self, solved: Sequence[int], rank: int) -> tuple[Any, ...]:
        d = self.description
        outputs = d.kernel("outputs")
        return (
            self.given,
            self.work_size,
            outputs.out_size if outputs else 0,
            [v.is_length for v in d.variables],
            solved,
            self.inputs,
            [i for i, v in enumerate(d.variables) if v.unknown],
            d.size,
            rank,
        )

    def prescribed(self, t: float) -> Array:
        """Return value, rate and acceleration of every input at a time, shape (inputs, 3)."""
        if not self.inputs:
            return np.zeros((0, 3))
        nothing = np.zeros(self.description.coordinates)
        return self("inputs", t, nothing, nothing)["inputs"].reshape(-1, 3)

    @property
    def lead(self) -> VariableInfo:
        """The first input of the scene."""
        return self.description.variables[self.inputs[self._lead]]

    def lead_at(self, t: float) -> tuple[float, float, float]:
        """Return value, rate and acceleration of the first input at a time."""
        value, rate, acceleration = self.prescribed(t)[self._lead].tolist()
        return value, rate, acceleration

    def times_of(self, values: Array) -> Array:
        """Return the first times, from 0 on, at which the first input has these values [rad, m]."""
        start, rate, _ = self.lead_at(0.0)
        if rate:
            times = (values - start) / rate
            info = self.description.kernel("inputs")
            out = np.zeros((len(times), (info.out_size if info else 0) + 1))
            rows = np.zeros((len(times), 2 * self.description.coordinates + 1))
            work = np.zeros((len(times), self.work_size + 1))
            address, n = self.library.addresses["inputs"], self.description.coordinates
            _core.call_many(address, times, rows, n, self.parameters, work, out)
            found = out[:, 3 * self._lead : 3 * self._lead + 2]
            met = np.abs(found[:, 0] - values) <= _CLOSE * np.maximum(1.0, np.abs(values))
            if np.all(met) and np.all(found[:, 1] == rate):
                return np.asarray(times)
        return np.array([self.time_of(float(v)) for v in values])

    def time_of(self, value: float) -> float:
        """Return the first time, from 0 on, at which the first input has a value [rad, m].

        It is looked for in the direction in which the input starts towards the value, in growing steps.

        Raises
        ------
        ModelError
            When the input stands still, or is not found to come to that value.
        """
        start, rate, acceleration = self.lead_at(0.0)
        gap, name = value - start, self.lead.name
        if gap == 0.0:
            return 0.0
        if rate:
            step = gap / rate
            if self.lead_at(step)[:2] == (value, rate):
                return step
        elif acceleration:
            step = math.sqrt(2 * abs(gap / acceleration))
        else:
            raise ModelError(
                f"{name} stands still at t = 0 s, so nothing says how fast the loop moves\n"
                '  Give the input a motion by the time t, such as "speed*t".'
            )
        h, t, before = step / _PARTS, 0.0, -gap
        for _ in range(_STEPS):
            after = self.lead_at(t + h)[0] - value
            if not math.isfinite(after):
                break
            if before * after <= 0.0:
                return self._met(value, t, t + h)
            t, before, h = t + h, after, h * _GROWTH
        raise ModelError(
            f"{name} does not come to {in_words(value, self.lead.is_length, self.description)} by its motion "
            f"in time, as far as t = {t:.3g} s"
        )

    def _met(self, value: float, low: float, high: float) -> float:
        from scipy.optimize import brentq

        t = float(brentq(lambda t: self.lead_at(t)[0] - value, low, high, xtol=1e-300, rtol=8.9e-16))
        at, rate, _ = self.lead_at(t)
        polished = t + (value - at) / rate if rate else t
        return polished if abs(self.lead_at(polished)[0] - value) < abs(at - value) else t

    def value_at(self, t: float) -> str:
        """Return the first input at a time, in words: ``theta1 = 45 deg``."""
        if not self.inputs:
            return f"t = {t:.9g} s"
        at = in_words(self.lead_at(t)[0], self.lead.is_length, self.description)
        return f"{self.lead.name} = {at}"


def in_words(value: float, is_length: bool, description: LoopDescription) -> str:
    """Return an angle in degrees or a displacement in the scene's unit, as messages give it."""
    if is_length:
        name, size = description.units["length"]
        return f"{value / size:.9g} {name}"
    return f"{math.degrees(value):.9g} deg"
