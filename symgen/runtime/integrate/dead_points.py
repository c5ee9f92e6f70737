"""Dead points of drives of unknown effort on a motion that is prescribed."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.integrate.causes import drives_of
from symgen.runtime.integrate.redundancy import extent, motions_of, onto, scaled_jacobian
from symgen.runtime.kernels.evaluate import Evaluator

#: Change of the line between two points of a link over its length in a step, and that by its rates.
_CHANGE, _BY_RATES = 0.15, 0.3
#: The longest step and the shortest over the range.
_LONGEST, _SHORTEST = 1 / 64, 1e-9
#: Determinant over its largest value that is zero where it has an extreme.
_ZERO = 1e-8


def dead_points(evaluator: Evaluator, times: Array, states: Array) -> Iterator[str]:
    """Yield at which times from the first to the last efforts of a linkage without freedom have a pole.

    The drives are at a dead point there: the determinant of their rates by those of the prescribed quantities
    changes its sign, or touches zero. The motion is followed from the first of the states (q, ...).
    A last note has the time at which this ends, if before the last of the times.
    """
    if not evaluator.efforts or evaluator.description.freedom or len(times) < 2:
        return
    first, last = int(np.argmin(times)), float(np.max(times))
    start = states[first, : evaluator.description.coordinates]
    nodes = _followed(evaluator, float(times[first]), start, last)
    size = extent(evaluator, start)

    def along(i: int) -> Callable[[float], float]:
        def value(t: float) -> float:
            k = i if t <= nodes[i][0] else i + 1
            (before, q), (after, new) = nodes[k - 1], nodes[k]
            pose = onto(evaluator, t, q + (t - before) / (after - before) * (new - q), size, [])
            return np.nan if pose is None else _transmission(evaluator, t, pose)

        return value

    values = np.array([_transmission(evaluator, t, q) for t, q in nodes])
    values[values == 0.0] = np.finfo(float).tiny
    largest = np.max(np.abs(values))
    outer = [i for i in {0, len(nodes) - 1} if abs(values[i]) <= _ZERO * largest]
    found = [nodes[i][0] for i in outer]
    for i in outer:  # rounding errors next to zero are no change of sign
        values[i] = np.copysign(values[i], values[abs(i - 1)])
    for i in range(1, len(nodes)):
        begin, end = nodes[i - 1][0], nodes[i][0]
        if values[i - 1] * values[i] < 0:
            at = _root(along(i), begin, end)
            pole = abs(along(i)(at)) > max(abs(values[i - 1]), abs(values[i]))  # a dead centre of the motion
            found += [] if pole else [at]
        elif i + 1 < len(nodes) and np.argmin(values[i] * values[i - 1 : i + 2]) == 1:  # all of one sign
            at, least = _least(along(i), begin, nodes[i + 1][0])
            found += [at] if least <= _ZERO * largest else []
    for t in sorted(found):
        yield (
            f"at t = {t:.9g} s there is a dead point of {drives_of(evaluator)}: next to it efforts "
            "grow without bounds"
        )
    if (reached := nodes[-1][0]) < last:
        yield (
            f"the motion could not be followed beyond t = {reached:.9g} s in search of dead points of "
            f"{drives_of(evaluator)}: later ones are not noted"
        )


def _root(of: Callable[[float], float], a: float, b: float) -> float:
    """Return where a function changes its sign, by bisection."""
    sign = np.sign(of(a))
    while a < (middle := (a + b) / 2) < b:
        a, b = (middle, b) if np.sign(of(middle)) == sign else (a, middle)
    return a


def _least(of: Callable[[float], float], a: float, b: float) -> tuple[float, float]:
    """Return where a function has its least magnitude, and that, by golden sections."""
    part = (np.sqrt(5) - 1) / 2
    inner = [b - part * (b - a), a + part * (b - a)]
    sizes = [abs(of(t)) for t in inner]
    for _ in range(50):
        if sizes[0] < sizes[1]:
            b, inner = inner[1], [inner[1] - part * (inner[1] - a), inner[0]]
            sizes = [abs(of(inner[0])), sizes[0]]
        else:
            a, inner = inner[0], [inner[1], inner[0] + part * (b - inner[0])]
            sizes = [sizes[1], abs(of(inner[1]))]
    k = int(np.argmin(sizes))
    return inner[k], sizes[k]


def _followed(evaluator: Evaluator, t: float, q: Array, end: float) -> list[tuple[float, Array]]:
    """Return times and poses of the prescribed motion from a pose on, in steps that turn every link a little.

    They end where no pose near the last meets the constraints.
    """
    size, span, nodes = extent(evaluator, q), end - t, [(t, q)]
    step, still = _LONGEST * span, np.zeros_like(q)
    while t < end and step > _SHORTEST * span:
        after = min(t + step, end)
        jacobian, scale = scaled_jacobian(evaluator, t, q)
        drift = evaluator.blocks("velocity_constraints", t, q, still)["velocity_constraints"].ravel() / scale
        rates = np.asarray(np.linalg.lstsq(jacobian, -drift, rcond=None)[0], dtype=float)
        if _change(evaluator, t, q, t, q, (after - t) * rates) <= _BY_RATES:
            new = onto(evaluator, after, q + (after - t) * rates, size, [])
            if new is not None and _change(evaluator, t, q, after, new, still) <= _CHANGE:
                nodes.append((after, new))
                t, q, step = after, new, min(1.5 * step, _LONGEST * span)
                continue
        step = min(step, after - t) / 2
    return nodes


def _change(evaluator: Evaluator, t: float, q: Array, after: float, new: Array, way: Array) -> float:
    """Return the largest change of a line between two points of a link over its length, and by a way."""
    d = evaluator.description
    ends = np.array([[d.points.index(p) for p in link[:2]] for link in d.links.values()])
    here, there = evaluator.blocks("points", t, q, way), evaluator.blocks("points", after, new, way)
    first, second = (np.diff(x["positions"][ends], axis=1)[:, 0] for x in (here, there))
    moved = second - first + np.diff(here["velocities"][ends], axis=1)[:, 0]
    return float(np.max(np.linalg.norm(moved, axis=1) / np.linalg.norm(first, axis=1)))


def _transmission(evaluator: Evaluator, t: float, q: Array) -> float:
    """Return the determinant of the rates of the drives by those of the prescribed quantities at a pose."""
    d = evaluator.description
    unit = np.eye(len(d.labels))[:, motions_of(d)]
    rates = np.linalg.lstsq(scaled_jacobian(evaluator, t, q)[0], unit, rcond=None)[0]
    pushes = evaluator("effort_forces", t, q, np.zeros_like(q)).reshape(len(q), -1)
    return float(np.linalg.det(pushes.T @ rates))
