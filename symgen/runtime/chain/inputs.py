"""Inputs of a chain: arrays checked, with errors that name the entry, and laid out for the kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.errors import ModelError
from symgen.runtime.arrays import Array, Indices

#: Relative error that the length of a rod may have.
_ON_LENGTH = 1e-6
#: Units of arrays by their names.
_UNITS = {
    "lengths": "m", "centres": "m", "base": "m", "masses": "kg", "point_masses": "kg", "inertias": "kg m^2",
    "gravity": "m/s^2",
}  # fmt: skip


def _real(name: str, values: Any) -> Array:
    """Return real numbers, in memory of their own; complex numbers are refused as text is."""
    try:
        if np.iscomplexobj(values):
            raise TypeError("complex numbers")
        return np.array(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise ModelError(f"{name}: expected numbers, got {values!r:.80}") from error


def vector(name: str, values: ArrayLike, size: int | None) -> Array:
    """Return finite numbers, ``size`` of them when it is given; one number stands for all."""
    array = _real(name, values)
    if size is not None and array.ndim == 0:
        array = np.full(size, float(array))
    if array.ndim != 1 or (size is not None and len(array) != size):
        expected = "a list of numbers" if size is None else f"{size} numbers"
        raise ModelError(f"{name}: expected {expected}, got an array of shape {array.shape}")
    refuse(name, ~np.isfinite(array), array, "finite")
    return array


def refuse(name: str, wrong: NDArray[np.bool_], array: Array, expected: str) -> None:
    """Refuse an array that is wrong somewhere, and say where."""
    if wrong.any():
        k = int(np.argmax(wrong))
        raise ModelError(f"{name}[{k}] is {array[k]:g} {_UNITS[name]}, expected {expected}")


def shaped(name: str, values: Any, shape: tuple[int, int]) -> Array:
    """Return finite numbers of a shape, or with further axes in front."""
    array = _real(name, values)
    if array.shape[-2:] != shape:
        raise ModelError(f"{name} have shape {array.shape}, expected {shape}, or that with axes in front")
    if not np.isfinite(array).all():
        place = np.argwhere(~np.isfinite(array))[0].tolist()
        raise ModelError(f"{name}{place} is not finite")
    return array


def tree(parents: Any, n: int) -> Indices | None:
    """Return the inner point of every rod, or None for a chain without branches."""
    if parents is None:
        return None
    numbers = np.asarray(parents)
    if numbers.shape != (n,) or not np.issubdtype(numbers.dtype, np.integer):
        raise ModelError(f"parents: expected {n} whole numbers, one for each rod, got {parents!r:.80}")
    wrong = (numbers < 0) | (numbers > np.arange(n))
    if wrong.any():
        k = int(np.argmax(wrong))
        raise ModelError(
            f"parents[{k}] is {numbers[k]}, expected a point from 0 to {k}: "
            "number the rods from the base outwards"
        )
    array = np.ascontiguousarray(numbers, dtype=np.intp)
    return None if np.array_equal(array, np.arange(n)) else array


def on_length(along: Array, lengths: Array) -> None:
    """Raise ModelError if rods deviate from their lengths by more than rounding and projection leave."""
    error = (
        np.abs(np.linalg.norm(along, axis=-1) / lengths - 1).reshape(-1, len(lengths)).max(axis=0, initial=0)
    )
    if not error.max() <= _ON_LENGTH:
        rod = int(np.argmax(error))
        raise ModelError(f"positions: rod {rod} is off its length by {error[rod]:.1e} of it")


def aligned(shape: tuple[int, ...]) -> Array:
    """Return memory that starts on a cache line, so that no vector register's load straddles two."""
    size = int(np.prod(shape))
    buffer = np.empty(size + 7)
    first = -buffer.ctypes.data % 64 // 8
    return buffer[first : first + size].reshape(shape)


def repeated(values: Array, lanes: int) -> Array:
    """Return values of one chain for every lane of a group."""
    array = aligned((len(values), lanes))
    array[...] = values[:, None]
    return array.reshape(-1)


def side_by_side(values: Array, axes: int, lanes: int) -> Array:
    """Return chains in lanes, (groups, entries, lanes); the last chain fills up the last group.

    The last ``axes`` axes of the values belong to one chain, those in front are many chains.
    """
    count = int(np.prod(values.shape[: values.ndim - axes]))
    flat, groups = values.reshape(count, int(np.prod(values.shape[values.ndim - axes :]))), -(-count // lanes)
    padded = flat[np.minimum(np.arange(groups * lanes), count - 1)]
    array = aligned((groups, flat.shape[1], lanes))
    array[...] = padded.reshape(groups, lanes, flat.shape[1]).transpose(0, 2, 1)
    return array


def apart(values: Array, batch: tuple[int, ...], shape: tuple[int, ...]) -> Array:
    """Return chains from lanes, with the axes of many in front: the inverse of :func:`side_by_side`."""
    groups, entries, lanes = values.shape
    flat = values.transpose(0, 2, 1).reshape(groups * lanes, entries)[: int(np.prod(batch))]
    return np.ascontiguousarray(flat).reshape(*batch, *shape)
