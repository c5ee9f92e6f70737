"""Terminal output of studies."""

from __future__ import annotations

from rich.console import Console

from symgen.report.tables import table
from symgen.study.page import PAGE
from symgen.study.running import Case, StudyReport


def print_report(report: StudyReport, console: Console) -> None:
    """Print every case with its closure and limits, then the location of plots and tables."""
    for study in report.studies:
        searched = bool(study.plan.searches)
        head = ("case", "closure defect", *(["limit"] if searched else []))
        rows = [(case.label, _closure(case), *([_limits(case)] if searched else [])) for case in study.cases]
        console.print(study.plan.about, style="italic")
        console.print(table("", head, rows))
    where = report.folder / PAGE
    console.print(f"{len(report.files)} files in {report.folder}; begin with {where}")


def _closure(case: Case) -> str:
    return f"{case.turn.closure:.1e}" if case.turn else case.problem


def _limits(case: Case) -> str:
    found = []
    for limit in case.limits:
        s = limit.search
        if limit.value is None:
            found.append(f"{s.parameter}: none up to {s.in_unit(s.stop):g} {s.unit}")
        else:
            found.append(f"{s.parameter} {s.in_unit(limit.value):.6f} {s.unit}")
    return ", ".join(found)
