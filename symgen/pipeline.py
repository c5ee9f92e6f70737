"""From a scene to a model. The whole of symgen is :func:`compile_scene`; the rest is when to call it."""

from __future__ import annotations

import gc
import hashlib
import importlib.util
import os
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symgen.cache import Cache, Entry, key
from symgen.compiler import Compilation, Compiler, find_compiler
from symgen.errors import (
    GenerationError,
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
    description, library = _cached(text, compiler, Cache())
    from symgen.runtime.library import open_shipped
    from symgen.runtime.model import Model

    if compiler is None and backend == "auto":
        library = open_shipped(description) or library
        _warn(library)
    model = Model(description, library, lambda: derive(text).by_name())
    return model.with_parameters(**_in_si(model, tunable, text.file)) if tunable else model


def compile_scene(text: SceneText, compiler: Compiler | None, folder: Path) -> tuple[Description, Library]:
    """Run the whole pipeline into a folder: sources, library and description."""
    with _no_collection():
        from symgen.codegen.emit import emit, equations_hash
        from symgen.codegen.target import Target
        from symgen.lowering.program import lower_system
        from symgen.models.system import linkage_system
        from symgen.scene.resolve import resolve

        linkage = resolve(check_scene(text))  # SceneText -> Scene -> Linkage
        system = linkage_system(linkage)  # Linkage -> System
        program = lower_system(system)  # System -> Program
        target = Target("c" if compiler else "numpy")
        equations = equations_hash(program, target)
        sources = emit(program, target, equations)  # Program -> (SourceFile, ...)
    compilation = _written(sources, compiler, folder)  # (SourceFile, ...) -> compilers at work
    description = _describe(linkage, program, equations)  # the runtime is loaded while they work
    library = _opened(folder, description, compilation)  # -> Library
    return _with_start(description, library), library


def derive(scene: Scene | SceneText | str | os.PathLike[str]) -> System:
    """Return the derived equations of a scene: its SymPy matrices by name."""
    from symgen.models.system import linkage_system
    from symgen.scene.resolve import resolve

    return linkage_system(resolve(check_scene(_text_of(scene))))


def shipped_sources() -> list[SourceFile]:
    """Generate everything that belongs under ``generated/``, in memory."""
    from symgen.codegen.emit import emit, equations_hash
    from symgen.codegen.loops import emit_loops, loops_hash
    from symgen.codegen.manifest import Shipped, manifest
    from symgen.codegen.target import Target
    from symgen.lowering.loop import lower_recursion
    from symgen.lowering.program import lower_system
    from symgen.models import BLOCKS, RECURSIONS, SHIPPED_SCENES

    systems = {name: make() for name, make in BLOCKS.items()}
    systems |= {name: derive(name) for name in SHIPPED_SCENES}
    models = {}
    for name, system in systems.items():
        program = lower_system(system)
        equations = equations_hash(program, Target())
        files = [f for language in ("c", "cython") for f in emit(program, Target(language), equations)]
        models[name] = Shipped(equations, files)
    for name, recursion in RECURSIONS.items():
        loops = lower_recursion(recursion())
        equations = loops_hash(loops)
        models[name] = Shipped(equations, emit_loops(loops, equations), optimisation=3)
    return [*(f for model in models.values() for f in model.files), manifest(models)]


def generated_folder() -> Path:
    """Return the folder of the committed kernels."""
    import symgen.generated

    return Path(str(symgen.generated.__file__)).resolve().parent


def generate() -> list[str]:
    """Write ``generated/`` anew in a checkout; return the names of the files that changed."""
    from symgen.atomic import write_text
    from symgen.codegen.manifest import write
    from symgen.scene.units import UNITS, answers

    folder = generated_folder()
    if not (folder.parent / "pyproject.toml").is_file():
        raise GenerationError(
            f"{folder} is not part of a checkout of symgen; only 'symgen generate --check' works"
        )
    touched = write(folder, shipped_sources())
    if UNITS.read_text(encoding="utf-8") != answers():
        write_text(UNITS, answers())
        touched.append(f"../symgen/scene/{UNITS.name}")
    return touched


def not_current() -> list[str]:
    """Return a difference for every generated file that is not what the derivation gives."""
    from symgen.codegen.manifest import differences
    from symgen.scene.units import UNITS, answers

    found = differences(generated_folder(), shipped_sources())
    if UNITS.read_text(encoding="utf-8") != answers():
        found.append(f"{UNITS} is not what Pint answers\n")
    return found


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


def _cached(text: SceneText, compiler: Compiler | None, store: Cache) -> tuple[Description, Library]:
    name = f"{text.name}-{key(text.canonical, _fingerprint(), compiler.identity if compiler else 'numpy')}"
    found = _from_cache(store.find(name))
    if found:
        return found
    with store.locked(name):
        found = _from_cache(store.find(name))
        if found:
            return found
        with store.building(name) as folder:
            description, library = compile_scene(text, compiler, folder)
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
    from symgen.mechanics.loads import AXES
    from symgen.runtime.description import BlockInfo, Description, KernelInfo, ParameterInfo

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
        constraints=tuple(r.removesuffix("_lambda") for r in solution["multipliers"].rows),
        labels=tuple(
            s.description.removeprefix("multiplier of ") for s in work if s.name.endswith("_lambda")
        ),
        work_of_loads=any(b.name == "power" for b in kernels["energy"].blocks),
        parameters=tuple(
            ParameterInfo(p.quantity.name, p.quantity.unit, p.quantity.description, float(p.default))
            for p in linkage.parameters
        ),
        kernels=tuple(
            KernelInfo(
                k.name,
                k.work_size,
                k.out_size,
                {kind: getattr(k.counts, kind) for kind in ("add", "mul", "div", "neg", "call", "flops")},
                tuple(
                    BlockInfo(b.name, b.offset, b.shape, b.unit, b.description, b.rows, b.columns)
                    for b in k.blocks
                ),
            )
            for k in program.kernels
        ),
        first_pivot=program.pivots,
        start=(),
        t_end=float(linkage.t_end.xreplace(dict(linkage.defaults))),
        references=program.references,
        left_out=program.left_out,
    )


def _with_start(description: Description, library: Library) -> Description:
    """Find the start of the scene, which also tells whether there is one."""
    from dataclasses import replace

    import numpy as np

    from symgen.runtime.evaluate import Evaluator
    from symgen.runtime.initial import start
    from symgen.runtime.model import Model

    evaluator = Evaluator(description, library, np.array([p.default for p in description.parameters]))
    try:
        q, u = start(evaluator)
        described = replace(description, start=(*q.tolist(), *u.tolist()))
        Model(described, library, lambda: None).initial_state()
    except InitialStateError as error:
        problem, _, hint = str(error).partition("\n")
        raise SceneError(problem, where=error.where, file=description.file, hint=hint.strip()) from None
    return described


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
