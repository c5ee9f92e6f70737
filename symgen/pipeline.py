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
from symgen.errors import (
    InitialStateError,
    ModelError,
    SceneError,
    SlowBackendWarning,
    nearest,
)
from symgen.scene.loading import SceneText, check_scene, override, read_scene

if TYPE_CHECKING:
    from symgen.codegen.emit import SourceFile
    from symgen.lowering.kernel import Program
    from symgen.runtime.description import Description
    from symgen.runtime.library import Library
    from symgen.runtime.model import Model
    from symgen.scene.linkage import Linkage
    from symgen.scene.schema import Scene
    from symgen.symbolic.system import System

BACKENDS = ("auto", "c", "numpy")
_DESCRIPTION, _LIBRARY = "description.json", "kernels.so"
_GENERATOR = ("scene", "symbolic", "mechanics", "models", "lowering", "codegen")


def build(
    scene: Scene | str | os.PathLike[str],
    *,
    set: Mapping[str, str] | None = None,
    backend: str = "auto",
) -> Model:
    """Derive, lower, emit and compile a scene, or take it from the cache.

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
    from symgen.runtime.model import Model

    if compiler is None and backend == "auto":
        library = open_shipped(description) or library
        _warn(library)
    model = Model(
        description,
        library,
        lambda: derive(text).by_name(),
        analyses=cache(lambda kind: _analysis(text, compiler, description, kind)),
    )
    if not tunable:
        return model
    values = _in_si(model, tunable, text.file)
    _check_values(override(text, tunable))
    return model.with_parameters(**values)


def compile_scene(text: SceneText, compiler: Compiler | None, folder: Path) -> tuple[Description, Library]:
    """Run the whole pipeline into a folder: sources, library and description."""
    with _no_collection():
        from symgen.models.system import linkage_system, with_redundancy
        from symgen.scene.resolve import resolve_linkage

        linkage = resolve_linkage(check_scene(text))  # SceneText -> Scene -> Linkage
        system = linkage_system(linkage)  # Linkage -> System
    description, library = _compiled(linkage, system, compiler, folder)
    # That constraints are redundant shows at the start only: then the factorisation must expect it.
    tolerant = with_redundancy(system)
    if description.redundant and tolerant is not system:
        # In a folder of its own: a library of a path that is open already would not be loaded again.
        again = folder / "again"
        again.mkdir()
        description, library = _compiled(linkage, tolerant, compiler, again)
        for file in sorted(again.iterdir()):
            file.replace(folder / file.name)
        again.rmdir()
    return description, library


def _compiled(
    linkage: Linkage, system: System, compiler: Compiler | None, folder: Path
) -> tuple[Description, Library]:
    with _no_collection():
        program, equations, sources = _lowered(system, compiler)  # System -> Program, (SourceFile, ...)
    compilation = _written(sources, compiler, folder)  # (SourceFile, ...) -> compilers at work
    description = _describe(linkage, program, equations)  # the runtime is loaded while they work
    library = _opened(folder, description, compilation)  # -> Library
    return _with_start(description, library), library


def _lowered(system: System, compiler: Compiler | None) -> tuple[Program, str, tuple[SourceFile, ...]]:
    from symgen.codegen.emit import emit, equations_hash
    from symgen.codegen.target import Target
    from symgen.lowering.program import lower_system

    program = lower_system(system)
    target = Target("c" if compiler else "numpy")
    equations = equations_hash(program, target)
    return program, equations, emit(program, target, equations)


def _analysis(
    text: SceneText, compiler: Compiler | None, base: Description, kind: str
) -> tuple[Description, Library]:
    """Return the kernels of one kind of analysis, which are made when it is first asked for."""
    from symgen.runtime.description import kernel_infos

    def make(folder: Path) -> tuple[Description, Library]:
        with _no_collection():
            from symgen.models.linearised import analysis_system
            from symgen.scene.resolve import resolve_linkage

            program, equations, sources = _lowered(
                analysis_system(resolve_linkage(check_scene(text)), kind), compiler
            )
        compilation = _written(sources, compiler, folder)
        kernels = kernel_infos(program.kernels)
        description = replace(base, name=program.name, equations=equations, kernels=kernels)
        return description, _opened(folder, description, compilation)

    return _cached(text, compiler, kind, make)


def derive(scene: Scene | SceneText | str | os.PathLike[str]) -> System:
    """Return the derived equations of a scene: its SymPy matrices by name."""
    from symgen.models.system import linkage_system
    from symgen.scene.resolve import resolve_linkage

    return linkage_system(resolve_linkage(check_scene(_text_of(scene))))


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


def _in_si(model: Model, values: Mapping[str, str], file: str) -> dict[str, float]:
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
    make: Callable[[Path], tuple[Description, Library]],
) -> tuple[Description, Library]:
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


def _from_cache(entry: Entry | None) -> tuple[Description, Library] | None:
    if entry is None:
        return None
    from symgen.runtime.description import Description

    try:
        description = Description.from_json(entry.read_text(_DESCRIPTION))
        return description, _opened(entry.folder, description)
    except (KeyError, TypeError, ValueError, OSError):
        return None


def _opened(folder: Path, description: Description, compilation: Compilation | None = None) -> Library:
    """Open the kernels in a folder: the compiled library, else the NumPy source."""
    from symgen.runtime.library import open_library, open_numpy

    library = compilation.finish() if compilation else folder / _LIBRARY
    if library.is_file():
        return open_library(library, description)
    return open_numpy((folder / f"{description.name}_numpy.py").read_text(encoding="utf-8"), description)


def _written(sources: tuple[SourceFile, ...], compiler: Compiler | None, folder: Path) -> Compilation | None:
    """Write the sources and start the compiler on those in C."""
    try:
        for source in sources:
            (folder / source.name).write_text(source.text, encoding="utf-8")
    except OSError as error:
        raise Cache(folder.parent).error(error) from None
    if compiler is None:
        return None
    return compiler.start([folder / s.name for s in sources if s.name.endswith(".c")], folder / _LIBRARY)


def _describe(linkage: Linkage, program: Program, equations: str) -> Description:
    from symgen.runtime.description import Description, ParameterInfo, kernel_infos
    from symgen.symbolic.quantity import AXES

    kernels = {k.name: k for k in program.kernels}
    solution = {b.name: b for b in kernels["accelerations"].blocks}
    work = next(slots for name, _, slots in program.groups if name == "work")
    return Description(
        name=program.name,
        file=linkage.file,
        title=program.title,
        equations=equations,
        axes=tuple(AXES[: linkage.dimension]),
        points=tuple(p.name for p in linkage.points),
        free=tuple(dict.fromkeys(r.rpartition("_")[0] for r in solution["accelerations"].rows)),
        ground=tuple(p.name for p in linkage.points if p.ground),
        links={k.name: [k.start, k.end, *(p.name for p in k.carried)] for k in linkage.links},
        constraints=tuple(r.removesuffix("_lambda") for r in solution["multipliers"].rows),
        labels=tuple(
            s.description.removeprefix("multiplier of ") for s in work if s.name.endswith("_lambda")
        ),
        work_of_loads=any(b.name == "power" for b in kernels["energy"].blocks),
        parameters=tuple(
            ParameterInfo(p.quantity.name, p.quantity.unit, p.quantity.description, float(p.default))
            for p in linkage.parameters
        ),
        kernels=kernel_infos(program.kernels),
        first_pivot=program.pivots,
        start=(),
        redundant=(),
        t_end=float(linkage.t_end.xreplace(dict(linkage.defaults))),
        assembly_tolerance=float(linkage.assembly_tolerance.xreplace(dict(linkage.defaults))),
        rank_tolerance=float(program.rank_tolerance),
        references=program.references,
        left_out=program.left_out,
    )


def _with_start(description: Description, library: Library) -> Description:
    """Find the start of the scene, which also tells whether there is one."""
    import numpy as np

    from symgen.runtime.evaluate import Evaluator
    from symgen.runtime.initial import start

    evaluator = Evaluator(description, library, np.array([p.default for p in description.parameters]))
    try:
        found = start(evaluator)
    except InitialStateError as error:
        problem, _, hint = str(error).partition("\n")
        raise SceneError(problem, where=error.where, file=description.file, hint=hint.strip()) from None
    return replace(description, start=(*found.q.tolist(), *found.u.tolist()), redundant=found.redundant)


@cache
def _fingerprint() -> str:
    """Return a hash of everything that decides the generated code besides the scene."""
    here = Path(__file__).resolve().parent
    files = [p for part in _GENERATOR for p in (here / part).rglob("*") if p.suffix in (".py", ".txt")]
    files += [Path(__file__), here / "runtime" / "description.py"]
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
