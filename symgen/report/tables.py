"""Tables on the terminal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from symgen.runtime.result import Result


def table(title: str, columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> Table:
    """Return a table of plain text; the first column is the name, numbers stand to the right."""
    made = Table(title=escape(title), title_justify="left", header_style="bold", show_header=any(columns))
    for i, column in enumerate(columns):
        made.add_column(escape(column), justify="left" if i == 0 else "right", overflow="fold")
    for row in rows:
        made.add_row(*(escape(_text(cell)) for cell in row))
    return made


def _text(value: Any) -> str:
    return f"{value + 0.0:.6g}" if isinstance(value, float) else str(value)  # no -0


def print_result(result: Result, console: Console) -> None:
    """Print where the points ended, and how well the run kept what it must keep."""
    rows = []
    for point, motion in result.final.items():
        numbers = ["  ".join(f"{x + 0.0: .9e}" for x in motion[what]) for what in ("position", "velocity")]
        rows.append((point, *numbers))
    t = result.statistics["t"]
    axes = ", ".join(result.axes)
    console.print(
        table(
            f"{result.title}: at t = {t:g} s",
            ("point", f"position {axes} [m]", f"velocity {axes} [m/s]"),
            rows,
        )
    )
    recorded = recorded_table(result)
    if recorded:
        console.print(recorded)
    console.print(run_table(result))
    if result.events:
        console.print(events_table(result))
    for note in result.notes:
        console.print(f"Note: {note}.")


#: What the table of the points says already.
_OF_POINTS = (".position", ".velocity")


def recorded_table(result: Result) -> Table | None:
    """Return a table of where all else that was recorded ended; None where there is nothing else."""
    rows = [
        (v.name, v.unit, "  ".join(f"{x + 0.0: .9e}" for x in np.atleast_1d(v.values[-1]).tolist()))
        for v in result.variables
        if not v.name.endswith(_OF_POINTS)
    ]
    return table("Recorded, at the end", ("output", "unit", "value"), rows) if rows else None


#: Events listed on the terminal.
_EVENTS = 20


def events_table(result: Result) -> Table:
    """Return a table of the events of a run, the first of many."""
    rows = [(e.name, f"{e.time:.12g}", "rising" if e.rising else "falling") for e in result.events[:_EVENTS]]
    more = len(result.events) - _EVENTS
    return table("Events" + (f" (and {more} more)" if more > 0 else ""), ("event", "t [s]", "passing"), rows)


def _type(result: Result) -> tuple[str, ...]:
    """Return the type of a run's numbers; results of before it was recorded tell none."""
    found = result.provenance.get("precision")
    return (found,) if found else ()


def run_table(result: Result) -> Table:
    """Return a table of how a run went, its errors beside its cost."""
    drift, statistics = result.drift, result.statistics
    return table(
        "The run",
        ("", ""),
        (
            ("method", result.provenance["method"]),
            ("backend", ", ".join((result.provenance["backend"], *_type(result)))),
            ("steps (rejected)", f"{statistics['steps']} ({statistics['rejected']})"),
            ("evaluations", statistics["evaluations"]),
            ("wall time", f"{statistics['wall_s'] * 1e3:.3g} ms"),
            ("constraint drift", f"{drift.constraint:.2e} m"),
            ("energy drift", f"{drift.energy:.2e} J"),
            ("energy exchanged", f"{drift.energy_exchanged:.2e} J"),
        ),
    )
