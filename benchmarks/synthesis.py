"""Synthesis of linkages: share of random tasks that are solved, the error, and the time for each.

Each feasible task prescribes quantities of a random crank-rocker or slider-crank, which are computed by the
law of cosines, or precision points that it passes. It is solved where that linkage is among those found, and
running it on its branch finds no fault. Choices of quantities that depend on each other are left out.
Searches have their default number of starts.

Five poses that are rounded to doubles may determine the lengths to fewer digits than are asked: rounding
changes those of one random task by 1.6e-9. The expected lengths are therefore those that the rounded poses
have, by Newton's method at 40 digits.

Tasks without a solution prescribe swing, folded angle of the rocker and least transmission angle (Case I of
the thesis on kineto-elastodynamics) whose sum is 180 deg or more: the triangle of the extended position does
not exist then. Or they prescribe three angles and the fixed link that the rocker's triangles contradict. All
must be refused; ``named`` are those whose refusal gives the contradiction, in place of a number of starts.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterator
from typing import Any

import mpmath as mp
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
    for kind, tasks in KINDS.items():
        solved, errors, seconds, asked = 0, [0.0], 0.0, 0
        for task, wanted in tasks(np.random.default_rng(0), count):
            begun = time.process_time()
            try:
                designs = symgen.synthesise(task).designs
            except SceneError as error:
                if "depend on each other" in str(error) or "got angles alone" in str(error):
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
    refused, named, seconds = 0, 0, 0.0
    for task in infeasible(np.random.default_rng(0), count):
        begun = time.process_time()
        try:
            symgen.synthesise(task)
        except SceneError as error:
            refused += 1
            named += "contradict" in str(error)
        seconds += time.process_time() - begun
    rows.append(
        {"task": "no solution", "tasks": count, "solved": 0, "refused": refused, "named": named,
         "processor time for one [s]": seconds / count}
    )  # fmt: skip
    required += [
        Required("no solution: share refused", refused / count, 1.0, True),
        Required("no solution: share named", named / count, 1.0, True),
    ]
    columns = ("task", "tasks", "solved", "refused", "named", "largest error", "processor time for one [s]")
    rows = [{name: row.get(name) for name in columns} for row in rows]
    return Measurement("Synthesis of random linkages", rows, required)


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


def motion(generator: np.random.Generator, count: int) -> Iterator[tuple[dict[str, Any], tuple[float, ...]]]:
    """Yield tasks with five poses of a coupler, and the lengths that they come from."""
    for _, (a, b, c, d) in zip(range(count), crank_rockers(generator), strict=False):
        cranks = np.sort(generator.uniform(0, 2 * math.pi, 5)) * 0.5
        places, turns, joint = _coupler((a, b, c, d), cranks, generator)
        task = {"kind": "motion", "points": places, "angles": turns.tolist()}
        with mp.workdps(40):
            o, at_a, crank = _dyad(places, turns, 0j, joint, a)
            q, at_b, rocker = _dyad(places, turns, d + 0j, joint + b, c)
            expected = tuple(map(float, (crank, abs(at_b - at_a), rocker, abs(q - o))))
        yield task, expected


def _dyad(places: list[list[str]], turns: Any, ground: complex, joint: complex, length: float) -> list[Any]:
    """Return ground point, joint on the coupler [m] and length [m] of the dyad of five poses next to one."""
    x = mp.matrix([ground.real, ground.imag, joint.real, joint.imag, length])
    points = [mp.mpc(*(float(value.split()[0]) for value in place)) for place in places]
    for _ in range(4):
        rows, missed = [], []
        for point, turn in zip(points, turns.tolist(), strict=True):
            rotation = mp.expj(turn)
            to = point + rotation * mp.mpc(x[2], x[3]) - mp.mpc(x[0], x[1])
            seen = to * mp.conj(rotation)
            rows.append([-to.real, -to.imag, seen.real, seen.imag, -x[4]])
            missed.append((abs(to) ** 2 - x[4] ** 2) / 2)
        x -= mp.lu_solve(mp.matrix(rows), mp.matrix(missed))
    return [mp.mpc(x[0], x[1]), mp.mpc(x[2], x[3]), x[4]]


def path(generator: np.random.Generator, count: int) -> Iterator[tuple[dict[str, Any], tuple[float, ...]]]:
    """Yield tasks with five points of a path and both ground points, and the lengths that they come from."""
    for _, (a, b, c, d) in zip(range(count), crank_rockers(generator), strict=False):
        cranks = np.sort(generator.uniform(0, 2 * math.pi, 5))
        places, *_ = _coupler((a, b, c, d), cranks, generator)
        ground = {"ground_x": ["0 m", f"{d!r} m"], "ground_y": ["0 m", "0 m"]}
        yield {"kind": "path", "points": places, **ground}, (a, b, c, d)


def _coupler(
    lengths: tuple[float, ...], cranks: Any, generator: np.random.Generator
) -> tuple[list[list[str]], Any, complex]:
    """Return places of a random point of the coupler [m], its rotations [rad], and A from that point [m]."""
    a, b, c, d = lengths
    joint = a * np.exp(1j * cranks)
    to = d - joint
    turn = np.unwrap(np.angle(to) + [_angle(c, abs(z), b) for z in to.tolist()])
    own = b * complex(*generator.uniform(-1.0, 1.0, 2))
    place = joint + own * np.exp(1j * turn)
    places = [[f"{x!r} m", f"{y!r} m"] for x, y in zip(place.real.tolist(), place.imag.tolist(), strict=True)]
    return places, turn, -own


def slider(generator: np.random.Generator, count: int) -> Iterator[tuple[dict[str, Any], tuple[float, ...]]]:
    """Yield tasks with three quantities of a slider-crank, and the lengths that they come from."""
    for _ in range(count):
        l, share, part = generator.uniform([0.5, 0.1, 0.1], [2.0, 0.9, 0.9]).tolist()
        r, e = l * share * part, l * share * (1 - part)
        far, near = math.sqrt((l + r) ** 2 - e * e), math.sqrt((l - r) ** 2 - e * e)
        every = {
            "crank": r, "coupler": l, "offset": e, "stroke": far - near, "slider_extended": far,
            "slider_folded": near, "crank_extended": math.atan2(e, far), "crank_folded": math.atan2(e, near),
            "transmission_least": math.acos((e + r) / l), "transmission_greatest": math.acos((e - r) / l),
        }  # fmt: skip
        names = generator.choice([*every], 3, replace=False).tolist()
        angles = ("crank_extended", "crank_folded", "transmission_least", "transmission_greatest")
        values = {name: f"{every[name]!r} {'rad' if name in angles else 'm'}" for name in names}
        yield {"kind": "limits", "linkage": "slider-crank", **values}, (r, l, e)


def infeasible(generator: np.random.Generator, count: int) -> Iterator[dict[str, Any]]:
    """Yield tasks without a solution: 180 deg or more in a triangle, or angles that contradict it."""
    for i in range(count):
        if i % 2:
            swing, folded = generator.uniform([20, 20], [90, 90]).tolist()
            least = 180 - swing - folded + generator.uniform(0, 30)
            if not 0 < least < 180:
                least = 179.0
            angles = {"swing": swing, "rocker_folded": folded, "transmission_least": least}
        else:
            crank, rocker = generator.uniform([10, 30], [60, 90]).tolist()
            angles = {"crank_extended": crank, "rocker_extended": rocker}
            angles["transmission_greatest"] = generator.uniform(0.2, 1.0) * (180 - crank - rocker)
        yield {"kind": "limits", "fixed_link": "1 m", **{n: f"{x!r} deg" for n, x in angles.items()}}


KINDS = {"limits": limits, "slider-crank": slider, "function": function, "motion": motion, "path": path}


if __name__ == "__main__":
    sys.exit(main())
