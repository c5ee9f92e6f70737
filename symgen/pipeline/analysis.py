"""Kernels of the analyses other than the motion in time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symgen.scene.loading import SceneText
from symgen.toolchain.cache import key
from symgen.toolchain.kernels import Tools, no_collection

if TYPE_CHECKING:
    from symgen.runtime.kernels.library import Library
    from symgen.scene.loop.loop import Loop
    from symgen.scene.rods.linkage import Linkage


def kernels_of_analysis(
    text: SceneText,
    tools: Tools,
    base: Any,
    kind: str,
    outputs: tuple[str, ...],
    resolved: Callable[[], Linkage | Loop],
    of: str = "",
    lanes: bool = False,
) -> tuple[Any, Library]:
    """Return the kernels of one kind of analysis, which are compiled on first use.

    ``outputs`` are those of the analysis. ``resolved`` returns the linkage or loop of the scene, or one
    derived from it, which ``of`` names. In ``lanes`` kernels take vectors.
    """
    from symgen.runtime.kernels.description import kernel_infos

    made = tools.of_lanes if lanes else tools

    def make(folder: Path) -> tuple[Any, Library]:
        with no_collection():
            from symgen.models.analyses import analysis_system

            found = replace(resolved(), outputs=outputs)
            program, equations, sources = made.lowered(analysis_system(found, kind), lanes)
        with made.written(program, sources, folder, lanes) as compilation:
            kernels = kernel_infos(program.kernels)
            description = replace(base, name=program.name, equations=equations, kernels=kernels)
            return description, made.opened(folder, description, compilation)

    parts = of, kind, key(*outputs)[:12] if outputs else "", "lanes" if lanes else ""
    return made.cached(text, "-".join(part for part in parts if part), make, base=base)
