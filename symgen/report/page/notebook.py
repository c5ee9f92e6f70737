"""Notebook representations of models and results, and facts of a run as names and values."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from symgen.report.page.figures import run_figure
from symgen.runtime.result.elastic import ElasticResult
from symgen.runtime.result.result import Result
from symgen.runtime.result.turn import Turn
from symgen.symbolic.system import html_table

if TYPE_CHECKING:
    from symgen.runtime.model.compiled import Compiled


def seconds(value: float) -> str:
    """Return a duration as text with three digits and a unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value * 1e6:.3g} µs"


def run_facts(result: Result) -> tuple[tuple[str, str], ...]:
    """Return facts about a run as names and values; error measures come last."""
    statistics = result.statistics
    wall = float(statistics["wall_s"])
    if isinstance(result, Turn):
        return (
            ("evaluated", f"{result.count} poses"),
            ("time", f"{seconds(wall)}, {seconds(wall / max(1, result.count))} per pose"),
            ("closed within", f"{result.closure:.1e}"),
        )
    if isinstance(result, ElasticResult):
        error = statistics["error"]
        return (
            ("method", str(result.provenance["method"])),
            ("steps", str(statistics["steps"])),
            ("time", seconds(wall)),
            ("estimated error", "not estimated" if error is None else f"{error:.1e} of the peak stress"),
        )
    drift, facts = result.drift.measured, []
    if "energy" in drift:
        facts.append(
            ("energy drift", f"{drift['energy']:.1e} J of {drift['energy_exchanged']:.1e} J exchanged")
        )
    if "constraint" in drift:
        facts.append(("constraint drift", f"{drift['constraint']:.1e} m"))
    return (
        ("method", str(result.provenance["method"])),
        ("to", f"t = {statistics['t']:g} s"),
        ("steps", f"{statistics['steps']}, {statistics['rejected']} rejected"),
        ("time", seconds(wall)),
        *facts,
    )


def model_html(model: Compiled) -> str:
    """Return a table of a model's kernels with their operation counts, and of its tunable parameters."""
    d = model.description
    rows = [(name, str(counts["flops"])) for name, counts in model.operations.items()]
    tunable = [(p.name, f"{model.parameters[p.name]:g} {p.unit}", p.about) for p in d.tunable]
    kernels = html_table(f"{d.title}: {model.backend} backend", ("kernel", "operations"), rows)
    return kernels + (html_table("Tunable", ("parameter", "value", "meaning"), tunable) if tunable else "")


def result_html(result: Result) -> str:
    """Return facts, notes and curves of a run."""
    parts = [html_table(result.title, ("", ""), run_facts(result))]
    parts += [f"<p>{escape(note)}.</p>" for note in result.notes]
    if result.variables and result.count > 1:
        figure = run_figure(result)
        parts.append(f'<img src="{figure.uri}" alt="{escape(figure.alt)}" style="max-width: 100%">')
    return "".join(parts)
