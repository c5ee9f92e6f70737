"""Plain-text explanation of a scene: simplifications, operations saved, and solution method."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from symgen.errors import SceneError
from symgen.inspection.view import view_of
from symgen.models import BLOCKS
from symgen.pipeline.build import build_selected
from symgen.pipeline.systems import system_of
from symgen.report.page.structure import matrix_lines, memory_lines, solver_lines
from symgen.scene.loading import load_scene
from symgen.scene.resolve import resolve


def explanation(scene: str, changes: Mapping[str, Any]) -> Iterator[str]:
    """Yield the explanation line by line; lines that need the compiled model come last.

    Raises
    ------
    SceneError
        If the scene is invalid.
    """
    if scene in BLOCKS:
        raise SceneError(
            f"{scene} is a building block, which has no solution to explain",
            hint=f"symgen show {scene} prints its equations, symgen report {scene} a page of them.",
        )
    resolved = resolve(load_scene(scene, set=changes))
    system = system_of(resolved)
    view = view_of(resolved)
    yield from view.structure(resolved, system)
    yield from matrix_lines(system)
    yield from solver_lines(system)
    model = build_selected(scene, set=changes)
    yield from model.mobility
    yield from view.solution(model)
    yield from memory_lines(model.description)
