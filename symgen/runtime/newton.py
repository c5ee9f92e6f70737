"""Newton's method: corrections until a residual is at its rounding, or until they vanish themselves."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from symgen.runtime.arrays import Array

_EPS = float(np.finfo(float).eps)
#: Residual over the size that may be rounding, and the part of the one before it that shows that it is.
_ROUNDING, _STALLED = 256 * _EPS, 0.25
_NONE = np.zeros(0)


def corrected(
    x: Array,
    change: Callable[[Array, Array], Array | None],
    size: Callable[[Array], Any],
    most: int,
    *,
    residual: Callable[[Array], Array] | None = None,
    falls: float = np.inf,
    tolerated: float = 0.0,
    close: float = 0.0,
    rounded: float = 0.0,
    far: float = np.inf,
) -> Array | None:
    """Return a point that corrections lead to from x, or None where they do not converge.

    With a residual they end where it is at its rounding: below the spacing of numbers of the size, or a few
    hundred times that where it no longer falls to a quarter. Otherwise they end where they vanish.

    Parameters
    ----------
    change
        Gives the correction of a point with its residual (empty without one); None where it has none.
    size
        Gives the size of the unknowns, a number, to which residuals and corrections are compared; without a
        residual also one for each of them.
    most
        Number of corrections.
    residual
        Gives what is to vanish, in the unit of the unknowns.
    falls
        Factor by which a residual above its rounding must fall with every correction.
    tolerated
        Residual over the size that is accepted after the last correction.
    close, rounded, far
        Without a residual, the largest correction over the size that is the last one, that is the last one if
        it is more than half of the one before, and beyond which corrections diverge.
    """
    before, left = np.inf, _NONE
    for count in range(most + 1):
        if residual is not None:
            left = residual(x)
            worst = float(np.max(np.abs(left), initial=0.0)) / size(x)
            stalled = worst > _STALLED * before
            if worst <= _EPS or (stalled and worst <= _ROUNDING) or (count == most and worst <= tolerated):
                return x
            if not worst < falls * before:
                return None
            before = worst
        step = change(x, left) if count < most else None
        if step is None:
            return None
        if residual is None:
            moved = float(np.max(np.abs(step) / size(x), initial=0.0))
            if not moved <= far:
                return None
            if moved <= close or before / 2 < moved <= rounded:
                return x + step
            before = moved
        x = x + step
    return None
