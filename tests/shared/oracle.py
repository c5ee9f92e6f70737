"""Reference values of kernels from the package's exact evaluation, and errors of kernels."""

from __future__ import annotations

from collections.abc import Iterable

import mpmath
import numpy as np
from numpy.typing import NDArray

from symgen.symbolic.exact import DIGITS, number
from symgen.symbolic.exact import Exact as Oracle

__all__ = ["DIGITS", "Oracle", "relative_error"]


def relative_error(found: NDArray[np.float64], exact: Iterable[mpmath.mpf]) -> float:
    """Return the largest error over the largest entry (over one when all are zero)."""
    with mpmath.workdps(DIGITS):
        entries = list(exact)
        size = max((abs(x) for x in entries), default=mpmath.mpf(0)) or mpmath.mpf(1)
        return float(max((abs(number(f) - x) / size for f, x in zip(found, entries, strict=True)), default=0))
