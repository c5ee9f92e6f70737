"""The kernels of a closed loop as functions of NumPy arrays, at one set of parameters."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime import _core, _loop
from symgen.runtime.description import LoopDescription
from symgen.runtime.evaluate import part
from symgen.runtime.library import Library

Array = NDArray[np.float64]

_STEPS, _CLOSE = 60, 4 * float(np.finfo(float).eps)


class LoopKernels:
    """Calls the kernels of one loop."""

    def __init__(self, description: LoopDescription, library: Library, parameters: Sequence[float]) -> None:
        self.description, self.library = description, library
        self.parameters = np.array([*parameters, 0.0])
        self.work_size = max(description.work_size, description.coordinates + 6)
        self.inputs = description.having("input")

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
        """Return the compiled view of the kernels that solves for these variables."""
        d = self.description
        return _loop.LoopEquations(
            self.library.addresses,
            self.parameters[:-1],
            self.work_size,
            max((k.out_size for k in d.kernels), default=0),
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

    def time_of(self, value: float) -> float:
        """Return the time at which the first input has a value [rad, m], by Newton's method.

        Raises
        ------
        ModelError
            When the input stands still, or does not come to that value.
        """
        name = self.description.variables[self.inputs[0]].name
        t, (at, rate, _) = 0.0, self.prescribed(0.0)[0]
        for _ in range(_STEPS):
            if rate == 0.0:
                raise ModelError(
                    f"{name} stands still at t = {t:g} s, so nothing says how fast the loop moves\n"
                    '  Give the input a motion by the time t, such as "rpm*t".'
                )
            new = t + (value - at) / rate
            if not math.isfinite(new) or abs(new - t) <= _CLOSE * abs(new):
                break
            t = new
            at, rate, _ = self.prescribed(t)[0]
        if not abs(at - value) <= 1e-12 * max(1.0, abs(value)):
            raise ModelError(f"{name} does not come to {value:g} by its motion in time")
        return t

    def value_at(self, t: float) -> str:
        """Return the first input at a time, in words: ``theta1 = 45 deg``."""
        if not self.inputs:
            return f"t = {t:.9g} s"
        v = self.description.variables[self.inputs[0]]
        at = float(self.prescribed(t)[0, 0])
        return f"{v.name} = {in_words(at, v.is_length, self.description)}"


def in_words(value: float, is_length: bool, description: LoopDescription) -> str:
    """Return an angle in degrees or a displacement in the scene's unit, as messages give it."""
    if is_length:
        name, size = description.units["length"]
        return f"{value / size:.9g} {name}"
    return f"{math.degrees(value):.9g} deg"
