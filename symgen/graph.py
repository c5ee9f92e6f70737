"""From a derivation to what it was made of: recorded when it is made, and looked up by content the next time.

An edge goes from a derivation to every file that had a part in it: the Python modules that were loaded when
it was done, templates, tables of units, the scene or the user's own file, and the packages symgen derives
with, by their versions. An entry of the cache is current as long as all of these are what they were.
"""

from __future__ import annotations

import hashlib
import json
import sys
import time
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from symgen.cache import Cache, Entry, key

_NEEDS = "needs.json"
#: Parts of symgen that call what decides what is generated, or run what it gave: all others count.
_CALLING = (
    "__main__", "atomic", "cache", "cli", "errors", "export", "generated", "graph", "inspection",
    "regeneration", "report", "runs", "runtime", "scenes", "sources", "study", "templates", "tuning",
    "_cython",
)  # fmt: skip
#: Modules of the runtime that a description of a scene, its start included, comes from.
_DESCRIBING = (
    "description", "elastic_description", "beam_data", "evaluate", "initial", "kinematic_model", "bonds",
    "loop_kernels", "loop_start",
)  # fmt: skip
#: Files beside the modules of a package that these read.
_DATA = {"symgen.scene": ("units.txt", "units.json")}
#: Templates of exported folders, and of pages for a browser: no kernel is made with these.
_EXPORTED, _OF_PAGES = "export", (".html", ".svg", ".css")
_PACKAGES = ("sympy", "mpmath", "jinja2")
#: Which elements there are decides nothing of what is made of one.
_REGISTRY = "symgen.elements"

#: What changed later may have been loaded as it was before.
_BEGUN = time.time()

Needs = Mapping[str, str]


def needs(further: Needs | None = None) -> Needs:
    """Return what was derived in this process depends on: each file by name, with the hash of its content.

    What else was derived in the same process counts too: never too little, and exact in a process of its own.

    Parameters
    ----------
    further
        What was read besides, such as a scene or the user's own file.
    """
    names = [f"version:{package}" for package in _PACKAGES]
    for module in sorted(filter(_decides, sys.modules)):
        names.append(_module(module))
        names += [f"{module}:{file}" for file in _DATA.get(module, ())]
    templates = _folder("symgen.templates")
    every = (p.relative_to(templates) for p in templates.rglob("*.j2"))
    printed = (p for p in every if Path(p.stem).suffix not in _OF_PAGES)
    names += [f"symgen.templates:{p.as_posix()}" for p in printed if p.parts[0] != _EXPORTED]
    return {name: _as_loaded(name) for name in sorted(names)} | dict(further or {})


def _as_loaded(name: str) -> str:
    """Return the content of a file; none, which is never current, if it changed since this process began."""
    where, _, rest = name.partition(":")
    if where != "version" and (_folder(where) / rest).stat().st_mtime > _BEGUN:
        return ""
    return content(name)


def of_package(package: str, file: str) -> Needs:
    """Return a file that is part of a package, for the needs of what is made of it."""
    name = f"{package}:{file}"
    return {name: content(name)}


def of_file(path: Path) -> Needs:
    """Return a file as it is now, for the needs of what is made of it."""
    name = f"file:{path.resolve()}"
    return {name: content(name)}


def _decides(module: str) -> bool:
    words = module.split(".")
    if words[0] != "symgen" or len(words) < 2 or module == _REGISTRY:
        return False
    return words[1] not in _CALLING or (words[1] == "runtime" and len(words) > 2 and words[2] in _DESCRIBING)


def _module(name: str) -> str:
    path = Path(str(sys.modules[name].__file__))
    return f"symgen:{path.relative_to(_folder('symgen')).as_posix()}"


@cache
def _folder(package: str) -> Path:
    spec = find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        raise FileNotFoundError(package)
    return Path(next(iter(spec.submodule_search_locations)))


def content(name: str) -> str:
    """Return the hash of a file by its name among the needs, or a package's version; empty if it is gone."""
    where, _, rest = name.partition(":")
    return _hash(Path(rest)) if where == "file" else _of_package(where, rest)


@cache
def _of_package(where: str, rest: str) -> str:
    """Return the content of what is part of symgen or of a package: the same as long as a process lives."""
    try:
        return _version(rest) if where == "version" else _hash(_folder(where) / rest)
    except ImportError:
        return ""


def _version(package: str) -> str:
    """Return the version of a package by the folder that its installer left beside it, which is read fast."""
    beside = _installed(_folder(package).parent)
    found = [name for name in beside if name.lower().startswith(f"{package}-")]
    if len(found) == 1:
        return found[0].removesuffix(".dist-info").partition("-")[2]
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
    """Return the names of those that are not what they were."""
    return [name for name, digest in before.items() if content(name) != digest]


def versions(store: Cache, name: str) -> Iterator[tuple[Path, Needs]]:
    """Yield the folders of all entries of this name with what they depend on, the latest made first."""
    for folder in _latest_first(store.root, f"{name}-"):
        try:
            yield folder, dict(json.loads((folder / _NEEDS).read_bytes()))
        except (OSError, ValueError, TypeError):
            continue  # an entry that cannot be read is made anew


def _latest_first(root: Path, start: str) -> list[Path]:
    try:
        return sorted(
            (p for p in root.iterdir() if p.name.startswith(start)),
            key=lambda p: (-p.stat().st_mtime_ns, p.name),
        )
    except OSError:  # no cache yet, or an entry that another process removed
        return []


def latest(store: Cache, name: str) -> tuple[Path, Needs] | None:
    """Return the folder of the latest entry of this name with what it depends on; None without one."""
    return next(versions(store, name), None)


def current(store: Cache, name: str) -> Entry | None:
    """Return the entry of this name that is whole and whose needs are what they were; None without one."""
    for folder, before in versions(store, name):
        if before and not changed(before):
            entry = store.find(folder.name)
            if entry:
                return entry
    return None


def keep(folder: Path, name: str, depends: Needs) -> str:
    """Write what an entry depends on into its folder; return its name, which these decide."""
    text = json.dumps(depends, indent=1, sort_keys=True)
    (folder / _NEEDS).write_text(text, encoding="utf-8")
    return f"{name}-{key(text)}"
