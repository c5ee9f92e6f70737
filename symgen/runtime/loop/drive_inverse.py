"""First times at which an input has given values, for many values at a time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.model.instants import bisected

#: Value, rate and acceleration of an input at many times, shape (times, 3).
Input = Callable[[Array], Array]

#: Step of the search, over the time passed.
_GROWTH = 0.01
#: Most steps of the search.
_STEPS = 6144
#: Steps that are evaluated at a time.
_CHUNK = 512
#: Parts of the way to the nearest value, at the first rate, that the first step is.
_PARTS = 64
#: First step where the input starts at rest and its acceleration gives no scale [s].
_AT_REST = 1e-12
#: Part of a value that rounding leaves.
_CLOSE = 4 * float(np.finfo(float).eps)


def first_times(lead: Input, values: Array) -> Array:
    """Return the first times [s], from 0 on, at which an input has these values; NaN if it never has.

    Values towards which the input moves at t = 0 are looked for at later times, the others at earlier ones;
    all at later times where it starts at rest. The value of a turning point is reached there.
    """
    start, rate, acceleration = lead(np.zeros(1))[0].tolist()
    gaps = values - start
    ahead = gaps * rate > 0.0 if rate else np.ones(len(values), dtype=bool)
    times = np.zeros(len(values))
    for way, part in ((1.0, ahead & (gaps != 0.0)), (-1.0, ~ahead & (gaps != 0.0))):
        if np.any(part):
            nearest = float(np.min(np.abs(gaps[part])))
            step = _AT_REST
            if rate:
                step = nearest / abs(rate) / _PARTS
            elif acceleration:
                step = float(np.sqrt(2.0 * nearest / abs(acceleration))) / _PARTS
            nodes, reached = _path(lead, values[part], way * step)
            times[part] = _passages(lead, values[part], nodes, reached)
    return times


def _path(lead: Input, values: Array, step: float) -> tuple[Array, Array]:
    """Return times and values of the input, between which it is monotone, until it has come to all values."""
    start = float(lead(np.zeros(1))[0, 0])
    highest, lowest = max(start, float(np.max(values))), min(start, float(np.min(values)))
    lengths = np.maximum(1.0, np.minimum(np.expm1(np.arange(_STEPS) * np.log1p(_GROWTH)) * _GROWTH, 1e300))
    ends = step * np.cumsum(lengths)
    nodes, reached = [np.zeros(1)], [np.array([start])]
    for first in range(0, _STEPS, _CHUNK):
        t = np.concatenate([nodes[-1][-1:], ends[first : first + _CHUNK]])
        jets = lead(t)
        finite = np.isfinite(jets[:, 0])
        count = len(t) if np.all(finite) else int(np.argmin(finite))
        t, x = _with_turns(lead, t[:count], jets[:count])
        nodes.append(t[1:])
        reached.append(x[1:])
        whole = np.concatenate(reached)
        met = np.max(whole) >= highest - _slack(highest) and np.min(whole) <= lowest + _slack(lowest)
        if met or count <= _CHUNK:
            break
    return np.concatenate(nodes), np.concatenate(reached)


def _with_turns(lead: Input, t: Array, jets: Array) -> tuple[Array, Array]:
    """Return times and values, with the turning points of the input inserted, found by bisection."""
    with np.errstate(invalid="ignore"):
        turns = np.flatnonzero(jets[:-1, 1] * jets[1:, 1] < 0.0)
    if not len(turns):
        return t, jets[:, 0]
    high = bisected(lambda x: lead(x)[:, 1], np.zeros(len(turns)), t[turns], t[turns + 1])
    whole = np.insert(t, turns + 1, high)
    return whole, np.insert(jets[:, 0], turns + 1, lead(high)[:, 0])


def _passages(lead: Input, values: Array, nodes: Array, reached: Array) -> Array:
    """Return the first time of every value on a path of monotone pieces."""
    times = np.full(len(values), np.nan)
    brackets = []
    for sign in (1.0, -1.0):
        part = np.flatnonzero(sign * (values - reached[0]) > 0.0)
        farthest = np.maximum.accumulate(sign * reached)
        positions = np.searchsorted(farthest, sign * values[part] - _slack(values[part]))
        brackets.append((part[positions < len(nodes)], positions[positions < len(nodes)]))
    which, ends = (np.concatenate(x) for x in zip(*brackets, strict=True))
    at_node = np.abs(reached[ends] - values[which]) <= _slack(values[which])
    times[which[at_node]] = nodes[ends[at_node]]
    which, ends = which[~at_node], ends[~at_node]
    if len(which):
        between = nodes[ends - 1], nodes[ends]
        times[which] = bisected(lambda t: lead(t)[:, 0], values[which], *between)
    return times


def _slack(value: Array | float) -> Array:
    return _CLOSE * np.maximum(1e-3, np.abs(value))
