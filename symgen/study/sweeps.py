"""Settings of a method from loose to tight, as far as they are worth running."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

#: Tolerances fall tenfold; numbers of steps double in two.
_TOLERANCES = tuple(10.0**-k for k in range(2, 32))
_STEPS = tuple(round(16 * 2 ** (k / 2)) for k in range(41))
#: A sweep ends after so many settings in a row that gained nothing, or so many that failed from the first on.
_IDLE, _FAILED = 3, 12


@dataclass(frozen=True, slots=True)
class Setting:
    """A method with its tolerance or its steps: their number, and their length [s] where it is given.

    ``precision`` is the type of numbers that it is run in.
    """

    method: str
    text: str
    rtol: float | None = None
    steps: int | None = None
    step: float | None = None
    precision: str = "float64"


def tolerances(method: str, tightest: float) -> Iterator[Setting]:
    """Yield tolerances, loose to tight, no tighter than one."""
    return (Setting(method, f"rtol {rtol:.0e}", rtol=rtol) for rtol in _TOLERANCES if rtol >= tightest)


def fixed_steps(method: str, t_end: float) -> Iterator[Setting]:
    """Yield numbers of steps, each 1.4 times the one before."""
    return (Setting(method, f"{n} steps", steps=n, step=t_end / n) for n in _STEPS)


def worth_running(
    settings: Iterator[Setting], run: Callable[[Setting], tuple[float, float]], goal: float, most: float
) -> Iterator[Setting]:
    """Yield the settings of a sweep until they gain nothing more.

    Parameters
    ----------
    settings
        Loose to tight.
    run
        Gives error and wall time [s] of a setting; the error of one that fails is not finite.
    goal
        The error beyond which a sweep has nothing to show.
    most
        The longest run [s] that is worth waiting for.
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
