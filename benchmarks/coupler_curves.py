"""Coupler curves: symgen's path synthesis against pylinkage's optimisers, at equal error.

Three problems with given ground points: five and nine points of a drawn crank-rocker, and nine points of an
arch that no four-bar has. The unknowns are the lengths of crank, coupler and rocker and the place of the
coupler's point, all within BOUNDS. The error is the same for both: the root of the mean square distance of
the points from the curve that the point traces while the crank makes a whole revolution.

symgen's time is that of `symgen.synthesise` for all linkages, with the check of each by running it; the best
of them that turns, within the bounds and without a fault, counts. Each of pylinkage's optimisers minimises
the error itself, on trajectories by its Numba solver, with its default settings. It is begun again with
other random numbers when it ends, and is stopped as soon as it reaches symgen's error, or after PATIENCE
times symgen's time; when its error falls below 0.1 % of the fixed link is listed, too. Processor times,
without compilation by Numba and without symgen's first call, which loads its model. The quickest optimiser
counts. The track of an error has POSES places, and chords between them.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from functools import partial
from itertools import count
from typing import Any

import numpy as np
from harness import Measurement, Required, arguments, report_repeats

import symgen

#: Least and greatest crank, coupler, rocker, distance AP [m], and angle from AB to AP [rad].
BOUNDS = ([0.05, 0.05, 0.05, 0.05, -math.pi], [4.0, 4.0, 4.0, 4.0, math.pi])
#: Poses of a revolution, a small error [m], ratio of times, the most tried, and symgen's starts.
POSES, SMALL, FASTER, PATIENCE, STARTS = 181, 1e-3, 20.0, 60.0, 30


def main() -> int:
    """Measure, print, and return the exit code."""
    options = arguments(__doc__)
    return report_repeats(measured, options)


def problems() -> dict[str, Any]:
    """Return the points (n, 2) of each problem [m]; the ground points are (0, 0) and (1, 0)."""
    cranks = np.linspace(0.3, 5.6, 9)
    own = np.array([0.4, 1.1, 0.9, math.hypot(0.3, 0.5), math.atan2(0.5, 0.3)])
    drawn = curve(own, cranks)
    arch = np.column_stack([np.linspace(0.1, 0.9, 9), 0.9 + 0.3 * np.sin(np.linspace(0, np.pi, 9))])
    return {"five of a curve": drawn[:5], "nine of a curve": drawn, "an arch": arch}


def curve(x: Any, cranks: Any) -> Any:
    """Return the coupler's point (n, 2) [m] with B to the left of AC; nan where there is no pose."""
    a, b, c, far, angle = x
    joint = a * np.exp(1j * cranks)
    to = 1 - joint
    e = np.abs(to)
    along = (e**2 + b**2 - c**2) / (2 * e)
    with np.errstate(invalid="ignore"):
        end = joint + (along + 1j * np.sqrt(b**2 - along**2)) * to / e
    point = joint + far * np.exp(1j * angle) * (end - joint) / b
    return np.column_stack([point.real, point.imag])


def missed(track: Any, points: Any) -> float:
    """Return the root of the mean square distance of points from a closed track (n, 2) [m]."""
    sides = np.roll(track, -1, axis=0) - track
    to = points[:, None] - track
    along = np.clip((to * sides).sum(2) / np.maximum((sides**2).sum(1), 1e-300), 0.0, 1.0)
    gaps = ((to - along[:, :, None] * sides) ** 2).sum(2).min(1)
    return float(np.sqrt(gaps.mean()))


def measured() -> Measurement:
    """Solve every problem by both once."""
    points = problems()
    solved(points["five of a curve"])  # loads the model
    rows, required, notes = [], [], []
    try:
        optimisers = peers()
    except ImportError:
        optimisers = {}
        notes = ["pylinkage is not installed (pip install pylinkage numba)."]
    for name, given in points.items():
        error, seconds = solved(given)
        rows.append(
            {"problem": name, "by": "symgen", "error [m]": error, "processor time [s]": seconds,
             "to 0.1 % [s]": seconds if error <= SMALL else None}
        )  # fmt: skip
        quickest = math.inf
        for how, optimiser in optimisers.items():
            reached, taken, small = optimiser(given, error, PATIENCE * seconds)
            quickest = min(quickest, taken)
            rows.append(
                {"problem": name, "by": how, "error [m]": reached, "processor time [s]": taken,
                 "to 0.1 % [s]": small}
            )  # fmt: skip
        if optimisers:
            line = f"{name}: time of the quickest over symgen's"
            required.append(Required(line, quickest / seconds, FASTER, True, timed=True))
    return Measurement("Coupler curves on given ground points", rows, required, notes)


def solved(points: Any) -> tuple[float, float]:
    """Return error [m] and processor time [s] of symgen."""
    begun = time.process_time()
    designs = symgen.synthesise(
        {"kind": "path", "points": [[f"{float(x)!r} m" for x in p] for p in points], "starts": STARTS,
         "ground_x": ["0 m", "1 m"], "ground_y": ["0 m", "0 m"]}
    ).designs  # fmt: skip
    seconds = time.process_time() - begun
    errors = [math.inf]
    for design in designs:
        k = design.linkage
        if not k.turns or design.faults:
            continue
        a, b, c, _ = k.lengths.values()
        to, arm = (complex(*(getattr(k, name) - k.A)) for name in "BP")
        x = np.array([a, b, c, abs(arm), np.angle(arm / to)])
        if (x >= BOUNDS[0]).all() and (x <= BOUNDS[1]).all():
            side = np.cross([*(k.C - k.A), 0], [*(k.B - k.A), 0])[2]
            mirror = 1.0 if side > 0 else -1.0
            track = curve(x * [1, 1, 1, 1, mirror], np.linspace(0, 2 * np.pi, POSES)[:-1])
            errors.append(missed(track * [1.0, mirror], points))
    return min(errors), seconds


class Reached(Exception):
    """An optimiser has reached the error."""


def peers() -> dict[str, Callable[[Any, float, float], tuple[float, float, float | None]]]:
    """Return pylinkage's optimisers; each returns its least error [m], its time, and that to SMALL [s]."""
    from pylinkage import Crank, FixedDyad, Ground, Linkage, RRRDyad
    from pylinkage import optimization as by
    from pylinkage.bridge.solver_conversion import linkage_to_solver_data
    from pylinkage.population._batch_sim import simulate_batch

    o, c = Ground(0.0, 0.0, name="O"), Ground(1.0, 0.0, name="C")
    a = Crank(anchor=o, radius=0.5, angular_velocity=2 * np.pi / (POSES - 1), name="A")
    b = RRRDyad(anchor1=a.output, anchor2=c, distance1=1.0, distance2=1.0, name="B")
    p = FixedDyad(anchor1=a.output, anchor2=b, distance=0.5, angle=0.5, name="P")
    linkage = Linkage([o, c, a, b, p])
    template = linkage_to_solver_data(linkage)
    start = np.array(linkage.get_coords(), dtype=float)[None]

    def error(points: Any, x: Any) -> float:
        track = simulate_batch(template, np.array([x]), start, POSES - 1)[0, :, -1]
        return missed(track, points) if np.isfinite(track).all() else math.inf

    def run(
        optimiser: Callable[..., Any], points: Any, target: float, most: float
    ) -> tuple[float, float, float | None]:
        least, begun, small = math.inf, time.process_time(), None

        def score(_linkage: Any, x: Any, _places: Any) -> float:
            nonlocal least, small
            now = error(points, x)
            least = min(least, now)
            taken = time.process_time() - begun
            if least <= SMALL and small is None:
                small = taken
            if least <= target or taken > most:
                raise Reached
            return now

        for seed in count():
            try:
                optimiser(seed, score, linkage, order_relation=min, verbose=False)
            except Reached:
                break
        return least, time.process_time() - begun, small

    def swarm(seed: int, *given: Any, **named: Any) -> Any:
        return by.particle_swarm_optimization(*given, bounds=BOUNDS, **named)  # it takes no seed

    def evolution(seed: int, *given: Any, **named: Any) -> Any:
        return by.differential_evolution_optimization(*given, bounds=BOUNDS, seed=seed, **named)

    def annealing(seed: int, *given: Any, **named: Any) -> Any:
        return by.dual_annealing_optimization(*given, bounds=BOUNDS, seed=seed, **named)

    def chain(seed: int, score: Any, linkage: Any, **named: Any) -> Any:
        stages = [
            (by.differential_evolution_optimization, {"bounds": BOUNDS, "seed": seed}),
            (by.minimize_linkage, {"method": "Nelder-Mead"}),
        ]
        return by.chain_optimizers(score, linkage, stages, **named)

    error(np.zeros((1, 2)), [0.5, 1.0, 1.0, 0.5, 0.5])  # compiles
    every = {
        "particle swarm": swarm,
        "differential evolution": evolution,
        "dual annealing": annealing,
        "evolution, then Nelder-Mead": chain,
    }
    return {f"pylinkage, {how}": partial(run, optimiser) for how, optimiser in every.items()}


if __name__ == "__main__":
    sys.exit(main())
