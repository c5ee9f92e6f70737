"""What the suite gave, as a table on the terminal and as a page of the documentation."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import groupby

from rich.console import Console

from symgen.report.tables import table
from symgen.study.stability.case import Outcome

_ABOUT = """# Hard cases, method by method

Made by `symgen stability --out docs/stability.md`. Every case is a shipped scene, or one with other
values, gone through by every integrator and method that makes sense for it. *What must hold* is the bound
on the error against what is known independently (a closed form, a motion in one coordinate, 40 digits, a
method of another kind); the drift off the constraints is bounded besides. Rows without a bound are there to
be seen: what a method does where it is not meant for the case, or with too long a step.

Errors and drifts are rounded up to the next power of ten and steps to two digits, and times are left out,
so that the page stays the same where nothing changed: `symgen stability` prints them all.
[Hard cases](hard_cases.md) tells what symgen does about them.
"""
#: Below this, round-off is all there is: what it comes to differs between machines.
_ROUND_OFF = 1e-15


def print_suite(outcomes: Sequence[Outcome], console: Console) -> None:
    """Print the table, then what symgen said of what was not survived, and what should hold and does not."""
    rows = [
        (
            o.case.name,
            o.trial.label,
            "yes" if o.survived else "no",
            _number(o, "error"),
            _number(o, "drift"),
            o.found.steps if o.found else "-",
            f"{o.found.seconds:.3g} s" if o.found else "-",
            _bound(o),
        )
        for o in outcomes
    ]
    head = ("case", "method", "survived", "error", "drift", "steps", "time", "must hold")
    made = table("Hard cases", head, rows)
    made.columns[1].justify = "left"
    console.print(made)
    for o in outcomes:
        if not o.survived:
            console.print(f"{o.case.name}, {o.trial.label}: {o.said}.", soft_wrap=True)
    broken = [o for o in outcomes if not o.holds]
    for o in broken:
        console.print(f"Does not hold: {o.case.name}, {o.trial.label}.", style="bold", soft_wrap=True)
    if not broken:
        required = sum(o.required for o in outcomes)
        console.print(f"All that must hold does: {required} of {len(outcomes)} rows have a bound.")


def _number(o: Outcome, which: str) -> str:
    if o.found is None or not math.isfinite(o.found.error):
        return "-"
    if which == "drift" and not o.case.drift_of:
        return "-"
    return f"{getattr(o.found, which):.1e}"


def _bound(o: Outcome) -> str:
    if o.trial.bound is None:
        return ""
    return f"{'' if o.holds else 'NOT '}<= {o.trial.bound:.3g}"


def page(outcomes: Sequence[Outcome]) -> str:
    """Return the page of the documentation, in Markdown."""
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
    yield "| method | survived | error | drift | steps | what must hold |"
    yield "|---|---|---|---|---|---|"
    for o in outcomes:
        steps = f"{o.found.steps:.2g}" if o.found else "-"
        steps = str(int(float(steps))) if o.found else steps
        survived = "yes" if o.survived else "**no**"
        error, drift = (_rounded(_number(o, which)) for which in ("error", "drift"))
        yield f"| {o.trial.label} | {survived} | {error} | {drift} | {steps} | {_bound(o)} |"
    yield ""
    said = [o for o in outcomes if not o.survived]
    for o in said:
        yield f"*{o.trial.label}*: {o.said}.\n"


def _rounded(number: str) -> str:
    """Return a number rounded up to the next power of ten."""
    if number == "-":
        return number
    value = float(number)
    if value <= _ROUND_OFF:
        return "round-off"
    return f"1e{math.ceil(math.log10(value) - 1e-9):+03d}".replace("e+00", "e0")
