"""Studies for readers: sweeps, optimisations and syntheses, on the terminal and as one HTML file each."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rich.console import Console

from symgen.report.page.figures import plain_figure
from symgen.report.page.page import Fact, TableView, environment
from symgen.report.page.sheet import Sheet
from symgen.report.tables import table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class Study:
    """The results of a study.

    Attributes
    ----------
    texts, keys
        On the terminal: columns of text in the table, and how many of them each of its parts repeats.
    figures
        Functions that draw the figures of the page, with alternative text and caption.
    drawings
        Returns the drawings of the page.
    """

    title: str
    table: TableView
    notes: tuple[str, ...]
    facts: tuple[Fact, ...] = ()
    texts: Collection[int] = (0,)
    keys: int = 1
    figures: tuple[tuple[Callable[[], Figure], str, str], ...] = ()
    drawings: Callable[[], Iterable[Sheet]] = tuple


def render_study(study: Study, name: str) -> str:
    """Return a study as one HTML file; ``name`` is that of its scene or task."""
    figures = [plain_figure(*figure) for figure in study.figures]
    return environment().get_template("study.html.j2").render(page=study, name=name, figures=figures)


def print_study(study: Study, console: Console) -> None:
    """Print the table, the facts in a line, and the notes of a study."""
    console.print(table(study.title, study.table.head, study.table.rows, study.texts, study.keys))
    if study.facts:
        console.print(", ".join(f"{fact.name}: {fact.value}" for fact in study.facts))
    for note in study.notes:
        console.print(note)
