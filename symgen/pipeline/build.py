"""From a scene to a model: :func:`compile_scene` is the pipeline; it runs unless the cache has its result."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from symgen.calls import checked
from symgen.errors import ModelError, SceneError, SlowBackendWarning
from symgen.methods import method_of
from symgen.pipeline import parameters as tuning
from symgen.pipeline.analysis import kernels_of_analysis
from symgen.pipeline.source import Source
from symgen.pipeline.systems import derive, system_of
from symgen.pipeline.user_system import is_user_file
from symgen.precision import FLOAT64
from symgen.scene.loading import SceneText, check_scene, override, text_of
from symgen.toolchain.kernels import GET_A_COMPILER, BuildSettings, no_collection, tools_for

if TYPE_CHECKING:
    from symgen.lowering.kernel import Program
    from symgen.runtime.elastic.model import ElasticModel
    from symgen.runtime.kernels.description import Described, Description
    from symgen.runtime.kernels.library import Library
    from symgen.runtime.kernels.typed import Typed
    from symgen.runtime.loop.model import LoopModel
    from symgen.runtime.model.model import Model
    from symgen.runtime.model.system import SystemModel
    from symgen.runtime.rods.model.general import GeneralModel
    from symgen.runtime.rods.model.kinematic import KinematicModel
    from symgen.runtime.rods.model.rods import RodModel
    from symgen.scene.loop.loop import Loop
    from symgen.scene.rods.linkage import Linkage
    from symgen.scene.schema import Scene

    _WithForces = RodModel | LoopModel | ElasticModel
    _Mechanism = _WithForces | KinematicModel


@checked
def build(
    scene: Scene | SceneText | str | os.PathLike[str],
    *,
    set: Mapping[str, Any] | None = None,
    backend: str = "auto",
    precision: str = "float64",
    digits: int | None = None,
    contraction: str = "off",
    vector: str = "none",
) -> Model:
    """Derive, lower, emit and compile a scene or a user-defined system, or take it from the cache.

    Returns a :class:`~symgen.Model` of the kind that ``symgen.methods`` binds to the scene. Type checkers see
    the base class, which declares all analyses, since a name or a path does not determine the kind.

    Parameters
    ----------
    scene
        Name of a shipped scene, path of a scene file, or a :class:`symgen.Scene`; or path of a Python file,
        which is executed.
    set
        Values to replace: parameter names or dotted keys, as in ``symgen.load_scene``. Tunable parameters
        are changed without recompilation.
    backend
        ``c`` (requires a C compiler), ``numpy`` (slow), or ``auto``: C if there is a compiler, else shipped
        kernels of the same equations, else NumPy, with a warning. ``mpmath`` adds
        kernels in any number of digits, as a reference: see ``Model.batch``.
    precision
        Number type of runs and batches: ``float32``, ``float64``, ``longdouble`` or ``float128``; see
        ``docs/precision.md``.
    digits
        Digits of the backend mpmath (40).
    contraction
        ``off``, or ``fast``: a product and a sum share one rounding if the processor supports it.
    vector
        ``none``: compiled code runs on any processor of this kind; ``native``: on this processor only.

    Raises
    ------
    SceneError
        For any fault of the scene, including a start that cannot be assembled or is contradictory.
    DerivationError
        When a Python file fails, or returns no System.
    BuildError, CacheError
        When the compiler fails, or the cache cannot be written.
    """
    options = (backend, precision, digits, contraction, vector)
    return _built(scene, options, set)


def build_scene(scene: Scene | SceneText | str | os.PathLike[str], **options: Any) -> _WithForces:
    """Build a scene, like :func:`build`, for callers that need a mechanism with forces.

    Raises
    ------
    ModelError
        When the scene is restricted to kinematics.
    """
    return with_forces(build_selected(scene, **options))


def with_forces(model: Model) -> _WithForces:
    """Return a model with forces; raise ModelError if its scene is restricted to kinematics."""
    if is_kinematic(model):
        raise ModelError(
            f"{model.name} selects kinematics, which computes no forces\n"
            '  Write kind = "dynamics" under [analysis], or give --set analysis.kind=dynamics.'
        )
    return cast("_WithForces", model)


def is_kinematic(model: Model) -> bool:
    """Return whether a model has no forces, without loading the modules of such models."""
    return bool(getattr(model.description, "kinematic", False))


def build_selected(
    scene: Scene | SceneText | str | os.PathLike[str], *, set: Mapping[str, Any] | None = None, **options: Any
) -> _Mechanism:
    """Build a scene, like :func:`build`, with the analysis that the scene selects.

    Raises
    ------
    SceneError
        For a user-defined system that does not move.
    """
    model = _built(scene, tuple({**_USUAL, **options}.values()), set)
    if model.description.method == "system":
        raise SceneError(
            f"expected a scene, got the Python file {str(scene)!r}, which describes no motion",
            hint="Give its System values of parameters and of the start: values={...}. 'symgen generate', "
            "'build', 'show', 'accuracy' and 'diff' take it as it is, and symgen.build.",
        )
    return cast("_Mechanism", model)


def build_kinematics(
    scene: Scene | SceneText | str | os.PathLike[str],
    *,
    set: Mapping[str, Any] | None = None,
    backend: str = "auto",
) -> _Mechanism:
    """Build the kinematics of a scene, independently of the analysis that the scene selects.

    A linkage is derived without forces. The closure of a loop has its forces with it.
    """
    text = None if is_user_file(scene) else text_of(scene)
    if text is None or "loop" in text.data:
        return build_selected(text or scene, set=set, backend=backend)
    changes, analysis = dict(set or {}), text.data.get("analysis", {})
    if isinstance(analysis, dict) and changes.pop("analysis.kind", analysis.get("kind")) != "kinematics":
        stated = text.data.get("outputs", ())
        names = [x["name"] for x in stated if isinstance(x, dict) and "name" in x]
        alone = {"kind": "kinematics", "outputs": names}
        text = replace(text, data={**text.data, "analysis": {**analysis, **alone}})
    return build_selected(text, set=changes, backend=backend)


_Options = tuple[Any, ...]
_USUAL = {"backend": "auto", "precision": "float64", "digits": None, "contraction": "off", "vector": "none"}


def _built(scene: Any, options: _Options, set_: Mapping[str, Any] | None = None) -> Any:
    return _user_model(str(scene), options, set_) if is_user_file(scene) else _of_scene(scene, options, set_)


def _of_scene(scene: Any, options: _Options, set_: Mapping[str, Any] | None) -> _Mechanism:
    tools = tools_for(*options)
    text = text_of(scene)
    tunable, fixed = tuning.split(text, set_ or {})
    text = override(text, fixed)
    base = tools.in_float64
    description, library = base.cached(text, "", lambda f: compile_scene(text, base, f))
    from symgen.runtime.kernels.library import open_shipped

    if tools.compiler is None and options[0] == "auto":
        library = open_shipped(description) or library
        _warn(library)
    model = _model(Source(text, options, _equations, _built), tools, description, library)
    if not tunable:
        return model
    values = tuning.in_si(model, tunable, text.file)
    tuning.check_values(override(text, tunable))
    return model.with_parameters(**values)


def _user_model(path: str, options: _Options, set_: Mapping[str, Any] | None) -> SystemModel | GeneralModel:
    from symgen.pipeline.user_model import build_user

    tools = tools_for(*options)
    if tools.digits or tools.precision != FLOAT64:
        raise ModelError(f"{path} is no scene: it is computed in {FLOAT64.name}")
    source = Source(str(Path(path).resolve()), options, _equations, _built)
    model = build_user(Path(path), tools, source, _of_resolved)
    if not set_:
        return model
    if model.description.method == "system":
        raise ModelError(f"{path} is no scene: its System has no values to set")
    return model.with_parameters(**tuning.of_user(model, set_, path))


@dataclass(frozen=True, slots=True)
class ModelParts:
    """Parts of a model of a scene."""

    text: SceneText
    tools: BuildSettings
    description: Any
    library: Library
    equations: Source
    typed: Typed


def _model(source: Source, tools: BuildSettings, description: Any, library: Library) -> Any:
    from symgen.runtime.kernels.typed import Typed

    text = cast("SceneText", source.scene)

    kernels = cache(lambda lanes, series=False: _typed(text, tools, description, lanes, series))
    typed = Typed(tools.precision, tools.digits, kernels, cache(tools.core))
    if tools.digits or tools.precision != FLOAT64:
        typed.kernels(False)  # compilation errors are raised here
    parts = ModelParts(text, tools, description, library, source, typed)
    return method_of(description).load("model")(parts)


def loop_model(parts: ModelParts) -> LoopModel:
    """Return the model of a loop."""
    from symgen.runtime.loop.model import LoopModel

    text, base, description = parts.text, parts.tools.in_float64, parts.description

    analyses = cache(
        lambda kind, outputs, lanes=False: kernels_of_analysis(
            text, base, description, kind, outputs, resolved, lanes=lanes
        )
    )

    def resolved() -> Loop:
        from symgen.scene.resolve import resolve

        return cast("Loop", resolve(check_scene(text)))

    return LoopModel(description, parts.library, parts.equations, typed=parts.typed, analyses=analyses)


def elastic_model(parts: ModelParts) -> ElasticModel:
    """Return the model of a linkage with elastic links."""
    from symgen.pipeline.user_model import supply_elements
    from symgen.runtime.elastic.model import ElasticModel

    supply_elements(parts.description.elastic.beams, parts.tools.in_float64)
    text, base, d = parts.text, parts.tools.in_float64, parts.description
    of_rigid = replace(parts, equations=replace(parts.equations, rigid=True))
    rigid = cast("RodModel", linkage_model(of_rigid))
    return ElasticModel(rigid, cache(lambda: _turned_by_motor(text, base, d)))


def linkage_model(parts: ModelParts) -> RodModel | KinematicModel:
    """Return the model of a linkage, its elastic links taken as rigid."""
    text, tools, description, typed = parts.text, parts.tools, parts.description, parts.typed
    kernels = (description, parts.library, parts.equations)
    if description.kinematic:
        from symgen.runtime.rods.model.kinematic import KinematicModel

        return KinematicModel(*kernels, typed=typed)
    base = tools.in_float64

    def analysis(
        kind: str, stepping: bool, outputs: tuple[str, ...], lanes: bool = False
    ) -> tuple[Description, Library]:
        # Kernels of runs are in the type of the model; all others are in double precision.
        in_type = stepping and not tools.digits and tools.precision != FLOAT64
        chosen, of = (tools, tools.precision.name) if in_type else (base, "")
        return kernels_of_analysis(
            text, chosen, description, kind, outputs, lambda: _linkage(text), of, lanes
        )

    analyses = cache(analysis)
    if description.plane is None:
        from symgen.runtime.rods.model.rods import RodModel

        return RodModel(*kernels, analyses=analyses, typed=typed)
    from symgen.runtime.rods.model.plane import PlaneModel

    in_space = cache(lambda: _derived(text, base, description, "in-space", lambda: _linkage(text).as_written))
    return PlaneModel(*kernels, analyses=analyses, typed=typed, in_space=in_space)


def _typed(text: SceneText, tools: BuildSettings, base: Described, lanes: bool, series: bool) -> Library:
    """Return the kernels of a scene in the requested type, for one state per call or for batches.

    Kernels of batches with power series (``series``) are built apart, since few runs need them.
    """
    target = replace(tools, compiler=None) if tools.digits else tools.of_lanes if lanes else tools

    def described(program: Program, equations: str) -> Described:
        from symgen.pipeline.analysis import kernel_infos

        # With more digits, other constants may be equal.
        return replace(base, equations=equations, kernels=kernel_infos(program.kernels))

    def make(folder: Path) -> tuple[Described, Library]:
        return target.built(folder, lambda: derive(text), described, lanes, series)

    name = f"{target.digits}-digits" if target.digits else target.precision.name
    if lanes and target.compiler:
        name += "-lanes-series" if series else "-lanes"
    return target.cached(text, name, make, base=base)[1]


def compile_scene(text: SceneText, tools: BuildSettings, folder: Path) -> tuple[Any, Library]:
    """Run the whole pipeline into a folder: sources, library and description."""
    with no_collection():
        from symgen.scene.resolve import resolve

        resolved = resolve(check_scene(text))  # SceneText -> Scene -> Linkage | Loop
    return _of_resolved(resolved, tools, folder)


def _of_resolved(resolved: Linkage | Loop, tools: BuildSettings, folder: Path) -> tuple[Any, Library]:
    from symgen.pipeline.describe import describe, with_start

    with no_collection():
        system = system_of(resolved)  # Linkage | Loop -> System
    # System -> Program -> (SourceFile, ...) -> compilers at work, while the runtime is loaded -> Library
    description, library = tools.built(folder, lambda: system, partial(describe, resolved))
    return with_start(system, description, library), library


def _linkage(text: SceneText) -> Linkage:
    from symgen.scene.resolve import resolve_linkage

    return resolve_linkage(check_scene(text))


def _turned_by_motor(text: SceneText, tools: BuildSettings, base: Description) -> RodModel:
    """Return the linkage of a scene with rigid links, its crank turned by its motor."""

    def linkage() -> Linkage:
        from symgen.scene.elastic.motor import with_motor

        places = {p: base.start[i * len(base.axes) :][: len(base.axes)] for i, p in enumerate(base.free)}
        return with_motor(_linkage(text), places)

    return _derived(text, tools, base, "with-motor", linkage)


def _derived(
    text: SceneText, tools: BuildSettings, base: Description, name: str, linkage: Callable[[], Linkage]
) -> RodModel:
    """Return the model of a linkage derived from that of a scene; ``name`` states how."""
    from symgen.runtime.rods.model.rods import RodModel

    description, library = tools.cached(text, name, lambda f: _of_resolved(linkage(), tools, f), base=base)
    analyses = cache(
        lambda kind, _, of, lanes=False: kernels_of_analysis(
            text, tools, description, kind, of, linkage, name, lanes
        )
    )
    return RodModel(description, library, lambda: system_of(linkage()).by_name(), analyses=analyses)


def _equations(scene: SceneText | str) -> Mapping[str, Any]:
    """Return the matrices of a scene or a Python file by name, derived now."""
    from symgen.pipeline.subject import Equations, Subject

    return Equations(Subject.of(scene))


def _warn(library: Library) -> None:
    used = (
        "the kernels that came with symgen are used"
        if library.backend == "shipped"
        else "the NumPy backend is used, some hundred times slower than compiled kernels"
    )
    warnings.warn(f"no C compiler was found: {used}. {GET_A_COMPILER}", SlowBackendWarning, stacklevel=3)
