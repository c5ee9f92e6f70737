"""Force components that redundant closure equations leave undetermined, pose by pose."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.loop.kernels import LoopKernels
from symgen.runtime.result.records import Variable

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Least singular value of independent screws, and least effect of a wrench that counts; of the largest.
_RANK, _PART = 1e-8, 1e-9
#: Rounding of screws that a wrench does no work on; a product of singular values far from a loss of rank.
_SAME, _CLEAR = 1e-13, 1e-3
#: Poses that are judged at a time, which bounds the memory.
_POSES = 4096
#: Components named in a note; the result lists all.
_SHOWN = 6


def undetermined(kernels: LoopKernels, times: Array, states: Array) -> dict[str, Mask]:
    """Return which entries of the outputs (poses, entries) redundant closure leaves undetermined.

    A wrench that does no work on the screws of any variable can be added to the closing wrench. At every
    pose these wrenches are the null space of the screws; an output that one of them changes is undetermined.

    Parameters
    ----------
    times
        Times of the poses [s].
    states
        Rows that start with the variables and their rates.
    """
    d = kernels.description
    found: dict[str, Mask] = {}
    outputs = d.kernel("outputs")
    if not kernels.has("inverse") or d.rank == 6 or not len(times) or outputs is None:
        return found
    chunks = (slice(first, first + _POSES) for first in range(0, len(times), _POSES))
    whole = np.concatenate([_of_poses(kernels, times[chunk], states[chunk]) for chunk in chunks])
    for b in outputs.blocks:
        mask = whole[:, b.offset : b.offset + b.shape[0] * b.shape[1]]
        if np.any(mask):
            found[b.name] = mask
    return found


def _of_poses(kernels: LoopKernels, times: Array, states: Array) -> Mask:
    """Return the same for all numbers that the kernel of the outputs writes, (poses, numbers)."""
    d, count = kernels.description, len(times)
    n, size = d.coordinates, d.size
    rows = np.zeros((count, 2 * n + 1))
    rows[:, :n] = states[:, :n]
    work = np.zeros((count, kernels.work_size + 1))
    screws = kernels.many("position", times, rows, work)["closure_jacobian"].reshape(count, 6, n)
    across = np.concatenate([screws[:, 3:], size * screws[:, :3]], axis=1)  # of (force, moment over size)
    # A loop that closes within a tolerance has screws and wrenches that are dependent within it.
    least_value, part = max(_RANK, kernels.tolerance), max(_PART, 10 * kernels.tolerance)
    left, rank = _spaces(across, least_value)
    work[:] = 0.0
    base = kernels.rows("outputs", times, rows, work)
    least = np.maximum(part * max(1.0, size), 1e-13 * (np.abs(base) + 1.0))
    found = np.zeros(base.shape, dtype=bool)
    for k in range(int(rank.min()), 6):
        work[:] = 0.0
        work[:, n : n + 6] = left[:, :, k] * np.array([1.0, 1.0, 1.0, size, size, size])
        change = kernels.rows("outputs", times, rows, work)
        change -= base
        differs = np.abs(change, out=change) > least
        differs[rank > k] = False
        found |= differs
    return found


def _spaces(screws: Array, least: float) -> tuple[Array, NDArray[np.intp]]:
    """Return the left singular vectors (poses, 6, 6) and the ranks of screws (poses, 6, n).

    In planar and spherical loops the wrenches that do no work are the same at every pose: those of the first
    pose are tried at all others, and only the poses at which they fail are decomposed.
    """
    u, values, _ = np.linalg.svd(screws[0])
    r = int(np.count_nonzero(values > least * values[0]))
    left, rank = np.repeat(u[None], len(screws), axis=0), np.full(len(screws), r)
    parts = u.T @ screws
    size = np.linalg.norm(screws, axis=(1, 2))
    idle = np.max(np.abs(parts[:, r:]), axis=(1, 2), initial=0.0) <= _SAME * size
    squared = np.linalg.det(parts[:, :r] @ parts[:, :r].transpose(0, 2, 1))  # product of singular values
    others = np.flatnonzero(~(idle & (squared > (_CLEAR * size**r) ** 2)))
    if len(others):
        left[others], values, _ = np.linalg.svd(screws[others])
        rank[others] = np.count_nonzero(values > least * values[:, :1], axis=1)
    return left, rank


def ranges_of(made: Sequence[Variable], masks: Mapping[str, Mask]) -> dict[str, list[list[int]]]:
    """Return by component the poses at which it is undetermined, as ranges (first, last) of their numbers."""
    return {
        name: _ranges(mask)
        for v in made
        if v.name in masks
        for name, mask in zip(component_names(v), masks[v.name].T, strict=True)
        if np.any(mask)
    }


def component_names(v: Variable) -> list[str]:
    """Return the names of the components of an output."""
    return [f"{v.name}.{c}" if c else v.name for c in v.components or ("",)]


def _ranges(mask: Mask) -> list[list[int]]:
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
