"""Kernels in memory: a shared library, a shipped extension module, or the NumPy backend."""

from __future__ import annotations

import ctypes
import importlib.util
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from symgen.calls import FAILURES
from symgen.errors import COMPILE_AGAIN, StaleBinaryError
from symgen.precision import FLOAT64, Precision
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.description import Described

if TYPE_CHECKING:
    from symgen.runtime._core import Core

_GENERATED = "symgen.generated"
#: Kernel of power series in time, which compiled kernels of motions have.
SERIES = "series"
KERNEL = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 6)
_ARRAYS = "t", "q", "u", "p", "work", "out"


@dataclass(frozen=True)
class Library:
    """Kernels of one model.

    Parameters
    ----------
    backend
        Kind of the kernels: ``c``, ``shipped``, ``numpy`` or ``mpmath``.
    addresses
        Address of each by name.
    owner
        Keeps them alive.
    derived
        Number of values that the kernel 'setup' writes behind the parameters; 0 without that kernel.
    functions
        Those in Python, each taking arrays (entries, states); empty for all others.
    provenance
        Build settings that decide the last bits of their results.
    """

    backend: str
    addresses: Mapping[str, int]
    owner: Any
    derived: int = 0
    functions: Mapping[str, Callable[..., None]] = field(default_factory=dict)
    provenance: Mapping[str, str] = field(default_factory=dict)


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
        names = [k.name for k in description.kernels]
        names += [SERIES] if hasattr(library, f"{description.name}_{SERIES}") else []
        functions = {name: getattr(library, f"{description.name}_{name}") for name in names}
    except (OSError, ValueError, AttributeError) as error:
        raise StaleBinaryError(f"cannot use the compiled kernels {path}: {error}\n{COMPILE_AGAIN}") from None
    _check_tag(tag, description.equations, str(path))
    addresses = {name: address_of(f) for name, f in functions.items()}
    return Library("c", addresses, library, description.derived)


def open_core(path: Path) -> Core:
    """Open a core of runs that was compiled for another type than double.

    Raises
    ------
    StaleBinaryError
        When it cannot be opened, or does not go with this version of symgen.
    """
    from symgen.runtime._core import Core

    try:
        library = ctypes.CDLL(str(path))
        table = ctypes.c_char.in_dll(library, "symgen_core")
        return Core(ctypes.addressof(table), library)
    except (OSError, ValueError) as error:
        raise StaleBinaryError(f"cannot use the compiled core {path}: {error}\n{COMPILE_AGAIN}") from None


def open_shipped(description: Described) -> Library | None:
    """Return the kernels compiled at install when they are of exactly these equations, else None."""
    if not is_compiled(description.name):
        return None
    module = shipped_module(description.name)
    if description.equations != module.EQUATIONS:
        return None
    return Library("shipped", module.ADDRESSES, module, description.derived)


def is_compiled(name: str) -> bool:
    """Return whether there is a shipped extension module of this name, of any equations."""
    return importlib.util.find_spec(f"{_GENERATED}.{name}") is not None


def shipped_module(name: str) -> ModuleType:
    """Import a shipped extension module; it must match the manifest in its directory.

    Raises
    ------
    StaleBinaryError
        When there is none, or it was compiled from other equations than ``generated/manifest.json`` lists.
    """
    package = importlib.import_module(_GENERATED)
    listed = Path(str(package.__file__)).with_name("manifest.json")
    manifest = _manifest(listed, listed.stat().st_mtime_ns)
    try:
        module = importlib.import_module(f"{_GENERATED}.{name}")
    except ImportError as error:
        raise StaleBinaryError(
            f"the compiled kernels of {name} cannot be loaded: {error}\n{COMPILE_AGAIN}"
        ) from None
    expected = manifest["models"].get(name, {"equations": "of no model"})["equations"]
    _check_tag(module.EQUATIONS, expected, module.__name__)
    return module


@lru_cache(maxsize=2)
def _manifest(file: Path, changed: int) -> Any:
    """Return the manifest in a file that was changed at this time [ns]."""
    return json.loads(file.read_text(encoding="utf-8"))


def _check_tag(tag: str, expected: str, noun: str) -> None:
    if tag != expected:
        raise StaleBinaryError(
            f"{noun} was compiled from the equations {tag[:12]}..., expected {expected[:12]}...\n"
            f"{COMPILE_AGAIN}"
        )


def open_numpy(source: str, description: Described, precision: Precision = FLOAT64) -> Library:
    """Return the kernels of the NumPy backend from their generated Python source."""
    functions = {name: quietly(f) for name, f in _defined(source, description, "NumPy").items()}
    return _in_python("numpy", functions, description, np.dtype(precision.dtype))


def open_mpmath(source: str, description: Described, digits: int) -> Library:
    """Return the kernels of the mpmath backend; behind addresses, their arrays are in double precision."""
    import mpmath

    def in_digits(function: Callable[..., None]) -> Callable[..., None]:
        def kernel(t: Any, q: Any, u: Any, p: Any, work: Any, out: Any) -> None:
            with mpmath.workdps(digits):
                for state in range(1 if out is None or out.ndim == 1 else out.shape[1]):
                    arguments = [_numbers(a, state, mpmath) for a in (t, q, u, p, work, out)]
                    try:
                        function(*arguments)
                    except ZeroDivisionError:
                        arguments[5] = [mpmath.nan] * len(arguments[5])
                    for array, values in zip((work, out), arguments[4:], strict=True):
                        if array is not None:
                            _column(array, state)[:] = [_real(x, mpmath) for x in values]

        return kernel

    functions = {name: in_digits(f) for name, f in _defined(source, description, "mpmath").items()}
    return _in_python("mpmath", functions, description, np.dtype(np.float64))


def _column(array: Any, state: int) -> Any:
    """Return the entries of one state; parameters are the same for all."""
    return array if array.ndim == 1 else array[:, min(state, array.shape[1] - 1)]


def _numbers(array: Any, state: int, mpmath: Any) -> list[Any]:
    return [] if array is None else [mpmath.mpf(x) for x in _column(array, state)]


def _real(value: Any, mpmath: Any) -> Any:
    """Return a real number; NaN for a complex one, such as the root of a negative number."""
    return value if isinstance(value, mpmath.mpf) else mpmath.nan


def _defined(source: str, description: Described, noun: str) -> dict[str, Callable[..., None]]:
    namespace: dict[str, Any] = {}
    exec(compile(source, f"<{description.name} {noun} kernels>", "exec"), namespace)  # noqa: S102 - our own code
    _check_tag(namespace["equations"], description.equations, f"the {noun} kernels")
    return {k.name: namespace[k.name] for k in description.kernels}


def quietly(function: Callable[..., None]) -> Callable[..., None]:
    """Return a kernel without the warnings of NumPy."""

    def kernel(*arrays: Any) -> None:
        with np.errstate(all="ignore"):
            function(*arrays)

    return kernel


def _in_python(
    backend: str, functions: Mapping[str, Callable[..., None]], description: Described, dtype: Any
) -> Library:
    callbacks = {
        k.name: callback(functions[k.name], description.sizes_of(k.name), dtype) for k in description.kernels
    }
    addresses = {name: address_of(c) for name, c in callbacks.items()}
    return Library(backend, addresses, callbacks, description.derived, functions)


def address_of(function: Any) -> int:
    """Return the address of a function of a library, or of a callback."""
    return ctypes.cast(function, ctypes.c_void_p).value or 0


def callback(function: Callable[..., None], entries: Sequence[int], dtype: Any) -> Any:
    """Return a Python function as a kernel for compiled callers, which must keep it.

    It takes the arrays t, q, u, p, work and out, with ``entries`` numbers of a type each. Its exception makes
    ``out`` NaN, and ``symgen.calls.raise_failure`` raises it.
    """
    sizes = tuple(dtype.itemsize * k for k in entries)

    def kernel(*pointers: int | None) -> None:
        arrays: list[Any] = []
        try:
            arrays += (
                np.frombuffer((ctypes.c_char * n).from_address(p), dtype) if p and n else None
                for p, n in zip(pointers, sizes, strict=True)
            )
            if not FAILURES.errors:
                function(*arrays)
        except BaseException as error:
            FAILURES.errors.append(error)  # ctypes would print and ignore it
        if FAILURES.errors and arrays and arrays[-1] is not None:
            arrays[-1][:] = np.nan  # ends the run

    return KERNEL(kernel)


def function(
    name: str, address: int, sizes: Sequence[int], reads: Sequence[str], about: str, counts: str, *blocks: str
) -> Callable[..., Array]:
    """Return a kernel as a function of the arrays t, q, u, p, work and out, which returns out.

    Parameters
    ----------
    name
        Name of the function.
    address
        Address of the kernel in memory.
    sizes
        Least numbers of entries of the arrays.
    reads
        Names of those that must be given; others are made when absent.
    about, counts, blocks
        Its description, operations, and blocks of results, for its docstring.
    """
    call = KERNEL(address)

    def kernel(
        t: Array | None = None,
        q: Array | None = None,
        u: Array | None = None,
        p: Array | None = None,
        work: Array | None = None,
        out: Array | None = None,
    ) -> Array:
        given = zip(_ARRAYS, (t, q, u, p, work, out), sizes, strict=True)
        arrays = [_checked(array, x, size, array in reads) for array, x, size in given]
        call(*(x.ctypes.data for x in arrays))
        return arrays[-1]

    lines = [about, "", counts, "", "Parameters", "----------"]
    for array, size in zip(_ARRAYS, sizes, strict=True):
        if size:
            lines += [array, f"    {size} entries{'' if array in reads else ', made when absent'}."]
    lines += (f"    {block}" for block in blocks)
    kernel.__name__, kernel.__doc__ = name, "\n".join([*lines, "", "Returns", "-------", "out"])
    return kernel


def _checked(name: str, array: Array | None, size: int, needed: bool) -> Array:
    """Return an array that a kernel may access; raise TypeError or ValueError for another."""
    if array is None:
        if needed:
            raise TypeError(f"{name} is missing: an array of {size} entries")
        return np.empty(size)
    written = name in ("work", "out")
    if not isinstance(array, np.ndarray) or array.dtype != float or array.ndim != 1:
        raise TypeError(f"{name} is {array!r}, expected a one-dimensional array of float64")
    if not array.flags.c_contiguous or (written and not array.flags.writeable):
        raise ValueError(f"{name} is a part of an array with gaps, or read only; expected a copy of it")
    if len(array) < size:
        raise ValueError(f"{name} has {len(array)} entries, expected {size}")
    return array
