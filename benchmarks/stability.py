"""Hard cases by every method: errors against independent solutions, and their bounds.

The cases are in ``stability_rods.py``, ``_loops.py`` and ``_elastic.py`` of ``tests/shared``. ``--out``
writes docs/stability.md. The exit code is 1 if an error exceeds its bound.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path

from rich.console import Console

from symgen.errors import check_known
from symgen.report.tables import table

sys.path.append(str(Path(__file__).parents[1] / "tests"))

from shared.stability_case import Case, Outcome, go_through
from shared.stability_cases import CASES

_ABOUT = """# Hard cases, method by method

This page is written by `python benchmarks/stability.py --out docs/stability.md`. Every case is a shipped
scene, or one with modified values, run by every suitable integrator and method. *Bound* is the limit on the
error against an independent reference (a closed form, a motion in minimal coordinates, or a method of
another kind); the drift off the constraints is bounded too. Rows without a bound show the behaviour of a
method that is not intended for the case, or of too long a step.

Errors and drifts are rounded up to the next power of ten and steps to two digits, and times are omitted,
so that most rows are equal on other machines. Without `--out`, the command prints all numbers. Where rank is
lost, round-off decides the rows without a bound.
[Hard cases](hard_cases.md) describes how symgen treats these cases.
"""
#: Errors below this are round-off and differ between machines.
_ROUND_OFF = 1e-15


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the cases, print or write their results, and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="cases, scenes or families; default: all")
    parser.add_argument("--out", type=Path, metavar="FILE", help="write the page of the documentation")
    options = parser.parse_args(arguments)
    outcomes = [go_through(case, trial) for case in chosen(options.names) for trial in case.trials]
    if options.out:
        options.out.write_text(page(outcomes), encoding="utf-8")
    print_suite(outcomes, Console(highlight=False))
    return 0 if all(o.holds for o in outcomes) else 1


def chosen(names: Sequence[str]) -> tuple[Case, ...]:
    """Return the cases with these names, families or scenes; all cases if none is given."""
    known = {word for case in CASES for word in _words(case)}
    for name in names:
        check_known(name, known, "there is no hard case")
    return tuple(case for case in CASES if not names or set(names) & set(_words(case)))


def _words(case: Case) -> tuple[str, ...]:
    return case.name, case.family, case.name.split(",")[0].split(" ")[0]


def print_suite(outcomes: Sequence[Outcome], console: Console) -> None:
    """Print the table, the messages of failed rows, and the rows that exceed their bound."""
    rows = [
        (
            o.case.name,
            o.trial.label,
            "yes" if o.survived else "no",
            _number(o, "error"),
            _number(o, "drift"),
            o.measured.steps if o.measured else "-",
            f"{o.measured.seconds:.3g} s" if o.measured else "-",
            _bound(o),
        )
        for o in outcomes
    ]
    head = ("case", "method", "survived", "error", "drift", "steps", "time", "bound")
    console.print(table("Hard cases", head, rows, texts=(0, 1)))
    for o in outcomes:
        if not o.survived:
            console.print(f"{o.case.name}, {o.trial.label}: {o.message}.")
    broken = [o for o in outcomes if not o.holds]
    for o in broken:
        console.print(f"Does not hold: {o.case.name}, {o.trial.label}.", style="bold")
    if not broken:
        required = sum(o.required for o in outcomes)
        console.print(f"All bounds hold: {required} of {len(outcomes)} rows have a bound.")


def _number(o: Outcome, which: str) -> str:
    if o.measured is None or not math.isfinite(o.measured.error):
        return "-"
    if which == "drift" and not o.case.drift_of:
        return "-"
    return f"{getattr(o.measured, which):.1e}"


def _bound(o: Outcome) -> str:
    if o.trial.bound is None:
        return ""
    return f"{'' if o.holds else 'NOT '}<= {o.trial.bound:.3g}"


def page(outcomes: Sequence[Outcome]) -> str:
    """Return the documentation page in Markdown."""
    lines = [_ABOUT]
    for family, of_family in groupby(outcomes, lambda o: o.case.family):
        lines.append(f"## {family.capitalize()}\n")
        for _, of_case in groupby(of_family, lambda o: o.case.name):
            lines += _section(list(of_case))
    return "\n".join(lines)


def _section(outcomes: Sequence[Outcome]) -> Iterator[str]:
    case = outcomes[0].case
    drift = f" Drift: {case.drift_of}." if case.drift_of else ""
    yield f"### {case.name}\n"
    yield f"{case.hard[0].upper()}{case.hard[1:]}. Error: {case.measure}.{drift}\n"
    yield "| method | survived | error | drift | steps | bound |"
    yield "|---|---|---|---|---|---|"
    for o in outcomes:
        steps = f"{o.measured.steps:.2g}" if o.measured else "-"
        steps = str(int(float(steps))) if o.measured else steps
        survived = "yes" if o.survived else "**no**"
        error, drift = (_rounded(_number(o, which)) for which in ("error", "drift"))
        yield f"| {o.trial.label} | {survived} | {error} | {drift} | {steps} | {_bound(o)} |"
    yield ""
    failed = [o for o in outcomes if not o.survived]
    for o in failed:
        yield f"*{o.trial.label}*: {o.message}.\n"


def _rounded(number: str) -> str:
    """Return a number rounded up to the next power of ten."""
    if number == "-":
        return number
    value = float(number)
    if value <= _ROUND_OFF:
        return "round-off"
    return f"1e{math.ceil(math.log10(value) - 1e-9):+03d}".replace("e+00", "e0")


if __name__ == "__main__":
    sys.exit(main())
