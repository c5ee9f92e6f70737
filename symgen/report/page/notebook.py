"""Notebook representations of models and results, and facts of a run as names and values."""

from __future__ import annotations

import math
from html import escape
from typing import TYPE_CHECKING

from symgen.display import display
from symgen.report.page.figures import run_figure
from symgen.runtime.result.result import Result
from symgen.symbolic.system import html_table

if TYPE_CHECKING:
    from symgen.runtime.model.compiled import Compiled


#: A result that took longer [s] does not move by itself in a notebook, since its analysis is repeated.
QUICK = 1.0


def model_html(model: Compiled) -> str:
    """Return a table of a model's kernels with their operation counts, and of its tunable parameters."""
    d = model.description
    rows = [(name, str(counts["flops"])) for name, counts in model.operations.items()]
    tunable = [(p.name, f"{model.parameters[p.name]:g} {p.unit}", p.about) for p in d.tunable]
    kernels = html_table(f"{d.title}: {model.backend} backend", ("kernel", "operations"), rows)
    return kernels + (html_table("Tunable", ("parameter", "value", "meaning"), tunable) if tunable else "")


def result_html(result: Result) -> str:
    """Return facts, notes, curves and animation of a run."""
    parts = [html_table(result.title, ("", ""), result.facts)]
    parts += [f"<p>{escape(note)}.</p>" for note in result.completed()["notes"]]
    if result.origin is not None and result.count > 1 and result.statistics.get("wall_s", math.inf) < QUICK:
        parts.append(display("moving_html", result))
    if result.variables and result.count > 1:
        figure = run_figure(result, schemes=False)
        parts.append(f'<img src="{figure.uri}" alt="{escape(figure.alt)}" style="max-width: 100%">')
    return "".join(parts)
