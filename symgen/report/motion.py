"""Terminal output of the motion of a linkage."""

from __future__ import annotations

from typing import Any

import numpy as np
from rich.console import Console

from symgen.report.extremes import Components
from symgen.report.tables import events_table, run_table, table
from symgen.runtime.result.records import Variable
from symgen.runtime.result.result import Result

#: Combinations of positions and velocities that fit 80 columns: two of each.
_SIDE_BY_SIDE = 2


def print_result(result: Result, model: Any, console: Console) -> None:
    """Print final positions and velocities, the range of every output, and the errors of the run.

    Ground points that have not moved are omitted.
    """
    t = result.statistics["t"]
    start = model.initial_state().positions
    points = [
        p
        for p, end in result.final.items()
        if p not in model.description.ground
        or any(end["velocity"])
        or list(end["position"]) != list(start[p])
    ]
    where = np.array([result.final[p]["position"] for p in points]).reshape(len(points), -1)
    rates = np.array([result.final[p]["velocity"] for p in points]).reshape(len(points), -1)
    position = [f"{a} [m]" for a in result.axes]
    velocity = [f"v{a} [m/s]" for a in result.axes]
    blocks = [(position, "m", where), (velocity, "m/s", rates)]
    if len(result.axes) <= _SIDE_BY_SIDE:
        cells = [*zip(_texts("m", where), _texts("m/s", rates), strict=True)]
        rows = [(p, *x, *v) for p, (x, v) in zip(points, cells, strict=True)]
        console.print(table(f"{result.title}: at t = {t:g} s", ("point", *position, *velocity), rows))
    else:
        for head, unit, values in blocks:
            rows = [(p, *x) for p, x in zip(points, _texts(unit, values), strict=True)]
            console.print(table(f"{result.title}: at t = {t:g} s", ("point", *head), rows))
    if result.variables:
        recorded = Components(result.shown, result.count)
        console.print(recorded.extremes("Recorded outputs", result.time, "s", end=True))
    console.print(run_table(result))
    if result.events:
        console.print(events_table(result))
    for note in result.notes:
        console.print(f"Note: {note}.", markup=False)


def _texts(unit: str, values: np.ndarray) -> list[list[str]]:
    """Return the rows of an array as text, with round-off as 0."""
    if not values.size:
        return [[] for _ in values]
    flat = Components([Variable("", unit, "", tuple(map(str, range(values.size))), values.reshape(1, -1))], 1)
    words = [flat.text(float(x[0])) for _, _, x in flat.rows]
    width = values.shape[1]
    return [words[i * width : (i + 1) * width] for i in range(len(values))]
