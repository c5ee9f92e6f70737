"""A scene as C for other programs: kernels, the core that runs them, an example, a check of the numbers."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symgen.errors import GenerationError

if TYPE_CHECKING:
    from symgen.codegen.emit import SourceFile
    from symgen.export.view import Exported
    from symgen.lowering.kernel import Program
    from symgen.scene.loading import SceneText
    from symgen.scene.schema import Scene
    from symgen.symbolic.system import System

#: The templates of an export, and the file each makes of a scene's name.
TEMPLATES = (
    ("model.h.j2", "{}.h"),
    ("model.c.j2", "{}.c"),
    ("main.c.j2", "main.c"),
    ("check.c.j2", "check.c"),
    ("CMakeLists.txt.j2", "CMakeLists.txt"),
    ("README.md.j2", "README.md"),
)
_NAMES = "core/names.h"
#: Names that C has, C++ besides it, their headers and compilers, or the files of an export.
_TAKEN = {
    "alignas", "alignof", "and", "and_eq", "asm", "assert", "auto", "bitand", "bitor", "bool", "break",
    "case", "catch", "char", "char16_t", "char32_t", "char8_t", "check", "class", "co_await", "co_return",
    "co_yield", "compl", "complex", "concept", "const", "const_cast", "consteval", "constexpr", "constinit",
    "continue", "core", "ctype", "decltype", "default", "delete", "do", "double", "dynamic_cast", "else",
    "enum", "EOF", "equations", "errno", "explicit", "export", "extern", "false", "fenv", "float", "for",
    "friend", "goto", "i386", "if", "INFINITY", "inline", "int", "inttypes", "iso646", "kernel", "limits",
    "linux", "locale", "long", "main", "math", "mutable", "namespace", "NAN", "new", "noexcept", "not",
    "not_eq", "NULL", "nullptr", "operator", "or", "or_eq", "private", "protected", "public", "real",
    "register", "reinterpret_cast", "requires", "restrict", "return", "run", "setjmp", "short", "signal",
    "signed", "size_t", "sizeof", "static", "static_assert", "static_cast", "stdalign", "stdarg", "stdatomic",
    "stdbool", "stddef", "stdint", "stdio", "stdlib", "stdnoreturn", "string", "struct", "switch", "template",
    "tgmath", "this", "thread_local", "threads", "throw", "time", "true", "try", "typedef", "typeid",
    "typename", "typeof", "typeof_unqual", "uchar", "union", "unix", "unsigned", "using", "virtual", "void",
    "volatile", "wchar", "wchar_t", "wctype", "while", "xor", "xor_eq",
}  # fmt: skip
#: What a header of the core declares with a name that programs see.
_DECLARED = re.compile(
    r"^(?!static|typedef)(?:extern )?(?:const )?(?:struct )?\w+ \**(\w+)(?:\(|;)", re.MULTILINE
)
#: What it calls by names of its own: tags, macros, types; and functions as an export calls its own.
_MEANT = re.compile(
    r"^(?:#define|struct|enum|union) (\w+)|^typedef \w+ (\w+)|^\w[\w *]*?\b(\w+)_(?:bytes|start)\(",
    re.MULTILINE,
)


def export_c(
    scene: Scene | str | os.PathLike[str],
    folder: str | os.PathLike[str],
    *,
    set: Mapping[str, Any] | None = None,
) -> list[str]:
    """Write a scene as C into a folder; return the names of the files.

    Parameters
    ----------
    scene
        A shipped name, the path of a scene file, or a :class:`symgen.Scene`.
    folder
        A folder that is not there, is empty, or holds an earlier export that nobody changed.
    set
        Values to replace: parameter names or dotted keys, as in ``symgen.load_scene``.

    Raises
    ------
    SceneError
        For anything wrong in the scene.
    ModelError
        When its name is one that C has, or the core.
    ResultError
        When the folder holds something else, or cannot be written. Nothing is written then.
    """
    from symgen.errors import ModelError
    from symgen.export.folder import place, write
    from symgen.pipeline import text_of

    name = text_of(scene).name
    if name in _TAKEN or name in _of_core():
        raise ModelError(
            f"a scene called {name!r} cannot be exported: C, C++ or a file of the export has that name\n"
            "  Export a copy of it under another name."
        )
    files_there = place(Path(folder))
    return write(Path(folder), list(files_of(scene, set)), files_there)


def _of_core() -> set[str]:
    """Return the names that the headers of the core give a meaning, whichever of them an export has."""
    from symgen.export.view import CORE_FOLDER

    headers = "".join(path.read_text(encoding="utf-8") for path in CORE_FOLDER.glob("*.h"))
    return {name for found in _MEANT.findall(headers) for name in found if name}


def files_of(
    scene: Scene | str | os.PathLike[str], set: Mapping[str, Any] | None = None
) -> Iterator[SourceFile]:
    """Yield the files of an export."""
    from symgen.codegen.emit import SourceFile, environment
    from symgen.export.view import CORE_FOLDER

    x = exported(scene, set)
    for template, name in TEMPLATES:
        text = environment().get_template(f"export/{template}").render(x=x)
        yield SourceFile(name.format(x.name), text)
    yield from x.kernels
    names = "".join(
        (CORE_FOLDER / name).read_text(encoding="utf-8") for name in x.core if name.endswith(".h")
    )
    found = sorted({*_DECLARED.findall(names), "explicit_kind"})
    text = environment().get_template("export/names.h.j2").render(x=x, names=found)
    yield SourceFile(_NAMES, text)
    for name in x.core:
        text = (CORE_FOLDER / name).read_text(encoding="utf-8")
        yield SourceFile(f"core/{name}", f'#include "names.h"\n{text}' if name == "real.h" else text)


def exported(scene: Scene | str | os.PathLike[str], set: Mapping[str, Any] | None = None) -> Exported:
    """Return what the templates of an export see of a scene."""
    from symgen.pipeline import build_scene, text_of
    from symgen.runtime.elastic_model import ElasticModel
    from symgen.runtime.loop_model import LoopModel
    from symgen.scene.loading import override

    text = override(text_of(scene), set or {})
    model = build_scene(text)
    program, sources = _emitted(_system(text, model), model.description.equations)
    if isinstance(model, LoopModel):
        from symgen.export.loop import loop

        return loop(model, program, sources)
    if isinstance(model, ElasticModel):
        from symgen.export.elastic import elastic

        parts = {kind: _emitted(system) for kind, system in _elastic_systems(text).items()}
        more = tuple(f for _, files in parts.values() for f in files)
        return elastic(model, program, (*sources, *more), {kind: p.name for kind, (p, _) in parts.items()})
    from symgen.export.rods import rods

    return rods(model, program, sources)


def _system(text: SceneText, model: Any) -> System:
    """Return the equations of motion, as the model was made of them."""
    from symgen.models.system import with_redundancy
    from symgen.pipeline import derive

    system = derive(text)
    return with_redundancy(system) if getattr(model.description, "redundant", ()) else system


def _elastic_systems(text: SceneText) -> dict[str, System]:
    from symgen.models.analyses import elastic_systems
    from symgen.scene.loading import check_scene
    from symgen.scene.resolve import resolve_linkage

    return elastic_systems(resolve_linkage(check_scene(text)))


def _emitted(system: System, expected: str = "") -> tuple[Program, tuple[SourceFile, ...]]:
    """Return the program of a system, and its sources in C.

    Raises
    ------
    GenerationError
        When its equations are not those expected.
    """
    from symgen.codegen.emit import emit, equations_hash
    from symgen.codegen.target import Target
    from symgen.lowering.program import lower_system
    from symgen.making import no_collection

    with no_collection():
        program = lower_system(system)
        equations = equations_hash(program, Target())
    if expected and equations != expected:
        raise GenerationError(
            f"the kernels of {system.name} in the cache are of other equations\n  Run 'symgen cache clear'."
        )
    return program, emit(program, Target(), equations)
