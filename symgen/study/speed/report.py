"""Work-precision results as tables and as a plot."""

from __future__ import annotations

import os
from pathlib import Path

from rich.console import Console

from symgen.display import seconds
from symgen.report.page import plots
from symgen.report.tables import print_notes, table
from symgen.study.speed.orders import Order
from symgen.study.speed.work_precision import WorkPrecision, WorkPrecisionPoint


def print_work_precision(measurement: WorkPrecision, console: Console) -> None:
    """Print errors and times of every setting, the orders of convergence, and remarks."""
    error = f"error at end [{measurement.unit}]"
    about = f"{measurement.title}: to t = {measurement.t_end:g} s, {measurement.samples} samples"
    head = ("method", "setting", error, "largest", "best", "median", "steps", "evaluations")
    console.print(table(about, head, map(_row, measurement.points)))
    columns = ("method", "order seen", "by theory", "over steps", "within 0.2")
    console.print(table("Order of convergence, at fixed steps", columns, map(_of_order, measurement.orders)))
    console.print(f"Error: {measurement.measured}. Times are those of the whole call, result included, warm.")
    console.print(
        f"Reference: {measurement.reference}; it differs by {measurement.uncertainty:.1e} {measurement.unit} "
        "from a looser one."
    )
    print_notes(measurement.notes, console)


def _row(p: WorkPrecisionPoint) -> tuple[str, ...]:
    mark = "" if p.resolved else "~"
    errors = (f"{mark}{p.end:.1e}", f"{mark}{p.along:.1e}")
    times = (seconds(p.best), seconds(p.median))
    counts = ("" if n is None else str(n) for n in (p.steps, p.evaluations))
    return (_name(p), p.setting, *errors, *times, *counts)


def _of_order(o: Order) -> tuple[str, ...]:
    name = o.method if o.precision == "float64" else f"{o.method}, {o.precision}"
    if o.observed is None:
        return name, "none seen", str(o.theoretical), "", ""
    verdict = "yes" if o.agrees else "NO"
    return name, f"{o.observed:.2f}", str(o.theoretical), f"{o.steps[0]} to {o.steps[-1]}", verdict


def _name(p: WorkPrecisionPoint) -> str:
    return p.method if p.precision == "float64" else f"{p.method}, {p.precision}"


def draw(measurement: WorkPrecision, file: str | os.PathLike[str]) -> None:
    """Plot wall time over error with one curve per method, and save the figure.

    Raises
    ------
    ResultError
        If the file cannot be written.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 5.2), layout="constrained")
    axes = figure.subplots()
    curves: dict[str, list[tuple[float, float]]] = {}
    for p in measurement.points:
        curves.setdefault(_name(p), []).append((p.along, p.best))
    plots.draw_errors(axes, curves.items(), f"{measurement.measured} [{measurement.unit}]")
    if measurement.uncertainty > (least := axes.get_xlim()[1]):
        axes.axvspan(least, measurement.uncertainty, color="0.9", label="uncertainty of the reference")
        axes.set_xlim(right=least)
    axes.legend(fontsize="small", frameon=False)
    figure.suptitle(f"{measurement.title}, to t = {measurement.t_end:g} s", fontsize="medium")
    save(figure, file)


def save(figure: object, file: str | os.PathLike[str]) -> None:
    """Save a figure atomically; equal numbers give identical bytes."""
    import matplotlib

    ending = Path(file).suffix.lower()
    stamp = {"Date": None} if ending == ".svg" else {"CreationDate": None} if ending == ".pdf" else {}
    with matplotlib.rc_context({"svg.hashsalt": "symgen"}):
        plots.save(figure, file, dpi=110, metadata=stamp)
