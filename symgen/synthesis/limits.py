"""Crank-rockers and slider-cranks of prescribed limit positions and transmission angles."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import SceneError
from symgen.mechanics.synthesis import limits as relations
from symgen.synthesis.contradictions import contradiction
from symgen.synthesis.four_bar import FourBar
from symgen.synthesis.linkage import angle
from symgen.synthesis.search import Search, conditions, search
from symgen.synthesis.slider_crank import SliderCrank
from symgen.synthesis.tasks import SIZES

Array = NDArray[np.float64]

#: Loss of rank, relative to the largest singular value.
_LOST = 1e-9
#: Values of a range at which linkages are found, and the change of a refined one, over the range.
_VALUES, _REFINED = 25, 1e-10
#: Bisections of the greatest transmission angle: to 0.001 deg.
_BISECTIONS = 12
#: Angle below zero, or length, that counts as zero: rounding.
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class Kind:
    """Limit positions of one kind of linkage.

    Attributes
    ----------
    block
        The compiled conditions.
    family
        Name of the linkage.
    quantities
        Rows of name, unit and meaning.
    conditions
        Number of conditions.
    necessary
        Linear relations of the quantities, as SymPy.
    random, accepts, drawn, measured, transmission
        Functions: lengths and quantities of a random linkage; whether a root is a linkage; the linkage of a
        root; quantities measured in a run; extremes of the transmission angle.
    """

    block: str
    family: str
    quantities: tuple[tuple[str, str, str], ...]
    conditions: int
    necessary: Callable[[dict[str, Any]], list[Any]]
    random: Callable[[np.random.Generator], dict[str, float]]
    accepts: Callable[[dict[str, float]], bool]
    drawn: Callable[[dict[str, float]], Any]
    measured: Callable[[Any], Iterator[tuple[str, float]]]
    transmission: Callable[[Any], tuple[float, float]]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the quantities."""
        return tuple(name for name, _, _ in self.quantities)

    @property
    def lengths(self) -> frozenset[str]:
        """Names of the quantities that are lengths."""
        return frozenset(name for name, unit, _ in self.quantities if unit == "m")

    @property
    def required(self) -> int:
        """Number of quantities that determine the others."""
        return len(self.quantities) - self.conditions

    def why_not(self, prescribed: dict[str, float], ranges: dict[str, tuple[float, float]]) -> str:
        """Return conditions of every linkage that exclude these values; empty if none is known."""
        low, scale = _over(prescribed | {name: ends[0] for name, ends in ranges.items()}, self.lengths)
        high = {n: ends[1] / scale if n in self.lengths else ends[1] for n, ends in ranges.items()}
        bounds = {name: (value, high.get(name, value)) for name, value in low.items()}
        return contradiction(self.quantities, self.necessary, bounds)


def linkages(kind: Kind, prescribed: dict[str, float], starts: int, seed: int) -> tuple[list[Any], Search]:
    """Return all linkages found that have the prescribed quantities [m, rad].

    Raises
    ------
    SceneError
        When the quantities are too few or many, or do not determine the linkage.
    """
    _check(kind, prescribed)
    prescribed, scale = _over(prescribed, kind.lengths)
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
            hint="Angles of a limit position add up to 180 deg; swing and stroke follow from both positions.",
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
    results.sort(key=lambda linkage: [*linkage.lengths.values()])
    return [linkage.scaled(scale) for linkage in results], roots


def best(
    kind: Kind, prescribed: dict[str, float], ranges: dict[str, tuple[float, float]], starts: int, seed: int
) -> tuple[list[Any], Search]:
    """Return the linkage of best transmission, with one of its quantities in a range [m, rad].

    Its transmission angle is least off 90 deg, at worst, over a revolution of the crank: the thesis on
    kineto-elastodynamics (Chapter III) bounds this angle. Linkages are found at values of the range, with a
    fifth of the starts each, and the best of them is refined by Brent's method between its neighbours.

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
    searches: list[Search] = []

    def at(value: float) -> tuple[float, Any]:
        value = 0.0 if name in kind.lengths and value < SIZES[0] else float(value)  # an offset of zero
        candidates, search = linkages(kind, {**prescribed, name: value}, max(starts // 5, 1), seed)
        searches.append(search)
        rated = [(_off_right(kind, linkage), linkage) for linkage in candidates]
        return min(rated, key=lambda pair: pair[0], default=(np.pi, None))

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


def greatest_transmission(kind: Kind, prescribed: dict[str, float], starts: int, seed: int) -> float:
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


def _off_right(kind: Kind, linkage: Any) -> float:
    """Return the largest deviation of the transmission angle from a right angle [rad]."""
    return max(abs(angle - np.pi / 2) for angle in kind.transmission(linkage))


def _over(prescribed: dict[str, float], lengths: frozenset[str]) -> tuple[dict[str, float], float]:
    """Return quantities with lengths over the first of them, which is not zero; and that length [m]."""
    scale = next(value for name, value in prescribed.items() if name in lengths and value)
    return {name: value / scale if name in lengths else value for name, value in prescribed.items()}, scale


def _check(kind: Kind, prescribed: dict[str, float]) -> None:
    if len(prescribed) != kind.required:
        names = ", ".join(prescribed) or "none"
        raise SceneError(
            f"expected {kind.required} quantities, which determine {kind.family}, "
            f"got {len(prescribed)}: {names}",
            hint=_advice(kind, prescribed) + f"Known: {', '.join(kind.names)}.",
        )
    least = {"offset": 0.0} if kind is SLIDER_CRANK else {}
    if not any(prescribed[name] for name in kind.lengths & prescribed.keys()):
        raise SceneError(
            "expected at least one length, got angles alone, which leave the size of the linkage open",
            hint='Add a length such as crank = "1 m" in place of an angle.',
        )
    for name, number in prescribed.items():
        unit = next(u for n, u, _ in kind.quantities if n == name)
        if unit == "m" and not (number >= SIZES[0] or number == least.get(name)):
            limit = f"{'of zero, or ' if name in least else ''}of {SIZES[0]:g} m or more"
            raise SceneError(f"expected a length {limit}, got {number:.6g} m", where=name)
        if unit == "1" and not 0 < number < np.inf:
            raise SceneError(f"expected a ratio above zero, got {number:.6g}", where=name)
        if unit == "rad" and not 0 < number < np.pi:
            text = f"{np.degrees(number):.6g} deg"
            raise SceneError(f"expected an angle between 0 and 180 deg, got {text}", where=name)


def _advice(kind: Kind, prescribed: dict[str, float]) -> str:
    """Return advice on further quantities if there are too few; empty without advice."""
    if len(prescribed) > kind.required or "transmission_least" in prescribed:
        return ""
    length = "" if kind.lengths & prescribed.keys() else "a length and, "
    return (
        f"Add {length}for example{',' * bool(length)} transmission_least, which may be a range: "
        '["30 deg", "90 deg"] finds the best.\n  '
    )


def _sample(kind: Kind, generator: np.random.Generator, prescribed: dict[str, float]) -> Array:
    """Return the quantities of a random linkage, of the size of the first prescribed length."""
    named = kind.random(generator)
    name = next(name for name in kind.names if name in kind.lengths and prescribed.get(name))
    scale = prescribed[name] / named[name]
    return np.array([named[n] * (scale if n in kind.lengths else 1.0) for n in kind.names])


def time_ratio(more: float) -> float:
    """Return the ratio of the rotations of a crank, of which one is ``more`` [rad] than half a revolution."""
    return float((np.pi + more) / (np.pi - more))


def _crank_rocker(generator: np.random.Generator) -> dict[str, float]:
    while True:
        a, b, c, d = np.exp(generator.uniform(np.log(0.1), np.log(2.0), 4)).tolist()
        if a < min(b, c, d) and 2 * (a + max(b, c, d)) < a + b + c + d:
            break
    out: dict[str, float] = {"crank": a, "coupler": b, "rocker": c, "fixed_link": d}
    for pose, side in (("extended", a + b), ("folded", b - a)):
        out[f"crank_{pose}"] = angle(c, side, d)
        out[f"rocker_{pose}"] = angle(side, c, d)
        out[f"transmission_{pose}"] = angle(d, side, c)
    out["swing"] = out["rocker_extended"] - out["rocker_folded"]
    out["transmission_least"], out["transmission_greatest"] = angle(d - a, b, c), angle(d + a, b, c)
    return out | {"time_ratio": time_ratio(out["crank_folded"] - out["crank_extended"])}


def _is_crank_rocker(x: dict[str, float]) -> bool:
    """Return whether a root is a crank-rocker with triangles, and no mirror image with negative parts."""
    names = [name for name, unit, _ in relations.QUANTITIES if unit == "rad"]
    return (
        all(x[name] > 0 for name in CRANK_ROCKER.lengths)
        and all(0 < x[name] < np.pi for name in names)
        and x["coupler"] > x["crank"]
    )


def _drawn_crank_rocker(x: dict[str, float]) -> FourBar:
    """Return the linkage in its extended limit position, the ground points on the axis."""
    a, b, d, theta = (x[name] for name in ("crank", "coupler", "fixed_link", "crank_extended"))
    direction = np.array([np.cos(theta), np.sin(theta)])
    places = (np.zeros(2), a * direction, (a + b) * direction, np.array([d, 0.0]), (a + b / 2) * direction)
    return FourBar(*places, error=x["error"])


def _measured_crank_rocker(linkage: FourBar) -> Iterator[tuple[str, float]]:
    lengths = linkage.lengths
    yield from lengths.items()
    extended = float(np.arctan2(*(linkage.A - linkage.O)[::-1]))
    a, b, c, d = lengths.values()
    folded = angle(c, d, b - a)
    run = linkage.angles([extended, extended + np.pi, folded + np.pi, 0.0, np.pi])
    rocker, transmission = run["rocker.angle"].values, np.abs(run["A.B.C.angle"].values)
    yield "swing", float(abs(rocker[2] - rocker[0]))
    yield "crank_extended", extended
    yield "crank_folded", folded
    yield "rocker_extended", float(np.pi - rocker[0])
    yield "rocker_folded", float(np.pi - rocker[2])
    yield "transmission_extended", float(transmission[0])
    yield "transmission_folded", float(transmission[2])
    yield "transmission_least", float(transmission[3])
    yield "transmission_greatest", float(transmission[4])
    yield "time_ratio", time_ratio(folded - extended)


def _slider_crank(generator: np.random.Generator) -> dict[str, float]:
    l, share, part = 1.0, *generator.uniform(0.05, 0.95, 2)
    r, e = share * part * l, share * (1 - part) * l
    out = {"crank": r, "coupler": l, "offset": e}
    for pose, side in (("extended", l + r), ("folded", l - r)):
        out[f"crank_{pose}"] = float(np.arcsin(e / side))
        out[f"slider_{pose}"] = float(np.sqrt(side * side - e * e))
    out["stroke"] = out["slider_extended"] - out["slider_folded"]
    out["transmission_least"], out["transmission_greatest"] = (
        float(np.arccos(x / l)) for x in (e + r, e - r)
    )
    return out | {"time_ratio": time_ratio(out["crank_folded"] - out["crank_extended"])}


def _is_slider_crank(x: dict[str, float]) -> bool:
    """Return whether a root is a slider-crank whose crank turns, and no mirror image."""
    return (
        min(x["crank"], x["coupler"], x["slider_folded"]) > 0
        and -_ROUNDING < x["offset"] < x["coupler"] - x["crank"]
        and all(-_ROUNDING < x[f"crank_{pose}"] < np.pi / 2 for pose in ("extended", "folded"))
        and all(0 < x[f"transmission_{end}"] < np.pi for end in ("least", "greatest"))
    )


def _drawn_slider_crank(x: dict[str, float]) -> SliderCrank:
    """Return the linkage in its extended limit position, the guide in the direction of the axis."""
    r, l, theta = (x[name] for name in ("crank", "coupler", "crank_extended"))
    direction = np.array([np.cos(theta), np.sin(theta)])
    places = (np.zeros(2), r * direction, (r + l) * direction, (r + l / 2) * direction)
    return SliderCrank(*places, guide=0.0, error=x["error"])


def _measured_slider_crank(linkage: SliderCrank) -> Iterator[tuple[str, float]]:
    r, l, e = linkage.lengths.values()
    yield from linkage.lengths.items()
    extended, folded = np.arcsin(e / (l + r)), np.arcsin(e / (l - r))
    run = linkage.angles([extended, folded + np.pi, 1.5 * np.pi, 0.5 * np.pi])
    slider = run["B.position"].values[:, 0]
    # From the normal of the guide that points to the crank.
    transmission = np.pi / 2 - run["coupler.angle"].values
    yield "crank_extended", float(extended)
    yield "crank_folded", float(folded)
    yield "slider_extended", float(slider[0])
    yield "slider_folded", float(slider[1])
    yield "stroke", float(slider[0] - slider[1])
    yield "transmission_least", float(transmission[2])
    yield "transmission_greatest", float(transmission[3])
    yield "time_ratio", time_ratio(folded - extended)


def _transmission_of_rocker(linkage: FourBar) -> tuple[float, float]:
    a, b, c, d = linkage.lengths.values()
    return angle(d - a, b, c), angle(d + a, b, c)


def _transmission_of_slider(linkage: SliderCrank) -> tuple[float, float]:
    r, l, e = linkage.lengths.values()
    return float(np.arccos((e + r) / l)), float(np.arccos((e - r) / l))


CRANK_ROCKER = Kind(
    "synthesis_limits", "a crank-rocker", relations.QUANTITIES, 10, relations.necessary, _crank_rocker,
    _is_crank_rocker, _drawn_crank_rocker, _measured_crank_rocker, _transmission_of_rocker,
)  # fmt: skip
SLIDER_CRANK = Kind(
    "synthesis_slider_limits", "a slider-crank", relations.SLIDER_QUANTITIES, 8, relations.slider_necessary,
    _slider_crank, _is_slider_crank, _drawn_slider_crank, _measured_slider_crank, _transmission_of_slider,
)  # fmt: skip
