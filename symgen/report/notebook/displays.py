"""What notebooks show of models, results and records of analyses."""

from __future__ import annotations

import math
from contextlib import suppress
from html import escape
from typing import TYPE_CHECKING, Any

from rich.console import Group

from symgen.display import display
from symgen.errors import SymgenError
from symgen.report.page.figures import plain_figure, run_figure
from symgen.report.page.study import Study, print_study
from symgen.report.sweeps import optimum_study, summary, sweep_study
from symgen.runtime.result.result import Result
from symgen.symbolic.system import html_table

if TYPE_CHECKING:
    import xarray

    from symgen.report.page.page import FigureView
    from symgen.runtime.model.compiled import Compiled
    from symgen.runtime.sweeps.optimisation import Optimum


#: A result that took longer [s] does not move by itself in a notebook, since its analysis is repeated.
QUICK = 1.0


def model_html(model: Compiled) -> str:
    """Return a drawing of a model, its freedoms, outputs and parameters, and operations of its kernels."""
    d, drawing, facts = model.description, "", list[tuple[str, str]]()
    with suppress(SymgenError):
        sheet, facts = display("still", model)
        drawing = sheet.svg()
    tunable = [(p.name, f"{model.parameters[p.name]:g} {p.unit}", p.about) for p in d.tunable]
    kernels = [(name, str(counts["flops"])) for name, counts in model.operations.items()]
    parts = [
        drawing,
        html_table(d.title, ("", ""), [*facts, ("backend", model.backend)]),
        html_table("Parameters", ("parameter", "value", "meaning"), tunable) if tunable else "",
        f"<details><summary>Kernels</summary>{html_table('', ('kernel', 'operations'), kernels)}</details>",
    ]
    return "".join(parts)


def record_html(record: Any, model: Any, verb: str) -> str:
    """Return what the command line prints of the record of an analysis."""
    printed: Any = _Printed()
    display("table_of", model, verb)([record] if verb == "modes" else record, model, printed)
    return "".join(printed.parts)


def optimum_html(optimum: Optimum) -> str:
    """Return the tables of an optimum; its objective is the first quantity with a unit."""
    return _printed(optimum_study(optimum, next(iter(optimum.units))))


def sweep_html(runs: xarray.Dataset) -> str:
    """Return the curves or maps of a sweep, and its extremes."""
    study = sweep_study(runs, summary(runs))
    figures = (plain_figure(*figure, schemes=False) for figure in study.figures)
    table = f"<details><summary>Extremes</summary>{_printed(study)}</details>"
    return "".join([*map(_image, figures), table])


def _printed(study: Study) -> str:
    printed: Any = _Printed()
    print_study(study, printed)
    return "".join(printed.parts)


def _image(figure: FigureView) -> str:
    caption = f"<p>{escape(figure.caption)}</p>" if figure.caption else ""
    return f'<img src="{figure.uri}" alt="{escape(figure.alt)}" style="max-width: 100%">{caption}'


class _Printed:
    """What functions print on a terminal, as HTML."""

    def __init__(self) -> None:
        self.parts: list[str] = []

    def print(self, *parts: Any) -> None:
        """Take over tables and lines of text."""
        for part in parts:
            if isinstance(part, Group):
                renderables: list[Any] = [*part.renderables]
                *title, cells = renderables
                self.parts.append(html_table("".join(map(str, title)), cells.columns, cells.rows))
            else:
                self.parts.append(f"<p>{escape(str(part))}</p>")


def result_html(result: Result) -> str:
    """Return facts, notes, curves and animation of a run."""
    parts = [html_table(result.title, ("", ""), result.facts)]
    parts += [f"<p>{escape(note)}.</p>" for note in result.completed()["notes"]]
    if result.origin is not None and result.count > 1 and result.statistics.get("wall_s", math.inf) < QUICK:
        parts.append(display("moving_html", result))
    if result.variables and result.count > 1:
        parts.append(_image(run_figure(result, schemes=False)))
    return "".join(parts)
