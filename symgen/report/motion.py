"""Terminal output of the motion of a linkage."""

from __future__ import annotations

from typing import Any

import numpy as np
from rich.console import Console

from symgen.report.extremes import Components, averages_of, extremes_of, means, print_work, texts
from symgen.report.tables import events_table, print_notes, run_table, table
from symgen.runtime.result.result import Result


def print_recorded(result: Result, console: Console) -> None:
    """Print the range of every output of a run, its means over time, and the work of powers."""
    averages = averages_of(result)
    recorded, by_name = Components(result.shown, result.count), means(result, averages)
    exact = extremes_of(result, averages)
    title = f"Recorded outputs, extremes of {'the motion' if exact else f'{result.count} samples'}"
    console.print(recorded.extremes(title, result.time, "s", end=True, means=by_name, exact=exact))
    print_work(result, averages, console)


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
    title = f"{result.title}: at t = {t:g} s"
    if points:
        where = np.array([result.final[p]["position"] for p in points]).reshape(len(points), -1)
        rates = np.array([result.final[p]["velocity"] for p in points]).reshape(len(points), -1)
        (length, per_length), (speed, per_speed) = (result.units.get(u, (u, 1.0)) for u in ("m", "m/s"))
        head = ("point", *(f"{a} [{length}]" for a in result.axes), *(f"v{a} [{speed}]" for a in result.axes))
        cells = zip(points, texts(length, where / per_length), texts(speed, rates / per_speed), strict=True)
        console.print(table(title, head, [(p, *x, *v) for p, x, v in cells]))
    else:
        console.print(title)
    if result.variables:
        print_recorded(result, console)
    d = model.description
    console.print(run_table(result, [("freedoms (drives)", f"{d.freedom} ({len(d.prescribed)})")]))
    if result.events:
        console.print(events_table(result))
    print_notes(result.notes, console)
