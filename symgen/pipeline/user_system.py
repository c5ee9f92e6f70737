"""User-defined systems: a Python file with a function ``system`` that returns a System.

Naming the file runs it, as ``python my_model.py`` would. Scenes are data, and nothing in them is executed.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symgen.errors import CONTROL, DerivationError, shown
from symgen.toolchain import dependencies as graph

if TYPE_CHECKING:
    from symgen.models.general.equations import GeneralSystem
    from symgen.symbolic.system import System

_FUNCTION = "system"
_EXAMPLE = f"'def {_FUNCTION}() -> System:' of symgen.symbolic.system; see docs/regeneration.md."


@dataclass(frozen=True, slots=True)
class UserFile:
    """Contents of a file: its System, and the source files at the time of loading."""

    system: System
    needs: graph.Needs


def is_user_file(source: object) -> bool:
    """Return whether a source is the name of a Python file."""
    return isinstance(source, str | os.PathLike) and Path(source).suffix == ".py"


def name_of(path: Path) -> str:
    """Return the name of a file in the cache and in messages."""
    return re.sub(r"\W", "_", path.stem, flags=re.ASCII)


def load(path: Path) -> UserFile:
    """Run a user's file and return the System of its function ``system``.

    Raises
    ------
    DerivationError
        When there is no such file, it fails, or it does not return a System with names valid in C.
    """
    if not path.is_file():
        raise DerivationError(f"there is no file {path}\n  Expected a Python file with {_EXAMPLE}")
    read = graph.of_file(path)
    with _importing_beside(path.parent.resolve()) as imported:
        system = _checked(path, _run(path))
    for neighbour in imported:
        read = {**read, **graph.of_file(neighbour)}
    return UserFile(system, read)


def general_system_of(system: System, file: str) -> GeneralSystem:
    """Return the mechanism of a System that moves; raise DerivationError where it is not complete."""
    from symgen.models.general.equations import general_system_of as stated

    return stated(system, file)


def equations_of(path: Path) -> System:
    """Return the System of a user's file; of one that moves, with all that follows from it."""
    from symgen.models.general.system import general_system

    system = load(path).system
    return system if system.values is None else general_system(general_system_of(system, path.name))


def _run(path: Path) -> Any:
    spec = spec_from_file_location(name_of(path), path)
    if spec is None or spec.loader is None:
        raise DerivationError(f"{path} cannot be read as Python")
    module = module_from_spec(spec)
    sys.modules[spec.name], before = module, sys.modules.get(spec.name)
    try:
        spec.loader.exec_module(module)
        make = getattr(module, _FUNCTION, None)
        if not callable(make):
            raise DerivationError(f"{path} has no function {_FUNCTION!r}\n  Expected {_EXAMPLE}")
        return make()
    except DerivationError as error:
        raise _located(path, error) from None
    except (Exception, SystemExit, GeneratorExit) as error:
        raise _failed(path, error) from error
    finally:
        if before is None:
            sys.modules.pop(spec.name, None)
        else:
            sys.modules[spec.name] = before


def _located(path: Path, error: DerivationError) -> DerivationError:
    text = str(error)
    return error if str(path) in text else DerivationError(f"{path}: {text}")


def _failed(path: Path, error: BaseException) -> DerivationError:
    """Return an error with the line of the user's file and the original error."""
    import traceback

    frames = traceback.extract_tb(error.__traceback__)
    lines = [f.lineno for f in frames if Path(f.filename).resolve() == path.resolve()]
    place = f"{path}, line {lines[-1]}" if lines else str(path)
    if isinstance(error, SyntaxError):
        place = f"{error.filename}, line {error.lineno}" if error.filename else place
        return DerivationError(f"{place}: this is not Python: {error.msg}")
    return DerivationError(
        f"{place}: {type(error).__name__}: {error}\n  The derivation failed; correct it there."
    )


def _checked(path: Path, system: Any) -> System:
    from symgen.symbolic.system import System

    if not isinstance(system, System):
        raise DerivationError(
            f"{path}: {_FUNCTION}() returned {type(system).__name__}, not a System\n  Expected {_EXAMPLE}"
        )
    for kind, names in (
        ("system", [system.name]),
        ("kernel", [e.kernel for e in system.exports]),
        ("argument group", [g.name for g in system.groups]),
    ):
        bad = next((n for n in names if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", n)), None)
        if bad is not None:
            raise DerivationError(f"{path}: a {kind} is called {bad!r}: expected letters, digits and _")
    unknown = [g.name for g in system.groups if g.name not in _ARRAYS]
    if unknown:
        raise DerivationError(
            f"{path}: there is an argument group {unknown[0]!r}; kernels have {', '.join(_ARRAYS)}"
        )
    for text in _texts(system):
        if not isinstance(text, str) or re.search(f"[{CONTROL}]", text):
            raise DerivationError(f"{path}: expected a text without control characters, got {shown(text)}")
    moves = system.values is not None
    if not moves and not any(e.matrices for e in system.exports) and system.saddle_point is None:
        raise DerivationError(f"{path}: the system exports no kernel: name the matrices of one in 'exports'")
    return system


def _texts(system: System) -> Iterator[str]:
    """Yield the texts of a system that tables, comments and messages show."""
    yield from (system.title, *system.references, *system.left_out)
    yield from (group.description for group in system.groups)
    yield from (kernel.description for kernel in system.exports)
    for quantity in system.quantities():
        yield from (quantity.name, quantity.unit, quantity.description)
    for matrix in system.matrices:
        yield from (matrix.name, matrix.unit, matrix.description, *matrix.rows, *matrix.columns)


#: Package folders of installers: of an environment, of the system, of the user.
_INSTALLED = {"site-packages", "dist-packages"}
#: The argument arrays that every kernel reads.
_ARRAYS = ("t", "q", "u", "p", "work")

#: Packages whose objects a System holds: loaded once, wherever they are.
_ALWAYS_LOADED = ("symgen", "sympy", "mpmath", "numpy")


@contextmanager
def _importing_beside(folder: Path) -> Iterator[list[Path]]:
    """Let a file import modules of its folder in their current form; yield their list, then unload them.

    No bytecode of them is written: Python would load it for a file of equal size changed in the same second.
    """
    away = {name: sys.modules[name] for name in sorted(sys.modules) if _is_beside(folder, name)}
    for name in away:  # imported earlier, perhaps in another form
        del sys.modules[name]
    before, files = set(sys.modules), list[Path]()
    writes, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    sys.path.insert(0, str(folder))
    try:
        yield files
    finally:
        sys.dont_write_bytecode = writes
        if str(folder) in sys.path:
            sys.path.remove(str(folder))
        for name in sorted(set(sys.modules) - before):
            file = getattr(sys.modules[name], "__file__", None)
            if file and name.partition(".")[0] != "symgen" and _is_users(Path(file).resolve()):
                files.append(Path(file))
                if not file.endswith(tuple(EXTENSION_SUFFIXES)):  # these can be loaded once only
                    del sys.modules[name]  # the next import reads its file again
        sys.modules.update(away)


def _is_beside(folder: Path, name: str) -> bool:
    """Return whether a loaded module is a Python file in that folder, and not one that symgen uses."""
    file = Path(getattr(sys.modules[name], "__file__", None) or "")
    if name == "__main__" or name.partition(".")[0] in _ALWAYS_LOADED or file.suffix != ".py":
        return False
    return file.resolve().is_relative_to(folder) and _is_users(file.resolve())


def _is_users(file: Path) -> bool:
    """Return whether a module is neither Python's nor installed, in this environment or another."""
    import sysconfig

    places = [Path(sysconfig.get_path(p)).resolve() for p in ("stdlib", "platstdlib")]
    return _INSTALLED.isdisjoint(file.parts) and not any(file.is_relative_to(place) for place in places)
