"""Where in its range a driven loop closes that does not close at the beginning of it."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from symgen.errors import InitialStateError, ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.closure.assemblies import Closing
from symgen.runtime.closure.closed_form import closed_forms
from symgen.runtime.closure.start import Closed, close_near
from symgen.runtime.integrate.pace import check_wall
from symgen.runtime.loop.kernels import LoopKernels

#: Equal parts of the range at whose ends a closure is searched.
_PARTS = 36


def closed_later(
    kernels: LoopKernels, guess: Array, guessed: Sequence[int], error: InitialStateError
) -> Closed:
    """Return the loop closed at a later value of its range; raise the error where it closes at none."""
    t = _closing(kernels, guess)
    if t is not None:
        with suppress(InitialStateError):
            return close_near(kernels, t, guess, guessed)
    raise error


def _closing(kernels: LoopKernels, guess: Array) -> float | None:
    """Return the first time, by equal parts of the range, at which the loop closes from its guess, if any."""
    d = kernels.description
    if not d.span:
        return None
    try:
        times = kernels.times_of(np.linspace(d.span[0], d.span[1], _PARTS + 1)[1:])
    except ModelError:
        return None
    for t in times.tolist():
        check_wall("searching for the closures of the loop")
        close = Closing(kernels, t)
        if any(close(start) is not None for start in (*closed_forms(kernels, t, guess), guess)):
            return float(t)
    return None
