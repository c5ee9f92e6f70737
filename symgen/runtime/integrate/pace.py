"""The pace of a run: its remaining wall time, the wall time that it may take, and the ends of its steps."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

from symgen.errors import SimulationError, SlowRunWarning
from symgen.runtime.arrays import Indices
from symgen.runtime.kernels.arguments import is_real, out_of_range

#: Function that is called with the completed part of a run, 0 to 1.
Progress = Callable[[float], None]
#: Answer of a run that was ended by ``max_wall``; the core's own answers are not negative.
OUT_OF_TIME = -1
#: Least wall time [s] over which the pace is measured.
SPAN = 1.5
#: The same as a part of the wall time spent.
_SHARE = 0.25
#: Remaining wall time [s] that is announced.
LONG = 20.0
#: Growth of the remaining time that is announced again.
_AGAIN = 10.0
#: Wall time [s] between two readings of the clock.
LOOK = 0.05
#: Largest growth of the number of steps between them.
_GROWTH = 64.0


@dataclass(slots=True)
class _Limit:
    """A limit of wall time [s], and the clock at its begin [s], advanced by time that is not counted."""

    seconds: float
    begun: float

    def passed(self) -> bool:
        return time.perf_counter() - self.begun >= self.seconds


_LIMIT: ContextVar[_Limit | None] = ContextVar("wall time", default=None)


def limited(max_wall: object) -> AbstractContextManager[None]:
    """Limit the wall time [s] of a run and its assembly, but for :func:`uncounted`; None: no limit.

    Raises
    ------
    ModelError
        When it is not a finite number above zero.
    """
    return _UNLIMITED if max_wall is None else _limited(max_wall)


_UNLIMITED = nullcontext()


@contextmanager
def _limited(max_wall: object) -> Iterator[None]:
    if not is_real(max_wall) or not max_wall > 0:  # type: ignore[operator]
        raise out_of_range("max_wall", max_wall)
    token = _LIMIT.set(_Limit(float(max_wall), time.perf_counter()))  # type: ignore[arg-type]
    try:
        yield
    finally:
        _LIMIT.reset(token)


@contextmanager
def unlimited() -> Iterator[None]:
    """Lift the limit of wall time inside, for a short computation on a run that the limit has ended."""
    token = _LIMIT.set(None)
    try:
        yield
    finally:
        _LIMIT.reset(token)


@contextmanager
def uncounted() -> Iterator[None]:
    """Do not count deriving and compiling, inside: they cannot be ended, and are kept for the next run."""
    begun, limit = time.perf_counter(), _LIMIT.get()
    try:
        yield
    finally:
        if limit is not None:
            limit.begun += time.perf_counter() - begun


def is_spent() -> bool:
    """Return whether the wall time of the run is spent."""
    limit = _LIMIT.get()
    return limit is not None and limit.passed()


def wall_left() -> float | None:
    """Return the wall time that is left [s], at least a millisecond; None without a limit."""
    limit = _LIMIT.get()
    return None if limit is None else max(limit.begun + limit.seconds - time.perf_counter(), 1e-3)


def check_wall(doing: str) -> None:
    """Raise SimulationError if the wall time is spent before the first step; ``doing`` names the activity."""
    limit = _LIMIT.get()
    if limit is not None and limit.passed():
        raise SimulationError(
            f"the run was ended after max_wall = {limit.seconds:g} s of wall time, before its first step, "
            f"{doing}\n  Raise max_wall."
        )


#: Ends of steps [s] of the runs of :func:`noted_ends`.
ENDS: ContextVar[list[float] | None] = ContextVar("ends of steps", default=None)


@contextmanager
def noted_ends() -> Iterator[list[float]]:
    """Note the ends of the steps [s] of the last run inside."""
    ends: list[float] = []
    token = ENDS.set(ends)
    try:
        yield ends
    finally:
        ENDS.reset(token)


class Pace:
    """Follows a run from ``start`` to ``end`` (times of the motion [s]) by the clock.

    The remaining time is estimated from the progress of the last seconds, not from that since the start: a
    run that has come into a region of short steps has slowed down for good more often than not.
    The limit of wall time is that of :func:`limited`. ``place`` is the text of warnings for time and end,
    ``first`` the number of steps before the first look at the clock, 4 with a limit and at least.
    """

    def __init__(
        self, start: float, end: float, place: str = "t = {:.6g} s of {:.6g} s", *, first: int = 0
    ) -> None:
        self._end, self._place = end, place
        self._begun = self._marked = time.perf_counter()
        self._at, self._announced = start, LONG / _AGAIN
        self._chunk, self._looked = 4 if _LIMIT.get() else max(4, first), math.nan

    @property
    def wall(self) -> float:
        """Wall time since the start [s]."""
        return time.perf_counter() - self._begun

    def chunk(self) -> int:
        """Return the number of steps until the next look at the clock, from the speed of those before it."""
        now = time.perf_counter()
        if not math.isnan(self._looked):
            scale = LOOK / max(now - self._looked, 1e-6)
            self._chunk = max(1, min(1 << 20, int(self._chunk * min(scale, _GROWTH))))
        self._looked = now
        return self._chunk

    def restart(self, at: float) -> None:
        """Begin another run over the same range, whose wall time counts towards the same limit."""
        self._marked, self._at, self._looked = time.perf_counter(), at, math.nan

    def spent(self, t: float, reason: str | Callable[[], str] = "") -> bool:
        """Return True if the wall time is spent at the time ``t`` of the motion; warn of a long run.

        ``reason`` is appended to the warning: the cause, if known.
        """
        now = time.perf_counter()
        wall, span = now - self._begun, now - self._marked
        if span >= max(SPAN, _SHARE * wall):
            progress, left = t - self._at, self._end - t
            self._marked, self._at = now, t
            remaining = left * span / progress if progress > 0.0 else math.inf
            if remaining >= _AGAIN * self._announced:
                self._announced = remaining
                self._warn(t, wall, remaining, reason() if callable(reason) else reason)
        return is_spent()

    def _warn(self, t: float, wall: float, remaining: float, reason: str) -> None:
        estimate = f"about {in_words(remaining)} remain" if math.isfinite(remaining) else "no end is in sight"
        limited_to = _LIMIT.get()
        limit = (
            "max_wall (--max-wall) ends a run earlier and keeps the samples recorded"
            if limited_to is None
            else f"the run ends after max_wall = {limited_to.seconds:g} s"
        )
        warnings.warn(
            f"{self._place.format(t, self._end)} after {wall:.1f} s: {estimate} at this pace{reason}; "
            f"{limit}",
            SlowRunWarning,
            stacklevel=3,
        )


class OutOfTime(Exception):
    """An elastic motion took all of its wall time at a time ``t`` [s].

    ``states`` holds the results at the recorded times of the indices ``reached``.
    """

    def __init__(self, t: float, states: Any, reached: Indices) -> None:
        self.t, self.states, self.reached = t, states, reached
        super().__init__(t)


def out_of_time(t: float, end: float) -> str:
    """Return the reason of the end of a run that took all of its wall time."""
    limit = _LIMIT.get()
    return (
        f"the run was ended after max_wall = {limit.seconds if limit else math.nan:g} s of wall time, "
        f"at t = {t:.9g} s of {end:.9g} s\n"
        "  Raise max_wall, shorten the run, or loosen its tolerance."
    )


def in_words(seconds: float) -> str:
    """Return a duration to one or two digits in the unit that suits it."""
    for unit, size in (("years", 31557600.0), ("days", 86400.0), ("hours", 3600.0), ("min", 60.0)):
        if seconds >= 2 * size:
            return f"{seconds / size:.2g} {unit}" if seconds < 100 * size else f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"
