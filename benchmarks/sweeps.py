"""Sweeps: peaks of joint forces of many variants, against vectorised NumPy.

The variants of ``crank_rocker`` have other lengths of all links; every one is followed over a revolution. The
same peaks are computed by NumPy from equations that SymPy derives here on its own and prints by ``lambdify``:
the closure by Newton's method from angle to angle, velocities and accelerations, and nine balances for the
joint forces and the torque, all vectorised over the variants. Processor times are compared per pose.

Two processes carry out a list of many more variants at few poses: memory must not grow with their number.
"""

from __future__ import annotations

import resource
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np
import sympy as sp
from harness import Measurement, Required, parser_of, report_repeats

import symgen
from symgen.runtime.sweeps.designs import Uniform
from symgen.scene.loading import SHIPPED, read_scene

RUNS, POSES, BY_NUMPY, BY_ONE = 100_000, 361, 1000, 20 * 1024
#: Runs of a list that two processes carry out, and their poses.
MANY, FEW = 400_000, 3
#: Lengths of crank, coupler and rocker [m], and of the frame.
LENGTHS = {"a": (0.09, 0.11), "b": (0.34, 0.36), "c": (0.29, 0.31)}
BASE, DENSITY, GRAVITY, SPEED = 0.4, 1.0, 9.81, 2 * np.pi
OUTPUTS = ["crank.torque", "crank.O.force", "crank.A.force", "coupler.B.force", "rocker.C.force"]
#: Wall time of all on two processors [s], memory [MiB], time of NumPy for ours, error over the largest peak.
MOST_WALL, MOST_MEMORY, FASTER, LARGEST_ERROR = 60.0, 1024.0, 20.0, 1e-9
#: Rounds of times of one thread and of NumPy, which alternate.
ROUNDS = 3


def main() -> int:
    """Measure, print, and return the exit code."""
    parser = parser_of(__doc__)
    parser.add_argument("--slack", type=float, default=1.0, help="divide the required ratio of times by this")
    options = parser.parse_args()
    return report_repeats(partial(measured, options.slack), options)


def _model() -> symgen.Model:
    data = dict(read_scene(SHIPPED / "crank_rocker.toml").data)
    values = {"a": "10 cm", "b": "35 cm", "c": "30 cm"}
    tunable = {name: {"value": value, "tunable": True} for name, value in values.items()}
    data["parameters"] = {**data["parameters"], **tunable}
    links = zip(data["links"].items(), values, strict=True)
    data["links"] = {link: {**table, "length": name} for (link, table), name in links}
    return symgen.build(symgen.Scene(**data))


def sweep(
    file: Path | None,
    runs: int,
    threads: int | None = None,
    chunk: int | None = None,
    executor: Any = None,
    samples: int = POSES,
    listed: bool = False,
) -> Any:
    """Return the peaks of a sweep of the lengths, random ones or a list of as many."""
    of: dict[str, Any] = {name: Uniform(*bounds) for name, bounds in LENGTHS.items()}
    if listed:
        of = {name: np.linspace(*bounds, runs) for name, bounds in LENGTHS.items()}
    return _model().sweep(
        of,
        "inverse_dynamics",
        sampling="list" if listed else "random",
        count=None if listed else runs,
        outputs=OUTPUTS,
        samples=samples,
        file=file,
        chunk=chunk,
        threads=threads,
        executor=executor,
    )


def measured(slack: float) -> Measurement:
    """Measure once."""
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        sweep(None, 8, 1)  # kernels are compiled
        began, busy = perf_counter(), process_time()
        found = sweep(folder / "all.zarr", RUNS, 2)
        wall, busy = perf_counter() - began, process_time() - busy
        rows.append(_row("sweep, two threads", RUNS, POSES, wall, busy))
        lengths = [found[name].values[:BY_NUMPY] for name in LENGTHS]
        reference, times = Reference(), []
        for _ in range(ROUNDS):
            alone = _timed(lambda: sweep(None, BY_ONE, 1, 1024))  # the chunks of the large sweep
            of_numpy = _timed(lambda: reference.peaks(*lengths))
            times.append((alone, of_numpy))
        (wall_one, alone), (wall_numpy, of_numpy) = (
            map(min, zip(*of_one, strict=True)) for of_one in zip(*times, strict=True)
        )
        rows.append(_row("sweep, one thread", BY_ONE, POSES, wall_one, alone))
        rows.append(_row("NumPy, lambdify", BY_NUMPY, POSES, wall_numpy, of_numpy))
        peaks = reference.peaks(*lengths)
        failed = sum(map(bool, found["error"].values))
        errors = [
            np.max(np.abs(found[f"{output}.peak"].values[:BY_NUMPY] - peak)) / np.max(peak)
            for output, peak in zip(OUTPUTS, peaks, strict=True)
        ]
        began, busy = perf_counter(), process_time()
        sweep(folder / "many.zarr", MANY, executor=2, samples=FEW, listed=True)
        wall_many, busy = perf_counter() - began, process_time() - busy
        rows.append(_row("list by two processes, here", MANY, FEW, wall_many, busy))
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        of_workers = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    ratio = (of_numpy / BY_NUMPY) / (alone / BY_ONE)
    required = [
        Required(
            f"{RUNS} variants at {POSES} poses, peaks: wall time [s]", wall, MOST_WALL * slack, False, True
        ),
        Required("memory [MiB]", memory, MOST_MEMORY, False),
        Required(f"memory of a process for a list of {MANY} [MiB]", of_workers, MOST_MEMORY, False),
        Required("processor time of NumPy for that of the sweep", ratio, FASTER / slack, True, True),
        Required("error of the peaks over the largest", float(max(errors)), LARGEST_ERROR, False),
        Required("failed runs", float(failed), 0.0, False),
    ]
    return Measurement("Sweeps", rows, required, [])


def _timed(task: Callable[[], Any]) -> tuple[float, float]:
    """Return the wall time and the processor time of a task [s]."""
    began, busy = perf_counter(), process_time()
    task()
    return perf_counter() - began, process_time() - busy


def _row(what: str, runs: int, poses: int, wall: float, busy: float) -> dict[str, Any]:
    each = busy / (runs * poses) * 1e6
    return {"runs": what, "variants": runs, "wall [s]": wall, "processor [s]": busy, "per pose [us]": each}


class Reference:
    """Joint forces of the crank-rocker by balances of its links, derived here and printed by ``lambdify``."""

    def __init__(self) -> None:
        a, b, c, w, t = sp.symbols("a b c w t")
        angles = [w * t, *(f(t) for f in sp.symbols("f g", cls=sp.Function))]
        units = [sp.Matrix([sp.cos(x), sp.sin(x)]) for x in angles]
        closure = a * units[0] + b * units[1] - c * units[2] - sp.Matrix([BASE, 0])
        starts = [sp.zeros(2, 1), a * units[0], sp.Matrix([BASE, 0])]
        centres = [s + length * u / 2 for s, length, u in zip(starts, (a, b, c), units, strict=True)]
        # Forces on the crank at O, on the coupler at A and B, on the rocker at C, and the driving torque.
        unknowns = sp.symbols("ox oy ax ay bx by cx cy torque")
        o, at_a, at_b, at_c = (sp.Matrix(unknowns[i : i + 2]) for i in (0, 2, 4, 6))
        ends = [(o, -at_a), (at_a, at_b), (at_c, -at_b)]
        balances: list[sp.Expr] = []
        for i, (length, unit, centre, (first, second)) in enumerate(
            zip((a, b, c), units, centres, ends, strict=True)
        ):
            mass, half = DENSITY * length, length * unit / 2
            weight = sp.Matrix([0, -mass * GRAVITY])
            balances += list(first + second + weight - mass * sp.diff(centre, t, 2))
            moment = half[0] * (second - first)[1] - half[1] * (second - first)[0]
            applied = unknowns[8] if i == 0 else 0
            balances.append(moment + applied - mass * length**2 / 12 * sp.diff(angles[i], t, 2))
        names = sp.symbols("x1 x2 x3 v2 v3 a2 a3")
        f, g = angles[1:]
        exchange = [
            *zip((sp.diff(f, t, 2), sp.diff(g, t, 2)), names[5:], strict=True),
            *zip((sp.diff(f, t), sp.diff(g, t)), names[3:5], strict=True),
            *zip((f, g), names[1:3], strict=True),
            (w * t, names[0]),
        ]
        slopes = closure.jacobian([f, g])

        def printed(expression: Any, *further: sp.Symbol) -> Any:
            return sp.lambdify((a, b, c, w, *further), [e.subs(exchange) for e in expression], cse=True)

        self.closure = printed([*closure, *slopes], *names[:3])
        rate = sp.diff(closure, t).subs({sp.diff(f, t): 0, sp.diff(g, t): 0})
        self.rates = printed(rate, *names[:3])
        second = sp.diff(closure, t, 2).subs({sp.diff(f, t, 2): 0, sp.diff(g, t, 2): 0})
        self.seconds = printed(second, *names[:5])
        matrix, right = sp.linear_eq_to_matrix(balances, unknowns)
        self.balances = printed([*matrix, *right], *names)

    def peaks(self, a: Any, b: Any, c: Any) -> list[Any]:
        """Return the largest torque [N m] and joint forces [N] over a revolution, (variants,) each."""
        w, count = np.full_like(a, SPEED), len(a)
        far = (
            BASE - a
        )  # the distance of the coupler's ends at the start, and the angles of the triangle there
        x = np.stack([np.arccos((b**2 + far**2 - c**2) / (2 * b * far)), np.zeros(count)], axis=1)
        x[:, 1] = np.pi - np.arccos((c**2 + far**2 - b**2) / (2 * c * far))
        found = [np.zeros(count) for _ in OUTPUTS]
        for angle in np.linspace(0.0, 2 * np.pi, POSES):
            crank = np.full(count, angle)
            for _ in range(4):
                values = self._stacked(self.closure(a, b, c, w, crank, *x.T), count)
                slopes = values[:, 2:].reshape(count, 2, 2)
                step = np.linalg.solve(slopes, values[:, :2, None])[..., 0]
                x = x - step
                if np.max(np.abs(step)) < 1e-9:
                    break
            rate = -np.linalg.solve(
                slopes, self._stacked(self.rates(a, b, c, w, crank, *x.T), count)[..., None]
            )
            bent = self._stacked(self.seconds(a, b, c, w, crank, *x.T, *rate[..., 0].T), count)
            second = -np.linalg.solve(slopes, bent[..., None])
            values = self._stacked(
                self.balances(a, b, c, w, crank, *x.T, *rate[..., 0].T, *second[..., 0].T), count
            )
            matrix = values[:, :81].reshape(count, 9, 9)
            forces = np.linalg.solve(matrix, values[:, 81:, None])[..., 0]
            sizes = [np.abs(forces[:, 8]), *(np.hypot(forces[:, i], forces[:, i + 1]) for i in (0, 2, 4, 6))]
            found = [np.maximum(old, new) for old, new in zip(found, sizes, strict=True)]
        return found

    @staticmethod
    def _stacked(values: Any, count: int) -> Any:
        return np.stack([np.broadcast_to(v, count) for v in values], axis=1)


if __name__ == "__main__":
    sys.exit(main())
