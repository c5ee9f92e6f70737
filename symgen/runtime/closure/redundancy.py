"""Force components that redundant closure equations leave undetermined, pose by pose."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.arrays import Array
from symgen.runtime.loop.kernels import LoopKernels
from symgen.runtime.result.records import Variable

Mask = NDArray[np.bool_]

#: Least pivot of independent screws, over the first.
_RANK = 1e-8
#: Least effect of a unit wrench that counts.
_PART = 1e-9
#: Components named in a note; the result lists all.
_SHOWN = 6


def undetermined(kernels: LoopKernels, times: Array, states: Array) -> dict[str, Mask]:
    """Return the entries of the outputs (poses, entries) that redundant closure leaves undetermined.

    Wrenches that do no work on the screws of any variable, their null space at a pose, can be added to the
    closing wrench. An output that such a wrench changes is undetermined.

    Parameters
    ----------
    times
        Times of the poses [s].
    states
        Rows that start with the variables.
    """
    d = kernels.description
    by_output: dict[str, Mask] = {}
    outputs = d.kernel("outputs")
    if not kernels.has("inverse") or d.rank == 6 or not len(times) or outputs is None:
        return by_output
    # A loop that closes within a tolerance has screws and wrenches that are dependent within it.
    least, part = max(_RANK, kernels.tolerance), max(_PART, 10 * kernels.tolerance)
    every = range(d.coordinates)
    whole = kernels.equations(every, min(6, len(every))).undetermined(times, states, least, part)
    for b in outputs.blocks:
        mask = whole[:, b.offset : b.offset + b.shape[0] * b.shape[1]]
        if np.any(mask):
            by_output[b.name] = mask
    return by_output


def ranges_of(variables: Sequence[Variable], masks: Mapping[str, Mask]) -> dict[str, list[list[int]]]:
    """Return by component the poses at which it is undetermined, as ranges (first, last) of their numbers."""
    return {
        name: _ranges(mask)
        for v in variables
        if v.name in masks
        for name, mask in zip(component_names(v), masks[v.name].T, strict=True)
        if mask.any()
    }


def component_names(v: Variable) -> list[str]:
    """Return the names of the components of an output."""
    return [f"{v.name}.{c}" if c else v.name for c in v.components or ("",)]


def _ranges(mask: Mask) -> list[list[int]]:
    if mask.all():  # as in most loops
        return [[0, len(mask) - 1]]
    edges = np.flatnonzero(np.diff(mask, prepend=False, append=False))  # begin and end of each run of True
    return [[first, after - 1] for first, after in edges.reshape(-1, 2).tolist()]


def note(kernels: LoopKernels, ranges: Mapping[str, Sequence[Sequence[int]]], poses: int) -> Iterator[str]:
    """Yield the note that names undetermined components of forces, and the values returned for them."""
    if not ranges:
        return
    d, names = kernels.description, list(ranges)
    shown = ", ".join(names[:_SHOWN]) + (", ..." if len(names) > _SHOWN else "")
    full = sum(1 for r in ranges.values() if [list(x) for x in r] == [[0, poses - 1]])
    some = f"; {len(names) - full} of them only at some of the poses" if full < len(names) else ""
    yield (
        f"redundant closure equations, {6 - d.rank} of 6, leave {len(names)} components of forces "
        f"undetermined ({shown}{some}): their values are those of the closing wrench of minimum norm"
    )
