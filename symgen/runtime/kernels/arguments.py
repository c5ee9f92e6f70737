"""Numbers that a user hands in, checked."""

from __future__ import annotations

import math
import numbers
from typing import Any

import numpy as np

from symgen.errors import ArgumentError, ModelError, shown
from symgen.runtime.arrays import Array


def is_real(value: Any) -> bool:
    """Return True if ``value`` is a finite real number, and no bool."""
    if type(value) is float:
        return math.isfinite(value)
    return isinstance(value, numbers.Real) and not isinstance(value, bool) and math.isfinite(value)


def out_of_range(name: str, value: Any) -> ArgumentError:
    """Return the error for a value that is not a finite number above zero."""
    return ArgumentError(
        name, before="expected ", after=f" to be a finite number above zero, got {shown(value)}"
    )


def real(value: Any, name: str) -> float:
    """Return a finite number; raise ModelError for anything else."""
    if not is_real(value):
        raise ModelError(f"expected a finite number for {name}, got {value!r}")
    return float(value)


def count(value: Any, name: str) -> int:
    """Return a whole number; raise ModelError for anything else."""
    if type(value) is int:
        return value
    if isinstance(value, bool) or not isinstance(value, numbers.Integral):
        raise ModelError(f"expected a whole number for {name}, got {value!r}")
    return int(value)


def reals(values: Any, name: str) -> Array:
    """Return finite numbers as an array of one axis; raise ModelError for anything else."""
    try:
        array = np.asarray(values)
    except (TypeError, ValueError):
        array = np.array(None)
    if array.dtype.kind not in "iuf" or not np.all(np.isfinite(array)):
        raise ModelError(f"expected finite numbers for {name}, got {values!r}")
    return np.atleast_1d(array.astype(float)).ravel()
