"""Limit positions of crank-rockers, in the plane and on a sphere."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from symgen.mechanics.synthesis import limits as relations
from symgen.synthesis.four_bar import FourBar
from symgen.synthesis.limits.kind import LimitKind, time_ratio
from symgen.synthesis.linkage import DesignedLinkage, angle
from symgen.synthesis.search import ONE_LINK
from symgen.synthesis.spherical import SphericalFourBar, corner

#: The angle opposite to the first of three sides of a triangle.
Angle = Callable[[float, float, float], float]

_LINKS = ("crank", "coupler", "rocker", "fixed_link")


def _turns(a: float, *others: float) -> bool:
    return a < min(others) and 2 * (a + max(others)) < a + sum(others)


def _derived(angle: Angle, lengths: list[float]) -> dict[str, float]:
    a, b, c, d = lengths
    out = dict(zip(_LINKS, lengths, strict=True))
    for pose, side in (("extended", a + b), ("folded", b - a)):
        out[f"crank_{pose}"] = angle(c, side, d)
        out[f"rocker_{pose}"] = angle(side, c, d)
        out[f"transmission_{pose}"] = angle(d, side, c)
    out["swing"] = out["rocker_extended"] - out["rocker_folded"]
    out["transmission_least"], out["transmission_greatest"] = angle(d - a, b, c), angle(d + a, b, c)
    return out | {"time_ratio": time_ratio(out["crank_folded"] - out["crank_extended"])}


def _random(generator: np.random.Generator) -> list[float]:
    while True:
        lengths: list[float] = np.exp(generator.uniform(np.log(0.1), np.log(2.0), 4)).tolist()
        if _turns(*lengths):
            return lengths


def _random_on_sphere(generator: np.random.Generator) -> list[float]:
    while True:
        arcs: list[float] = generator.uniform(0.05, 3.0, 4).tolist()
        if _turns_on_sphere(*arcs):
            return arcs


def _turns_on_sphere(a: float, *others: float) -> bool:
    """Return whether the crank turns and is the shortest link, also where axes are replaced by opposites."""
    return a > ONE_LINK and _turns(a, *others) and a + max(others) < np.pi and a + sum(others) < 2 * np.pi


def _accepts(quantities: tuple[tuple[str, str, str], ...], x: dict[str, float]) -> bool:
    """Return whether a root is a crank-rocker with triangles, and no mirror image with negative parts."""
    angles = [name for name, unit, _ in quantities if unit == "rad"]
    return (
        all(x[name] > 0 for name in _LINKS)
        and all(0 < x[name] < np.pi for name in angles)
        and x["coupler"] > x["crank"]
    )


def _accepts_on_sphere(x: dict[str, float]) -> bool:
    return _accepts(relations.SPHERICAL_QUANTITIES, x) and _turns_on_sphere(*(x[name] for name in _LINKS))


def _drawn(x: dict[str, float]) -> FourBar:
    """Return the linkage in its extended limit position, the ground points on the axis."""
    a, b, d, theta = (x[name] for name in ("crank", "coupler", "fixed_link", "crank_extended"))
    direction = np.array([np.cos(theta), np.sin(theta)])
    places = (np.zeros(2), a * direction, (a + b) * direction, np.array([d, 0.0]), (a + b / 2) * direction)
    return FourBar(*places, error=x["error"])


def _drawn_on_sphere(x: dict[str, float]) -> SphericalFourBar:
    """Return the linkage in its extended limit position, O on z, and C towards x."""
    a, b, d, theta = (x[name] for name in ("crank", "coupler", "fixed_link", "crank_extended"))

    def axis(arc: float, turned: float) -> Any:
        return np.array([np.sin(arc) * np.cos(turned), np.sin(arc) * np.sin(turned), np.cos(arc)])

    return SphericalFourBar(axis(0, 0), axis(a, theta), axis(a + b, theta), axis(d, 0), error=x["error"])


def _measured(angle: Angle, linkage: DesignedLinkage) -> Iterator[tuple[str, float]]:
    lengths = linkage.lengths
    yield from lengths.items()
    extended = linkage.parameters["start"]
    a, b, c, d = lengths.values()
    folded = angle(c, d, b - a)
    run = linkage.angles([extended, extended + np.pi, folded + np.pi, 0.0, np.pi])
    rocker, transmission = linkage.output(run), linkage.transmission(run)
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


CRANK_ROCKER = LimitKind(
    "synthesis_limits", "a crank-rocker", relations.QUANTITIES, 10, relations.necessary, _random,
    partial(_derived, angle), partial(_accepts, relations.QUANTITIES), _drawn, partial(_measured, angle),
)  # fmt: skip
SPHERICAL_CRANK_ROCKER = LimitKind(
    "synthesis_spherical_limits", "a spherical crank-rocker", relations.SPHERICAL_QUANTITIES, 10,
    relations.spherical_necessary, _random_on_sphere, partial(_derived, corner), _accepts_on_sphere,
    _drawn_on_sphere, partial(_measured, corner),
)  # fmt: skip
