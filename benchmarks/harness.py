"""What every benchmark shares: timing with warm-up and medians, one table, one JSON object, one exit code."""

from __future__ import annotations

import argparse
import gc
import json
import math
import os
import platform
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median, quantiles
from time import perf_counter, process_time
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import symgen

#: How long a case is called before it is timed, where that is asked for [s].
_PRIMED = 1e-3


@dataclass(frozen=True, slots=True)
class Case:
    """Something to time: ``run`` does ``work`` units of it each time it is called."""

    run: Callable[[], Any]
    work: int


@dataclass(frozen=True, slots=True)
class Timing:
    """Seconds for one unit of work over the rounds: median, quartiles and the best.

    ``processor`` is the least time of the processor that it took: that of a machine that does nothing else.
    """

    median: float
    lower: float
    upper: float
    best: float
    processor: float = math.nan


@dataclass(frozen=True, slots=True)
class Required:
    """A line that must hold: ``value`` at least ``bound``, or at most when ``at_least`` is false."""

    name: str
    value: float
    bound: float
    at_least: bool

    @property
    def holds(self) -> bool:
        """Whether it does; never for a value that is not a number."""
        return self.value >= self.bound if self.at_least else self.value <= self.bound


def measure(
    cases: Mapping[str, Case], rounds: int = 15, warm_up: int = 2, *, primed: bool = False
) -> dict[str, Timing]:
    """Time all cases in turn, round by round, so that what else the machine does meets them alike.

    Parameters
    ----------
    cases
        What to time, by name.
    rounds
        Rounds that count.
    warm_up
        Rounds before them that do not.
    primed
        Whether each is called untimed for a millisecond, and once at least, right before it is timed: what is
        measured is a program at the same work all along, its code and data at hand.
    """
    times: dict[str, list[float]] = {name: [] for name in cases}
    least = dict.fromkeys(cases, math.inf)
    collecting = gc.isenabled()
    gc.disable()
    try:
        for turn in range(warm_up + rounds):
            for name, case in cases.items():
                begun = perf_counter()
                while primed:
                    case.run()
                    if perf_counter() - begun > _PRIMED:
                        break
                busy, begun = process_time(), perf_counter()
                case.run()
                spent, busy = perf_counter() - begun, process_time() - busy
                if turn >= warm_up:
                    times[name].append(spent / case.work)
                    least[name] = min(least[name], busy / case.work)
    finally:
        if collecting:
            gc.enable()
    result = {}
    for name, values in times.items():
        lower, _, upper = quantiles(values, n=4)
        result[name] = Timing(median(values), lower, upper, min(values), least[name])
    return result


def machine() -> dict[str, Any]:
    """Return what a figure depends on besides the code measured."""
    from symgen.compiler import find_compiler

    compiler = find_compiler()
    return {
        "cpu": _cpu(),
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "symgen": symgen.__version__,
        "compiler": compiler.version if compiler else None,
        "flags": " ".join(compiler.flags) if compiler else None,
    }


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor() or platform.machine())


def arguments(description: str | None, *, short: bool = False, slack: bool = False) -> argparse.Namespace:
    """Read the command line that all benchmarks share.

    With ``short``, whether only a part is asked for; with ``slack``, by what ratios of times may fall short.
    """
    parser = argparse.ArgumentParser(description=(description or "").partition("\n")[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    if short:
        parser.add_argument("--short", action="store_true", help="measure a part only")
    if slack:
        parser.add_argument(
            "--slack",
            type=float,
            default=1.0,
            help="divide required ratios of times by this: shared machines",
        )
    return parser.parse_args()


def report(
    title: str,
    rows: Sequence[Mapping[str, Any]],
    required: Sequence[Required],
    *,
    notes: Sequence[str] = (),
    as_json: bool = False,
) -> int:
    """Print what was measured; return the exit code: 1 where a required line does not hold, else 0.

    Parameters
    ----------
    title
        What was measured.
    rows
        One mapping of column to value a case, all with the same columns.
    required
        The lines that must hold.
    notes
        How it was measured, for whoever reads the table.
    as_json
        Print ``{machine, rows, required}`` as one JSON object in place of the table.
    """
    about = machine()
    if as_json:
        content = {
            "machine": about,
            "rows": [{key: _finite(value) for key, value in row.items()} for row in rows],
            "required": [
                {"name": r.name, "value": _finite(r.value), "bound": r.bound, "holds": r.holds}
                for r in required
            ],
        }
        print(json.dumps(content, allow_nan=False))
    else:
        console = Console(width=None if sys.stdout.isatty() else 110, highlight=False)
        console.print(_table(title, list(rows[0]), [list(row.values()) for row in rows]))
        lines = [
            [r.name, r.value, f"{'>=' if r.at_least else '<='} {r.bound:g}", "yes" if r.holds else "NO"]
            for r in required
        ]
        console.print(_table("Required", ["line", "value", "bound", "holds"], lines))
        for note in notes:
            console.print(note)
        console.print(", ".join(f"{key} {value}" for key, value in about.items() if value is not None))
    return 0 if all(r.holds for r in required) else 1


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _table(title: str, columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> Table:
    made = Table(title=title, title_justify="left", header_style="bold")
    for i, column in enumerate(columns):
        made.add_column(column, justify="left" if i == 0 else "right")
    for row in rows:
        made.add_row(*("" if c is None else f"{c:.3g}" if isinstance(c, float) else str(c) for c in row))
    return made
