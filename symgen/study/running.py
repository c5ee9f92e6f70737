"""Execution of the studies of a scene, with output to a folder."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from symgen.calls import checked
from symgen.errors import InitialStateError, ModelError, SimulationError
from symgen.pipeline.build import build_scene
from symgen.runtime.loop.model import LoopModel
from symgen.runtime.result.turn import Turn
from symgen.scene.loading import load_scene
from symgen.study.cases import Case, StudyResult
from symgen.study.folder import writable_folder, write
from symgen.study.limits import STEPS, find_limit
from symgen.study.page import files_of
from symgen.study.plan import Plan, Setting, plans

#: Cost of a plot in the progress count, in evaluations of a range.
_A_PLOT = 8


@dataclass(frozen=True, slots=True)
class StudyReport:
    """Results of the studies of a scene, and the output folder."""

    scene: str
    title: str
    folder: Path
    files: tuple[str, ...]
    studies: tuple[StudyResult, ...]

    def summary(self) -> dict[str, Any]:
        """Return cases and limits as plain data for ``symgen study --json``."""
        return {
            "scene": self.scene,
            "folder": str(self.folder),
            "files": list(self.files),
            "studies": {
                s.plan.name: [
                    {
                        "values": {x.parameter: x.text for x in case.settings},
                        "closure": case.turn.closure if case.turn else None,
                        "poles": [p.at for p in case.turn.poles] if case.turn else [],
                        "problem": case.problem,
                        "limits": [
                            {
                                "parameter": limit.search.parameter,
                                "value": None if limit.value is None else limit.search.in_unit(limit.value),
                                "width": limit.search.in_unit(limit.width),
                                "unit": limit.search.unit,
                                "closure": limit.closure,
                            }
                            for limit in case.limits
                        ],
                    }
                    for case in s.cases
                ]
                for s in self.studies
            },
        }


@checked
def run_studies(
    scene: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    *,
    set: Mapping[str, Any] | None = None,
    backend: str = "auto",
    progress: Callable[[float], None] | None = None,
) -> StudyReport:
    """Run the studies of a scene and write plots, numbers and a page ``index.md`` into a folder.

    Files are written after all evaluations and plots are complete. Other files in the folder are kept.

    Parameters
    ----------
    scene
        A shipped name, or the path of a scene file.
    folder
        Output folder; created if it does not exist.
    set
        Scene values to override, before those set by a study.
    progress
        Callback that receives the completed fraction.

    Raises
    ------
    SceneError
        If the scene or its studies are invalid.
    ModelError
        If the scene is not a driven loop, or cannot traverse its range at the start of a search.
    ResultError
        If a plotted output is not recorded, or the folder cannot be written.
    """
    target = writable_folder(folder)
    checked_scene = load_scene(scene, set=set)
    wanted = plans(checked_scene)
    total = sum(len(p.cases) * (1 + len(p.searches) * STEPS) + len(p.plots) * _A_PLOT for p in wanted)
    count = _Counter(total, progress)
    studies = []
    for plan in wanted:
        model = build_scene(scene, set={**(set or {}), **plan.changes}, backend=backend)
        if not model.is_driven:
            raise ModelError(
                "studies are for driven loops: scenes with a link-joint table that inputs alone move"
            )
        loop = cast("LoopModel", model)
        studies.append(StudyResult(plan, tuple(_case(loop, plan, s, count) for s in plan.cases)))
    title = checked_scene.title or checked_scene.name
    files = files_of(os.fspath(scene), title, studies, lambda: count.step(_A_PLOT))
    write(target, files)
    return StudyReport(checked_scene.name, title, target, tuple(files), tuple(studies))


def _case(model: LoopModel, plan: Plan, settings: tuple[Setting, ...], count: _Counter) -> Case:
    """Evaluate one combination."""
    own = model.with_parameters(**{s.parameter: s.value for s in settings})
    turn, problem = None, ""
    try:
        turn = cast(Turn, own.inverse_dynamics())
    except (SimulationError, InitialStateError) as error:
        problem = str(error).partition("\n")[0]
    count.step()
    if turn:
        for name in plan.plots:
            turn.variable(name)
    limits = []
    for search in plan.searches:
        after = count.done + STEPS
        try:
            limits.append(find_limit(own, search, count.step))
        except ModelError as error:
            where = ", ".join((f"study {plan.name!r}", *map(str, settings)))
            raise ModelError(f"{where}: {error}") from None
        count.step(after - count.done)
    return Case(settings, turn, problem, tuple(limits))


class _Counter:
    """Counts evaluations and reports the completed fraction."""

    def __init__(self, total: int, progress: Callable[[float], None] | None) -> None:
        self.total, self.progress, self.done = total, progress, 0

    def step(self, count: int = 1) -> None:
        self.done += count
        if self.progress:
            self.progress(self.done / self.total)
