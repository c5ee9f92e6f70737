"""Measurements for the page of a scene: curves, drift, and speed against error."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from symgen.display import seconds
from symgen.errors import ModelError, SimulationError
from symgen.report.page.figures import FigureView, error_figure, run_figure
from symgen.report.page.page import Fact, TableView
from symgen.runtime.elastic.model import ElasticModel
from symgen.runtime.loop.model import LoopModel
from symgen.runtime.result.elastic import ElasticResult
from symgen.runtime.result.result import Result
from symgen.runtime.result.turn import Turn
from symgen.scene.loading import SceneText, check_scene
from symgen.study.speed.work_precision import WorkPrecision, work_precision

#: Methods in the speed measurement: for linkages and loops, and for elastic links.
_METHODS = ("dop853", "dopri5", "rk4")
_OF_ELASTIC = ("gauss", "newmark", "dop853")
#: Facts of a run shown at the head of the page.
_TELLING = ("energy drift", "constraint drift", "closed within", "estimated error")
#: Time [s] of one run that ends a sweep of settings, for elastic links and for all other models.
_LONGEST_ELASTIC, _LONGEST = 0.3, 0.05
#: Repeats per setting; recorded times; error relative to the peak over a revolution of elastic links.
_REPEATS, _SAMPLES, _ELASTIC = 2, 11, 1e-3


@dataclass(frozen=True, slots=True)
class Measured:
    """A run and its cost; ``result`` is None if the run failed at once."""

    result: Result | None
    headline: tuple[Fact, ...] = ()
    facts: tuple[Fact, ...] = ()
    figure: FigureView | None = None
    notes: tuple[str, ...] = ()
    final: TableView | None = None
    speed: TableView | None = None
    speed_figure: FigureView | None = None
    speed_caption: str = ""


def measure(model: Any, text: SceneText, *, speed: bool, told: Callable[[str], None]) -> Measured:
    """Run a model over the range set in its scene, and measure speed against error."""
    told("running")
    failure: tuple[str, ...] = ()
    try:
        result: Result | None = _run(model)
    except SimulationError as error:
        failure = (str(error).partition("\n")[0],)
        result = error.partial if isinstance(error.partial, Result) else None
    if result is None:
        return Measured(None, notes=failure)
    facts = tuple(Fact(*fact) for fact in result.facts)
    table: TableView | None = None
    figure: FigureView | None = None
    caption = ""
    if isinstance(result, Turn):
        table, caption = _of_turn(result)
    elif speed:
        told("measuring speed against error")
        table, figure, caption = _speed(model, text)
    return Measured(
        result,
        headline=tuple(f for f in facts if f.name in _TELLING),
        facts=facts,
        figure=run_figure(result) if result.variables else None,
        notes=(*failure, *result.notes),
        final=_final(result),
        speed=table,
        speed_figure=figure,
        speed_caption=caption,
    )


def _run(model: Any) -> Result:
    found: Result
    if isinstance(model, ElasticModel):
        found = model.simulate(rtol=_ELASTIC)
    elif isinstance(model, LoopModel) and model.is_driven:
        found = model.inverse_dynamics()
    else:
        found = model.simulate()
    return found


def _final(result: Result) -> TableView | None:
    """Return the final positions of the points of a linkage."""
    if isinstance(result, Turn | ElasticResult) or not result.final:
        return None
    rows = tuple(
        (point, *(f"{x:.6g}" for what in ("position", "velocity") for x in np.atleast_1d(motion[what])))
        for point, motion in result.final.items()
        if {"position", "velocity"} <= set(motion)
    )
    head = tuple(
        f"{what} {a} [{unit}]" for what, unit in (("position", "m"), ("velocity", "m/s")) for a in result.axes
    )
    return TableView(("point at the end", *head), rows) if rows else None


def _of_turn(turn: Turn) -> tuple[TableView, str]:
    """Return the time per pose of a driven loop and the largest closure defect."""
    row = (
        turn.provenance["backend"],
        str(turn.count),
        seconds(turn.statistics["wall_s"] / max(1, turn.count)),
        f"{turn.closure:.1e}",
    )
    caption = (
        "A driven loop is not integrated: each pose is closed by Newton's method starting from the previous "
        "one, with all rates, accelerations and forces. The defect is the maximum over all poses, of angles "
        "in radians, of translations relative to the size of the loop."
    )
    return TableView(("backend", "poses", "time per pose", "largest defect"), (row,)), caption


def _speed(model: Any, text: SceneText) -> tuple[TableView | None, FigureView | None, str]:
    methods, longest = (
        (_OF_ELASTIC, _LONGEST_ELASTIC) if isinstance(model, ElasticModel) else (_METHODS, _LONGEST)
    )
    try:
        found = work_precision(
            check_scene(text), methods=methods, samples=_SAMPLES, repeats=_REPEATS, longest=longest
        )
    except (ModelError, SimulationError) as error:
        return TableView(("not measured",), ((str(error).partition("\n")[0],),)), None, ""
    return speed_table(found), speed_figure(found), speed_caption(found)


def speed_table(found: WorkPrecision) -> TableView:
    """Return the loosest, a middle and the tightest setting of each method."""
    rows = []
    for method in dict.fromkeys(p.method for p in found.points):
        own = [p for p in found.points if p.method == method]
        picked = sorted({0, len(own) // 2, len(own) - 1})
        rows += [
            (
                f"{p.method}, {p.setting}",
                f"{'' if p.told else '~'}{p.along:.1e}",
                seconds(p.best),
                str(p.steps),
            )
            for p in (own[i] for i in picked)
        ]
    return TableView(("method", f"error [{found.unit}]", "time", "steps"), tuple(rows))


def speed_figure(found: WorkPrecision) -> FigureView:
    """Return a plot of time against error with one curve per method."""
    curves = [
        (method, [(p.along, p.best) for p in found.points if p.method == method])
        for method in dict.fromkeys(p.method for p in found.points)
    ]
    return error_figure(curves, f"{found.measured} [{found.unit}]")


def speed_caption(found: WorkPrecision) -> str:
    """Return the caption with the measured error and its reference."""
    marked = (
        " ~ marks errors within the uncertainty of the reference."
        if any(not p.told for p in found.points)
        else ""
    )
    return (
        f"To t = {found.t_end:g} s; error is the {found.measured} against {found.reference}, which "
        f"differs by {found.uncertainty:.1e} from a looser one. Times are for whole calls from Python "
        f"on the machine that wrote this page.{marked}"
    )
