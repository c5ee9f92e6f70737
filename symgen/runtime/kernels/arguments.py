"""Numbers that a user hands in, checked."""

from __future__ import annotations

import math
import numbers
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ArgumentError, ModelError, shown

Array = NDArray[np.float64]


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


def real(value: Any, what: str) -> float:
    """Return a finite number; raise ModelError for anything else."""
    if not is_real(value):
        raise ModelError(f"expected a finite number for {what}, got {value!r}")
    return float(value)


def count(value: Any, what: str) -> int:
    """Return a whole number; raise ModelError for anything else."""
    if type(value) is int:
        return value
    if isinstance(value, bool) or not isinstance(value, numbers.Integral):
        raise ModelError(f"expected a whole number for {what}, got {value!r}")
    return int(value)


def reals(values: Any, what: str) -> Array:
    """Return finite numbers as an array of one axis; raise ModelError for anything else."""
    try:
        found = np.asarray(values)
    except (TypeError, ValueError):
        found = np.array(None)
    if found.dtype.kind not in "iuf" or not np.all(np.isfinite(found)):
        raise ModelError(f"expected finite numbers for {what}, got {values!r}")
    return np.atleast_1d(found.astype(float)).ravel()
