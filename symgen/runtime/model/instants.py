"""Times at which the drive of a linkage has given values, and the times of a range."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.errors import ModelError, RangeError
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.options import end_of_scene
from symgen.runtime.kernels.arguments import reals

#: Gives the values of the drives [rad or m] at many times, by name.
Drives = Callable[[Array], dict[str, Array]]
#: Times at which the drive is evaluated to bracket a value.
_GRID = 1025
#: By how much of a revolution a direction may lie beyond the range of the drive, by rounding.
_SLACK = 1e-12


@dataclass(frozen=True, slots=True)
class Instants:
    """Where a driven linkage is evaluated.

    Attributes
    ----------
    start, stop
        Range of time [s] over which the linkage is followed.
    samples
        Number of equally spaced times of the range.
    at, over
        Values to evaluate instead, or None: of the first drive (``input``) [rad or m], each at its first time
        in the range, or of the ``time`` [s].
    spread
        Spread the samples of a range over the part of it that the linkage reaches.
    """

    start: float
    stop: float
    samples: int
    at: ArrayLike | None = None
    over: str = "time"
    spread: bool = False

    def times(self, name: str, drives: Drives) -> Array:
        """Return the times [s] to evaluate; ``name`` is that of the linkage. Errors are those of times_of."""
        if self.at is None:
            return np.linspace(self.start, self.stop, self.samples)
        if self.over == "time":
            return reals(self.at, "times")
        return times_of(name, drives, self.at, self.start, self.stop)


def instants(
    start: float | None,
    stop: float | None,
    at: ArrayLike | None,
    over: str | None,
    samples: int,
    end: float,
) -> Instants:
    """Return where to evaluate a linkage whose scene ends at a time [s].

    Raises
    ------
    ModelError
        For an empty range, or an unknown variable.
    SimulationError
        Where the end of the scene is needed and its parameters make it none.
    """
    if over not in (None, "input", "time"):
        raise ModelError(f"expected over to be 'input' or 'time', got {over!r}")
    if at is None and over == "input":
        if start is None or stop is None:
            raise ModelError("a range of the input needs both start and stop")
        first, last = _ordered(start, stop, "")
        return Instants(0.0, end_of_scene(end), samples, np.linspace(first, last, samples).tolist(), "input")
    if at is not None and over == "time":
        times = reals(at, "times")
        if not len(times):
            raise ModelError("expected at least one time")
        low, high = float(np.min(times)), float(np.max(times))
        if low == high:  # a range is longer than that
            low, high = min(0.0, low), max(end_of_scene(end), high)
        return Instants(low, high, samples, times.tolist(), "time")
    first, last = _ordered(0.0 if start is None else start, end_of_scene(end) if stop is None else stop, " s")
    return Instants(first, last, samples, at, "input")


def _ordered(start: float, stop: float, unit: str) -> tuple[float, float]:
    if not start < stop:
        raise ModelError(f"expected a range with start before stop, got {start:g} to {stop:g}{unit}")
    return start, stop


def times_of(name: str, drives: Drives, values: ArrayLike, start: float, stop: float) -> Array:
    """Return the first time in a range at which the first drive has each of the values [rad or m].

    Parameters
    ----------
    name
        Name of the linkage, for messages.
    drives
        The drives over times. One called ``LINK.angle`` or ``LINK.relative_angle`` is equal after a
        revolution.
    values, start, stop
        Values of the drive, and the range of time [s].

    Raises
    ------
    ModelError
        When there is no drive.
    RangeError
        When it does not take a value in the range.
    """
    input_values = reals(values, "values of the input").tolist()
    if not input_values:
        raise ModelError("expected at least one value of the input")
    times = np.linspace(start, stop, _GRID)
    over_times = drives(times)
    first = next(iter(over_times), None)
    if first is None:
        raise ModelError(
            f"{name} has no driven link, and so no values of an input\n  Give a range of time instead."
        )
    drive_values = over_times[first]
    is_angle = first.endswith("angle")
    targets = []
    for value in input_values:
        target = _target(drive_values, value, 2 * math.pi if is_angle else 0.0)
        if target is None:
            unit, size = ("deg", math.pi / 180) if is_angle else ("m", 1.0)
            raise RangeError(
                f"{first} is between {np.min(drive_values) / size:.9g} and "
                f"{np.max(drive_values) / size:.9g} {unit} from "
                f"t = {start:g} s to {stop:g} s, and does not come to {value / size:.9g} {unit}\n"
                "  Give a longer range of time."
            )
        targets.append(target)
    return _first(lambda at: drives(at)[first], times, drive_values, np.array(targets))


def _target(drive_values: Array, value: float, period: float) -> float | None:
    """Return the value of the drive, or the one that is equal to it and taken first; None without one."""
    low, high = float(np.min(drive_values)), float(np.max(drive_values))
    if low <= value <= high:
        return value
    if not period:
        return None
    first = math.ceil((low - value) / period - _SLACK)
    last = math.floor((high - value) / period + _SLACK)
    targets = [min(max(value + period * k, low), high) for k in range(first, last + 1)]
    return min(targets, key=lambda v: int(np.argmax(_crossed(drive_values, v))), default=None)


def _crossed(drive_values: Array, target: float) -> NDArray[np.bool_]:
    gap = drive_values - target
    return gap[:-1] * gap[1:] <= 0.0


def _first(drive: Callable[[Array], Array], times: Array, drive_values: Array, targets: Array) -> Array:
    """Return the first times at which a drive has some values, bisected down to neighbouring numbers."""
    before = np.array([int(np.argmax(_crossed(drive_values, target))) for target in targets])
    low, high = times[before], times[before + 1]
    for end, place in ((high, before + 1), (low, before)):  # where both have it, the first
        met = drive_values[place] == targets
        low, high = np.where(met, end, low), np.where(met, end, high)
    return bisected(drive, targets, low, high)


def bisected(function: Callable[[Array], Array], targets: Array, low: Array, high: Array) -> Array:
    """Return the times between two at which a function passes each target, to neighbouring numbers."""
    rising = function(low) < targets
    while True:
        middle = (low + high) / 2
        if np.all((middle == low) | (middle == high)):
            break
        is_before = (function(middle) < targets) == rising
        low, high = np.where(is_before, middle, low), np.where(is_before, high, middle)
    nearer = np.abs(function(low) - targets) <= np.abs(function(high) - targets)
    return np.where(nearer, low, high)
