"""Tables for the terminal."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Group
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from symgen.runtime.result.result import Result


def table(
    title: str, columns: Sequence[str], rows: Iterable[Sequence[Any]], texts: Collection[int] = (0,)
) -> Group:
    """Return a table of plain text; columns of numbers are right-aligned, those numbered in ``texts`` left.

    The title is a line of its own: a title of the table would be broken at the width of its columns.
    """
    made = Table(
        header_style="bold",
        show_header=any(columns),
        box=SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
        collapse_padding=True,
    )
    for i, column in enumerate(columns):
        made.add_column(escape(column), justify="left" if i in texts else "right", overflow="fold")
    for row in rows:
        made.add_row(*(escape(_text(cell)) for cell in row))
    return Group(Text(title, style="table.title"), made) if title else Group(made)


def _text(value: Any) -> str:
    return f"{value + 0.0:.6g}" if isinstance(value, float) else str(value)  # no -0


#: Maximum number of modes listed on the terminal.
MODES = 10
#: Maximum number of events listed on the terminal.
_EVENTS = 20


def events_table(result: Result) -> Group:
    """Return a table of the events of a run, truncated if long."""
    rows = [(e.name, f"{e.time:.12g}", "rising" if e.rising else "falling") for e in result.events[:_EVENTS]]
    more = len(result.events) - _EVENTS
    return table("Events" + (f" (and {more} more)" if more > 0 else ""), ("event", "t [s]", "passing"), rows)


def _type(result: Result) -> tuple[str, ...]:
    """Return the number type of a run; empty for results saved before it was recorded."""
    found = result.provenance.get("precision")
    return (found,) if found else ()


def run_table(result: Result) -> Group:
    """Return a table of run statistics: cost and errors."""
    drift, statistics = result.drift.measured, result.statistics
    return table(
        "The run",
        ("", ""),
        (
            ("method", result.provenance["method"]),
            ("backend", ", ".join((result.provenance["backend"], *_type(result)))),
            ("steps (rejected)", f"{statistics['steps']} ({statistics['rejected']})"),
            ("evaluations", statistics["evaluations"]),
            ("wall time", f"{statistics['wall_s'] * 1e3:.3g} ms"),
            *(
                (what, f"{drift[name]:.2e} {unit}")
                for name, what, unit in (
                    ("constraint", "constraint drift", "m"),
                    ("energy", "energy drift", "J"),
                    ("energy_exchanged", "energy exchanged", "J"),
                )
                if name in drift
            ),
        ),
    )
