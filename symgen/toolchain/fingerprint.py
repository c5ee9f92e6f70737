"""Hashes of Python objects by content: of kinds that a program registers, whose code is no file of symgen.

Two objects have the same hash if they have the same code and the same values, wherever they are defined. A
function counts with its bytecode, constants, defaults, closure and the global objects that it uses, a class
with its bases and attributes, any other object with the state that a pickle would hold. Lines and comments
do not count. Objects of Python, of symgen and of packages that symgen requires count by name. An object
whose content cannot be read has another hash at each call, so that no entry of the cache derived from it is
reused.
"""

from __future__ import annotations

import hashlib
import os
import sys
import types
from collections.abc import Iterator, Mapping
from typing import Any, get_args, get_origin

from symgen.registry import Registry

#: Packages whose objects count by name. Their versions are dependencies of their own.
_BY_NAME = {
    "annotated_types", "jinja2", "mpmath", "numpy", "pydantic", "pydantic_core", "scipy", "symgen", "sympy",
    "typing_extensions", "xarray", *sys.stdlib_module_names,
} - {"__main__"}  # fmt: skip
_PLAIN = (type(None), bool, int, float, complex, str, bytes, type(...), range)
#: Attributes of classes without effect on results, or derived from the others by Python and Pydantic.
_OF_PYTHON = {
    "__module__", "__doc__", "__dict__", "__weakref__", "__firstlineno__", "__static_attributes__",
    "__hash__", "__signature__", "__annotations_cache__", "__parameters__", "__class_vars__", "_abc_impl",
}  # fmt: skip
_FIELDS = "__pydantic_fields__"


def of_registered() -> str:
    """Return the hash of all kinds that this program added to the registries of symgen."""
    added = (registry.added() for registry in Registry.loaded)
    return fingerprint([kinds for kinds in added if kinds])


def fingerprint(thing: Any) -> str:
    """Return the hash of an object by content."""
    reading = _Reading()
    reading.read(thing)
    return reading.digest.hexdigest()


def _package(thing: Any) -> str:
    module = thing.__name__ if isinstance(thing, types.ModuleType) else getattr(thing, "__module__", None)
    return str(module or "").partition(".")[0]


class _Reading:
    """One pass over an object and those that it refers to."""

    def __init__(self) -> None:
        self.digest = hashlib.sha256()
        self._seen: dict[int, int] = {}
        self._referenced: list[Any] = []  # so that no id is used twice

    def read(self, thing: Any) -> None:
        if isinstance(thing, _PLAIN):
            return self._write(type(thing).__name__, repr(thing))
        if id(thing) in self._seen:
            return self._write("again", str(self._seen[id(thing)]))
        self._seen[id(thing)] = len(self._seen)
        self._referenced.append(thing)
        if isinstance(thing, list | tuple):
            return self._all(type(thing).__name__, thing)
        if isinstance(thing, Mapping):
            return self._all("mapping", (entry for item in thing.items() for entry in item))
        if isinstance(thing, set | frozenset):
            return self._all("set", sorted(map(fingerprint, thing)))
        if isinstance(thing, types.CodeType):
            return self._code(thing)
        if get_origin(thing) is not None:
            return self._all("generic", (get_origin(thing), *get_args(thing)))
        if isinstance(thing, types.ModuleType):
            return self._write("module", thing.__name__)
        if isinstance(thing, type):
            return self._class(thing)
        return self._other(thing)

    def _write(self, kind: str, text: str) -> None:
        self.digest.update(f"{kind} {len(text)}:{text}\n".encode("utf-8", "surrogatepass"))

    def _all(self, kind: str, things: Any) -> None:
        parts = list(things)
        self._write(kind, str(len(parts)))
        for part in parts:
            self.read(part)

    def _class(self, thing: type) -> None:
        name = (
            f"{thing.__module__}.{thing.__qualname__}" if _package(thing) in _BY_NAME else thing.__qualname__
        )
        self._write("class", name)
        if _package(thing) in _BY_NAME:
            return
        attributes = {n: v for n, v in vars(thing).items() if n not in _OF_PYTHON}
        attributes = {n: v for n, v in attributes.items() if n == _FIELDS or not n.startswith("__pydantic_")}
        self._all("bases", thing.__bases__)
        self.read({n: attributes[n] for n in sorted(attributes)})

    def _other(self, thing: Any) -> None:
        if isinstance(thing, types.FunctionType):
            return (
                self._write("named", thing.__qualname__)
                if _package(thing) in _BY_NAME
                else self._function(thing)
            )
        if isinstance(thing, classmethod | staticmethod):
            return self._all(type(thing).__name__, [thing.__func__])
        if isinstance(thing, property):
            return self._all("property", [thing.fget, thing.fset, thing.fdel])
        if isinstance(thing, types.MethodType):
            return self._all("method", [thing.__func__, thing.__self__])
        if callable(getattr(thing, "__wrapped__", None)):  # by functools.cache and the like
            return self._all(type(thing).__name__, [thing.__wrapped__])
        try:
            state = thing.__reduce_ex__(4)
        except Exception:
            return self._write("named", getattr(thing, "__qualname__", None) or os.urandom(16).hex())
        if isinstance(state, str):
            return self._write("named", f"{_package(thing)}.{state}")
        return self._all("object", (list(s) if isinstance(s, Iterator) else s for s in state))

    def _function(self, thing: types.FunctionType) -> None:
        self._code(thing.__code__)
        self._all("defaults", [thing.__defaults__, thing.__kwdefaults__, vars(thing)])
        self._all("closure", [_content(cell) for cell in thing.__closure__ or ()])
        names = _names(thing.__code__)
        self._globals({n: thing.__globals__[n] for n in sorted(names) if n in thing.__globals__}, names)

    def _globals(self, values: dict[str, Any], names: set[str]) -> None:
        """Read the global objects that code uses; of modules of a program, what ``names`` uses of them."""
        for name, value in values.items():
            self._write("global", name)
            if isinstance(value, types.ModuleType) and _package(value) not in _BY_NAME:
                attributes = {n: vars(value)[n] for n in sorted(names) if n in vars(value)}
                if id(value) not in self._seen:
                    self._seen[id(value)] = len(self._seen)
                    self._referenced.append(value)
                    self._globals(attributes, names)
            else:
                self.read(value)

    def _code(self, code: types.CodeType) -> None:
        self._write("code", code.co_code.hex())
        self._all("names", (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars))
        self._all(
            "arguments", (code.co_argcount, code.co_kwonlyargcount, code.co_posonlyargcount, code.co_flags)
        )
        self._all("constants", code.co_consts)


def _content(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # not yet set
        return None


def _names(code: types.CodeType) -> set[str]:
    inner = (_names(c) for c in code.co_consts if isinstance(c, types.CodeType))
    return {*code.co_names, *(name for names in inner for name in names)}
