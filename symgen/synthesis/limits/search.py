"""Linkages of prescribed limit positions and transmission angles, and those of best transmission."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import SceneError
from symgen.synthesis.limits.kind import LimitKind, in_sizes
from symgen.synthesis.search import RootSearch, conditions, search
from symgen.synthesis.spherical import without_opposites
from symgen.synthesis.tasks import SIZES

Array = NDArray[np.float64]

#: Loss of rank, relative to the largest singular value.
_LOST = 1e-9
#: Values of a range at which linkages are found, and the change of a refined one, over the range.
_VALUES, _REFINED = 25, 1e-10
#: Bisections of the greatest transmission angle: to 0.001 deg.
_BISECTIONS = 12
#: The quantity that may be zero.
_MAY_VANISH = "offset"


def linkages(
    kind: LimitKind, prescribed: dict[str, float], starts: int, seed: int
) -> tuple[list[Any], RootSearch]:
    """Return all linkages found that have the prescribed quantities [m, rad].

    Raises
    ------
    SceneError
        When the quantities are too few or many, or do not determine the linkage.
    """
    _check(kind, prescribed)
    prescribed, scale = in_sizes(prescribed, kind.lengths)
    equations = conditions(kind.block, kind.conditions)
    fixed = np.array([name in prescribed for name in kind.names])
    values = np.array([prescribed.get(name, 0.0) for name in kind.names])
    generator = np.random.default_rng(seed)

    def residual(x: Array) -> tuple[Array, Array]:
        full = values.copy()
        full[~fixed] = x
        (r,), (slopes,) = equations(full[None])
        return r, slopes[:, ~fixed]

    samples = [_sample(kind, generator, prescribed) for _ in range(starts)]
    for sample in samples[:3]:
        _, (slopes,) = equations(sample[None])
        sizes = np.linalg.svd(slopes[:, ~fixed], compute_uv=False)
        if sizes[-1] > _LOST * sizes[0]:
            break
    else:
        raise SceneError(
            f"{', '.join(prescribed)} depend on each other and do not determine {kind.family}",
            hint="Sides and angles of a triangle depend on each other; both positions give swing and stroke.",
        )
    roots = search(residual, (sample[~fixed] for sample in samples))
    results = []
    for x in roots.roots:
        full = values.copy()
        full[~fixed] = x
        named = dict(zip(kind.names, full.tolist(), strict=True))
        if kind.accepts(named):
            error = float(np.abs(equations(full[None])[0]).max())
            results.append(kind.drawn({**named, "error": error}))
    if not kind.lengths:
        results = without_opposites(results)
    results.sort(key=lambda linkage: [*linkage.lengths.values()])
    return [linkage.scaled(scale) if kind.lengths else linkage for linkage in results], roots


def best(
    kind: LimitKind,
    prescribed: dict[str, float],
    ranges: dict[str, tuple[float, float]],
    starts: int,
    seed: int,
    allowed: Callable[[Any], bool],
) -> tuple[list[Any], RootSearch]:
    """Return the linkage of best transmission, with one of its quantities in a range [m, rad].

    Its transmission angle is least off 90 deg, at worst, over a revolution of the crank: the thesis on
    kineto-elastodynamics (Chapter III) bounds this angle. Linkages are found at values of the range, with a
    fifth of the starts each, and the best of them is refined by Brent's method between its neighbours.
    Linkages that are not ``allowed`` are worse than all others.

    Raises
    ------
    SceneError
        When there is more than one range, or its ends are not in order.
    """
    from scipy.optimize import minimize_scalar

    if len(ranges) > 1:
        raise SceneError(f"expected one range, got {len(ranges)}: {', '.join(ranges)}")
    ((name, (low, high)),) = ranges.items()
    if not low < high:
        raise SceneError("expected a range of rising values", where=name)
    searches: list[RootSearch] = []

    def at(value: float) -> tuple[float, Any]:
        value = 0.0 if name in kind.lengths and value < SIZES[0] else float(value)  # an offset of zero
        candidates, search = linkages(kind, {**prescribed, name: value}, max(starts // 5, 1), seed)
        searches.append(search)
        rated = [(_off_right(kind, x) + np.pi * (not allowed(x)), x) for x in candidates]
        return min(rated, key=lambda pair: pair[0], default=(2 * np.pi, None))

    values = np.linspace(low, high, _VALUES)
    tried = [at(value) for value in values]
    top = int(np.argmin([off for off, _ in tried]))
    if tried[top][1] is None:
        return [], searches[0]
    ends = values[max(top - 1, 0)], values[min(top + 1, _VALUES - 1)]
    refined = minimize_scalar(
        lambda value: at(value)[0], bounds=ends, method="bounded", options={"xatol": _REFINED * (high - low)}
    )
    return [min(tried[top], at(refined.x), key=lambda pair: pair[0])[1]], searches[top]


def greatest_transmission(kind: LimitKind, prescribed: dict[str, float], starts: int, seed: int) -> float:
    """Return the greatest ``transmission_least`` [rad] found with the other quantities, at most 90 deg.

    Linkages are searched at values up to a right angle, with a fifth of the starts each, then by bisection
    above the greatest value with a linkage. Zero if there is none.
    """

    def exists(value: float) -> bool:
        trial = {**prescribed, "transmission_least": value}
        return bool(linkages(kind, trial, max(starts // 5, 1), seed)[0])

    values = np.linspace(0.0, np.pi / 2, _VALUES).tolist()
    met = [i for i, value in enumerate(values) if i and exists(value)]
    if not met or met[-1] == _VALUES - 1:
        return float(values[met[-1]]) if met else 0.0
    low, high = values[met[-1] : met[-1] + 2]
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if exists(middle) else (low, middle)
    return float(low)


def _off_right(kind: LimitKind, linkage: Any) -> float:
    """Return the largest deviation of the transmission angle from a right angle [rad]."""
    values = kind.derived([*linkage.lengths.values()])
    return max(abs(values[f"transmission_{end}"] - np.pi / 2) for end in ("least", "greatest"))


def _check(kind: LimitKind, prescribed: dict[str, float]) -> None:
    if len(prescribed) != kind.required:
        names = ", ".join(prescribed) or "none"
        raise SceneError(
            f"expected {kind.required} quantities, which determine {kind.family}, "
            f"got {len(prescribed)}: {names}",
            hint=_advice(kind, prescribed) + f"Known: {', '.join(kind.names)}.",
        )
    if kind.lengths and not any(prescribed[name] for name in kind.lengths & prescribed.keys()):
        raise SceneError(
            "expected at least one length, got angles alone, which leave the size of the linkage open",
            hint='Add a length such as crank = "1 m" in place of an angle.',
        )
    for name, number in prescribed.items():
        unit = next(u for n, u, _ in kind.quantities if n == name)
        if unit == "m" and not (number >= SIZES[0] or (name == _MAY_VANISH and number == 0)):
            limit = f"{'of zero, or ' if name == _MAY_VANISH else ''}of {SIZES[0]:g} m or more"
            raise SceneError(f"expected a length {limit}, got {number:.6g} m", where=name)
        if unit == "1" and not 0 < number < np.inf:
            raise SceneError(f"expected a ratio above zero, got {number:.6g}", where=name)
        if unit == "rad" and not 0 < number < np.pi:
            text = f"{np.degrees(number):.6g} deg"
            raise SceneError(f"expected an angle between 0 and 180 deg, got {text}", where=name)


def _advice(kind: LimitKind, prescribed: dict[str, float]) -> str:
    """Return advice on further quantities if there are too few; empty without advice."""
    if len(prescribed) > kind.required or "transmission_least" in prescribed:
        return ""
    length = "" if not kind.lengths or kind.lengths & prescribed.keys() else "a length and, "
    return (
        f"Add {length}for example{',' * bool(length)} transmission_least, which may be a range: "
        '["30 deg", "90 deg"] finds the best.\n  '
    )


def _sample(kind: LimitKind, generator: np.random.Generator, prescribed: dict[str, float]) -> Array:
    """Return the quantities of a random linkage, of the size of the first prescribed length."""
    named = kind.derived(kind.random(generator))
    sized = (name for name in kind.names if name in kind.lengths and prescribed.get(name))
    scale = next((prescribed[name] / named[name] for name in sized), 1.0)
    return np.array([named[n] * (scale if n in kind.lengths else 1.0) for n in kind.names])
