"""Running the studies of a scene, and writing what they give into a folder."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from symgen.errors import InitialStateError, ModelError, SimulationError
from symgen.pipeline import build_scene
from symgen.runtime.loop_model import LoopModel
from symgen.runtime.turn import Turn
from symgen.scene.loading import load_scene
from symgen.study.folder import checked, write
from symgen.study.limits import STEPS, Limit, find_limit
from symgen.study.plan import Plan, Setting, plans

#: What drawing a plot takes, in evaluations of a range, for the progress that is told.
_A_PLOT = 8


@dataclass(frozen=True, slots=True)
class Case:
    """One combination of values: the loop over its range, or why it could not go through it."""

    settings: tuple[Setting, ...]
    turn: Turn | None
    problem: str
    limits: tuple[Limit, ...]

    @property
    def label(self) -> str:
        """Its values, for legends."""
        return ", ".join(map(str, self.settings)) or "the scene's own values"


@dataclass(frozen=True, slots=True)
class StudyResult:
    """A study and its cases."""

    plan: Plan
    cases: tuple[Case, ...]


@dataclass(frozen=True, slots=True)
class StudyReport:
    """What the studies of a scene gave, and where it is written."""

    scene: str
    title: str
    folder: Path
    files: tuple[str, ...]
    studies: tuple[StudyResult, ...]

    def summary(self) -> dict[str, Any]:
        """Return cases and limits in plain numbers: what ``symgen run --study --json`` prints."""
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


def run_studies(
    scene: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    *,
    set: Mapping[str, Any] | None = None,
    backend: str = "auto",
    progress: Callable[[float], None] | None = None,
) -> StudyReport:
    """Run the studies of a scene and write plots, numbers and a page ``index.md`` into a folder.

    Nothing is written before everything is evaluated and drawn. Files of other names in the folder stay.

    Parameters
    ----------
    scene
        A shipped name, or the path of a scene file.
    folder
        Where to write; it is made when it is not there.
    set
        Values to replace in the scene, before those that a study sets.
    progress
        Takes the part that is done.

    Raises
    ------
    SceneError
        For anything wrong in the scene or its studies.
    ModelError
        When the scene is not a driven loop, or a limit is looked for from where there is no whole range.
    ResultError
        When an output to be drawn is not recorded, or the folder cannot be written.
    """
    from symgen.study.page import files_of

    target = checked(folder)
    checked_scene = load_scene(scene, set=set)
    wanted = plans(checked_scene)
    total = sum(len(p.cases) * (1 + len(p.searches) * STEPS) + len(p.plots) * _A_PLOT for p in wanted)
    count = _Counter(total, progress)
    studies = []
    for plan in wanted:
        model = build_scene(scene, set={**(set or {}), **plan.changes}, backend=backend)
        if not isinstance(model, LoopModel) or not model.is_driven:
            raise ModelError(
                "studies are for driven loops: scenes with a link-joint table that inputs alone move"
            )
        studies.append(StudyResult(plan, tuple(_case(model, plan, s, count) for s in plan.cases)))
    title = checked_scene.title or checked_scene.name
    files = files_of(os.fspath(scene), title, studies, lambda: count.step(_A_PLOT))
    write(target, files)
    return StudyReport(checked_scene.name, title, target, tuple(files), tuple(studies))


def _case(model: LoopModel, plan: Plan, settings: tuple[Setting, ...], count: _Counter) -> Case:
    """Evaluate one combination."""
    own = model.with_parameters(**{s.parameter: s.value for s in settings})
    turn, problem = None, ""
    try:
        turn = own.turn()
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
    """Counts evaluations, and tells which part of them is done."""

    def __init__(self, total: int, progress: Callable[[float], None] | None) -> None:
        self.total, self.progress, self.done = total, progress, 0

    def step(self, count: int = 1) -> None:
        self.done += count
        if self.progress:
            self.progress(self.done / self.total)
