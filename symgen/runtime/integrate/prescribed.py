"""Jumps of prescribed motions over a range of time, where no acceleration takes a mechanism further."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from symgen.errors import SimulationError
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.failures import PRESCRIBED, of_prescribed

#: Intervals in which switching points are looked for, at first.
_LOOKS = 1440
#: Most switching points that are examined.
_MOST = 20_000
#: Jumps of places over the size, and of rates over the largest, that count.
_PLACE, _RATE = 1e-9, 1e-6
#: Times of a range at which rates are compared with jumps.
_RATES = 32

#: Side of a switching point, of tables the piece, at many times.
Sides = Callable[[int, Array], Array]
#: Prescribed places and their rates at a time, both over the size.
Prescribed = Callable[[float], tuple[Array, Array]]


def check_prescribed(
    switches: Sequence[str], sides: Sides, motions: Sequence[Prescribed], start: float, stop: float
) -> None:
    """Raise SimulationError if a prescribed motion, or its rate, jumps between two times [s].

    Parameters may move the knots of tables and profiles: the scene was checked for its own values.
    """
    passed = [
        (k, low, high)
        for k, text in enumerate(switches)
        if PRESCRIBED.search(text)
        for low, high in _passed(lambda times, k=k: sides(k, times), start, stop)  # type: ignore[misc]
    ]
    passed.sort(key=lambda each: each[2])
    for motion in motions if passed else ():
        pairs = [(motion(low), motion(high)) for _, low, high in passed]
        # At times of no period: at the ends of dwells rates are zero.
        times = start + (stop - start) * (np.arange(1, _RATES + 1) * np.sqrt(2) % 1.0)
        rates = [motion(t)[1] for t in times.tolist()]
        rates += [rate for pair in pairs for _, rate in pair]
        fastest = max(float(np.max(np.abs(rates), initial=0.0)), 1.0 / (stop - start))
        for (k, _, t), ((place, rate), (place_after, rate_after)) in zip(passed, pairs, strict=True):
            moved = float(np.max(np.abs(place_after - place), initial=0.0))
            changed = float(np.max(np.abs(rate_after - rate), initial=0.0))
            if moved > _PLACE or changed > _RATE * fastest:
                raise SimulationError(of_prescribed(switches[k], f"at t = {t:.9g} s"), time=t)


def _passed(side: Callable[[Array], Array], start: float, stop: float) -> list[tuple[float, float]]:
    """Return a time before and one after every change of a side between two times, by halving."""
    looks = np.arange(_LOOKS + 1)
    times = np.clip(start + (stop - start) * (looks + 0.4 * np.sin(looks**2.0)) / _LOOKS, start, stop)
    times[[0, -1]] = start, stop
    least = 4 * np.spacing(max(abs(start), abs(stop)))
    sides = side(times)
    low, high, before, after = times[:-1], times[1:], sides[:-1], sides[1:]
    while True:
        apart = before != after
        low, high, before, after = low[apart], high[apart], before[apart], after[apart]
        if len(low) > _MOST or not np.any(wide := high - low > least):
            return [*zip(low.tolist(), high.tolist(), strict=True)][:_MOST]
        middle = np.where(wide, (low + high) / 2, high)
        at = np.where(wide, side(middle), after)
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        before, after = np.concatenate([before, at]), np.concatenate([at, after])
