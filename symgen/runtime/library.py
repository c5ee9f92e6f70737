"""Kernels in memory: a shared library, a shipped extension module, or the NumPy backend."""

from __future__ import annotations

import ctypes
import importlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from symgen.errors import StaleBinaryError
from symgen.runtime.description import Described

_POINTER = ctypes.POINTER(ctypes.c_double)
_KERNEL = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 6)


@dataclass(frozen=True)
class Library:
    """Addresses of the kernels by name; ``owner`` keeps them alive, ``backend`` says what they are."""

    backend: str
    addresses: Mapping[str, int]
    owner: Any


def open_library(path: Path, description: Described) -> Library:
    """Open a compiled shared library and check that it computes the described equations.

    Raises
    ------
    StaleBinaryError
        When it was compiled from other equations, or cannot be opened.
    """
    try:
        library = ctypes.CDLL(str(path))
        tag = (
            (ctypes.c_char * 65)
            .in_dll(library, f"{description.name}_equations")
            .value.decode("ascii", "replace")
        )
        functions = {k.name: getattr(library, f"{description.name}_{k.name}") for k in description.kernels}
    except (OSError, ValueError, AttributeError) as error:
        raise StaleBinaryError(f"cannot use the compiled kernels {path}: {error}") from None
    _check_tag(tag, description.equations, str(path))
    addresses = {name: ctypes.cast(f, ctypes.c_void_p).value or 0 for name, f in functions.items()}
    return Library("c", addresses, library)


def open_shipped(description: Described) -> Library | None:
    """Return the kernels compiled at install when they are of exactly these equations, else None."""
    try:
        module = shipped_module(description.name)
    except ImportError:
        return None
    if description.equations != module.EQUATIONS:
        return None
    return Library("shipped", module.ADDRESSES, module)


def shipped_module(name: str) -> ModuleType:
    """Import a shipped extension module, refusing one that does not belong to the manifest beside it.

    Raises
    ------
    ImportError
        When no such module was compiled.
    StaleBinaryError
        When it was compiled from other equations than ``generated/manifest.json`` lists.
    """
    package = importlib.import_module("symgen.generated")
    manifest = json.loads(
        (Path(str(package.__file__)).with_name("manifest.json")).read_text(encoding="utf-8")
    )
    module = importlib.import_module(f"symgen.generated.{name}")
    expected = manifest["models"][name]["equations"]
    _check_tag(module.EQUATIONS, expected, f"symgen.generated.{name}")
    return module


def _check_tag(tag: str, expected: str, what: str) -> None:
    if tag != expected:
        raise StaleBinaryError(
            f"{what} was compiled from the equations {tag[:12]}..., expected {expected[:12]}...\n"
            "  Compile it again: 'pip install -e .' in a checkout, 'symgen cache clear' for a scene."
        )


def open_numpy(source: str, description: Described) -> Library:
    """Return the kernels of the NumPy backend from their generated Python source."""
    namespace: dict[str, Any] = {}
    exec(compile(source, f"<{description.name} numpy kernels>", "exec"), namespace)  # noqa: S102 - our own code
    _check_tag(namespace["equations"], description.equations, "the NumPy kernels")
    n, parameters = description.coordinates, len(description.parameters)
    callbacks = {}
    for kernel in description.kernels:
        sizes = (1, n, n, parameters, kernel.work_size, kernel.out_size)
        callbacks[kernel.name] = _KERNEL(_over_pointers(namespace[kernel.name], sizes))
    addresses = {name: ctypes.cast(c, ctypes.c_void_p).value or 0 for name, c in callbacks.items()}
    return Library("numpy", addresses, callbacks)


def _over_pointers(function: Callable[..., None], sizes: tuple[int, ...]) -> Callable[..., None]:
    def kernel(*pointers: int | None) -> None:
        arrays = [
            np.ctypeslib.as_array(ctypes.cast(p, _POINTER), (size,)) if p and size else None
            for p, size in zip(pointers, sizes, strict=True)
        ]
        with np.errstate(all="ignore"):
            function(*arrays)

    return kernel
