"""Kernels of a shipped extension module as functions of NumPy arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.kernels.library import KERNEL

_ARRAYS = "t", "q", "u", "p", "work", "out"


def function(
    name: str, address: int, sizes: Sequence[int], reads: Sequence[str], document: str
) -> Callable[..., Array]:
    """Return a kernel as a function of the arrays t, q, u, p, work and out, which returns out.

    Parameters
    ----------
    name, document
        Those of the function.
    address
        Address of the kernel in memory.
    sizes
        Least numbers of entries of the arrays.
    reads
        Names of those that must be given; others are made when absent.
    """
    call = KERNEL(address)

    def kernel(
        t: Array | None = None,
        q: Array | None = None,
        u: Array | None = None,
        p: Array | None = None,
        work: Array | None = None,
        out: Array | None = None,
    ) -> Array:
        given = zip(_ARRAYS, (t, q, u, p, work, out), sizes, strict=True)
        arrays = [_checked(array, x, size, array in reads) for array, x, size in given]
        call(*(x.ctypes.data for x in arrays))
        return arrays[-1]

    kernel.__name__, kernel.__doc__ = name, document
    return kernel


def _checked(name: str, array: Array | None, size: int, needed: bool) -> Array:
    """Return an array that a kernel may access; raise TypeError or ValueError for another."""
    if array is None:
        if needed:
            raise TypeError(f"{name} is missing: an array of {size} entries")
        return np.empty(size)
    written = name in ("work", "out")
    if not isinstance(array, np.ndarray) or array.dtype != float or array.ndim != 1:
        raise TypeError(f"{name} is {array!r}, expected a one-dimensional array of float64")
    if not array.flags.c_contiguous or (written and not array.flags.writeable):
        raise ValueError(f"{name} is a part of an array with gaps, or read only; expected a copy of it")
    if len(array) < size:
        raise ValueError(f"{name} has {len(array)} entries, expected {size}")
    return array
