"""Settings of a method from loose to tight, up to the last one that improves the result."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

#: Tolerances decrease tenfold; numbers of steps double every second time.
_TOLERANCES = tuple(10.0**-k for k in range(2, 32))
_STEPS = tuple(round(16 * 2 ** (k / 2)) for k in range(41))
#: Consecutive settings without improvement after which a sweep ends.
_IDLE = 3
#: Initial failures after which a sweep ends.
_FAILED = 12


@dataclass(frozen=True, slots=True)
class Setting:
    """A method with its tolerance or its number of steps, and the step length [s] if given.

    ``precision`` is the number type of the run.
    """

    method: str
    text: str
    rtol: float | None = None
    steps: int | None = None
    step: float | None = None
    precision: str = "float64"


def tolerances(method: str, tightest: float) -> Iterator[Setting]:
    """Yield tolerances from loose to tight, down to the tightest."""
    return (Setting(method, f"rtol {rtol:.0e}", rtol=rtol) for rtol in _TOLERANCES if rtol >= tightest)


def fixed_steps(method: str, t_end: float) -> Iterator[Setting]:
    """Yield numbers of steps, increasing by a factor of 1.4."""
    return (Setting(method, f"{n} steps", steps=n, step=t_end / n) for n in _STEPS)


def worth_running(
    settings: Iterator[Setting], run: Callable[[Setting], tuple[float, float]], goal: float, most: float
) -> Iterator[Setting]:
    """Yield the settings of a sweep as long as they improve the result.

    Parameters
    ----------
    settings
        Settings from loose to tight.
    run
        Function that returns error and wall time [s] of a setting; the error of a failure is not finite.
    goal
        Error below which the sweep ends.
    most
        Wall time [s] of a run that ends the sweep.
    """
    best, idle = math.inf, 0
    for tried, setting in enumerate(settings, 1):
        error, wall = run(setting)
        if math.isfinite(error):
            yield setting
        idle = 0 if error < 0.5 * best else idle + math.isfinite(best)
        best = min(best, error)
        if best <= goal or wall > most or idle == _IDLE or (tried == _FAILED and best == math.inf):
            return
