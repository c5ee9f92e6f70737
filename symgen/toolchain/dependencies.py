"""Dependencies of derivations: recorded with the result, compared by content on the next lookup.

A derivation depends on every file involved: the Python modules loaded at that time, templates, unit
tables, the scene or the user's own file, and the versions of the packages used for the derivation. A cache
entry is current as long as the content of all of these is unchanged.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
import time
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.abc import InspectLoader
from importlib.util import find_spec
from pathlib import Path
from types import CodeType

from symgen.toolchain.cache import Cache, CacheEntry, key
from symgen.toolchain.fingerprint import of_registered

_NEEDS = "needs.json"
#: Parts of symgen that only call the generation or use its results; all other parts affect kernels.
_CALLING = (
    "__main__", "_cython", "atomic", "calls", "cli", "display", "errors", "export", "generated",
    "inspection", "pipeline.parameters", "regeneration", "registry", "report", "runtime", "scenes", "study",
    "templates", "toolchain.cache", "toolchain.dependencies", "toolchain.fingerprint", "toolchain.ownership",
)  # fmt: skip
#: The module that describes a scene, including its initial state, and the package whose modules it uses.
_DESCRIBING, _RUNTIME = "symgen.pipeline.describe", "symgen.runtime"
#: Data files of a package that its modules read.
_DATA = {"symgen.scene": ("units.txt", "units.json")}
#: Templates of exported folders and of browser pages, which no kernel depends on.
_EXPORTED, _OF_PAGES = "export", (".html", ".svg", ".css", ".js")
_PACKAGES = ("sympy", "mpmath", "jinja2")
_SYMGEN = "version:symgen"
#: The list of registered elements, which does not affect the equations of any one element.
_REGISTRY = "symgen.elements"
#: The loads, joints, elements and methods that a program adds, by content.
_REGISTERED = "registered:kinds registered by the program"

#: Start of this process: a file modified later may differ from the version that was loaded.
BEGUN = time.time()

Needs = Mapping[str, str]


def needs(further: Needs | None = None) -> Needs:
    """Return the dependencies of the derivations in this process: content hashes of files by name.

    All derivations of the process count, so the result is exact if each has a process of its own.

    Parameters
    ----------
    further
        Additional files that were read, such as a scene or the user's own file.
    """
    names = [_SYMGEN, *(f"version:{package}" for package in _PACKAGES)]
    for module in sorted({*filter(_decides, sys.modules), *_describing()}):
        names.append(_module(module))
        names += [f"{module}:{file}" for file in _DATA.get(module, ())]
    names += _templates()
    return {name: _as_loaded(name) for name in sorted(names)} | {
        _REGISTERED: content(_REGISTERED),
        **(further or {}),
    }


@cache
def _templates() -> tuple[str, ...]:
    """Return the names of the templates of kernels, constant for the life of the process."""
    folder = package_folder("symgen.templates")
    every = (p.relative_to(folder) for p in folder.rglob("*.j2"))
    printed = (p for p in every if Path(p.stem).suffix not in _OF_PAGES)
    return tuple(f"symgen.templates:{p.as_posix()}" for p in printed if p.parts[0] != _EXPORTED)


def _as_loaded(name: str) -> str:
    """Return the hash of a file's content; empty (never current) if it changed after this process started."""
    where, _, rest = name.partition(":")
    if where != "version" and _place(where, rest).stat().st_mtime > BEGUN:
        return ""
    return content(name)


@cache
def _place(package: str, file: str) -> Path:
    return package_folder(package) / file


def of_package(package: str, file: str) -> Needs:
    """Return a dependency on a file of a package."""
    name = f"{package}:{file}"
    return {name: content(name)}


def of_file(path: Path) -> Needs:
    """Return a dependency on a file with its present content."""
    name = f"file:{path.resolve()}"
    return {name: content(name)}


@cache
def _decides(module: str) -> bool:
    package, _, part = module.partition(".")
    if package != "symgen" or not part or module == _REGISTRY:
        return False
    return not f"{part}.".startswith(tuple(f"{calling}." for calling in _CALLING))


def _describing() -> set[str]:
    """Return the loaded runtime modules that the description of a scene imports, directly or indirectly."""
    modules: set[str] = set()
    reached = {_DESCRIBING} & sys.modules.keys()
    while reached:
        module = reached.pop()
        modules.add(module)
        reached |= (_imports(module) & sys.modules.keys()) - modules
    return modules - {_DESCRIBING}


@cache
def _imports(module: str) -> frozenset[str]:
    """Return the runtime modules that a loaded module imports, constant for the life of the process.

    Without files of bytecode, every call compiles the source.
    """
    loader = getattr(sys.modules[module].__spec__, "loader", None)
    return frozenset(_imported(loader.get_code(module) if isinstance(loader, InspectLoader) else None))


def _imported(code: CodeType | None) -> Iterator[str]:
    """Yield the runtime modules that compiled code imports, including imports inside functions."""
    if code is None:
        return
    for module in code.co_names:  # dotted names occur in imports only
        if module == _RUNTIME or module.startswith(f"{_RUNTIME}."):
            yield module
            yield from (f"{module}.{name}" for name in code.co_names)  # from module import name
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _imported(constant)


@cache
def _module(name: str) -> str:
    path = Path(str(sys.modules[name].__file__))
    return f"symgen:{path.relative_to(package_folder('symgen')).as_posix()}"


@cache
def package_folder(package: str) -> Path:
    """Return the folder of an installed package; FileNotFoundError if there is none."""
    spec = find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        raise FileNotFoundError(package)
    return Path(next(iter(spec.submodule_search_locations)))


def content(name: str) -> str:
    """Return the content hash of a dependency, or a package's version; empty if it no longer exists."""
    if name == _REGISTERED:
        return of_registered()
    where, _, rest = name.partition(":")
    return _hash(Path(rest)) if where == "file" else content_of_package(where, rest)


@cache
def content_of_package(where: str, rest: str) -> str:
    """Return the content hash of a file of symgen or of a package, constant for the life of the process."""
    try:
        return _version(rest) if where == "version" else _hash(package_folder(where) / rest)
    except ImportError:
        return ""


def _version(package: str) -> str:
    """Return a package's version from its ``dist-info`` folder, which is faster than importlib.metadata."""
    if package == "symgen":  # the metadata of an editable installation may be outdated
        from symgen.version import __version__

        return __version__
    beside = _installed(package_folder(package).parent)
    folders = [name for name in beside if name.lower().startswith(f"{package}-")]
    if len(folders) == 1:
        return folders[0].removesuffix(".dist-info").partition("-")[2]
    from importlib.metadata import version

    return version(package)


@cache
def _installed(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.glob("*.dist-info"))


def _hash(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return ""


def changed(before: Needs) -> list[str]:
    """Return the names of dependencies whose content has changed."""
    return [name for name, digest in before.items() if content(name) != digest]


def versions(store: Cache, name: str) -> Iterator[tuple[Path, Needs]]:
    """Yield the folders of all entries with this name and their dependencies, the latest first.

    Raises
    ------
    CacheError
        If other users can write to the cache.
    """
    if not store.is_private():
        return
    for folder in _latest_first(store.root, f"{name}-"):
        try:
            yield folder, dict(json.loads((folder / _NEEDS).read_bytes()))
        except (OSError, ValueError, TypeError):
            continue  # an unreadable entry is rebuilt


def _latest_first(root: Path, start: str) -> list[Path]:
    try:
        with os.scandir(root) as entries:  # a cache may have thousands
            folders = [root / entry.name for entry in entries if entry.name.startswith(start)]
        return sorted(folders, key=lambda p: (-p.stat().st_mtime_ns, p.name))
    except OSError:  # no cache yet, or another process removed the entry
        return []


def latest(store: Cache, name: str) -> tuple[Path, Needs] | None:
    """Return the folder of the latest entry with this name and its dependencies; None if there is none."""
    return next(versions(store, name), None)


def current(store: Cache, name: str) -> CacheEntry | None:
    """Return the intact entry with this name whose dependencies are unchanged; None if there is none."""
    for folder, before in versions(store, name):
        if {_SYMGEN, _REGISTERED} <= before.keys() and not changed(before):
            entry = store.find(folder.name)
            if entry:
                return entry
    return None


def keep(folder: Path, name: str, depends: Needs) -> str:
    """Write the dependencies of an entry into its folder; return the entry's name, which they determine."""
    text = json.dumps(depends, indent=1, sort_keys=True)
    (folder / _NEEDS).write_text(text, encoding="utf-8")
    return f"{name}-{key(text)}"
