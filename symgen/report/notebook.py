"""Models and results as notebooks show them, and how a run went as names and values."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from symgen.report.figures import run_figure
from symgen.runtime.elastic_result import ElasticResult
from symgen.runtime.result import Result
from symgen.runtime.turn import Turn
from symgen.symbolic.system import html_table

if TYPE_CHECKING:
    from symgen.runtime.compiled import Compiled


def seconds(value: float) -> str:
    """Return a time in words, of three digits."""
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value * 1e6:.3g} µs"


def run_facts(result: Result) -> tuple[tuple[str, str], ...]:
    """Return how a run went, by name; what it strayed by comes last."""
    statistics = result.statistics
    wall = float(statistics["wall_s"])
    if isinstance(result, Turn):
        return (
            ("evaluated", f"{len(result.time)} poses"),
            ("time", f"{seconds(wall)}, {seconds(wall / max(1, len(result.time)))} a pose"),
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
    drift = result.drift
    return (
        ("method", str(result.provenance["method"])),
        ("to", f"t = {statistics['t']:g} s"),
        ("steps", f"{statistics['steps']}, {statistics['rejected']} rejected"),
        ("time", seconds(wall)),
        ("energy drift", f"{drift.energy:.1e} J of {drift.energy_exchanged:.1e} J exchanged"),
        ("constraint drift", f"{drift.constraint:.1e} m"),
    )


def model_html(model: Compiled) -> str:
    """Return a table of a model's kernels with their operations, and of its tunable parameters."""
    d = model.description
    rows = [(name, str(counts["flops"])) for name, counts in model.operations.items()]
    tunable = [(p.name, f"{model.parameters[p.name]:g} {p.unit}", p.about) for p in d.parameters]
    kernels = html_table(f"{d.title}: {model.backend} backend", ("kernel", "operations"), rows)
    return kernels + (html_table("Tunable", ("parameter", "value", "meaning"), tunable) if tunable else "")


def result_html(result: Result) -> str:
    """Return how a run went, its notes and its curves."""
    parts = [html_table(result.title, ("", ""), run_facts(result))]
    parts += [f"<p>{escape(note)}.</p>" for note in result.notes]
    if result.variables and len(result.time) > 1:
        figure = run_figure(result)
        parts.append(f'<img src="{figure.uri}" alt="{escape(figure.alt)}" style="max-width: 100%">')
    return "".join(parts)
