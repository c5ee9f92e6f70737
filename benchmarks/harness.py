"""Shared parts of the benchmarks: timing with warm-up and medians, tables, JSON output and exit code."""

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
from textwrap import fill
from time import perf_counter, process_time
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import symgen

#: Duration [s] of the untimed calls of a primed case.
_PRIMED = 1e-3


@dataclass(frozen=True, slots=True)
class Case:
    """A case to time: each call of ``run`` does ``work`` units."""

    run: Callable[[], Any]
    work: int


@dataclass(frozen=True, slots=True)
class Timing:
    """Time per unit of work over the rounds [s]: median, quartiles and best.

    ``processor`` is the least processor time, which other load on the machine hardly affects.
    """

    median: float
    lower: float
    upper: float
    best: float
    processor: float = math.nan


@dataclass(frozen=True, slots=True)
class Required:
    """A criterion: ``value`` must be at least ``bound``, or at most if ``at_least`` is False.

    ``timed``: whether the value is a time or a ratio of times, which other load on the machine affects.
    """

    name: str
    value: float
    bound: float
    at_least: bool
    timed: bool = False

    @property
    def holds(self) -> bool:
        """Whether the criterion is met; False for NaN."""
        return self.value >= self.bound if self.at_least else self.value <= self.bound


@dataclass(frozen=True, slots=True)
class Measurement:
    """One repeat of a benchmark: title, one row (column to value) per case, criteria and notes."""

    title: str
    rows: Sequence[Mapping[str, Any]]
    required: Sequence[Required]
    notes: Sequence[str] = ()


def measure(
    cases: Mapping[str, Case], rounds: int = 15, warm_up: int = 2, *, primed: bool = False
) -> dict[str, Timing]:
    """Time all cases alternately in rounds, so that other load on the machine affects all of them.

    Parameters
    ----------
    cases
        Cases by name.
    rounds
        Number of timed rounds.
    warm_up
        Number of untimed rounds before them.
    primed
        Whether each case is called untimed for a millisecond, at least once, just before it is timed, so
        that its code and data are cached as in continuous use.
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
    """Return the properties of the machine and software that affect the results."""
    from symgen.toolchain.compiler import find_compiler

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


def parser_of(description: str | None) -> argparse.ArgumentParser:
    """Return a parser of the command-line arguments that ``report_repeats`` reads."""
    parser = argparse.ArgumentParser(description=(description or "").partition("\n")[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    parser.add_argument(
        "--page", type=Path, metavar="FILE", help="write the tables into the benchmark's place on a page"
    )
    parser.add_argument(
        "--repeats",
        type=int,
        default=3,
        help="maximum number of repeats while a criterion on times is not met",
    )
    return parser


def arguments(description: str | None, *, short: bool = False, slack: bool = False) -> argparse.Namespace:
    """Parse the command-line arguments of a benchmark.

    ``short`` adds an option for a reduced measurement, ``slack`` one that relaxes ratios of times.
    """
    parser = parser_of(description)
    if short:
        parser.add_argument("--short", action="store_true", help="reduced measurement")
    if slack:
        parser.add_argument(
            "--slack",
            type=float,
            default=1.0,
            help="divide required ratios of times by this, for shared machines",
        )
    return parser.parse_args()


def report_repeats(measured: Callable[[], Measurement], options: argparse.Namespace) -> int:
    """Measure, print every repeat, and return the exit code: 1 if a criterion is not met, else 0.

    A criterion on times is met if it is met in one repeat, because other load on the machine only increases
    times. The measurement is repeated until then. Every other criterion must be met in each repeat.

    Parameters
    ----------
    measured
        Function that performs one measurement.
    options
        What :func:`parser_of` parses. With ``json``, ``{machine, rows, required}`` is printed as one JSON
        object instead of the tables. With ``page``, the lines of that page in Markdown between
        ``<!-- NAME -->`` and ``<!-- /NAME -->``, for a benchmark NAME.py, are replaced by the last tables.
    """
    name, found = Path(sys.argv[0]).stem, list[Measurement]()
    if options.page:
        _place(options.page, name)  # which a page must have before anything is measured
    while len(found) < options.repeats:
        found.append(measured())
        if not options.json:
            _print_rows(found[-1], len(found))
        if all(_holds(lines) for lines in _by_name(found)) or not all(
            r.holds for r in found[-1].required if not r.timed
        ):
            break
    lines = _by_name(found)
    if options.json:
        content = {
            "machine": machine(),
            "rows": [
                {"repeat": k, **{key: _finite(value) for key, value in row.items()}}
                for k, m in enumerate(found, 1)
                for row in m.rows
            ],
            "required": [
                {
                    "name": line[0].name,
                    "values": [_finite(r.value) for r in line],
                    "bound": line[0].bound,
                    "holds": _holds(line),
                }
                for line in lines
            ],
        }
        print(json.dumps(content, allow_nan=False))
    else:
        _print_required(lines, found[-1].notes)
    if options.page:
        _write(options.page, name, found[-1], lines)
    return 0 if all(map(_holds, lines)) else 1


def _place(page: Path, name: str) -> tuple[str, str]:
    """Return the parts of a page before and after the tables of a benchmark, with their markers."""
    begin, end = f"<!-- {name} -->\n", f"<!-- /{name} -->\n"
    head, found, rest = page.read_text(encoding="utf-8").partition(begin)
    _, closed, tail = rest.partition(end)
    if not found or not closed:
        raise SystemExit(
            f"{page} has no place for {name}: write {begin.strip()} and {end.strip()}, a line each"
        )
    return head + begin, end + tail


def _write(page: Path, name: str, measured: Measurement, lines: Sequence[Sequence[Required]]) -> None:
    """Replace the lines of a benchmark on a page by its tables."""
    before, after = _place(page, name)
    columns, rows = list(measured.rows[0]), [list(row.values()) for row in measured.rows]
    text = [
        _markdown(columns, rows),
        _markdown(_LINES, _required_rows(lines)),
        "\n".join(_wrapped(f"{note.rstrip('.')}.") for note in measured.notes),
        _wrapped(f"Measured on: {_of_machine()}."),
    ]
    written = "\n\n".join(filter(None, text))
    page.write_text(f"{before}\n{written}\n\n{after}", encoding="utf-8")


def _wrapped(text: str) -> str:
    return fill(text, 138, break_long_words=False, break_on_hyphens=False)


def _markdown(columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    cells = ([_cell(c).replace("|", "\\|") for c in row] for row in rows)
    lines = [columns, ["---"] * len(columns), *cells]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def report(
    title: str,
    rows: Sequence[Mapping[str, Any]],
    required: Sequence[Required],
    *,
    notes: Sequence[str] = (),
    as_json: bool = False,
) -> int:
    """Print one measurement; return the exit code of ``report_repeats``."""
    once = argparse.Namespace(repeats=1, json=as_json, page=None)
    return report_repeats(lambda: Measurement(title, rows, required, notes), once)


def _by_name(found: Sequence[Measurement]) -> list[list[Required]]:
    """Return the criteria, with the values of all repeats of each."""
    lines: dict[str, list[Required]] = {}
    for measurement in found:
        for line in measurement.required:
            lines.setdefault(line.name, []).append(line)
    return list(lines.values())


def _holds(line: Sequence[Required]) -> bool:
    return any(r.holds for r in line) if line[0].timed else all(r.holds for r in line)


def _console() -> Console:
    return Console(width=None if sys.stdout.isatty() else 110, highlight=False, markup=False)


def _print_rows(measured: Measurement, repeat: int) -> None:
    title = measured.title if repeat == 1 else f"{measured.title}, repeat {repeat}"
    rows = measured.rows
    _console().print(_table(title, list(rows[0]), [list(row.values()) for row in rows]))


def _print_required(lines: Sequence[Sequence[Required]], notes: Sequence[str]) -> None:
    console = _console()
    console.print(_table("Required", _LINES, _required_rows(lines)))
    for note in notes:
        console.print(note)
    console.print(_of_machine())


#: Columns of the table of criteria.
_LINES = ["required", "value in each repeat", "bound", "holds"]


def _required_rows(lines: Sequence[Sequence[Required]]) -> list[list[str]]:
    return [
        [
            line[0].name,
            ", ".join(f"{r.value:.3g}" for r in line),
            f"{'>=' if line[0].at_least else '<='} {line[0].bound:g}",
            "yes" if _holds(line) else "NO",
        ]
        for line in lines
    ]


def _of_machine() -> str:
    return ", ".join(f"{key} {value}" for key, value in machine().items() if value is not None)


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _table(title: str, columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> Table:
    made = Table(title=title, title_justify="left", header_style="bold")
    for i, column in enumerate(columns):
        made.add_column(column, justify="left" if i == 0 else "right")
    for row in rows:
        made.add_row(*map(_cell, row))
    return made


def _cell(value: Any) -> str:
    return "" if value is None else f"{value:.3g}" if isinstance(value, float) else str(value)
