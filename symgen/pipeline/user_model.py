"""From a user-defined system to its compiled kernels, through the same lowering, printers and cache."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symgen.pipeline.user_system import load, own_name
from symgen.scene.loading import SceneText
from symgen.toolchain.kernels import Tools, no_collection

if TYPE_CHECKING:
    from symgen.lowering.kernel import Program, Slot
    from symgen.runtime.kernels.description import SystemDescription
    from symgen.runtime.kernels.library import Library
    from symgen.runtime.model.system import SystemModel


def build_own(path: Path, tools: Tools, equations: Callable[[], Any]) -> SystemModel:
    """Return the kernels of the System that a Python file returns; ``equations`` derives its matrices.

    Raises
    ------
    DerivationError
        When the file fails, or returns no System.
    BuildError, CacheError
        When the compiler fails, or the cache cannot be written.
    """
    from symgen.runtime.model.system import SystemModel

    own = cache(lambda: load(path))

    def make(folder: Path) -> tuple[SystemDescription, Library]:
        with no_collection():
            program, equations, sources = tools.lowered(own().system)
        with tools.written(program, sources, folder) as compilation:
            description = _described(path, program, equations)
            return description, tools.opened(folder, description, compilation)

    text = SceneText(own_name(path), str(path.resolve()), {})
    description, library = tools.cached(text, "own", make, lambda: own().needs)
    return SystemModel(description, library, equations)


def _described(path: Path, program: Program, equations: str) -> SystemDescription:
    from symgen.runtime.kernels.description import ArrayInfo, SystemDescription, kernel_infos

    def info(about: str, slots: tuple[Slot, ...]) -> ArrayInfo:
        names, units, meanings = zip(*((s.name, s.unit, s.description) for s in slots), strict=True)
        return ArrayInfo(about, names, units, meanings)

    return SystemDescription(
        name=program.name,
        file=path.name,
        title=program.title,
        equations=equations,
        parameters=(),
        kernels=kernel_infos(program.kernels),
        references=program.references,
        left_out=program.left_out,
        arrays={name: info(about, slots) for name, about, slots in program.groups if slots},
    )
