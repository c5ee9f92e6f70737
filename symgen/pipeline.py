"""From a scene to a model. The whole of symgen is :func:`compile_scene`; the rest is when to call it."""

from __future__ import annotations

import gc
import hashlib
import importlib.util
import os
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symgen.cache import Cache, Entry, key
from symgen.compiler import Compilation, Compiler, find_compiler
from symgen.describe import describe, with_start
from symgen.errors import (
    ModelError,
    SceneError,
    SlowBackendWarning,
    nearest,
)
from symgen.scene.loading import SceneText, check_scene, override, read_scene

if TYPE_CHECKING:
    from symgen.codegen.emit import SourceFile
    from symgen.lowering.kernel import Program
    from symgen.runtime.description import Described, Description
    from symgen.runtime.elastic_model import ElasticModel
    from symgen.runtime.library import Library
    from symgen.runtime.loop_model import LoopModel
    from symgen.runtime.model import Model
    from symgen.scene.linkage import Linkage
    from symgen.scene.loop import Loop
    from symgen.scene.schema import Scene
    from symgen.symbolic.system import System

BACKENDS = ("auto", "c", "numpy")
_DESCRIPTION, _LIBRARY = "description.json", "kernels.so"
_GENERATOR = ("scene", "symbolic", "joints", "elements", "mechanics", "models", "lowering", "codegen")


def build(
    scene: Scene | str | os.PathLike[str],
    *,
    set: Mapping[str, Any] | None = None,
    backend: str = "auto",
) -> Model | LoopModel | ElasticModel:
    """Derive, lower, emit and compile a scene, or take it from the cache.

    Returns a :class:`~symgen.runtime.model.Model`; of a scene with a link-joint table a
    :class:`~symgen.runtime.loop_model.LoopModel`, of one with elastic links an
    :class:`~symgen.runtime.elastic_model.ElasticModel`.

    Parameters
    ----------
    scene
        A shipped name, the path of a scene file, or a :class:`symgen.Scene`.
    set
        Values to replace: parameter names or dotted keys, as in ``symgen.load_scene``. Tunable parameters
        are changed without compiling again.
    backend
        ``c`` (a C compiler is needed), ``numpy`` (slow, needs none), or ``auto``: C where there is a
        compiler, else shipped kernels of the same equations, else NumPy, with a warning.

    Raises
    ------
    SceneError
        For anything wrong in the scene, its start that cannot be assembled or is contradictory included.
    BuildError, CacheError
        When the compiler fails, or the cache cannot be written.
    """
    if backend not in BACKENDS:
        raise ModelError(f"there is no backend {backend!r}. {nearest(backend, BACKENDS)}")
    text = _text_of(scene)
    tunable, fixed = _split(text, set or {})
    text = override(text, fixed)
    compiler = None if backend == "numpy" else find_compiler()
    if compiler is None and backend == "c":
        raise ModelError(f"the backend 'c' needs a C compiler, and there is none. {_GET_A_COMPILER}")
    description, library = _cached(text, compiler, "", lambda f: compile_scene(text, compiler, f))
    from symgen.runtime.library import open_shipped

    if compiler is None and backend == "auto":
        library = open_shipped(description) or library
        _warn(library)
    model = _model(text, compiler, description, library)
    if not tunable:
        return model
    values = _in_si(model, tunable, text.file)
    _check_values(override(text, tunable))
    return model.with_parameters(**values)


def _model(
    text: SceneText, compiler: Compiler | None, description: Any, library: Library
) -> Model | LoopModel | ElasticModel:
    from symgen.runtime.description import LoopDescription

    def equations() -> Any:
        return derive(text).by_name()

    if isinstance(description, LoopDescription):
        from symgen.runtime.loop_model import LoopModel

        return LoopModel(description, library, equations)
    from symgen.runtime.model import Model

    analyses = cache(lambda kind: _analysis(text, compiler, description, kind, lambda: _linkage(text)))
    model = Model(description, library, equations, analyses=analyses)
    if description.elastic is None:
        return model
    from symgen.runtime.elastic_model import ElasticModel

    return ElasticModel(model, cache(lambda count: _in_segments(text, compiler, description, count)))


def compile_scene(text: SceneText, compiler: Compiler | None, folder: Path) -> tuple[Any, Library]:
    """Run the whole pipeline into a folder: sources, library and description."""
    with _no_collection():
        from symgen.models.system import with_redundancy
        from symgen.scene.resolve import resolve

        resolved = resolve(check_scene(text))  # SceneText -> Scene -> Linkage | Loop
        system = system_of(resolved)  # Linkage | Loop -> System
    description, library = _compiled(resolved, system, compiler, folder)
    # That constraints are redundant shows at the start only: then the factorisation must expect it.
    tolerant = with_redundancy(system)
    if tolerant is not system and description.redundant:
        # In a folder of its own: a library of a path that is open already would not be loaded again.
        again = folder / "again"
        again.mkdir()
        description, library = _compiled(resolved, tolerant, compiler, again)
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
    from symgen.models.system import linkage_system

    return linkage_system(resolved)


def _compiled(
    resolved: Linkage | Loop, system: System, compiler: Compiler | None, folder: Path
) -> tuple[Any, Library]:
    with _no_collection():
        program, equations, sources = _lowered(system, compiler)  # System -> Program, (SourceFile, ...)
    compilation = _written(program, sources, compiler, folder)  # (SourceFile, ...) -> compilers at work
    description = describe(resolved, program, equations)  # the runtime is loaded while they work
    library = _opened(folder, description, compilation)  # -> Library
    return with_start(description, library), library


def _lowered(system: System, compiler: Compiler | None) -> tuple[Program, str, tuple[SourceFile, ...]]:
    from symgen.codegen.emit import emit, equations_hash
    from symgen.codegen.target import Target
    from symgen.lowering.program import lower_system

    program = lower_system(system)
    target = Target("c" if compiler else "numpy")
    equations = equations_hash(program, target)
    return program, equations, emit(program, target, equations)


def _linkage(text: SceneText) -> Linkage:
    from symgen.scene.resolve import resolve_linkage

    return resolve_linkage(check_scene(text))


def _analysis(
    text: SceneText,
    compiler: Compiler | None,
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
        with _no_collection():
            from symgen.models.analyses import analysis_system

            program, equations, sources = _lowered(analysis_system(linkage(), kind), compiler)
        compilation = _written(program, sources, compiler, folder)
        kernels = kernel_infos(program.kernels)
        description = replace(base, name=program.name, equations=equations, kernels=kernels)
        return description, _opened(folder, description, compilation)

    return _cached(text, compiler, f"{of}-{kind}" if of else kind, make)


def _in_segments(text: SceneText, compiler: Compiler | None, base: Description, count: int) -> Model:
    """Return the linkage of a scene with its elastic links as rods with springs between them."""
    from symgen.runtime.model import Model

    def linkage() -> Linkage:
        from symgen.scene.segments import segmented

        size = len(base.axes)
        places = {p: base.start[size * i : size * (i + 1)] for i, p in enumerate(base.free)}
        return segmented(_linkage(text), count, places)

    def equations() -> Any:
        return system_of(linkage()).by_name()

    def make(folder: Path) -> tuple[Description, Library]:
        with _no_collection():
            made = linkage()
            system = system_of(made)
        return _compiled(made, system, compiler, folder)

    name = f"segments-{count}"
    description, library = _cached(text, compiler, name, make)
    analyses = cache(lambda kind: _analysis(text, compiler, description, kind, linkage, name))
    return Model(description, library, equations, analyses=analyses)


def derive(scene: Scene | SceneText | str | os.PathLike[str]) -> System:
    """Return the derived equations of a scene: its SymPy matrices by name."""
    from symgen.scene.resolve import resolve

    return system_of(resolve(check_scene(_text_of(scene))))


def _text_of(scene: Any) -> SceneText:
    if isinstance(scene, SceneText):
        return scene
    if isinstance(scene, str | os.PathLike):
        return read_scene(scene)
    return SceneText(scene.name, scene.file, scene.model_dump(exclude_unset=True) | {"symgen": scene.symgen})


def _split(text: SceneText, changes: Mapping[str, str]) -> tuple[dict[str, str], dict[str, str]]:
    """Part the changes into those of tunable parameters and those that change the equations."""
    parameters = text.data.get("parameters", {})
    tunable = {}
    for name, value in changes.items():
        table = parameters.get(name) if isinstance(parameters, Mapping) else None
        if isinstance(table, Mapping) and table.get("tunable") is True:
            from symgen.scene.units import is_quantity

            if is_quantity(str(value)):
                tunable[name] = str(value)
    return tunable, {k: v for k, v in changes.items() if k not in tunable}


def _check_values(text: SceneText) -> None:
    """Check a scene with other values of its tunable parameters as if they were written in it."""
    from symgen.scene.resolve import resolve

    resolve(check_scene(text))


def _in_si(model: Model | LoopModel | ElasticModel, values: Mapping[str, str], file: str) -> dict[str, float]:
    from symgen.scene.units import parse_quantity

    result = {}
    for info in model.description.parameters:
        if info.name in values:
            try:
                number, dimension = parse_quantity(values[info.name])
                if dimension.unit != info.unit:
                    raise SceneError(f"expected a quantity in {info.unit}, got {values[info.name]!r}")
            except SceneError as error:
                raise error.located(where=f"parameters.{info.name}", file=file) from None
            result[info.name] = float(number)
    return result


def _cached(
    text: SceneText,
    compiler: Compiler | None,
    kind: str,
    make: Callable[[Path], tuple[Any, Library]],
) -> tuple[Any, Library]:
    """Take from the cache what ``make`` makes of a scene, or make it; ``kind`` is part of its name there."""
    store = Cache()
    how = compiler.identity if compiler else "numpy"
    parts = (text.file, text.canonical, _fingerprint(), how)
    name = "-".join(part for part in (text.name, kind, key(*parts)) if part)
    found = _from_cache(store.find(name))
    if found:
        return found
    with store.locked(name):
        found = _from_cache(store.find(name))
        if found:
            return found
        with store.building(name) as folder:
            description, library = make(folder)
            try:
                (folder / _DESCRIPTION).write_text(description.to_json(), encoding="utf-8")
            except OSError as error:
                raise store.error(error) from None
        return description, library


def _from_cache(entry: Entry | None) -> tuple[Described, Library] | None:
    if entry is None:
        return None
    from symgen.runtime.description import read_description

    try:
        description = read_description(entry.read_text(_DESCRIPTION))
        return description, _opened(entry.folder, description)
    except (KeyError, TypeError, ValueError, OSError):
        return None


def _opened(folder: Path, description: Described, compilation: Compilation | None = None) -> Library:
    """Open the kernels in a folder: the compiled library, else the NumPy source."""
    from symgen.runtime.library import open_library, open_numpy

    library = compilation.finish() if compilation else folder / _LIBRARY
    if library.is_file():
        return open_library(library, description)
    return open_numpy((folder / f"{description.name}_numpy.py").read_text(encoding="utf-8"), description)


def _written(
    program: Program, sources: tuple[SourceFile, ...], compiler: Compiler | None, folder: Path
) -> Compilation | None:
    """Write the sources and start the compiler on those in C."""
    try:
        for source in sources:
            (folder / source.name).write_text(source.text, encoding="utf-8")
    except OSError as error:
        raise Cache(folder.parent).error(error) from None
    if compiler is None:
        return None
    in_c = [folder / s.name for s in sources if s.name.endswith(".c")]
    return compiler.start(in_c, folder / _LIBRARY, functions=program.calls_functions)


@cache
def _fingerprint() -> str:
    """Return a hash of everything that decides the generated code besides the scene."""
    here = Path(__file__).resolve().parent
    files = [p for part in _GENERATOR for p in (here / part).rglob("*") if p.suffix in (".py", ".txt")]
    files += [Path(__file__), here / "describe.py", here / "runtime" / "description.py"]
    templates = importlib.util.find_spec("symgen.templates")
    if templates and templates.origin:
        files += Path(templates.origin).parent.rglob("*.j2")
    sympy = importlib.util.find_spec("sympy")
    if sympy and sympy.origin:
        files.append(Path(sympy.origin).with_name("release.py"))
    digest = hashlib.sha256()
    for path in sorted(files):
        digest.update(path.name.encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


_GET_A_COMPILER = (
    "Install one: 'apt install gcc' or 'dnf install gcc' on Linux, 'xcode-select --install' on macOS; "
    "or name it in CC."
)


def _warn(library: Library) -> None:
    what = (
        "the kernels that came with symgen are used"
        if library.backend == "shipped"
        else "the NumPy backend is used, some hundred times slower than compiled kernels"
    )
    warnings.warn(f"no C compiler was found: {what}. {_GET_A_COMPILER}", SlowBackendWarning, stacklevel=3)


@contextmanager
def _no_collection() -> Iterator[None]:
    """Pause the garbage collector: a derivation makes many objects that all live until its end."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
