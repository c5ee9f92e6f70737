"""Jumps of prescribed motions over a range of time, where no acceleration takes a linkage further."""

from __future__ import annotations

import numpy as np

from symgen.errors import SimulationError
from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.failures import PRESCRIBED, of_prescribed
from symgen.runtime.rods.constraints import Constraints

#: Intervals in which switching points are looked for, at first.
_LOOKS = 1440
#: Most switching points that are examined.
_MOST = 20_000
#: Jumps of places over the size, and of rates over the largest, that count.
_PLACE, _RATE = 1e-9, 1e-6
#: Poses at which constraints are compared: at some of them a row may not depend on the value that jumps.
_POSES = 3


def check_prescribed(constraints: Constraints, q: Array, start: float, stop: float) -> None:
    """Raise SimulationError if a prescribed motion, or its rate, jumps between two times [s].

    Parameters may move the knots of tables and profiles: the scene was checked for its own values. ``q`` is a
    pose of the linkage.
    """
    switches = constraints.description.switches
    chosen = [k for k, text in enumerate(switches) if PRESCRIBED.search(text)]
    if not chosen:
        return
    pairs = {k: _passed(constraints, k, start, stop) for k in chosen}
    random = np.random.default_rng(0)
    size = constraints.length(q)
    poses = [q + size * random.uniform(-1.0, 1.0, len(q)) for _ in range(_POSES)]
    for pose in poses:
        rates = [constraints.drift(pose, t) for t in np.linspace(start, stop, 2 * _POSES).tolist()]
        sides = {
            (k, high): [(constraints.residual(pose, t), constraints.drift(pose, t)) for t in (low, high)]
            for k, found in pairs.items()
            for low, high in found
        }
        rates += [rate for both in sides.values() for _, rate in both]
        fastest = float(np.max(np.abs(rates), initial=0.0))
        for (k, t), both in sorted(sides.items(), key=lambda item: item[0][1]):
            (place, rate), (place_after, rate_after) = both
            moved = float(np.max(np.abs(place_after - place)))
            changed = float(np.max(np.abs(rate_after - rate)))
            if moved > _PLACE * size or changed > _RATE * fastest:
                raise SimulationError(of_prescribed(switches[k], f"at t = {t:.9g} s"), time=t)


def _passed(constraints: Constraints, k: int, start: float, stop: float) -> list[tuple[float, float]]:
    """Return a time before and one after every passage of a switching point between two times, by halving."""
    looks = np.arange(_LOOKS + 1)
    times = np.clip(start + (stop - start) * (looks + 0.4 * np.sin(looks**2.0)) / _LOOKS, start, stop)
    times[[0, -1]] = start, stop
    least = 4 * np.spacing(max(abs(start), abs(stop)))
    sides = _sides(constraints, k, times)
    low, high, before, after = times[:-1], times[1:], sides[:-1], sides[1:]
    while True:
        apart = before != after
        low, high, before, after = low[apart], high[apart], before[apart], after[apart]
        if len(low) > _MOST or not np.any(wide := high - low > least):
            return [*zip(low.tolist(), high.tolist(), strict=True)][:_MOST]
        middle = np.where(wide, (low + high) / 2, high)
        at = np.where(wide, _sides(constraints, k, middle), after)
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        before, after = np.concatenate([before, at]), np.concatenate([at, after])


def _sides(constraints: Constraints, k: int, times: Array) -> Array:
    """Return the side of a switching point, of tables the piece, at many times."""
    evaluator, d = constraints.evaluator, constraints.description
    parameters = evaluator.parameter_values.copy()
    if is_table := k >= len(d.switches) - d.tables:
        parameters[d.of_held.stop - len(d.switches) + k] = _core.WHICH_PIECE
    of = type(evaluator)(d, evaluator.library, parameters)
    still = np.zeros((len(times), d.coordinates))
    values = of.many_blocks("events", times, still, still)["switches"].reshape(len(times), -1)[:, k]
    return values if is_table else np.where(values < 0.0, -1.0, 1.0)
