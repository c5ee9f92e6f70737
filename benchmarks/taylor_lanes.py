"""Power series in lanes, a part of ``taylor.py``: 512 swings of ``four_bar`` in one call and one thread.

The swings start with 0.5 to 1.5 times the rates of the scene. An error is the largest of all swings, against
Lagrange's equations in the crank angle.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import minimal_equations as minimal
import numpy as np
from fronts import time_at
from harness import Case, Required, measure
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import symgen

Array = NDArray[np.float64]

MOTION, T_END, ERROR, FASTER = "four bar, 512 swings", 2.0, 1e-8, 1.5
PARTS = np.linspace(0.5, 1.5, 512)
NEW = "taylor"
#: Methods, and their options: steps [s], or relative tolerances.
TRIED: Mapping[str, tuple[str, Mapping[str, Array]]] = {
    NEW: ("taylor", {"rtol": 10.0 ** -np.arange(5.0, 13.0)}),
    "dop853, fixed steps": ("dop853", {"step": T_END / np.array([60, 80, 100, 120, 140, 160, 200, 250])}),
    "dop853": ("dop853", {"rtol": 10.0 ** -np.arange(6.0, 12.0)}),
    "rk4": ("rk4", {"step": T_END / np.array([400, 800, 1200, 1600, 2400, 4800])}),
}


def truth() -> Array:
    """Return where B is at the end of each swing (swings, 2) [m]."""
    rates = minimal.FOUR_BAR.rates_of(np, float)

    def of_all(_: float, y: Array) -> Array:
        return np.concatenate(rates(list(y.reshape(2, -1))))

    angle, rate = map(float, minimal.FOUR_BAR.start)
    start = np.concatenate([np.full(len(PARTS), angle), rate * PARTS])
    run = solve_ivp(of_all, (0.0, T_END), start, method="DOP853", rtol=3e-14, atol=1e-14)
    x, y = minimal.FOUR_BAR.places(run.y[: len(PARTS), -1], np, float)["B"]
    return np.stack([x.value, y.value], axis=1)


def calls() -> Iterator[tuple[str, float, Callable[[], Any]]]:
    """Yield the programs with a step or tolerance, and their calls."""
    model = symgen.build("four_bar")
    start = model.initial_state()
    states = [
        model.state(start.positions, {p: part * v for p, v in start.velocities.items()}) for part in PARTS
    ]
    given = {"states": states, "t_end": T_END, "samples": 2, "outputs": ["B.position"], "threads": 1}
    for program, (method, options) in TRIED.items():
        for option, values in options.items():
            for value in values.tolist():
                chosen = {"method": method, option: value, **given}
                yield program, value, lambda chosen=chosen: model.simulate_many(**chosen)


def measured_in_lanes(rounds: int) -> tuple[list[dict[str, Any]], Required]:
    """Return the rows of all programs, and the criterion on the time to the error."""
    tried, there = list(calls()), truth()
    errors = [float(np.max(np.abs(run()["B.position"].values[:, -1] - there))) for _, _, run in tried]
    timings = measure({str(i): Case(run, 1) for i, (_, _, run) in enumerate(tried)}, rounds, 1, primed=True)
    spent = [timings[str(i)].processor for i in range(len(tried))]
    rows = [
        {"motion": MOTION, "program": program, "tolerance": value, "error": error, "processor [s]": time}
        for (program, value, _), error, time in zip(tried, errors, spent, strict=True)
    ]
    at = {
        name: time_at([(r["error"], r["processor [s]"]) for r in rows if r["program"] == name], ERROR)
        for name in TRIED
    }
    others = [time for name, time in at.items() if name != NEW and time]
    ratio = min(others) / at[NEW] if others and at[NEW] else math.nan
    rows += [
        {"motion": MOTION, "program": f"{name} at this error", "tolerance": None, "error": ERROR,
         "processor [s]": time}
        for name, time in at.items()
    ]  # fmt: skip
    name = f"{MOTION}: least time of other methods over that of taylor at {ERROR:.0e}"
    return rows, Required(name, ratio, FASTER, at_least=True, timed=True)
