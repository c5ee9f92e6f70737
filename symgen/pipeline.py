"""From a scene to a model. The whole of symgen is :func:`compile_scene`; the rest is when to call it."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from symgen import tuning
from symgen.describe import describe, with_start
from symgen.errors import ModelError, SlowBackendWarning
from symgen.making import GET_A_COMPILER, Tools, no_collection, tools_for
from symgen.own import is_own, load
from symgen.precision import FLOAT64
from symgen.scene.loading import SceneText, check_scene, override, read_scene

if TYPE_CHECKING:
    from symgen.runtime.description import Described, Description
    from symgen.runtime.elastic_model import ElasticModel
    from symgen.runtime.kinematic_model import KinematicModel
    from symgen.runtime.library import Library
    from symgen.runtime.loop_model import LoopModel
    from symgen.runtime.model import Model
    from symgen.runtime.system_model import SystemModel
    from symgen.scene.linkage import Linkage
    from symgen.scene.loop import Loop
    from symgen.scene.schema import Scene
    from symgen.symbolic.system import System

    _WithForces = Model | LoopModel | ElasticModel
    _Mechanism = _WithForces | KinematicModel


def build(
    scene: Scene | SceneText | str | os.PathLike[str],
    *,
    set: Mapping[str, Any] | None = None,
    backend: str = "auto",
    precision: str = "float64",
    digits: int | None = None,
    contraction: str = "off",
    vector: str = "none",
) -> _Mechanism | SystemModel:
    """Derive, lower, emit and compile a scene or a user's own derivation, or take it from the cache.

    Returns a :class:`~symgen.runtime.model.Model`; of a scene with a link-joint table a
    :class:`~symgen.runtime.loop_model.LoopModel`, of one that asks for kinematics a
    :class:`~symgen.runtime.kinematic_model.KinematicModel`, of one with elastic links an
    :class:`~symgen.runtime.elastic_model.ElasticModel`; of a Python file that returns a System a
    :class:`~symgen.runtime.system_model.SystemModel`.

    Parameters
    ----------
    scene
        A shipped name, the path of a scene file, or a :class:`symgen.Scene`; or the path of a Python file,
        which is run.
    set
        Values to replace: parameter names or dotted keys, as in ``symgen.load_scene``. Tunable parameters
        are changed without compiling again.
    backend
        ``c`` (a C compiler is needed), ``numpy`` (slow, needs none), or ``auto``: C where there is a
        compiler, else shipped kernels of the same equations, else NumPy, with a warning. ``mpmath`` adds
        kernels in any number of digits, as a reference: see :meth:`~symgen.runtime.compiled.Compiled.batch`.
    precision
        ``float32``, ``float64``, ``longdouble`` or ``float128``: the type that runs of rods and batches are
        computed in, see ``docs/precision.md``.
    digits
        Digits of the backend mpmath (40).
    contraction
        ``off``, or ``fast``: products and sums in one rounding where the processor has that.
    vector
        ``none``: any processor of this kind runs what is compiled; or ``native``: for this processor.

    Raises
    ------
    SceneError
        For anything wrong in the scene, its start that cannot be assembled or is contradictory included.
    DerivationError
        When a Python file fails, or returns no System.
    BuildError, CacheError
        When the compiler fails, or the cache cannot be written.
    """
    options = (backend, precision, digits, contraction, vector)
    return _own(str(scene), options, set) if is_own(scene) else _of_scene(scene, options, set)


def build_scene(scene: Scene | SceneText | str | os.PathLike[str], **options: Any) -> _WithForces:
    """Do the same as :func:`build` for a scene alone: for what asks for a mechanism and its forces.

    Raises
    ------
    ModelError
        When the scene asks for kinematics alone.
    """
    return with_forces(build_asked(scene, **options))


def with_forces(made: _Mechanism) -> _WithForces:
    """Return a model as one that has forces; raise ModelError where its scene asks for kinematics alone."""
    if is_kinematic(made):
        raise ModelError(
            f"{made.name} asks for kinematics, so that it has no forces\n"
            '  Write kind = "dynamics" under [analysis], or give --set analysis.kind=dynamics.'
        )
    return cast("_WithForces", made)


def is_kinematic(made: _Mechanism) -> bool:
    """Tell whether a model has no forces, without loading what such models need."""
    return bool(getattr(made.description, "kinematic", False))


def build_asked(
    scene: Scene | SceneText | str | os.PathLike[str],
    *,
    set: Mapping[str, Any] | None = None,
    backend: str = "auto",
    precision: str = "float64",
    digits: int | None = None,
    contraction: str = "off",
    vector: str = "none",
) -> _Mechanism:
    """Do the same as :func:`build` for a scene alone: for what evaluates what it asks for."""
    return _of_scene(scene, (backend, precision, digits, contraction, vector), set)


def build_kinematics(
    scene: Scene | SceneText | str | os.PathLike[str],
    *,
    set: Mapping[str, Any] | None = None,
    backend: str = "auto",
) -> KinematicModel:
    """Build what the kinematics of a scene needs, whatever else it asks for.

    Raises
    ------
    ModelError
        For a link-joint table.
    """
    text = text_of(scene)
    if "loop" in text.data:
        raise ModelError(
            f"kinematics is for linkages of points and links, and {text.name} is a link-joint table\n"
            f"  'symgen run {text.name}' evaluates it."
        )
    changes, analysis = dict(set or {}), text.data.get("analysis", {})
    if isinstance(analysis, dict) and changes.pop("analysis.kind", analysis.get("kind")) != "kinematics":
        alone = {"kind": "kinematics", "outputs": []}
        text = replace(text, data={**text.data, "analysis": {**analysis, **alone}})
    made = _of_scene(text, (backend, FLOAT64.name, None, "off", "none"), changes)
    return cast("KinematicModel", made)


_Options = tuple[str, str, int | None, str, str]


def _of_scene(scene: Any, options: _Options, set_: Mapping[str, Any] | None) -> _Mechanism:
    tools = tools_for(*options)
    text = text_of(scene)
    tunable, fixed = tuning.split(text, set_ or {})
    text = override(text, fixed)
    base = tools.in_float64
    description, library = base.cached(text, "", lambda f: compile_scene(text, base, f))
    from symgen.runtime.library import open_shipped

    if tools.compiler is None and options[0] == "auto":
        library = open_shipped(description) or library
        _warn(library)
    model = _model(text, tools, description, library)
    if not tunable:
        return model
    values = tuning.in_si(model, tunable, text.file)
    tuning.check_values(override(text, tunable))
    return model.with_parameters(**values)


def _own(path: str, options: _Options, set_: Mapping[str, Any] | None) -> SystemModel:
    from symgen.own_model import build_own

    tools = tools_for(*options)
    if set_ or tools.digits or tools.precision != FLOAT64:
        raise ModelError(f"{path} is no scene: it has no values to set, and is in {FLOAT64.name}")
    return build_own(Path(path), tools)


def _model(text: SceneText, tools: Tools, description: Any, library: Library) -> _Mechanism:
    from symgen.runtime.description import LoopDescription
    from symgen.runtime.typed import Typed

    def equations() -> Any:
        return derive(text).by_name()

    kernels = cache(lambda lanes: _typed(text, tools, description, lanes))
    typed = Typed(tools.precision, tools.digits, kernels, cache(tools.core))
    if tools.digits or tools.precision != FLOAT64:
        typed.kernels(False)  # what cannot be compiled is said now
    if isinstance(description, LoopDescription):
        from symgen.runtime.loop_model import LoopModel

        return LoopModel(description, library, equations, typed=typed)
    if description.kinematic:
        from symgen.runtime.kinematic_model import KinematicModel

        return KinematicModel(description, library, equations, typed=typed)
    from symgen.runtime.model import Model

    base = tools.in_float64

    def analysis(kind: str, stepping: bool) -> tuple[Description, Library]:
        # What runs step through is in their type; all else is in double precision.
        in_type = stepping and not tools.digits and tools.precision != FLOAT64
        made, of = (tools, tools.precision.name) if in_type else (base, "")
        return _analysis(text, made, description, kind, lambda: _linkage(text), of)

    analyses = cache(analysis)
    if description.plane is not None:
        from symgen.runtime.in_its_plane import ModelInItsPlane

        in_space = cache(lambda: _made_of(text, base, "in-space", lambda: _linkage(text).as_written))
        return ModelInItsPlane(
            description, library, equations, analyses=analyses, typed=typed, in_space=in_space
        )
    model = Model(description, library, equations, analyses=analyses, typed=typed)
    if description.elastic is None:
        return model
    from symgen.runtime.elastic_model import ElasticModel

    return ElasticModel(model, cache(lambda count: _in_segments(text, base, description, count)))


def _typed(text: SceneText, tools: Tools, base: Described, lanes: bool) -> Library:
    """Return the kernels of a scene in the type that was asked for, for one state a call or for many."""
    from symgen.runtime.description import Description, kernel_infos

    made = replace(tools, compiler=None) if tools.digits else tools

    def make(folder: Path) -> tuple[Described, Library]:
        with no_collection():
            from symgen.models.system import with_redundancy

            system = derive(text)
            if isinstance(base, Description) and base.redundant:
                system = with_redundancy(system)
            program, equations, sources = made.lowered(system, lanes)
        compilation = made.written(program, sources, folder, lanes)
        # Of more digits, other constants may be equal.
        description = replace(base, equations=equations, kernels=kernel_infos(program.kernels))
        return description, made.opened(folder, description, compilation)

    name = f"{made.digits}-digits" if made.digits else made.precision.name
    return made.cached(text, f"{name}-lanes" if lanes and made.compiler else name, make)[1]


def compile_scene(text: SceneText, tools: Tools, folder: Path) -> tuple[Any, Library]:
    """Run the whole pipeline into a folder: sources, library and description."""
    with no_collection():
        from symgen.scene.resolve import resolve

        resolved = resolve(check_scene(text))  # SceneText -> Scene -> Linkage | Loop
    return _of_resolved(resolved, tools, folder)


def _of_resolved(resolved: Linkage | Loop, tools: Tools, folder: Path) -> tuple[Any, Library]:
    with no_collection():
        from symgen.models.system import with_redundancy

        system = system_of(resolved)  # Linkage | Loop -> System
    description, library = _compiled(resolved, system, tools, folder)
    # That constraints are redundant shows at the start only: then the factorisation must expect it.
    tolerant = with_redundancy(system)
    if tolerant is not system and description.redundant:
        # In a folder of its own: a library of a path that is open already would not be loaded again.
        again = folder / "again"
        again.mkdir()
        description, library = _compiled(resolved, tolerant, tools, again)
        for file in sorted(again.iterdir()):
            file.replace(folder / file.name)
        again.rmdir()
    return description, library


def system_of(resolved: Linkage | Loop) -> System:
    """Return the System of a resolved scene."""
    from symgen.scene.loop import Loop

    if isinstance(resolved, Loop):
        from symgen.models.loop import loop_system

        return loop_system(resolved)
    if resolved.kinematic:
        from symgen.models.driven import driven_system

        return driven_system(resolved)
    from symgen.models.system import linkage_system

    return linkage_system(resolved)


def _compiled(resolved: Linkage | Loop, system: System, tools: Tools, folder: Path) -> tuple[Any, Library]:
    with no_collection():
        program, equations, sources = tools.lowered(system)  # System -> Program, (SourceFile, ...)
    compilation = tools.written(program, sources, folder)  # (SourceFile, ...) -> compilers at work
    description = describe(resolved, program, equations)  # the runtime is loaded while they work
    library = tools.opened(folder, description, compilation)  # -> Library
    return with_start(description, library), library


def _linkage(text: SceneText) -> Linkage:
    from symgen.scene.resolve import resolve_linkage

    return resolve_linkage(check_scene(text))


def _analysis(
    text: SceneText,
    tools: Tools,
    base: Description,
    kind: str,
    linkage: Callable[[], Linkage],
    of: str = "",
) -> tuple[Description, Library]:
    """Return the kernels of one kind of analysis, which are made when it is first asked for.

    ``linkage`` gives the linkage of the scene, or what was made of it, which ``of`` names.
    """
    from symgen.runtime.description import kernel_infos

    def make(folder: Path) -> tuple[Description, Library]:
        with no_collection():
            from symgen.models.analyses import analysis_system

            program, equations, sources = tools.lowered(analysis_system(linkage(), kind))
        compilation = tools.written(program, sources, folder)
        kernels = kernel_infos(program.kernels)
        description = replace(base, name=program.name, equations=equations, kernels=kernels)
        return description, tools.opened(folder, description, compilation)

    return tools.cached(text, f"{of}-{kind}" if of else kind, make)


def _in_segments(text: SceneText, tools: Tools, base: Description, count: int) -> Model:
    """Return the linkage of a scene with its elastic links as rods with springs between them."""

    def linkage() -> Linkage:
        from symgen.scene.segments import segmented

        size = len(base.axes)
        places = {p: base.start[size * i : size * (i + 1)] for i, p in enumerate(base.free)}
        return segmented(_linkage(text), count, places)

    return _made_of(text, tools, f"segments-{count}", linkage)


def _made_of(text: SceneText, tools: Tools, name: str, linkage: Callable[[], Linkage]) -> Model:
    """Return the model of a linkage that was made of that of a scene; ``name`` says how."""
    from symgen.runtime.model import Model

    def equations() -> Any:
        return system_of(linkage()).by_name()

    description, library = tools.cached(text, name, lambda folder: _of_resolved(linkage(), tools, folder))
    analyses = cache(lambda kind, _: _analysis(text, tools, description, kind, linkage, name))
    return Model(description, library, equations, analyses=analyses)


def derive(scene: Scene | SceneText | str | os.PathLike[str]) -> System:
    """Return the derived equations of a scene, or of a Python file that returns a System."""
    from symgen.scene.resolve import resolve

    if is_own(scene):
        return load(Path(str(scene))).system

    return system_of(resolve(check_scene(text_of(scene))))


def text_of(scene: Any) -> SceneText:
    """Return the tables of a scene given as a name, a path, in Python, or read already."""
    if isinstance(scene, SceneText):
        return scene
    if isinstance(scene, str | os.PathLike):
        return read_scene(scene)
    return SceneText(scene.name, scene.file, scene.model_dump(exclude_unset=True) | {"symgen": scene.symgen})


def _warn(library: Library) -> None:
    what = (
        "the kernels that came with symgen are used"
        if library.backend == "shipped"
        else "the NumPy backend is used, some hundred times slower than compiled kernels"
    )
    warnings.warn(f"no C compiler was found: {what}. {GET_A_COMPILER}", SlowBackendWarning, stacklevel=3)
