"""Reductions of the samples of a run to one value."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from symgen.errors import ModelError, nearest
from symgen.runtime.arrays import Array
from symgen.runtime.result.records import Variable

#: The whole history, which is no reduction.
HISTORY = "history"
#: Steps between samples are equal that differ by less over their size.
_EQUAL = 1e-9


def _magnitudes(values: Array, vector: bool) -> Array:
    """Return the magnitude of each sample: of a vector that of the vector."""
    return np.sqrt(np.sum(values**2, axis=-1)) if vector else np.abs(values)


def mean_weights(along: Array, times: Array | None = None) -> Array:
    """Return the weights of samples in a mean over their coordinate, by the trapezoidal rule.

    If the coordinate reverses, the mean is over ``times`` (samples,), if these are given and rise. Weights of
    unordered samples are equal. Equal steps give the same bits for any range. Rows of values (runs, samples)
    give rows of weights.
    """
    if along.ndim == 2:
        return np.array([mean_weights(row, times) for row in along]).reshape(along.shape)
    steps = np.diff(along)
    if len(steps) == 0 or not (np.all(steps > 0.0) or np.all(steps < 0.0)):
        return np.full(len(along), 1.0 / len(along)) if times is None else mean_weights(times)
    if np.ptp(steps) <= _EQUAL * np.max(np.abs(steps)):
        steps = np.ones_like(steps)
    weights: Array = np.append(steps, 0.0) + np.append(0.0, steps)
    return weights / np.sum(weights)


def _mean(values: Array, weights: Array) -> Any:
    return np.sum(values * weights.reshape(*weights.shape, *[1] * (values.ndim - 2)), axis=1)


#: Reductions by name of values (runs, samples, ...), with whether the last axis is of vectors, and weights of
#: the samples in a mean.
REDUCTIONS: dict[str, Callable[[Array, bool, Array], Any]] = {
    "peak": lambda values, vector, _: np.max(_magnitudes(values, vector), axis=1),
    "greatest": lambda values, *_: np.max(values, axis=1),
    "least": lambda values, *_: np.min(values, axis=1),
    "range": lambda values, *_: np.max(values, axis=1) - np.min(values, axis=1),
    "mean": lambda values, _, weights: _mean(values, weights),
    "rms": lambda values, vector, weights: np.sqrt(_mean(_magnitudes(values, vector) ** 2, weights)),
    "final": lambda values, *_: values[:, -1],
}
_OF_MAGNITUDE = ("peak", "rms")
#: Extremes of samples: the greatest and the least of each component, the longest vector, the last; and the
#: numbers of those from which a reduction has the value of all samples, of scalars and of vectors.
EXTREMES = {
    "peak": ([0, 1], [2]),
    "greatest": ([0], [0]),
    "least": ([1], [1]),
    "range": ([0, 1], [0, 1]),
    "final": ([3], [3]),
}


def reductions(names: str | Sequence[str]) -> tuple[str, ...]:
    """Return the names of reductions as a tuple; raise ModelError for unknown ones."""
    requested = tuple(dict.fromkeys((names,) if isinstance(names, str) else names))
    if not requested:
        raise ModelError(f"expected a reduction: {', '.join((*REDUCTIONS, HISTORY))}; got none")
    for name in requested:
        if name != HISTORY and name not in REDUCTIONS:
            raise ModelError(f"there is no reduction {name!r}. {nearest(name, [*REDUCTIONS, HISTORY])}")
    return requested


def of_extremes(variable: Variable, name: str, weights: Array) -> Variable:
    """Return a reduction of the outputs of many runs from their extremes, (runs, 4, ...)."""
    numbers = EXTREMES[name][bool(variable.components)]
    return reduced(replace(variable, values=variable.values[:, numbers]), name, weights)


def reduced(variable: Variable, name: str, weights: Array) -> Variable:
    """Return the reduction ``OUTPUT.NAME`` of an output (runs, samples, ...) over its samples.

    ``weights`` are those of the samples in a mean. Peak and rms of a vector are of its magnitude.
    """
    vector = bool(variable.components)
    samples = np.ascontiguousarray(variable.values)
    values = np.asarray(REDUCTIONS[name](samples, vector, weights), dtype=float)
    components = () if name in _OF_MAGNITUDE else variable.components
    return Variable(
        f"{variable.name}.{name}", variable.unit, f"{name} of {variable.about}", components, values
    )
