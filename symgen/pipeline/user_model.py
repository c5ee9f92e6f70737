"""From a user-defined system, or a beam element, to its compiled kernels in the cache."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.pipeline.analysis import kernels_of_analysis
from symgen.pipeline.user_system import general_system_of, load, name_of
from symgen.scene.loading import SceneText
from symgen.toolchain.fingerprint import fingerprint
from symgen.toolchain.kernels import BuildSettings

if TYPE_CHECKING:
    from symgen.lowering.kernel import Program, Slot
    from symgen.models.general.equations import GeneralSystem
    from symgen.pipeline.source import Source
    from symgen.runtime.kernels.elastic_description import BeamInfo
    from symgen.runtime.kernels.library import Library
    from symgen.runtime.kernels.system_description import SystemDescription
    from symgen.runtime.model.system import SystemModel
    from symgen.runtime.rods.model.general import GeneralModel


#: Resolved scene, settings and a folder -> description and kernels.
Compiled = Callable[["GeneralSystem", BuildSettings, Path], "tuple[Any, Library]"]


def build_user(
    path: Path, tools: BuildSettings, equations: Source, compiled: Compiled
) -> SystemModel | GeneralModel:
    """Return the model of the System that a Python file returns; ``equations`` derives its matrices.

    ``compiled`` compiles the kernels of a System that moves.

    Raises
    ------
    DerivationError
        When the file fails, or returns no System.
    BuildError, CacheError
        When the compiler fails, or the cache cannot be written.
    """
    user = cache(lambda: load(path))
    text = SceneText(name_of(path), str(path.resolve()), {})

    def make(folder: Path) -> tuple[Any, Library]:
        system = user().system
        if system.values is None:
            return tools.built(folder, lambda: system, partial(_described, path.name))
        return compiled(general_system_of(system, path.name), tools, folder)

    description, library = tools.cached(text, "own", make, lambda: user().needs)
    if description.method != "general":
        from symgen.runtime.model.system import SystemModel

        return SystemModel(description, library, equations)
    from symgen.runtime.rods.model.general import GeneralModel

    def analysis(kind: str, _: bool, outputs: tuple[str, ...], lanes: bool = False) -> tuple[Any, Library]:
        def resolved() -> GeneralSystem:
            # A file that was run for this model is not read again.
            if not user.cache_info().currsize and not tools.is_current(text, "own", description):
                raise ModelError(f"{path} has changed since the model was built\n  Build it again.")
            return general_system_of(user().system, path.name)

        return kernels_of_analysis(text, tools, description, kind, outputs, resolved, lanes=lanes)

    return GeneralModel(description, library, equations, analyses=cache(analysis))


def definition_of(element: str) -> str:
    """Return a hash of the definition of an element that this program registered; empty for one of symgen."""
    from symgen.elements import ELEMENTS

    added = ELEMENTS.added()
    return fingerprint(added[element])[:16] if element in added else ""


def supply_elements(beams: Iterable[BeamInfo], tools: BuildSettings) -> None:
    """Compile the kernels of the beam elements that have no shipped module."""
    from symgen.runtime.beams.elements import SUPPLIED
    from symgen.runtime.kernels.library import is_compiled

    for block, name in sorted({(beam.block, beam.element) for beam in beams}):
        if block not in SUPPLIED and not is_compiled(block):
            SUPPLIED[block] = _Module(_element(name, tools))


class _Module:
    """Kernels of a model, called as those of a shipped module: arrays of arguments -> flat array."""

    def __init__(self, model: SystemModel) -> None:
        self._model = model

    def __getattr__(self, kernel: str) -> Callable[..., NDArray[np.float64]]:
        return partial(self._call, kernel)

    def _call(
        self, kernel: str, q: NDArray[np.float64], u: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        place = np.zeros(1) if u is None else u  # of a station, which only the kernel shape reads
        shown = self._model.description.arrays.get("p")  # arguments of matrices that no kernel gives
        none = np.zeros(len(shown.names) if shown else 0)
        blocks = self._model.evaluate(kernel, q=q, u=place, p=none).values()
        return np.concatenate([block.ravel() for block in blocks])


def _element(name: str, tools: BuildSettings) -> SystemModel:
    from symgen.elements import ELEMENTS
    from symgen.models.elastic.element import elastic_element_system
    from symgen.runtime.model.system import SystemModel

    element = ELEMENTS[name]
    derive = partial(elastic_element_system, element)
    text = SceneText(f"element_{name}", "", {})
    make = partial(tools.built, system=derive, describe=partial(_described, ""))
    return SystemModel(*tools.cached(text, "own", make), lambda: derive().by_name())


def _described(file: str, program: Program, equations: str) -> SystemDescription:
    from symgen.pipeline.analysis import kernel_infos
    from symgen.runtime.kernels.system_description import ArrayInfo, SystemDescription

    def info(about: str, slots: tuple[Slot, ...]) -> ArrayInfo:
        return ArrayInfo(about, tuple(s.name for s in slots), tuple(s.unit for s in slots))

    return SystemDescription(
        name=program.name,
        file=file,
        title=program.title,
        units={},
        equations=equations,
        parameters=(),
        kernels=kernel_infos(program.kernels),
        references=program.references,
        left_out=program.left_out,
        arrays={name: info(about, slots) for name, about, slots in program.groups if slots},
    )
