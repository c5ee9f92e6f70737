"""A scene as C for other programs: kernels, the core that runs them, an example, and a test."""

from __future__ import annotations

import json
import os
import re
import shlex
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from symgen.calls import checked
from symgen.errors import CapabilityError, GenerationError
from symgen.methods import further_of, method_of

if TYPE_CHECKING:
    from symgen.codegen.emit import SourceFile
    from symgen.export.view import Exported
    from symgen.lowering.kernel import Program
    from symgen.scene.loading import SceneText
    from symgen.scene.schema import Scene
    from symgen.symbolic.system import System

_NAMES = "core/names.h"
#: Reserved names: keywords and functions of C and C++, their headers and compilers, and files of the export.
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
#: A declaration in a header of the core with external linkage.
_DECLARED = re.compile(
    r"^(?!static|typedef)(?:extern )?(?:const )?(?:struct )?\w+ \**(\w+)(?:\(|;)", re.MULTILINE
)
#: Other reserved names in the core: tags, macros and types, and the functions of an export.
_MEANT = re.compile(
    r"^(?:#define|struct|enum|union) (\w+)|^typedef \w+ (\w+)|^\w[\w *]*?\b(\w+)_(?:bytes|start)\(",
    re.MULTILINE,
)


@checked
def export_c(
    scene: Scene | str | os.PathLike[str],
    folder: str | os.PathLike[str],
    *,
    set: Mapping[str, Any] | None = None,
    method: str = "dop853",
    name: str | None = None,
) -> list[str]:
    """Write a scene, or the kernels of a user-defined system, as C; return the names of the files.

    Parameters
    ----------
    scene
        A shipped name, the path of a scene file, a :class:`symgen.Scene`, or the path of a Python file, which
        is run.
    folder
        A folder that does not exist, is empty, or holds an earlier, unmodified export.
    set
        Values to override: parameter names or dotted keys, as in ``symgen.load_scene``.
    method
        Of runs in C: ``dop853``, or of linkages without elastic links ``taylor``.
    name
        Prefix of all functions and files; default: the name of the scene. Exports with different names can be
        linked into one program.

    Raises
    ------
    SceneError, DerivationError
        If the scene is invalid, or the Python file fails.
    ModelError
        If the name is reserved in C, C++ or the core; for values to set in a user-defined system; if there is
        no such method.
    CapabilityError
        If the scene has no export, or none with this method.
    ResultError
        If the folder has other contents or cannot be written. Nothing is written in this case.
    """
    from symgen.errors import ModelError
    from symgen.export.folder import place, write
    from symgen.pipeline.build import text_of
    from symgen.pipeline.user_system import is_user_file, load

    kind = "system" if is_user_file(scene) else "scene"
    if is_user_file(scene) and name is not None:
        raise ModelError(
            "the name of the export of a Python file is that of its System\n"
            f"  Change it there: System({name!r}, ...)."
        )
    called = name or (load(Path(str(scene))).system.name if kind == "system" else text_of(scene).name)
    if called in _TAKEN or called in _of_core():
        raise ModelError(
            f"a {kind} called {called!r} cannot be exported: C, C++ or a file of the export has that name\n"
            f"  Give it {'another name there' if kind == 'system' else 'a name: --name, in Python name='}."
        )
    files_there = place(Path(folder))
    return write(Path(folder), list(files_of(exported(scene, set, method, name))), files_there)


def _of_core() -> set[str]:
    """Return the identifiers declared in the headers of the core, whichever of them an export contains."""
    from symgen.export.view import CORE_FOLDER

    headers = "".join(path.read_text(encoding="utf-8") for path in CORE_FOLDER.glob("*.h"))
    return {name for pair in _MEANT.findall(headers) for name in pair if name}


def files_of(x: Exported) -> Iterator[SourceFile]:
    """Yield the files of an export."""
    from symgen.codegen.emit import SourceFile, environment
    from symgen.export.view import CORE_FOLDER

    for template, name in x.templates:
        text = environment().get_template(f"export/{template}").render(x=x)
        yield SourceFile(name.format(x.name), text)
    yield from x.kernels
    if not x.core:
        return
    names = "".join(
        (CORE_FOLDER / name).read_text(encoding="utf-8") for name in x.core if name.endswith(".h")
    )
    names_in_core = sorted(
        {*_DECLARED.findall(names), "core_interrupted", "beam_kind", "explicit_kind", f"{x.method.kind}_kind"}
    )
    text = environment().get_template("export/names.h.j2").render(x=x, names=names_in_core)
    yield SourceFile(_NAMES, text)
    for name in x.core:
        text = (CORE_FOLDER / name).read_text(encoding="utf-8")
        yield SourceFile(f"core/{name}", f'#include "names.h"\n{text}' if name == "real.h" else text)


def exported(
    scene: Scene | SceneText | str | os.PathLike[str],
    set: Mapping[str, Any] | None = None,
    method: str = "dop853",
    name: str | None = None,
) -> Exported:
    """Return the template data of a scene under a name, whose runs take a method of ``RUN_METHODS``."""
    from symgen.errors import check_known
    from symgen.export.view import RUN_METHODS
    from symgen.pipeline.build import build, build_scene, text_of
    from symgen.pipeline.systems import derive
    from symgen.pipeline.user_system import equations_of, is_user_file
    from symgen.scene.loading import check_scene, override
    from symgen.scene.resolve import resolve
    from symgen.scene.table import checked_name

    check_known(method, RUN_METHODS, "exports have no method")
    series = method == "taylor"
    if is_user_file(scene):
        built = build(scene, set=set)
        kernels = _emitted(equations_of(Path(str(scene))), built.description.equations, series)
        return _with_method(method, cast("Exported", _export_of(built)(built, *kernels)))
    text = override(text_of(scene), set or {})
    text = text if name is None else replace(text, name=checked_name(name))
    model = build_scene(text)
    export = _export_of(model)
    program, sources = _emitted(derive(text), model.description.equations, series)
    further = further_of(resolve(check_scene(text)))
    parts = {kind: _emitted(system) for kind, system in further.items()}
    sources = (*sources, *(f for _, files in parts.values() for f in files))
    names = ({kind: p.name for kind, (p, _) in parts.items()},) if parts else ()
    made = _with_method(method, cast("Exported", export(model, program, sources, *names)))
    file = Path(scene).name if isinstance(scene, str | os.PathLike) else ""
    changed = "".join(f" --set {shlex.quote(f'{key}={_written(x)}')}" for key, x in (set or {}).items())
    named = "" if name is None else f" --name {name}"
    return replace(made, source=f"{shlex.quote(file)}{changed}{named}" if file else "")


def _written(value: Any, inner: bool = False) -> str:
    """Return a value after --set: text bare unless it is inside of a list or table, which are in TOML."""
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{key} = {_written(x, True)}' for key, x in value.items())} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(_written(x, True) for x in value)}]"
    if value is None or (isinstance(value, str) and not inner):
        return value or "none"
    return json.dumps(value, default=float)


def _export_of(model: Any) -> Callable[..., Any]:
    """Return the export of a model's method; raise CapabilityError if it has none."""
    method = method_of(model)
    if not method.export:
        raise CapabilityError(
            f"{model.name} has no export to C and no live page: its links are elastic in space\n"
            "  symgen animate and symgen report write pages of it."
        )
    return cast("Callable[..., Any]", method.load("export"))


def _with_method(method: str, made: Exported) -> Exported:
    """Return an export whose runs take this method; raise CapabilityError for another one."""
    if made.method.name != method:
        raise CapabilityError(
            f"{made.name} has no export with {method}: power series are for linkages of points and links and "
            "user-defined systems whose loads have them\n  Choose dop853."
        )
    return made


def _emitted(
    system: System, expected: str = "", series: bool = False
) -> tuple[Program, tuple[SourceFile, ...]]:
    """Return the program of a system, and its sources in C; power series only if they are asked for.

    Raises
    ------
    GenerationError
        If the equations differ from the expected ones.
    """
    from symgen.codegen.emit import emit, equations_hash
    from symgen.codegen.target import Target
    from symgen.lowering.program import lower_system
    from symgen.toolchain.kernels import no_collection

    if system.saddle_point and system.saddle_point.efforts:
        raise CapabilityError(f"{system.name} has no export in C: unknown efforts keep its [[motions]]")
    if system.saddle_point and system.saddle_point.couples:
        raise CapabilityError(f"{system.name} has no export in C: its bearings have friction")
    with no_collection():
        program = lower_system(system)
        equations = equations_hash(program, Target())
    if expected and equations != expected:
        raise GenerationError(
            f"the cached kernels of {system.name} belong to other equations\n  Run 'symgen cache clear'."
        )
    program = program if series else replace(program, series=())
    return program, emit(program, Target(), equations)
