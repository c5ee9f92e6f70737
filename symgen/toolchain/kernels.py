"""Build settings, and the kernels of a system built with them or read from the cache."""

from __future__ import annotations

import gc
import json
import logging
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symgen.errors import BuildError, CacheError, ModelError, SceneError, check_known
from symgen.methods import METHODS
from symgen.precision import FLOAT64, Precision
from symgen.precision import precision as precision_named
from symgen.toolchain import dependencies as graph
from symgen.toolchain.cache import Cache, key
from symgen.toolchain.compiler import (
    DEFAULT,
    OF_CORE,
    OF_LANES,
    OF_OPTIMISED,
    Compilation,
    Compiler,
    find_compiler,
)

if TYPE_CHECKING:
    from symgen.codegen.source import SourceFile
    from symgen.lowering.kernel import Program
    from symgen.runtime._core import Core
    from symgen.runtime.kernels.description import Described
    from symgen.runtime.kernels.library import Library
    from symgen.scene.loading import SceneText
    from symgen.symbolic.system import System

BACKENDS = ("auto", "c", "numpy", "mpmath")
_log = logging.getLogger(__name__)
#: Default number of digits of the backend mpmath.
DIGITS = 40
GET_A_COMPILER = (
    "Install one: 'pip install symgen[cc]' anywhere, 'apt install gcc' or 'dnf install gcc' on Linux, "
    "'xcode-select --install' on macOS; or name it in CC."
)
_DESCRIPTION, _LIBRARY = "description.json", "kernels.so"
#: Extra digits of constants beyond the working precision of mpmath.
_GUARD = 10


@dataclass(frozen=True, slots=True)
class BuildSettings:
    """Build settings of kernels: language, compiler and precision.

    Parameters
    ----------
    compiler
        The C compiler with its flags, or None for Python kernels.
    precision
        The number type.
    digits
        Decimal digits of kernels in mpmath; 0 for all other backends.
    contraction, vector
        Options already contained in the compiler's flags.
    """

    compiler: Compiler | None
    precision: Precision = FLOAT64
    digits: int = 0
    contraction: str = "off"
    vector: str = "none"

    @property
    def language(self) -> str:
        """The language of the kernels."""
        return "c" if self.compiler else "mpmath" if self.digits else "numpy"

    @property
    def identity(self) -> str:
        """All settings that may change the kernels."""
        target = self.compiler.identity if self.compiler else self.language
        return "\n".join((target, self.precision.name, str(self.digits)))

    @property
    def in_float64(self) -> BuildSettings:
        """Return the same settings for kernels in double precision."""
        return replace(self, precision=FLOAT64, digits=0)

    @property
    def of_lanes(self) -> BuildSettings:
        """Return the settings of kernels in lanes."""
        return replace(self, compiler=self.compiler.of_lanes) if self.compiler else self

    @property
    def provenance(self) -> dict[str, str]:
        """Return the settings that affect the last bits of a result, for reports."""
        data = {"precision": f"{self.digits} digits" if self.digits else self.precision.name}
        if self.compiler:
            data["compiler"] = self.compiler.version
            data |= {"contraction": self.contraction, "vector": self.vector}
        return data

    def lowered(
        self, system: System, lanes: bool = False, series: bool = False
    ) -> tuple[Program, str, tuple[SourceFile, ...]]:
        """Return the program of a system, the hash of its equations, and its sources."""
        from symgen.codegen.emit import emit, equations_hash
        from symgen.codegen.target import Target
        from symgen.lowering.expressions import keeping
        from symgen.lowering.program import lower_system

        with keeping(self.digits + _GUARD):
            program = lower_system(system)
        if lanes and not series:
            program = replace(program, series=())
        target = Target(self.language, self.precision, lanes and self.compiler is not None)
        equations = equations_hash(program, target)
        return program, equations, emit(program, target, equations)

    def written(
        self, program: Program, sources: tuple[SourceFile, ...], folder: Path, lanes: bool = False
    ) -> AbstractContextManager[Compilation | None]:
        """Write the sources and start compiling those in C; the context ends the compiler on exit."""
        from symgen.codegen.source import LOOPS

        try:
            for source in sources:
                (folder / source.name).write_text(source.text, encoding="utf-8")
        except OSError as error:
            raise Cache(folder.parent).error(error) from None
        if self.compiler is None:
            return nullcontext()
        in_c = [folder / s.name for s in sources if s.name.endswith(".c")]
        functions = program.calls_functions and self.vector != "native"  # where DEFAULT stands for more
        optimised = functions or any(file.name.endswith(LOOPS) for file in in_c)
        instead = OF_LANES if lanes else OF_OPTIMISED if optimised else DEFAULT
        return self.compiler.start(in_c, folder / _LIBRARY, instead, self.precision.libraries)

    def built(
        self,
        folder: Path,
        system: Callable[[], System],
        describe: Callable[[Program, str], Any],
        lanes: bool = False,
        series: bool = False,
    ) -> tuple[Any, Library]:
        """Derive a system and compile its kernels into a folder; return their description and library.

        ``describe`` returns the description by program and hash of its equations, while compilers work. In
        ``lanes`` kernels take vectors, and motions have power series with ``series`` only.
        """
        with no_collection():
            program, equations, sources = self.lowered(system(), lanes, series)
        with self.written(program, sources, folder, lanes) as compilation:
            description = describe(program, equations)
            return description, self.opened(folder, description, compilation)

    def opened(self, folder: Path, description: Described, compilation: Compilation | None = None) -> Library:
        """Open the kernels in a folder: the compiled library, else the Python source."""
        from symgen.runtime.kernels.library import open_library, open_mpmath, open_numpy

        library = self._finished(compilation) if compilation else folder / _LIBRARY
        if library.is_file():
            return replace(open_library(library, description), provenance=self.provenance)
        source = (folder / f"{description.name}_{self.language}.py").read_text(encoding="utf-8")
        if self.digits:
            kernels = open_mpmath(source, description, self.digits)
        else:
            kernels = open_numpy(source, description, self.precision)
        return replace(kernels, provenance=self.provenance)

    def _finished(self, compilation: Compilation) -> Path:
        try:
            return compilation.finish()
        except BuildError as error:
            if not self.precision.needs:
                raise
            raise BuildError(
                f"{self.precision.name} needs a compiler with {self.precision.needs}\n{error}"
            ) from None

    def core(self) -> Core:
        """Return the core of runs for this precision, compiled once for all scenes.

        Raises
        ------
        BuildError
            If there is no C compiler, or compilation fails.
        """
        from symgen.runtime.kernels.library import open_core

        if self.compiler is None:
            raise BuildError(f"runs in {self.precision.name} need a C compiler, and there is none")
        here = Path(__file__).resolve().parent.parent / "runtime" / "core"
        sources = {p.name: p.read_text(encoding="utf-8") for p in sorted(here.glob("*.[ch]"))}
        store = Cache()
        name = f"core-{self.precision.name}-{key(self.identity, *OF_CORE, *sources, *sources.values())}"
        with store.locked(name):
            entry = store.find(name)
            if entry is None:
                with store.building(name) as folder:
                    self._compile_core(sources, folder)
                entry = store.find(name)
        if entry is None:
            raise CacheError(f"the compiled core {store.root / name} cannot be read back")
        return open_core(entry.folder / _LIBRARY)

    def _compile_core(self, sources: dict[str, str], folder: Path) -> None:
        for file, text in sources.items():
            (folder / file).write_text(text, encoding="utf-8")
        chosen = (*OF_CORE, f"-DSYMGEN_REAL_{self.precision.name.upper()}")
        in_c = [folder / file for file in sources if file.endswith(".c")]
        if self.compiler:
            flags = tuple(f for f in self.compiler.flags if f not in DEFAULT)
            compiler = replace(self.compiler, flags=(*flags, *chosen))
            self._finished(compiler.start(in_c, folder / _LIBRARY, libraries=self.precision.libraries))

    def cached(
        self,
        text: SceneText,
        kind: str,
        make: Callable[[Path], tuple[Any, Library]],
        read: Callable[[], graph.Needs] = dict,
        base: Described | None = None,
    ) -> tuple[Any, Library]:
        """Return the cached result of ``make`` for a scene, or build it; ``kind`` enters the entry's name.

        After a build, ``read`` returns the dependencies other than the scene, symgen and the description
        ``base``.
        """
        store, name = Cache(), self._entry(text, kind, base)
        entry = self._from_cache(store, name)
        if entry:
            return entry
        with store.locked(name):
            entry = self._from_cache(store, name)
            if entry:
                return entry
            with store.building(name, lambda f: graph.keep(f, name, graph.needs(read()))) as folder:
                subject = kind.partition("-")[0].replace("_", " ") or "equations of motion"
                _log.info("%s: deriving and compiling %s; later calls use the cache", text.name, subject)
                with _naming_quantities(text):
                    description, library = make(folder)
                try:
                    (folder / _DESCRIPTION).write_text(description.to_json(), encoding="utf-8")
                except OSError as error:
                    raise store.error(error) from None
            return description, library

    def _entry(self, text: SceneText, kind: str, base: Described | None = None) -> str:
        """Return the name of an entry of the cache, without its dependencies."""
        parts = (text.file, text.canonical, self.identity, repr(base) if base else "")
        return "-".join(part for part in (text.name, kind, key(*parts)) if part)

    def is_current(self, text: SceneText, kind: str, description: Described) -> bool:
        """Return whether a description from the cache is that of the sources as they are now."""
        entry = graph.current(Cache(), self._entry(text, kind))
        return entry is not None and _description(entry.read_text(_DESCRIPTION)) == description

    def _from_cache(self, store: Cache, name: str) -> tuple[Described, Library] | None:
        entry = graph.current(store, name)
        if entry is None:
            return None
        try:
            description = _description(entry.read_text(_DESCRIPTION))
            return description, self.opened(entry.folder, description)
        except Exception:  # intact but unusable, for whatever reason: rebuild it
            store.remove(entry)
            return None


@contextmanager
def _naming_quantities(text: SceneText) -> Iterator[None]:
    """Name the largest or smallest quantity of a scene where a constant of its equations is out of range."""
    from symgen.codegen.printers import ConstantError

    try:
        yield
    except ConstantError as error:
        from symgen.scene.units import farthest

        _, where, quantity = farthest(text.data)
        if not where:
            raise
        problem = f"{quantity} is too large or too small next to the other quantities: {error}"
        raise SceneError(problem, where=where, file=text.file) from None


def _description(text: str) -> Described:
    """Read what ``Described.to_json`` wrote; raise ValueError for anything else."""
    from symgen.runtime.kernels.records import record

    data = json.loads(text)
    if not isinstance(data, dict):
        raise ValueError(f"expected an object, got {text[:100]}")
    description: Described = record(METHODS[data.pop("method", "")].load("description"), data)
    entries = len(getattr(description, "start", ()))
    if entries not in (0, description.coordinates, 2 * description.coordinates):
        raise ValueError(f"expected a start of {description.coordinates} coordinates, got {entries} numbers")
    return description


@contextmanager
def no_collection() -> Iterator[None]:
    """Pause the garbage collector: a derivation creates many objects that live until its end."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def tools_for(
    backend: str, precision: str, digits: int | None, contraction: str, vector: str
) -> BuildSettings:
    """Return the build settings for these options; raise ModelError if they are incompatible."""
    check_known(backend, BACKENDS, "there is no backend")
    wanted = precision_named(precision)
    compiler = None if backend == "numpy" else find_compiler()
    if compiler is None and backend == "c":
        raise ModelError(f"the backend 'c' needs a C compiler, and there is none. {GET_A_COMPILER}")
    if compiler is None and wanted.low:
        raise ModelError(f"{wanted.name} needs a C compiler: NumPy has no such type. {GET_A_COMPILER}")
    if backend != "mpmath" and digits is not None:
        raise ModelError(f"digits = {digits!r} goes with the backend 'mpmath', not {backend!r}")
    if backend == "mpmath":
        from symgen.runtime.kernels.arguments import count

        digits = count(DIGITS if digits is None else digits, "digits")
        if not 15 <= digits <= 10_000:
            raise ModelError(f"expected between 15 and 10000 digits, got {digits}")
        if wanted != FLOAT64:
            raise ModelError(f"the backend 'mpmath' has digits, not a precision, got {precision!r}")
    if compiler is None and (contraction, vector) != ("off", "none"):
        raise ModelError("contraction and vector are options of a C compiler, and none is used")
    if compiler:
        compiler = compiler.with_options(contraction, vector)
    return BuildSettings(compiler, wanted, digits or 0, contraction, vector)
