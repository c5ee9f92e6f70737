"""Synthesis of four-bars: share of random tasks that are solved, the error, and the time for each.

Each task prescribes four quantities of a random crank-rocker, which are computed by the law of cosines, or
precision points that it passes. It is solved where that crank-rocker is among the linkages found, and
running it on its branch finds no fault.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from harness import Measurement, Required, arguments, report_repeats

import symgen
from symgen.errors import SceneError

TASKS, SHARE, LARGEST_ERROR = 200, 0.97, 1e-9
_LENGTHS = ("crank", "coupler", "rocker", "fixed_link")


def main() -> int:
    """Measure, print, and return the exit code."""
    options = arguments(__doc__, short=True)
    count = TASKS // 10 if options.short else TASKS
    return report_repeats(lambda: measured(count), options)


def measured(count: int) -> Measurement:
    """Solve tasks of every kind once."""
    rows, required = [], []
    for kind, tasks in (("limits", limits), ("function", function)):
        solved, errors, seconds, asked = 0, [0.0], 0.0, 0
        for task, wanted in tasks(np.random.default_rng(0), count):
            begun = time.process_time()
            try:
                designs = symgen.synthesise(task).designs
            except SceneError as error:
                if "depend on each other" in str(error):
                    continue
                designs = ()
            seconds += time.process_time() - begun
            asked += 1
            found = [_error(d, wanted) for d in designs]
            if found and min(found) < 1e-6:
                solved += 1
                errors.append(min(found))
        rows.append(
            {"task": kind, "tasks": asked, "solved": solved, "largest error": max(errors),
             "processor time for one [s]": seconds / asked}
        )  # fmt: skip
        required += [
            Required(f"{kind}: share solved", solved / asked, SHARE, True),
            Required(f"{kind}: relative error of the lengths", max(errors), LARGEST_ERROR, False),
        ]
    return Measurement("Synthesis of random four-bars", rows, required)


def _error(design: Any, wanted: tuple[float, ...]) -> float:
    lengths = np.array([*design.linkage.lengths.values()])
    return math.inf if design.faults else float(np.abs(lengths / wanted - 1).max())


def crank_rockers(generator: np.random.Generator) -> Iterator[tuple[float, ...]]:
    """Yield lengths of crank-rockers with transmission angles between 20 and 160 deg."""
    while True:
        a, b, c, d = generator.uniform(0.2, 2.0, 4).tolist()
        if a < min(b, c, d) and 2 * (a + max(b, c, d)) < a + b + c + d:
            ends = [_angle(d - a, b, c), _angle(d + a, b, c)]
            if ends[0] > math.radians(20) and ends[1] < math.radians(160):
                yield a, b, c, d


def _angle(far: float, p: float, q: float) -> float:
    return math.acos((p * p + q * q - far * far) / (2 * p * q))


def limits(generator: np.random.Generator, count: int) -> Iterator[tuple[dict[str, Any], tuple[float, ...]]]:
    """Yield tasks with a length and three other quantities, and the lengths that they come from."""
    for _, (a, b, c, d) in zip(range(count), crank_rockers(generator), strict=False):
        every = dict(zip(_LENGTHS, (a, b, c, d), strict=True))
        for pose, side in (("extended", a + b), ("folded", b - a)):
            every[f"crank_{pose}"] = _angle(c, side, d)
            every[f"rocker_{pose}"] = _angle(side, c, d)
            every[f"transmission_{pose}"] = _angle(d, side, c)
        every["swing"] = every["rocker_extended"] - every["rocker_folded"]
        every["transmission_least"], every["transmission_greatest"] = _angle(d - a, b, c), _angle(d + a, b, c)
        first = _LENGTHS[int(generator.integers(4))]
        others = [name for name in every if name != first]
        names = [first, *generator.choice(others, 3, replace=False).tolist()]
        values = {name: f"{every[name]!r} {'m' if name in _LENGTHS else 'rad'}" for name in names}
        yield {"kind": "limits", **values}, (a, b, c, d)


def function(
    generator: np.random.Generator, count: int
) -> Iterator[tuple[dict[str, Any], tuple[float, ...]]]:
    """Yield tasks with five pairs of rotations, and the lengths that they come from."""
    for _, (a, b, c, d) in zip(range(count), crank_rockers(generator), strict=False):
        cranks = np.sort(generator.uniform(0, 2 * math.pi, 5)) * 0.5
        joint = a * np.exp(1j * cranks)
        to = d - joint
        turn = [_angle(b, abs(z), c) for z in to.tolist()]
        rockers = np.unwrap(np.angle(-to) - turn)
        task = {"kind": "function", "fixed_link": f"{d!r} m", "input": (cranks - cranks[0]).tolist(),
                "output": (rockers - rockers[0]).tolist()}  # fmt: skip
        yield task, (a, b, c, d)


if __name__ == "__main__":
    sys.exit(main())
