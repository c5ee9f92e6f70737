"""Batched kernels: many states in one call, in the number type of the model."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.errors import ModelError, nearest
from symgen.runtime._core import address_of
from symgen.runtime.kernels.arguments import count as whole
from symgen.runtime.kernels.description import Described, KernelInfo
from symgen.runtime.kernels.evaluate import part
from symgen.runtime.kernels.library import Library
from symgen.runtime.kernels.typed import Typed

Rows = NDArray[Any]

#: Kernels that use their work memory by themselves; all others find results of 'accelerations' there.
_WITHOUT_WORK = ("accelerations", "factor", "solve")
#: Kernels that have no results for each state.
_WITHIN = ("solve", "setup")
_CACHE_LINE = 64
#: Operations of all kernels of a model beyond which runs are not carried out in lanes. Code for vectors is
#: straight-line, and takes more than proportional time to compile: 5 s at 18,000 operations, 52 s at 67,000.
MOST_IN_LANES = 20_000


@dataclass(frozen=True, slots=True)
class _States:
    """Times, coordinates, velocities and work memory, one row per state; ``rest``: low parts of ``work``."""

    t: Rows
    q: Rows
    u: Rows
    work: Rows | None = None
    rest: Rows | None = None


class Batch:
    """Calls the kernels of one model at many states.

    Parameters
    ----------
    description
        Description of the model.
    typed
        Its kernels.
    parameters
        Values of its parameters, as kernels take them.
    """

    def __init__(self, description: Described, typed: Typed, parameters: Sequence[float]) -> None:
        self.description, self.typed = description, typed
        self.library: Library = typed.kernels(True)
        self.dtype = np.dtype(object if typed.digits else typed.precision.dtype)
        tolerance = typed.precision.coarsened(getattr(description, "rank_tolerance", 0.0))
        derived = np.zeros(self.library.derived)  # until the kernel 'setup' writes them
        row = np.array([*parameters, *derived, tolerance], np.float64).astype(self.dtype)
        self._parameters = row
        self._evaluate = self._in_python
        if self.library.functions:
            self._parameters = row[:, None]
            if len(derived):
                behind = self._parameters[len(parameters) :]
                self.library.functions["setup"](None, None, None, self._parameters, None, behind)
        else:
            self._evaluate = self._in_c
            self._lanes, self._size = lanes_of(self.library, description.name)
            self._in_library = self.library.owner[f"{description.name}_batch"]
            self._in_library.restype, self._in_library.argtypes = None, _ARGUMENTS

    def __call__(
        self, name: str, t: ArrayLike, q: ArrayLike, u: ArrayLike | None, work: ArrayLike | None, threads: int
    ) -> tuple[dict[str, Rows], dict[str, Rows]]:
        """Return the results of a kernel by name, and the remainders of wider numbers."""
        info = self._kernel(name)
        if whole(threads, "threads") < 1:
            raise ModelError(f"expected one thread or more, got {threads}")
        n = self.description.coordinates
        rows = self._rows("q", q, n)
        rates = np.zeros_like(rows) if u is None else self._rows("u", u, n, len(rows))
        states = _States(self._times(t, len(rows)), rows, rates)
        high, low = self._evaluate(info, self._with_work(info, states, work, threads), threads)
        blocks = info.blocks
        rest = {} if low is None else {b.name: part(low, b) for b in blocks}
        return {b.name: part(high, b) for b in blocks}, rest

    def _kernel(self, kernel: str) -> KernelInfo:
        """Return the kernel with this name, or the kernel with a result of this name."""
        kernels = [k for k in self.description.kernels if k.blocks and k.name not in _WITHIN]
        for k in kernels:
            if k.name == kernel:
                return k
        for k in kernels:
            if any(b.name == kernel for b in k.blocks):
                return k
        known = {k.name for k in kernels} | {b.name for k in kernels for b in k.blocks}
        name = self.description.name
        raise ModelError(f"{name} has no kernel or result {kernel!r}. {nearest(str(kernel), known)}")

    def _rows(self, name: str, values: ArrayLike, size: int, count: int | None = None) -> Rows:
        try:
            array = np.asarray(values, dtype=self.dtype)
        except (TypeError, ValueError):
            array = np.zeros(0)
        if array.ndim != 2 or array.shape[1] != size:
            raise ModelError(f"expected rows of {size} numbers for {name}, got the shape {np.shape(values)}")
        if any(step % array.itemsize for step in array.strides):
            array = array.copy()
        if count is not None and len(array) != count:
            raise ModelError(f"expected as many rows of {name} as of q, {count}, got {len(array)}")
        return array

    def _times(self, t: ArrayLike, count: int) -> Rows:
        times = np.empty(count, self.dtype)
        try:
            times[...] = t
        except (TypeError, ValueError):
            raise ModelError(f"expected one time or {count} of them for t, got {t!r}") from None
        return times

    def _with_work(self, info: KernelInfo, states: _States, work: ArrayLike | None, threads: int) -> _States:
        """Return states with a work memory for a kernel: ``work`` if given, else the motion of each state."""
        if info.name in _WITHOUT_WORK or not info.work_size:
            return states
        if work is not None:
            return replace(states, work=self._rows("work", work, info.work_size, len(states.q)))
        motion = self.description.kernel("accelerations")
        if motion is None:
            raise ModelError(
                f"the kernel {info.name!r} needs {info.work_size} numbers of work memory a state: give work"
            )
        high, low = self._evaluate(motion, states, threads)
        rest = None if low is None else _fitted(low, info.work_size)
        return replace(states, work=_fitted(high, info.work_size), rest=rest)

    def _in_c(self, info: KernelInfo, states: _States, threads: int) -> tuple[Rows, Rows | None]:
        count = len(states.q)
        high = _columns(info.out_size, count, self.dtype)
        low = _columns(info.out_size, count, self.dtype) if self.typed.precision.low else None
        arguments = (_Rows * 5)(
            _rows_of(states.t[:, None], None),
            _rows_of(states.q, None),
            _rows_of(states.u, None),
            _rows_of(self._parameters[None, :], None),
            _rows_of(states.work, states.rest, info.work_size),
        )
        memory_size = self._size * (sum(g.size for g in arguments) + self.library.derived + info.out_size)
        results = info.out_size, high.strides[0] // high.itemsize, _pointer(high), _pointer(low)
        address = self.library.addresses[info.name]

        def run(first: int, last: int) -> None:
            memory = np.empty(memory_size + _CACHE_LINE, np.uint8)
            begin = _pointer(memory) or 0
            self._in_library(address, first, last, arguments, *results, begin + -begin % _CACHE_LINE)

        groups = -(-count // self._lanes)
        if threads == 1 or groups < 2:
            run(0, count)
            return high.T, None if low is None else low.T
        edges = [min(count, self._lanes * (groups * k // threads)) for k in range(threads + 1)]
        parts = [(a, b) for a, b in pairwise(edges) if a < b]
        with ThreadPoolExecutor(len(parts)) as pool:
            list(pool.map(lambda ends: run(*ends), parts))
        return high.T, None if low is None else low.T

    def _in_python(self, info: KernelInfo, states: _States, threads: int) -> tuple[Rows, Rows | None]:
        count, work = len(states.q), states.work
        memory = np.zeros((info.work_size, count), self.dtype) if work is None else work.T.copy()
        out = np.zeros((info.out_size, count), self.dtype)
        arrays = states.t[None, :], states.q.T, states.u.T, self._parameters, memory, out
        self.library.functions[info.name](*arrays)
        return out.T, None


def fits_lanes(description: Described) -> bool:
    """Return whether code for vectors is compiled in a time that runs in lanes may gain."""
    return sum(sum(k.operations.values()) for k in description.kernels) <= MOST_IN_LANES


def lanes_of(library: Library, name: str) -> tuple[int, int]:
    """Return how many numbers the vectors of a batched library have, and their bytes."""
    lanes, size = (ctypes.c_int * 2).in_dll(library.owner, f"{name}_lanes")
    return lanes, size


def _fitted(rows: Rows, size: int) -> Rows:
    """Return rows with ``size`` entries, truncated or filled with zeros."""
    fitted = np.zeros((len(rows), size), rows.dtype)
    width = min(size, rows.shape[1])
    fitted[:, :width] = rows[:, :width]
    return fitted


def _columns(size: int, count: int, dtype: np.dtype[Any]) -> Rows:
    """Return memory for results, each in a row of its own that starts in another set of cache lines."""
    in_line = max(1, _CACHE_LINE // dtype.itemsize)
    lines = -(-count // in_line) | 1
    return np.empty((size, lines * in_line), dtype)[:, :count]


class _Rows(ctypes.Structure):
    """The struct ``rows`` of the generated C."""

    _fields_ = (
        ("start", ctypes.c_void_p), ("rest", ctypes.c_void_p),
        ("size", ctypes.c_ssize_t), ("state", ctypes.c_ssize_t), ("next", ctypes.c_ssize_t),
    )  # fmt: skip


def _rows_of(rows: Rows | None, rest: Rows | None, size: int = 0) -> _Rows:
    """Return address and strides of an argument's rows; only the size of an absent argument."""
    if rows is None:
        return _Rows(None, None, size, 0, 0)
    if rest is not None and rest.strides != rows.strides:
        raise ValueError("both parts of wide numbers must have the same strides")
    (state, entry), item = rows.strides, rows.itemsize
    return _Rows(_pointer(rows), _pointer(rest), rows.shape[1], state // item, entry // item)


def _pointer(array: Rows | None) -> int | None:
    return None if array is None else address_of(array)


_SIZE, _POINTER = ctypes.c_ssize_t, ctypes.c_void_p
#: Of the batch function of the generated C.
_ARGUMENTS = (_POINTER, _SIZE, _SIZE, _Rows * 5, _SIZE, _SIZE, _POINTER, _POINTER, _POINTER)
