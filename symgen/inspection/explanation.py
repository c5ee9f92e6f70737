"""Plain-text explanation of a scene: simplifications, operations saved, and solution method."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from symgen.models.generality import general
from symgen.models.loop.structure import general as general_loop
from symgen.models.loop.structure import loop_structure
from symgen.models.structure import structure
from symgen.pipeline.build import build_asked, system_of
from symgen.report.mathematics.saving import saving_lines
from symgen.report.page.structure import elastic_lines, matrix_lines, memory_lines, solver_lines
from symgen.runtime.elastic.model import ElasticModel
from symgen.scene.loading import load_scene
from symgen.scene.resolve import resolve
from symgen.scene.rods.linkage import Linkage


def explanation(scene: str, changes: Mapping[str, Any]) -> Iterator[str]:
    """Yield the explanation line by line; lines that need the compiled model come last.

    Raises
    ------
    SceneError
        If the scene is invalid.
    """
    resolved = resolve(load_scene(scene, set=changes))
    system = system_of(resolved)
    if isinstance(resolved, Linkage):
        yield from structure(resolved)
        whole, what = general(resolved), "any masses, lengths, centres, inertias and gravity"
        yield from saving_lines(system, system_of(whole), what)
        if resolved.plane:
            yield from saving_lines(system, system_of(resolved.as_written), "motion across its plane")
    else:
        yield from loop_structure(resolved, system)
        yield from saving_lines(system, system_of(general_loop(resolved)), "general offsets")
    yield from matrix_lines(system)
    yield from solver_lines(system)
    model = build_asked(scene, set=changes)
    yield from model.mobility
    if isinstance(model, ElasticModel):
        yield from elastic_lines(model)
    yield from memory_lines(model.description)
