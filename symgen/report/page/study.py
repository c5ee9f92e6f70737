"""Pages of studies: sweeps, optimisations and syntheses as one HTML file each."""

from __future__ import annotations

from dataclasses import dataclass

from symgen.report.page.figures import FigureView
from symgen.report.page.page import Fact, TableView, environment


@dataclass(frozen=True, slots=True)
class StudyPage:
    """All contents of a page; ``drawings`` are SVG."""

    name: str
    title: str
    facts: tuple[Fact, ...]
    tables: tuple[TableView, ...]
    figures: tuple[FigureView, ...] = ()
    drawings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def render_study(page: StudyPage) -> str:
    """Return the page of a study as one HTML file."""
    return environment().get_template("study.html.j2").render(page=page)
