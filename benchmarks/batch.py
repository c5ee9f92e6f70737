"""Batch evaluations in float32 against float64: states a second beside the error.

The accelerations and multipliers of many random states, each type in vectors as wide as the processor has
(``vector="native"``), in one thread: from NumPy arrays to NumPy arrays, by ``model.batch``. Arrays hold a row
a state, their columns one after the other in memory, so that a vector register takes the numbers of
neighbouring states in one load. Beside it the scalar kernel in float64, called in a compiled loop.

The error of each is measured on some of the states against the same program in 40 digits (backend mpmath), at
the very numbers that a state has in float32, over the largest acceleration or multiplier of the state.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from harness import Case, Required, arguments, measure, report
from numpy.typing import NDArray

import symgen
from symgen.runtime import _core

Rows = NDArray[Any]

SCENES = ("triple_pendulum", "peaucellier")
#: No power of two, whose columns would meet in the same sets of the cache; all arrays fit its second level.
STATES, CALLS, JUDGED, SEED = 16_448, 4, 64, 6
SHIFT, SPEED = 0.05, 0.3  # of the largest coordinate; m/s
TYPES = ("float32", "float64")
RATIO = 1.5


def main() -> int:
    """Measure, print, and return the exit code."""
    options = arguments(__doc__)
    if symgen.build(SCENES[0]).backend != "c":
        print("this benchmark needs compiled kernels: install a C compiler", file=sys.stderr)
        return 1
    rows, required = [], []
    for scene in SCENES:
        found, ratio, error = compared(scene)
        rows += found
        required += [
            Required(f"{scene}: states a second in float32 over float64", ratio, RATIO, True),
            Required(f"{scene}: median relative error in float32", error, 1e-5, False),
        ]
    notes = (
        f"{STATES} random states a call, {CALLS} calls, one thread; the best round counts.",
        f"Errors are those of {JUDGED} states against 40 digits, median and largest over states.",
    )
    return report("Accelerations of many states", rows, required, notes=notes, as_json=options.json)


def compared(scene: str) -> tuple[list[dict[str, Any]], float, float]:
    """Return rows of the table, how much faster float32 is, and its median error."""
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
    """Return coordinates and velocities around the drawn pose, as float32 holds them."""
    generator = np.random.default_rng(SEED)
    drawn = model.initial_state().q
    shape = (STATES, len(drawn))
    q = drawn + SHIFT * np.max(np.abs(drawn)) * generator.uniform(-1, 1, shape)
    u = SPEED * generator.uniform(-1, 1, shape)
    return tuple(x.astype(np.float32).astype(float) for x in (q, u))  # type: ignore[return-value]


def repeated(model: symgen.Model, q: Rows, u: Rows) -> Callable[[], None]:
    """Return what calls the batch so many times."""

    def run() -> None:
        for _ in range(CALLS):
            model.batch("accelerations", 0.0, q, u)

    return run


def scalar(model: symgen.Model, q: Rows, u: Rows) -> Callable[[], None]:
    """Return what calls the scalar kernel for every state in a compiled loop."""
    n, m = q.shape[1], len(model.description.constraints)
    states = np.column_stack([q, u, np.zeros(len(q))])
    evaluator = model.evaluator
    address = evaluator.library.addresses["accelerations"]
    work, out = np.zeros(evaluator.work_size + 1), np.zeros((len(q), n + m))
    return lambda: _core.call_repeatedly(address, CALLS, states, n, evaluator.parameters, work, out)


def relative_errors(scene: str, model: symgen.Model, q: Rows, u: Rows) -> Rows:
    """Return the largest error of each state over its largest acceleration or multiplier of the same kind."""
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
