"""Kernels as functions of NumPy arrays."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import cached_property
from math import prod
from typing import Any, Self

import numpy as np

from symgen.errors import ModelError
from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.description import BlockInfo, Described, Description, KernelInfo
from symgen.runtime.kernels.library import Library
from symgen.runtime.kernels.tangent import places
from symgen.runtime.kernels.typed import Typed

#: Address and sizes of a kernel, and name, part of ``out`` and shape of each of its results.
_Call = tuple[int, "_core.Sizes", tuple[tuple[str, slice, tuple[int, ...]], ...]]
#: Unit of tangents as imaginary parts: their products are below every number of a mechanism.
UNIT = 1e-80


class Kernels:
    """Kernels of one model at one set of parameters."""

    def __init__(self, description: Described, library: Library, given: Sequence[float] | Array) -> None:
        self.description, self.library = description, library
        self.parameter_values = np.array(given, dtype=float)
        self.work_size = description.work_size
        self._infos = {k.name: k for k in description.kernels}
        self._calls: dict[str, _Call] = {}

    @cached_property
    def parameters(self) -> Array:
        """The parameters as the kernels take them: see :func:`as_taken`."""
        return as_taken(self.library, self.parameter_values, getattr(self.description, "rank_tolerance", 0.0))

    @cached_property
    def _first(self) -> dict[tuple[Any, ...], Any]:
        """The first equations by the options of ``equations``."""
        return {}

    def at(self, parameters: Array) -> Self:
        """Return the same kernels with other parameters."""
        other = copy(self)
        for name in ("parameters", "_first"):
            other.__dict__.pop(name, None)
        other.parameter_values = parameters
        return other

    def has(self, kernel: str) -> bool:
        """Return True if the model has this kernel."""
        return kernel in self.library.addresses

    def find(self, kernel: str) -> KernelInfo | None:
        """Return name and sizes of a kernel; None if the model has no such kernel."""
        return self._infos.get(kernel)

    def info(self, kernel: str) -> KernelInfo:
        """Return name and sizes of a kernel; raise ModelError if the model has no such kernel."""
        info = self.find(kernel)
        if info is None:
            raise ModelError(f"{self.description.name} has no kernel {kernel!r}")
        return info

    def _call(self, kernel: str) -> _Call:
        call = self._calls.get(kernel)
        if call is None:
            info = self.info(kernel)
            sizes = (*self.description.sizes, info.work_size, info.out_size)
            whole = np.empty(info.out_size)
            shapes = [(b, part(whole, b).shape) for b in info.blocks]
            blocks = tuple((b.name, slice(b.offset, b.offset + prod(of)), of) for b, of in shapes)
            call = self._calls[kernel] = self.library.addresses[kernel], sizes, blocks
        return call

    def rows(self, kernel: str, times: Array, rows: Array, work: Array) -> Array:
        """Return the ``out`` arrays of a kernel at many states, a row each, with one number more.

        ``rows`` hold (q, u, ...), and ``work`` rows of work memory, which the kernel may change.
        """
        address, sizes, _ = self._call(kernel)
        out = np.zeros((len(times), sizes[-1] + 1))
        n = self.description.coordinates
        _core.call_many(address, sizes, times, rows, n, self.parameters, work, out)
        return out


class Evaluator(Kernels):
    """Calls the kernels of a linkage."""

    description: Description

    def with_tunable(self, values: Array) -> Evaluator:
        """Return the kernels with values of the tunable parameters."""
        return self.at(np.concatenate([values, self.parameter_values[len(values) :]]))

    def holding(self, values: Array) -> Evaluator:
        """Return the kernels with values of the first of the parameters that runs set."""
        parameters, first = self.parameter_values.copy(), self.description.of_held.start
        parameters[first : first + len(values)] = values
        if np.array_equal(parameters, self.parameter_values):
            return self
        return self.at(parameters)

    @cached_property
    def outputs_by_places(self) -> bool:
        """Whether the places of the points are all that the scene's outputs depend on."""
        outputs = self.find("outputs")
        return outputs is not None and not (outputs.reads_rates or outputs.work_size)

    def call(self, kernel: str) -> tuple[int, _core.Sizes]:
        """Return address and sizes of a kernel; raise ModelError if the model has no such kernel."""
        return self._call(kernel)[:2]

    def __call__(self, kernel: str, t: float, q: Array, u: Array, work: Array | None = None) -> Array:
        """Return the ``out`` array of a kernel."""
        address, sizes, _ = self._call(kernel)
        q, u = np.ascontiguousarray(q, dtype=float), np.ascontiguousarray(u, dtype=float)
        return _core.evaluate(address, sizes, t, q, u, self.parameters, work)

    def blocks(
        self, kernel: str, t: float, q: Array, u: Array, work: Array | None = None
    ) -> dict[str, Array]:
        """Return the results of a kernel by name, shaped."""
        out = self(kernel, t, q, u, work)
        return {name: out[where].reshape(shape) for name, where, shape in self._call(kernel)[2]}

    def many(self, kernel: str, times: Array, q: Array, u: Array, work: Array | None = None) -> Array:
        """Return the ``out`` arrays of a kernel at many states, (states, entries), given ``work`` of each."""
        n, width = self.description.coordinates, self.info(kernel).work_size
        rows, memory = np.empty((len(times), 2 * n + 1)), np.zeros((len(times), width + 1))
        rows[:, :n], rows[:, n:-1], rows[:, -1] = q, u, 0.0
        if work is not None:
            width = min(work.shape[1], width)
            memory[:, :width] = work[:, :width]
        return self.along(kernel, np.ascontiguousarray(times), rows, memory)

    def along(self, kernel: str, times: Array, rows: Array, work: Array) -> Array:
        """Return the same for rows (q, u, ...) and of work memory, which the kernel may change."""
        return self.rows(kernel, times, rows, work)[:, :-1]

    def many_blocks(
        self, kernel: str, times: Array, q: Array, u: Array, work: Array | None = None
    ) -> dict[str, Array]:
        """Return the results of a kernel at many states by name, (states, *shape)."""
        out = self.many(kernel, times, q, u, work)
        return {b.name: part(out, b) for b in self.info(kernel).blocks}

    @cached_property
    def efforts(self) -> tuple[str, ...]:
        """Names of the efforts that keep prescribed motions, unknowns behind the multipliers."""
        motion = self.description.kernel("accelerations")
        blocks = motion.blocks if motion else ()
        return next((b.rows for b in blocks if b.name == "effort_forces"), ())

    @cached_property
    def couples(self) -> tuple[str, ...]:
        """Names of the couples by the forces in joints, or of efforts: unknowns behind the multipliers."""
        motion = self.description.kernel("accelerations")
        return motion.blocks[2].rows if motion and len(motion.blocks) > 2 else ()

    def equations(
        self,
        redundant: int = 0,
        slack: float = np.inf,
        work_of_loads: bool = True,
        *,
        stabilisation: float = 0.0,
        tangent: Evaluator | None = None,
        typed: Typed | None = None,
    ) -> _core.KernelEquations:
        """Return the compiled view of the kernels, which solves and steps; of those of a type, if given.

        The work of loads without potential is integrated along where there is any, unless told not to.
        ``stabilisation`` is the rate [1/s] of Baumgarte's terms, ``tangent`` the kernels of the analysis of
        that name, for implicit methods.
        """
        of_type = typed if typed and not typed.is_plain else None
        key = redundant, slack, work_of_loads, stabilisation, tangent, of_type
        first = self._first.get(key)
        if first is None:
            first = self._first[key] = self._first_equations(*key)
        return first.copy()

    def _first_equations(
        self,
        redundant: int,
        slack: float,
        work_of_loads: bool,
        stabilisation: float,
        tangent: Evaluator | None,
        typed: Typed | None,
    ) -> _core.KernelEquations:
        d = self.description
        return _core.KernelEquations(
            typed.kernels(False) if typed else self.library,
            d.coordinates,
            len(d.constraints),
            int(d.work_of_loads and work_of_loads),
            self.parameter_values,
            self.work_size,
            d.first_pivot,
            typed.precision.coarsened(d.rank_tolerance) if typed else d.rank_tolerance,
            redundant,
            slack,
            series_rows=d.series_rows,
            series_watched=d.series_watched,
            events=len(d.events),
            switches=len(d.switches),
            tables=d.tables,
            windings=d.windings,
            turns=len(d.turns),
            core=typed.stepping if typed else _core.DOUBLE,
            stabilisation=stabilisation,
            tangent=places(d, tangent.description) if tangent else (),
            tangent_library=tangent.library if tangent else None,
            couples=len(self.couples),
        )


class Duals:
    """Kernels of a model whose results have tangents, as imaginary parts, where the coordinates have them.

    Parameters
    ----------
    values
        The kernels.
    tangents
        Those of the analysis that has their tangents, ``NAME_tangent``; without it coordinates are plain.
    direction
        Tangents of the parameters.
    """

    def __init__(
        self, values: Evaluator, tangents: Evaluator | None = None, direction: Array | None = None
    ) -> None:
        self.values, self._tangents = values, tangents
        self._direction = np.zeros(0) if direction is None else direction

    def __call__(
        self, kernel: str, times: Array, q: Array, u: Array, work: Array | None = None
    ) -> dict[str, Array]:
        """Return the results at many states by name, (states, *shape)."""
        if not np.iscomplexobj(q) or self._tangents is None:
            return self.values.many_blocks(kernel, times, q, u, work)
        d = self.values.description
        work_rows = np.zeros((len(times), d.coordinates + len(d.constraints))) if work is None else work
        values = self.values.many_blocks(kernel, times, q.real, u.real, work_rows.real)
        direction = np.broadcast_to(UNIT * self._direction, (len(times), len(self._direction)))
        seeds = np.hstack([work_rows.real, q.imag, u.imag, direction, work_rows.imag])
        slopes = self._tangents.many_blocks(f"{kernel}_tangent", times, q.real, u.real, seeds)
        return {name: value + 1j * slopes[f"{name}_tangent"] for name, value in values.items()}


def as_taken(library: Library, values: Sequence[float] | Array, rank_tolerance: float = 0.0) -> Array:
    """Return parameters in double precision as the kernels of a library take them.

    The array holds the values, the output of the kernel 'setup' for them, and the rank tolerance. Runs do the
    same in their own type, in ``set_up`` of the core, and batches in the generated C.
    """
    row = np.array([*values, *np.zeros(library.derived), rank_tolerance])
    if library.derived:
        _core.set_up(library.addresses["setup"], row, len(values), library.derived)
    return row


def at_rows(address: int, y: Array, n: int, p: Array, width: int, work: Array | None = None) -> Array:
    """Return the results of a kernel of a building block for every row of ``y`` and ``work``, (rows, width).

    Rows of ``y`` hold q, n numbers, and u; the parameters ``p`` are common to all rows.
    """
    count, memory = len(y), np.zeros((len(y), 1)) if work is None else work
    sizes = (0, n, y.shape[1] - n, len(p), 0 if work is None else memory.shape[1], width)
    out = np.empty((count, width))
    _core.call_many(address, sizes, np.zeros(count), y, n, p, memory, out)
    return out


def part(out: Array, block: BlockInfo) -> Array:
    """Return one block of an ``out`` array (or of rows of them), shaped; single columns lose that axis."""
    rows, columns = block.shape
    flat = out[..., block.offset : block.offset + rows * columns]
    return flat if columns == 1 else flat.reshape((*out.shape[:-1], rows, columns))
