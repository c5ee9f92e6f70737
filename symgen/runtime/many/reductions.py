"""Reductions of the samples of a run to one value."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError, nearest
from symgen.runtime.result.records import Variable

Array = NDArray[np.float64]
#: The whole history, which is no reduction.
HISTORY = "history"


def _magnitudes(values: Array) -> Any:
    """Return the magnitude of each sample: of a vector that of the vector."""
    return np.abs(values) if values.ndim == 1 else np.sqrt(np.sum(values**2, axis=1))


#: Reductions of samples (samples,) or (samples, components) by name.
REDUCTIONS: dict[str, Callable[[Array], Any]] = {
    "peak": lambda values: np.max(_magnitudes(values)),
    "greatest": lambda values: np.max(values, axis=0),
    "least": lambda values: np.min(values, axis=0),
    "range": lambda values: np.max(values, axis=0) - np.min(values, axis=0),
    "mean": lambda values: np.mean(values, axis=0),
    "rms": lambda values: np.sqrt(np.mean(_magnitudes(values) ** 2)),
    "final": lambda values: values[-1],
}


def reductions(names: str | Sequence[str]) -> tuple[str, ...]:
    """Return the names of reductions as a tuple; raise ModelError for unknown ones."""
    wanted = tuple(dict.fromkeys((names,) if isinstance(names, str) else names))
    if not wanted:
        raise ModelError(f"expected a reduction: {', '.join((*REDUCTIONS, HISTORY))}; got none")
    for name in wanted:
        if name != HISTORY and name not in REDUCTIONS:
            raise ModelError(f"there is no reduction {name!r}. {nearest(name, [*REDUCTIONS, HISTORY])}")
    return wanted


def reduced(variable: Variable, name: str) -> Variable:
    """Return the reduction ``OUTPUT.NAME`` of an output; peak and rms of a vector are of its magnitude."""
    values = np.asarray(REDUCTIONS[name](variable.values), dtype=float)
    components = variable.components if values.ndim else ()
    about = f"{name} of {variable.about}"
    return replace(
        variable, name=f"{variable.name}.{name}", about=about, components=components, values=values
    )
