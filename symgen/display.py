"""Plots, drawings and notebook tables of models and results, drawn by higher parts when first requested.

Results and models stand below ``report`` and ``inspection`` and must not import them; this registry names
what draws them.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

_DRAWN_BY = {
    "animate": "symgen.inspection.film",
    "draw": "symgen.inspection.film",
    "still": "symgen.inspection.film",
    "moving_html": "symgen.inspection.film",
    "table_of": "symgen.methods",
    "plot": "symgen.report.page.plots",
    "result_html": "symgen.report.notebook.displays",
    "model_html": "symgen.report.notebook.displays",
    "record_html": "symgen.report.notebook.displays",
    "optimum_html": "symgen.report.notebook.displays",
    "sweep_html": "symgen.report.notebook.displays",
    "widget": "symgen.report.notebook.widget",
}


class Shown:
    """A record of an analysis, which notebooks show with the tables of the command line."""

    __slots__ = ("_analysis",)

    def _of_analysis(self, model: Any, verb: str) -> None:
        """Set the model, and the name of its analysis, whose table shows the record."""
        object.__setattr__(self, "_analysis", (model, verb))

    def _repr_html_(self) -> str | None:
        analysis = getattr(self, "_analysis", None)
        return display("record_html", self, *analysis) if analysis else None


def display(name: str, *arguments: Any, **options: Any) -> Any:
    """Draw a result or a model; ``what`` is a key of the registry."""
    return getattr(import_module(_DRAWN_BY[name]), name)(*arguments, **options)


def seconds(value: float) -> str:
    """Return a duration as text with three digits and a unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value * 1e6:.3g} µs"
