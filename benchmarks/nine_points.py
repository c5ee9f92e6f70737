"""Nine-point path synthesis: real four-bars of a published problem against their published number, with time.

Problem 3 of Wampler, Morgan and Sommese, Complete solution of the nine-point path synthesis problem for
four-bar linkages (1992): 64 of the 1442 classes of solutions are real, as Hauenstein and Sottile certified
(alphaCertified, algorithm 921 of the ACM's Transactions on Mathematical Software). A class is a linkage with
its two cognates. Processor times on one core.

``--solutions FILE`` computes the solutions for complex points, from which symgen starts, and writes them: one
solution is chosen, and points are moved in loops through random complex points; each loop leads to others.
"""

from __future__ import annotations

import sys
import time
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from harness import Measurement, Required, parser_of, report_repeats

import symgen
from symgen.synthesis import nine_points

POINTS = (
    (0.25, 0.00), (0.52, 0.10), (0.80, 0.70), (1.20, 1.00), (1.40, 1.30), (1.10, 1.48), (0.70, 1.40),
    (0.20, 1.00), (0.02, 0.40),
)  # fmt: skip
#: Classes of solutions, and real ones among them.
CLASSES, REAL = 1442, 64
#: Loops without a new class after which the search ends.
STALE = 2


def main() -> int:
    """Measure, print, and return the exit code."""
    parser = parser_of(__doc__)
    parser.add_argument("--solutions", type=Path, metavar="FILE", help="compute the solutions to start from")
    options = parser.parse_args()
    if options.solutions:
        return solved(options.solutions)
    return report_repeats(measured, options)


def measured() -> Measurement:
    """Solve the published problem once."""
    task = {"kind": "path", "points": [[f"{x} m" for x in p] for p in POINTS]}
    begun = time.process_time()
    found = symgen.synthesise(task)
    seconds = time.process_time() - begun
    row = {
        "paths": found.search.starts, "lost": found.search.singular, "four-bars": len(found.designs),
        "with cognates as one": len(found.designs) / 3, "published": REAL,
        "without a fault": sum(not d.faults for d in found.designs),
        "processor time [s]": seconds,
    }  # fmt: skip
    required = [
        Required("share of the published linkages", len(found.designs) / 3 / REAL, 1.0, True),
        Required("linkages beyond the published ones", len(found.designs) / 3 - REAL, 0.0, False),
    ]
    return Measurement("Nine-point path synthesis", [row], required)


def solved(file: Path) -> int:
    """Write one solution of each class for complex points."""
    generator = np.random.default_rng(1)
    normal = partial(_normal, generator)
    x, points = _first(generator)
    stale = 0
    while stale < STALE:
        places = [points, *(np.abs(points).mean() * normal(*points.shape) for _ in range(2)), points]
        moved = x
        for here, there in pairwise(places):
            moved, lost = nine_points.follow(moved, here, there)
            moved = moved[~lost]
        both = np.concatenate([x, moved])
        known, x = len(x), both[nine_points.classes(both)]
        stale = stale + 1 if len(x) == known else 0
        print(f"{len(x)} classes, {known - len(moved)} paths lost, {time.process_time():.0f} s", flush=True)
        np.savez(file, solutions=x, points=points)
    return 0 if len(x) == CLASSES else 1


def _normal(generator: np.random.Generator, *shape: int) -> Any:
    return generator.normal(size=shape) + 1j * generator.normal(size=shape)


def _first(generator: np.random.Generator) -> tuple[Any, Any]:
    """Return one complex linkage (1, 8), and points (8, 2) that it passes at rotations of its coupler."""
    g1, h1, w1, v1, g2, h2, w2, v2 = x = _normal(generator, 8)
    turned = np.exp(2j * np.pi * generator.random(8) + 0.3 * generator.normal(size=8))
    one, two = (w1 - g1) * (v1 - h1), (w2 - g2) * (v2 - h2)
    # u and one/u reach from the ground point to the joint; the same of the other dyad is a step further.
    step, back = turned * (w2 - w1) - g2 + g1, (v2 - v1) / turned - h2 + h1
    half = step * back + one - two
    u = (-half + np.sqrt(half**2 - 4 * back * step * one)) / (2 * back)
    return x[None], np.stack([u - turned * w1 + g1, one / u - v1 / turned + h1], axis=1)


if __name__ == "__main__":
    sys.exit(main())
