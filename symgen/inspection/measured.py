"""Measurements for the page of a scene: curves, drift, and speed against error."""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain
from typing import Any

import numpy as np

from symgen.display import seconds
from symgen.errors import ModelError, SimulationError
from symgen.inspection.view import View, view_of
from symgen.report.extremes import texts
from symgen.report.page.figures import error_figure, run_figure
from symgen.report.page.page import Fact, FigureView, Measured, TableView
from symgen.runtime.result.result import Result
from symgen.scene.loading import SceneText, check_scene
from symgen.study.speed.work_precision import WorkPrecision, work_precision

#: Facts of a run shown at the head of the page.
_OF_POINTS = (("position", "m"), ("velocity", "m/s"))
_TELLING = ("energy drift", "constraint drift", "closed within", "error by time steps")
#: Repeats per setting.
_REPEATS = 2
#: Recorded times.
_SAMPLES = 11


def measure(model: Any, text: SceneText | None, *, progress: Callable[[str], None]) -> Measured:
    """Run a model over its range, and measure speed against error of the scene ``text``, if given."""
    progress("running")
    view = view_of(model)
    failure: tuple[str, ...] = ()
    try:
        result: Result | None = view.run(model)
    except SimulationError as error:
        failure = (str(error).partition("\n")[0],)
        result = error.partial if isinstance(error.partial, Result) else None
    if result is None:
        return Measured(None, notes=failure)
    facts = tuple(Fact(*fact) for fact in result.facts)
    table: TableView | None = None
    figure: FigureView | None = None
    caption = ""
    cost = view.cost(model, result)
    if cost:
        table, caption = cost
    elif text is not None:
        progress("measuring speed against error")
        table, figure, caption = _speed(view, text)
        if figure and getattr(model.description, "freedom", 1) == 0 and not model.description.elastic:
            figure = None  # points at rounding, no curves
            caption += " Drives prescribe the motion, so that every step has errors of rounding only."
    return Measured(
        result,
        headline=tuple(f for f in facts if f.name in _TELLING),
        facts=facts,
        figure=run_figure(result) if result.variables else None,
        notes=(*failure, *result.completed()["notes"]),
        final=_final(result),
        speed=table,
        speed_figure=figure,
        speed_caption=caption,
    )


def _final(result: Result) -> TableView | None:
    """Return the final positions of the points of a linkage."""
    if not result.final:
        return None
    shown = [(of, *result.units.get(unit, (unit, 1.0))) for of, unit in _OF_POINTS]
    points = {p: motion for p, motion in result.final.items() if all(of in motion for of, _ in _OF_POINTS)}
    cells = [
        texts(unit, np.array([np.atleast_1d(motion[of]) for motion in points.values()]) / size)
        for of, unit, size in shown
    ]
    rows = tuple((point, *chain(*parts)) for point, *parts in zip(points, *cells, strict=True))
    head = tuple(f"{of} {a} [{unit}]" for of, unit, _ in shown for a in result.axes)
    return TableView(("point at the end", *head), rows) if rows else None


def _speed(view: View, text: SceneText) -> tuple[TableView | None, FigureView | None, str]:
    try:
        measurement = work_precision(
            check_scene(text),
            methods=view.integrators,
            samples=_SAMPLES,
            repeats=_REPEATS,
            longest=view.longest,
        )
    except (ModelError, SimulationError) as error:
        return TableView(("not measured",), ((str(error).partition("\n")[0],),)), None, ""
    return speed_table(measurement), speed_figure(measurement), speed_caption(measurement)


def speed_table(measurement: WorkPrecision) -> TableView:
    """Return the loosest, a middle and the tightest setting of each method."""
    rows = []
    for method in dict.fromkeys(p.method for p in measurement.points):
        points = [p for p in measurement.points if p.method == method]
        picked = sorted({0, len(points) // 2, len(points) - 1})
        rows += [
            (
                f"{p.method}, {p.setting}",
                f"{'' if p.resolved else '~'}{p.along:.1e}",
                seconds(p.best),
                str(p.steps),
            )
            for p in (points[i] for i in picked)
        ]
    return TableView(("method", f"error [{measurement.unit}]", "time", "steps"), tuple(rows))


def speed_figure(measurement: WorkPrecision) -> FigureView:
    """Return a plot of time against error with one curve per method."""
    curves = [
        (method, [(p.along, p.best) for p in measurement.points if p.method == method])
        for method in dict.fromkeys(p.method for p in measurement.points)
    ]
    return error_figure(curves, f"{measurement.measured} [{measurement.unit}]")


def speed_caption(measurement: WorkPrecision) -> str:
    """Return the caption with the measured error and its reference."""
    marked = (
        " ~ marks errors within the uncertainty of the reference."
        if any(not p.resolved for p in measurement.points)
        else ""
    )
    return (
        f"To t = {measurement.t_end:g} s; error is the {measurement.measured} against "
        f"{measurement.reference}, which differs by {measurement.uncertainty:.1e} {measurement.unit} from a "
        f"looser one. Times are for whole calls from Python on the machine that wrote this page.{marked}"
    )
