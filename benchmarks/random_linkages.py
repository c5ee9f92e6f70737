"""Random driven linkages of the plane: compiled steps in lanes against the curve by arc length.

``python benchmarks/random_linkages.py`` draws the lengths of four-bars, slider-cranks and six-bars, these
with two dyads or a triad, drawn in both branches of the dyads. ``model.kinematics_many`` follows them in
SIMD lanes, and the solution curve by pseudo-arc-length, which takes other steps from the same start, one
by one. Positions must agree to 1e-11 of the size of the linkage, and both must reach the same angles of
the crank. Dead centres of four-bars and slider-cranks must be where their circles touch. Linkages that do
not close at the start are counted as refused; more than 10,000 close. Equal values of ``--seed`` give
equal linkages.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Any
from unittest.mock import patch

import numpy as np
from harness import Measurement, Required, parser_of, report_repeats
from linkages import meeting
from numpy.typing import NDArray

import symgen
from symgen.errors import InitialStateError
from symgen.runtime.rods import kinematics

Array = NDArray[np.float64]

#: Angle of the crank at the start [rad], the range and number of its values, and linkages of a task.
FIRST, RANGE, VALUES, SHARE = 0.4, 1.5, 6, 50
#: Lengths of linkages with one and with two loops vary by these parts of those that are drawn.
SPREADS = (0.6, 0.25)
#: Largest differences of positions, over the size of the linkage, and of the angle at a dead centre [rad].
APART, DEAD_APART = 1e-11, 1e-9
_CRANK = 0.2 * np.array([np.cos(FIRST), np.sin(FIRST)])


def four_bar(side: float) -> symgen.Scene:
    """Return a four-bar OABC, B on one side of AC."""
    b = meeting(_CRANK, np.array([0.6, 0.0]), 0.5, 0.45, side)
    return _scene({"A": _CRANK, "B": b}, {"C": ("d", "0 m")}, {"OA": "a", "AB": "b", "CB": "c"}, "abcd")


def slider_crank(side: float) -> symgen.Scene:
    """Return a slider-crank whose slider B is before or behind the crank, at the height d."""
    b = np.array([_CRANK[0] + side * np.sqrt(0.5**2 - (_CRANK[1] - 0.05) ** 2), 0.05])
    ground = {"R": ("-2 m", "h"), "S": ("2 m", "h")}
    links = {"OA": "a", "AB": "b", "RS": ""}
    return _scene({"A": _CRANK, "B": b}, ground, links, "abh", guides=[{"points": ["B"], "along": "RS"}])


def watt(first: float, second: float) -> symgen.Scene:
    """Return a six-bar: a dyad EG on the coupler point E of a four-bar OABC."""
    b = meeting(_CRANK, np.array([0.6, 0.0]), 0.5, 0.45, first)
    e = meeting(_CRANK, b, 0.35, 0.3)
    g = meeting(e, np.array([0.9, 0.5]), 0.5, 0.55, second)
    links = {"OA": "a", "AB": "b", "CB": "c", "AE": "e", "BE": "f", "EG": "g", "HG": "i"}
    ground = {"C": ("d", "0 m"), "H": ("0.9 m", "0.5 m")}
    return _scene({"A": _CRANK, "B": b, "E": e, "G": g}, ground, links, "abcdefgi")


def stephenson() -> symgen.Scene:
    """Return a six-bar: a triad, the ternary link BEG on links to A and to the ground."""
    b, e, g = np.array([0.5, 0.35]), np.array([0.75, 0.55]), np.array([0.45, 0.7])
    links = {"OA": "a", "AB": "b", "BE": "e", "EG": "f", "BG": "g", "CE": "c", "HG": "i"}
    ground = {"C": ("d", "0 m"), "H": ("0.1 m", "0.5 m")}
    return _scene({"A": _CRANK, "B": b, "E": e, "G": g}, ground, links, "abcdefgi")


FAMILIES: Mapping[str, Any] = {
    "four-bar": partial(four_bar, 1.0),
    "four-bar, other branch": partial(four_bar, -1.0),
    "slider-crank": partial(slider_crank, 1.0),
    "slider-crank, other branch": partial(slider_crank, -1.0),
    **{f"six-bar of dyads, {s:+.0f} {r:+.0f}": partial(watt, s, r) for s in (1.0, -1.0) for r in (1.0, -1.0)},
    "six-bar with a triad": stephenson,
}


def _scene(
    free: Mapping[str, Array],
    ground: Mapping[str, tuple[str, str]],
    links: Mapping[str, str],
    names: str,
    guides: Sequence[Mapping[str, Any]] = (),
) -> symgen.Scene:
    """Return a scene that is driven at OA from where it is drawn, with tunable lengths ``names``."""
    known = {"d": 0.6, "h": 0.05}
    places = {**free, "O": np.zeros(2), "C": np.array([0.6, 0.0])}
    fixed = {name: at for name, at in ground.items() if all(x.endswith(" m") for x in at)}
    places |= {name: np.array([float(x.split()[0]) for x in at]) for name, at in fixed.items()}
    for ends, name in links.items():
        if name:
            known[name] = float(np.linalg.norm(places[ends[0]] - places[ends[1]]))
    return symgen.Scene(
        parameters={"w": "1 rad/s", **{n: {"value": f"{known[n]!r} m", "tunable": True} for n in names}},
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True},
            **{name: {"at": list(at), "ground": True} for name, at in ground.items()},
            **{name: {"at": [f"{float(x)!r} m" for x in at]} for name, at in free.items()},
        },
        links={
            ends: {"points": list(ends), **({"length": name} if name else {})} for ends, name in links.items()
        },
        guides=list(guides),
        drivers=[{"link": "OA", "angle": f"{FIRST!r} + w*t"}],
        analysis={"kind": "kinematics", "t_end": f"{RANGE!r} s"},
    )


def share(family: str, count: int, seed: int) -> dict[str, float]:
    """Compare some linkages of a family; return counts, and the largest differences."""
    model = symgen.build(FAMILIES[family]())
    random = np.random.default_rng([seed, list(FAMILIES).index(family)])
    spread = SPREADS[family.startswith("six-bar")]
    lengths = {n: x * random.uniform(1 - spread, 1 + spread, count) for n, x in model.parameters.items()}
    options = {"start": 0.0, "stop": RANGE, "samples": VALUES}
    points = [p for p in model.description.points if p in "ABEG"]
    found = {
        "linkages": count,
        "refused": 0,
        "dead centres": 0,
        "apart": 0.0,
        "missed": 0,
        "dead centre apart": 0.0,
    }
    runs = model.kinematics_many(lengths, threads=1, of=points, **options)
    for i in range(count):
        one = model.with_parameters(**{n: x[i] for n, x in lengths.items()})
        with patch.object(kinematics, "along_branch", lambda *given: None):
            try:
                curve = one.kinematics(of=points, **options)
            except InitialStateError:
                found["refused"] += 1
                found["missed"] += not runs["error"].values[i]
                continue
        size = max(x[i] for x in lengths.values())
        reached = np.isfinite(runs["A.position"].values[i, :, 0])
        if not np.array_equal(runs["time"].values[reached], curve.time):
            found["missed"] += 1
            continue
        for p in points:
            apart = runs[f"{p}.position"].values[i, reached] - curve[f"{p}.position"].values
            found["missed"] += not np.isfinite(apart).all()
            found["apart"] = max(found["apart"], float(np.max(np.abs(apart), initial=0.0)) / size)
        for pose in curve.dead_centres:
            found["dead centres"] += 1
            gap = _touching(family, {n: float(x[i]) for n, x in lengths.items()}, FIRST + pose.t)
            found["dead centre apart"] = max(found["dead centre apart"], gap)
    return found


def _touching(family: str, x: Mapping[str, float], angle: float) -> float:
    """Return the distance of an angle from one in which the circles of a dyad touch [rad]; 0 for six-bars."""
    a, b = x["a"], x["b"]
    if family.startswith("four-bar"):
        cosines = [(a**2 + x["d"] ** 2 - r**2) / (2 * a * x["d"]) for r in (b + x["c"], b - x["c"])]
        angles = [s * np.arccos(c) for c in cosines if abs(c) <= 1 for s in (1, -1)]
    elif family.startswith("slider-crank"):
        sines = [(x["h"] + s * b) / a for s in (1, -1)]
        angles = [y for s in sines if abs(s) <= 1 for y in (np.arcsin(s), np.pi - np.arcsin(s))]
    else:
        return 0.0
    return min((abs(float((angle - y + np.pi) % (2 * np.pi) - np.pi)) for y in angles), default=np.inf)


def measured(count: int, seed: int, processes: int) -> Measurement:
    """Compare so many linkages, distributed over the families."""
    tasks = [
        (family, min(SHARE, own - first), seed + first)
        for k, family in enumerate(FAMILIES)
        for own in [count // len(FAMILIES) + (k < count % len(FAMILIES))]
        for first in range(0, own, SHARE)
    ]
    with ProcessPoolExecutor(processes) as pool:
        parts = list(zip((t[0] for t in tasks), pool.map(share, *zip(*tasks, strict=True)), strict=True))
    rows = []
    for family in FAMILIES:
        own = [part for name, part in parts if name == family]
        if own:
            total = {key: (max if "apart" in key else sum)(part[key] for part in own) for key in own[0]}
            rows.append({"family": family, **total})
    closed = sum(r["linkages"] - r["refused"] for r in rows)
    required = [
        Required(
            f"{closed} linkages that close: positions apart, over the size",
            max(r["apart"] for r in rows),
            APART,
            False,
        ),
        Required(
            "dead centres from where circles touch [rad]",
            max(r["dead centre apart"] for r in rows),
            DEAD_APART,
            False,
        ),
        Required("linkages reached farther by one of the methods", sum(r["missed"] for r in rows), 0, False),
        Required("dead centres met", sum(r["dead centres"] for r in rows), 1 if count > 50 else 0, True),
    ]
    return Measurement("Random linkages against the curve by arc length", rows, required)


def main() -> int:
    """Compare, print, and return the exit code."""
    parser = parser_of(__doc__)
    parser.add_argument("--count", type=int, default=11_600, help="linkages of all families together")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first linkage")
    parser.add_argument("--processes", type=int, default=os.cpu_count(), help="number of processes")
    chosen = parser.parse_args()
    run = partial(measured, chosen.count, chosen.seed, chosen.processes)
    return report_repeats(run, chosen)


if __name__ == "__main__":
    sys.exit(main())
