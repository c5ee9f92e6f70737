"""Batch evaluations in float32 against float64: states per second and error.

Accelerations and multipliers of many random states in a single thread, by ``model.batch``, with SIMD vectors
of full width (``vector="native"``). NumPy arrays hold one state per row and are contiguous by columns, so a
vector register loads the values of neighbouring states at once. The scalar float64 kernel, called in a
compiled loop, is included for comparison.

Errors of a sample of the states are measured against the same program with 40 digits (backend mpmath), with
the float32 values as inputs, relative to the largest acceleration or multiplier of the state.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from harness import Case, Measurement, Required, arguments, measure, report_repeats
from numpy.typing import NDArray

import symgen
from symgen.runtime import _core

Rows = NDArray[Any]

SCENES = ("triple_pendulum", "peaucellier")
#: Not a power of two, for which columns would share cache sets; all arrays fit the second-level cache.
STATES, CALLS, JUDGED, SEED = 16_448, 4, 64, 6
SHIFT, SPEED = 0.05, 0.3  # relative to the largest coordinate; m/s
TYPES = ("float32", "float64")
RATIO = 1.5


def main() -> int:
    """Measure, print, and return the exit code."""
    options = arguments(__doc__, slack=True)
    if symgen.build(SCENES[0]).backend != "c":
        print("this benchmark needs compiled kernels: install a C compiler", file=sys.stderr)
        return 1
    return report_repeats(partial(measured, options.slack), options)


def measured(slack: float) -> Measurement:
    """Measure once."""
    rows, required = [], []
    for scene in SCENES:
        found, ratio, error = compared(scene)
        rows += found
        required += [
            Required(
                f"{scene}: states a second in float32 over float64", ratio, RATIO / slack, True, timed=True
            ),
            Required(f"{scene}: median relative error in float32", error, 1e-5, False),
        ]
    notes = (
        f"{STATES} random states per call, {CALLS} calls, one thread; best of all rounds.",
        f"Errors of {JUDGED} states against 40 digits, median and largest over states.",
    )
    return Measurement("Accelerations of many states", rows, required, notes)


def compared(scene: str) -> tuple[list[dict[str, Any]], float, float]:
    """Return the table rows, the speed ratio of float32 to float64, and the median error in float32."""
    models = {p: symgen.build(scene, precision=p, vector="native") for p in TYPES}
    q, u = random_states(models["float64"])
    given = {p: (np.asfortranarray(q.astype(p)), np.asfortranarray(u.astype(p))) for p in TYPES}
    cases = {p: Case(repeated(models[p], *given[p]), CALLS * STATES) for p in TYPES}
    cases["float64, state by state"] = Case(scalar(symgen.build(scene), q, u), CALLS * STATES)
    timings = measure(cases, rounds=25)
    errors = {p: relative_errors(scene, models[p], q[:JUDGED], u[:JUDGED]) for p in TYPES}
    errors["float64, state by state"] = errors["float64"]
    rows = [
        {
            "scene": scene,
            "type": name,
            "states/s": 1 / timing.best,
            "best [s]": timing.best,
            "median [s]": timing.median,
            "median error": float(np.median(errors[name])),
            "largest error": float(np.max(errors[name])),
        }
        for name, timing in timings.items()
    ]
    ratio = timings["float64"].best / timings["float32"].best
    return rows, ratio, float(np.median(errors["float32"]))


def random_states(model: symgen.Model) -> tuple[Rows, Rows]:
    """Return coordinates and velocities around the drawn pose, rounded to float32."""
    generator = np.random.default_rng(SEED)
    drawn = model.initial_state().q
    shape = (STATES, len(drawn))
    q = drawn + SHIFT * np.max(np.abs(drawn)) * generator.uniform(-1, 1, shape)
    u = SPEED * generator.uniform(-1, 1, shape)
    return tuple(x.astype(np.float32).astype(float) for x in (q, u))  # type: ignore[return-value]


def repeated(model: symgen.Model, q: Rows, u: Rows) -> Callable[[], None]:
    """Return a function that evaluates the batch repeatedly."""

    def run() -> None:
        for _ in range(CALLS):
            model.batch("accelerations", 0.0, q, u)

    return run


def scalar(model: symgen.Model, q: Rows, u: Rows) -> Callable[[], None]:
    """Return a function that calls the scalar kernel for every state in a compiled loop."""
    n, m = q.shape[1], len(model.description.constraints)
    states = np.column_stack([q, u, np.zeros(len(q))])
    evaluator = model.evaluator
    address = evaluator.library.addresses["accelerations"]
    sizes = evaluator.description.sizes_of("accelerations")
    work, out = np.zeros(evaluator.work_size + 1), np.zeros((len(q), n + m))
    return lambda: _core.call_repeatedly(address, sizes, CALLS, states, n, evaluator.parameters, work, out)


def relative_errors(scene: str, model: symgen.Model, q: Rows, u: Rows) -> Rows:
    """Return the largest error of each state relative to its largest acceleration or multiplier."""
    exact = symgen.build(scene, backend="mpmath").batch("accelerations", 0.0, q, u)
    found = model.batch("accelerations", 0.0, q, u)
    worst = np.zeros(len(q))
    for name, values in found.items():
        truth = exact[name]
        miss = np.abs(values.astype(float).astype(object) - truth).astype(float)
        worst = np.maximum(worst, miss.max(axis=1) / np.abs(truth).max(axis=1).astype(float))
    return worst


if __name__ == "__main__":
    raise SystemExit(main())
