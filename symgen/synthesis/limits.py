"""Crank-rockers of prescribed limit positions and transmission angles."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from symgen.errors import SceneError
from symgen.mechanics.synthesis.limits import QUANTITIES
from symgen.synthesis.four_bar import FourBar
from symgen.synthesis.search import Conditions, Search, conditions, search
from symgen.synthesis.tasks import LimitTask
from symgen.synthesis.triangle import angle

Array = NDArray[np.float64]

NAMES = tuple(name for name, _, _ in QUANTITIES)
_LENGTHS = frozenset(name for name, unit, _ in QUANTITIES if unit == "m")
#: Conditions between the quantities.
CONDITIONS = 9
#: Quantities that determine the others.
GIVEN = len(NAMES) - CONDITIONS
#: Loss of rank, relative to the largest singular value.
_LOST = 1e-9


def crank_rockers(task: LimitTask) -> tuple[list[FourBar], Search]:
    """Return all crank-rockers found that have the prescribed quantities.

    Raises
    ------
    SceneError
        When the quantities are not four, or do not determine the linkage.
    """
    given = task.given()
    _check(given)
    scale = next(value for name, value in given.items() if name in _LENGTHS)
    given = {name: value / scale if name in _LENGTHS else value for name, value in given.items()}
    equations = conditions("synthesis_limits", CONDITIONS)
    fixed = np.array([name in given for name in NAMES])
    values = np.array([given.get(name, 0.0) for name in NAMES])
    generator = np.random.default_rng(task.seed)

    def residual(x: Array) -> tuple[Array, Array]:
        full = values.copy()
        full[~fixed] = x
        (r,), (slopes,) = equations(full[None])
        return r, slopes[:, ~fixed]

    samples = [_sample(generator, given) for _ in range(task.starts)]
    _check_rank(equations, fixed, samples[:3], given)
    found = search(residual, (sample[~fixed] for sample in samples))
    linkages = []
    for x in found.roots:
        full = values.copy()
        full[~fixed] = x
        if _is_one(dict(zip(NAMES, full.tolist(), strict=True))):
            linkages.append(_drawn(dict(zip(NAMES, full.tolist(), strict=True)), full, equations))
    linkages.sort(key=lambda linkage: [*linkage.lengths.values()])
    return [linkage.scaled(scale) for linkage in linkages], found


def _check(given: dict[str, float]) -> None:
    if len(given) != GIVEN:
        names = ", ".join(given) or "none"
        raise SceneError(
            f"expected {GIVEN} quantities, which determine a crank-rocker, got {len(given)}: {names}",
            hint=f"Known: {', '.join(NAMES)}.",
        )
    if not _LENGTHS & given.keys():
        raise SceneError(
            "expected at least one length, got angles alone, which leave the size of the linkage open",
            hint='Add fixed_link = "1 m" in place of an angle.',
        )
    for name, number in given.items():
        if name in _LENGTHS and not 0 < number < np.inf:
            raise SceneError(f"expected a length above zero, got {number:.6g} m", where=name)
        if name not in _LENGTHS and not 0 < number < np.pi:
            got = f"{np.degrees(number):.6g} deg"
            raise SceneError(f"expected an angle between 0 and 180 deg, got {got}", where=name)


def _sample(generator: np.random.Generator, given: dict[str, float]) -> Array:
    """Return the quantities of a random crank-rocker, of the size of the first prescribed length."""
    while True:
        a, b, c, d = np.exp(generator.uniform(np.log(0.1), np.log(2.0), 4))
        if a < min(b, c, d) and 2 * (a + max(b, c, d)) < a + b + c + d:
            break
    named = {"crank": a, "coupler": b, "rocker": c, "fixed_link": d}
    name = next(name for name in NAMES if name in _LENGTHS & given.keys())
    scale = given[name] / named[name]
    a, b, c, d = (scale * x for x in (a, b, c, d))

    out: dict[str, float] = {"crank": a, "coupler": b, "rocker": c, "fixed_link": d}
    for pose, side in (("extended", a + b), ("folded", b - a)):
        out[f"crank_{pose}"] = angle(c, side, d)
        out[f"rocker_{pose}"] = angle(side, c, d)
        out[f"transmission_{pose}"] = angle(d, side, c)
    out["swing"] = out["rocker_extended"] - out["rocker_folded"]
    out["transmission_least"], out["transmission_greatest"] = angle(d - a, b, c), angle(d + a, b, c)
    return np.array([out[name] for name in NAMES])


def _check_rank(
    equations: Conditions, fixed: NDArray[np.bool_], samples: list[Array], given: dict[str, float]
) -> None:
    """Refuse quantities that depend on each other in every crank-rocker."""
    for sample in samples:
        _, (slopes,) = equations(sample[None])
        sizes = np.linalg.svd(slopes[:, ~fixed], compute_uv=False)
        if sizes[-1] > _LOST * sizes[0]:
            return
    raise SceneError(
        f"{', '.join(given)} depend on each other and do not determine a crank-rocker",
        hint="Angles of a limit position add up to 180 deg, and the swing is the difference of the rocker's.",
    )


def _is_one(x: dict[str, float]) -> bool:
    """Return whether a root is a crank-rocker with triangles, and no mirror image with negative parts."""
    angles = [v for name, v in x.items() if name not in _LENGTHS]
    return (
        all(x[name] > 0 for name in _LENGTHS)
        and all(0 < value < np.pi for value in angles)
        and x["coupler"] > x["crank"]
    )


def _drawn(x: dict[str, float], full: Array, equations: Conditions) -> FourBar:
    """Return the linkage in its extended limit position, the ground points on the axis."""
    a, b, d, theta = (x[name] for name in ("crank", "coupler", "fixed_link", "crank_extended"))
    direction = np.array([np.cos(theta), np.sin(theta)])
    residual, _ = equations(full[None])
    places = (np.zeros(2), a * direction, (a + b) * direction, np.array([d, 0.0]), (a + b / 2) * direction)
    return FourBar(*places, error=float(np.abs(residual).max()))


def measured(linkage: FourBar) -> Iterator[tuple[str, float]]:
    """Yield the quantities of a crank-rocker, measured in poses of a run."""
    lengths = linkage.lengths
    yield from lengths.items()
    extended = float(np.arctan2(*(linkage.A - linkage.O)[::-1]))
    a, b, c, d = lengths.values()
    folded = angle(c, d, b - a)
    run = linkage.angles([extended, extended + np.pi, folded + np.pi, 0.0, np.pi])
    rocker, transmission = run["rocker.angle"].values, np.abs(run["A.B.C.angle"].values)
    yield "swing", float(abs(rocker[2] - rocker[0]))
    yield "transmission_extended", float(transmission[0])
    yield "transmission_folded", float(transmission[2])
    yield "transmission_least", float(transmission[3])
    yield "transmission_greatest", float(transmission[4])
