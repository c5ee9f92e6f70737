"""N four-bar linkages in a row: operations, code, time from file to first step, evaluation and memory over N.

Each linkage shares a crank with the next, so that 2 N + 2 coordinates have 2 N + 1 constraints and one degree
of freedom remains. Time to the first step, processor time and memory are those of a new process with an empty
cache, compilers included. Errors are those of all accelerations, against the pendulum that the row is
equivalent to.

The motion is problem A02 of M. González et al., A benchmarking system for MBS simulation software, Multibody
Syst. Dyn. 16, 2006 (http://lim.ii.udc.es/mbsbenchmark): 40 linkages with upright cranks, whose tips start at
1 m/s, for 20 s. Its error is the one defined there, over positions and velocities of the first tip at 400
steps of output; the mechanism passes positions in which it has 41 degrees of freedom. The reference is the
equivalent pendulum. Other programs, where they are installed, run it with halved steps until they are in the
class of low precision; symgen runs it by its default options. Times of these runs are processor times,
without those of building the models.
"""

from __future__ import annotations

import math
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import scipy.integrate
from harness import Case, Measurement, Required, arguments, measure, report_repeats
from numpy.typing import NDArray
from regeneration import IMPORT, best, cold
from scaling_peers import PEERS, Peer

import symgen
from symgen.runtime import _core

Array = NDArray[np.float64]

SIZES, SHORT_SIZES = (5, 10, 40, 160, 1000), (10, 40)
#: Least ratio of two N between which growth is measured: over less, an error of 3 % in a time counts as 0.04.
APART = 4
#: Bounds: growth with N between any two such sizes, time to the first step by N [s], error.
EXPONENT, FIRST_STEP, LARGEST_ERROR = 1.15, {40: 5.0, 1000: 20.0}, 1e-12
#: Mass of every link [kg], start of the cranks (1 m long) [m, rad/s], and gravity [m/s^2].
MASS, ACROSS, UP, RATE, GRAVITY = 1.0, 0.6, 0.8, -2.0, 9.81
TIMES = 2000
#: The benchmark motion: duration [s], steps of output, magnitude below which errors are absolute
#: [m, m/s], and the largest error of its class of high precision. Its cranks start upright.
DURATION, SAMPLES, THRESHOLD, OF_MOTION = 20.0, 400, 1e-3, 1e-3
UPRIGHT = (0.0, 1.0, -1.0)
#: Linkages of the comparison with peers, their largest error (of the class of low precision), and how much
#: faster symgen must be. Its time is the least of some runs.
COMPARED, OF_PEER, FASTER, RUNS = (10, 40), 1e-1, 5.0, 5
#: Columns whose growth is bounded, and whether they are times.
GROWING = {
    "operations": False,
    "code [kB]": False,
    "processor [s]": True,
    "evaluation [us]": True,
    "memory [MB]": False,
}


def main() -> int:
    """Measure, print, and return the exit code."""
    options = arguments(__doc__, short=True)
    sizes = SHORT_SIZES if options.short else SIZES
    return report_repeats(lambda: measured(sizes), options)


def measured(sizes: tuple[int, ...]) -> Measurement:
    """Measure once."""
    with tempfile.TemporaryDirectory() as folder:
        sympy = best(["-c", "import sympy"], Path(folder), 3)
        rows = [size(n, Path(folder)) for n in sizes]
        motions = {n: motion(n, Path(folder)) for n in COMPARED}
    pairs = [(a, b) for a in rows for b in rows if b["N"] >= APART * a["N"]]
    required = [
        Required(
            f"largest exponent of {column}",
            max(math.log(b[column] / a[column]) / math.log(b["N"] / a["N"]) for a, b in pairs),
            EXPONENT,
            at_least=False,
            timed=timed,
        )
        for column, timed in GROWING.items()
    ]
    slow = max(1.0, sympy.processor / IMPORT)
    required += [
        Required(
            f"processor time to the first step, N = {row['N']} [s]",
            row["processor [s]"] / slow,
            FIRST_STEP[row["N"]],
            at_least=False,
            timed=True,
        )
        for row in rows
        if row["N"] in FIRST_STEP
    ]
    wrong = max(row["relative error"] for row in rows)
    required.append(Required("relative error", wrong, LARGEST_ERROR, at_least=False))
    notes = [f"Seconds required: where SymPy is imported in {IMPORT:g} s; on a slower machine in proportion."]
    for n, (wrong, seconds) in motions.items():
        required.append(Required(f"error of the motion, N = {n}", wrong, OF_MOTION, at_least=False))
        notes.append(f"The motion of {n} linkages by default options: {seconds:.3g} s, error {wrong:.1e}.")
        for name, peer in PEERS.items():
            try:
                step, of_peer, needed = peer_motion(peer, n)
            except ImportError:
                notes.append(f"Skipped: {name} is not installed (pip install 'symgen[peers]').")
                continue
            notes.append(f"{name}, {n} linkages, steps of {step:g} s: {needed:.3g} s, error {of_peer:.1e}.")
            faster = f"{name}'s time over symgen's, N = {n}"
            required.append(Required(faster, needed / seconds, FASTER, at_least=True, timed=True))
    return Measurement("N four-bar linkages in a row", rows, required, notes)


def size(n: int, folder: Path) -> dict[str, Any]:
    """Return the row of one N."""
    file = folder / f"row_of_{n}.toml"
    file.write_text(scene(n), encoding="utf-8")
    spent = cold(["simulate", str(file), "--t-end", "1e-3", "--json"], folder, 1)
    os.environ["SYMGEN_CACHE"] = str(folder / "cache")  # of the process above
    model = symgen.build(file)
    found, start = model.accelerations(), model.initial_state()
    expected = exact(n)
    wrong = max(float(np.linalg.norm(found[point] - expected)) for point in model.description.free)
    kernel, counts = model.library.addresses["accelerations"], model.description.sizes_of("accelerations")
    state, unknowns = np.concatenate([start.q, start.u, [0.0]])[None, :], 4 * n + 3
    work = np.zeros(max(k.work_size for k in model.description.kernels) + 1)
    out = np.zeros((1, unknowns))
    times = max(1, TIMES // n)

    def evaluate() -> None:
        _core.call_repeatedly(
            kernel, counts, times, state, len(start.q), model.evaluator.parameters, work, out
        )

    evaluation = measure({"": Case(evaluate, times)}, primed=True)[""]
    return {
        "N": n,
        "operations": model.operations["accelerations"]["flops"],
        "code [kB]": sum(file.stat().st_size for file in (folder / "cache").rglob("*.c")) / 1e3,
        "first step [s]": spent.seconds,
        "processor [s]": spent.processor,
        "evaluation [us]": evaluation.best * 1e6,
        "memory [MB]": spent.memory,
        "relative error": wrong / float(np.linalg.norm(expected)),
    }


def motion(n: int, folder: Path) -> tuple[float, float]:
    """Return the error of the benchmark motion of n linkages, and the processor time of its run [s]."""
    file, times = folder / f"motion_of_{n}.toml", np.linspace(0.0, DURATION, SAMPLES + 1)
    file.write_text(scene(n, UPRIGHT, ("B0.position", "B0.velocity")), encoding="utf-8")
    model = symgen.build(file)
    seconds = math.inf
    for _ in range(RUNS):
        began = time.process_time()
        result = model.simulate(t_end=DURATION, samples=SAMPLES + 1)
        seconds = min(seconds, time.process_time() - began)
    found = np.concatenate([np.asarray(result[f"B0.{which}"]) for which in ("position", "velocity")], axis=1)
    return error_of(found, swing(n, times)), seconds


def peer_motion(program: type[Peer], n: int) -> tuple[float, float, float]:
    """Return the step [s] with which a program is in the class of low precision, its error and time [s].

    The time is NaN if that is no step.
    """
    times = np.linspace(0.0, DURATION, SAMPLES + 1)
    for step in program.STEPS:
        peer = program(n, step, UPRIGHT[2], GRAVITY)
        began = time.process_time()
        found = peer.run(times)
        seconds = time.process_time() - began
        wrong = error_of(found, swing(n, times))
        if wrong <= OF_PEER:
            return step, wrong, seconds
    return step, wrong, math.nan


def error_of(found: Array, expected: Array) -> float:
    """Return the error of a motion in the measure of the benchmark."""
    wrong = (found - expected) / np.maximum(np.abs(expected), THRESHOLD)
    return float(np.sqrt(np.mean(wrong**2)))


def swing(n: int, times: Array) -> Array:
    """Return position and velocity of the first tip in the benchmark motion (times, 4) [m, m/s]."""
    across, up, rate = UPRIGHT
    inertia, moment = pendulum(n)
    found = scipy.integrate.solve_ivp(
        lambda _, y: (y[1], -moment * GRAVITY * math.cos(y[0]) / inertia),
        (0.0, DURATION),
        (math.atan2(up, across), rate),
        "DOP853",
        times,
        rtol=1e-13,
        atol=1e-13,
    )
    angle, speed = found.y
    x, y = np.cos(angle), np.sin(angle)
    return np.stack([x, y, -speed * y, speed * x], axis=1)


def scene(
    n: int, start: tuple[float, float, float] = (ACROSS, UP, RATE), outputs: tuple[str, ...] = ()
) -> str:
    """Return the scene of N linkages with n + 1 cranks of 1 m, 1 m apart, and n couplers.

    ``start`` has the direction of the cranks and their rate [rad/s]; the last tip is recorded by default.
    """
    across, up, rate = start
    recorded = ", ".join(f'"{x}"' for x in outputs or (f"B{n}.position",))
    lines = ["symgen = 1", f'title = "{n} four-bar linkages in a row"', "[points]"]
    for k in range(n + 1):
        lines.append(f'A{k} = {{ at = ["{k} m", "0 m"], ground = true }}')
        lines.append(f'B{k} = {{ at = ["{k + across} m", "{up} m"] }}')
    lines.append("[links]")
    lines += [f'crank{k} = {{ points = ["A{k}", "B{k}"], mass = "{MASS} kg" }}' for k in range(n + 1)]
    lines += [f'coupler{k} = {{ points = ["B{k}", "B{k + 1}"], mass = "{MASS} kg" }}' for k in range(n)]
    lines += ["[gravity]", f'acceleration = ["0 m/s^2", "-{GRAVITY} m/s^2"]', "[start.velocities]"]
    lines += [f'B{k} = ["{-rate * up} m/s", "{rate * across} m/s"]' for k in range(n + 1)]
    return "\n".join([*lines, "[analysis]", f"outputs = [{recorded}]", ""])


def pendulum(n: int) -> tuple[float, float]:
    """Return moment of inertia [kg m^2] and static moment [kg m] of the equivalent pendulum."""
    return (n + 1) * MASS / 3 + n * MASS, (n + 1) * MASS / 2 + n * MASS


def exact(n: int) -> Array:
    """Return the acceleration of every moving point [m/s^2]: all cranks turn alike, couplers translate."""
    inertia, moment = pendulum(n)
    turning = -moment * GRAVITY * ACROSS / inertia
    return turning * np.array([-UP, ACROSS]) - RATE**2 * np.array([ACROSS, UP])


if __name__ == "__main__":
    sys.exit(main())
