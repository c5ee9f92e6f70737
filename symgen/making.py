"""Kernels of a system made with one set of tools, or taken from the cache."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symgen import graph
from symgen.cache import Cache, Entry, key
from symgen.compiler import DEFAULT, OF_CORE, OF_FUNCTIONS, OF_LANES, Compilation, Compiler, find_compiler
from symgen.errors import BuildError, CacheError, ModelError, nearest
from symgen.precision import FLOAT64, Precision
from symgen.precision import precision as precision_named

if TYPE_CHECKING:
    from symgen.codegen.source import SourceFile
    from symgen.lowering.kernel import Program
    from symgen.runtime._core import Core
    from symgen.runtime.description import Described
    from symgen.runtime.library import Library
    from symgen.scene.loading import SceneText
    from symgen.symbolic.system import System

BACKENDS = ("auto", "c", "numpy", "mpmath")
#: Digits of the backend mpmath where none are asked for.
DIGITS = 40
GET_A_COMPILER = (
    "Install one: 'apt install gcc' or 'dnf install gcc' on Linux, 'xcode-select --install' on macOS; "
    "or name it in CC."
)
_DESCRIPTION, _LIBRARY = "description.json", "kernels.so"
#: Digits of constants beyond those that mpmath works with.
_GUARD = 10


@dataclass(frozen=True, slots=True)
class Tools:
    """What kernels are made with.

    Parameters
    ----------
    compiler
        The C compiler with its flags, or None for kernels in Python.
    precision
        The type of all numbers.
    digits
        Digits of kernels in mpmath, for which there is no compiler; 0 for all others.
    contraction, vector
        The options that are in the compiler's flags.
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
        """Everything about them that may change what is made."""
        how = self.compiler.identity if self.compiler else self.language
        return "\n".join((how, self.precision.name, str(self.digits)))

    @property
    def in_float64(self) -> Tools:
        """The same tools for kernels in double precision."""
        return replace(self, precision=FLOAT64, digits=0)

    @property
    def provenance(self) -> dict[str, str]:
        """What decides the last bits of a result, for whoever reads it."""
        how = {"precision": f"{self.digits} digits" if self.digits else self.precision.name}
        if self.compiler:
            how |= {"compiler": self.compiler.version, "contraction": self.contraction, "vector": self.vector}
        return how

    def lowered(self, system: System, lanes: bool = False) -> tuple[Program, str, tuple[SourceFile, ...]]:
        """Return the program of a system, the hash of its equations, and its sources."""
        from symgen.codegen.emit import emit, equations_hash
        from symgen.codegen.target import Target
        from symgen.lowering.nodes import keeping
        from symgen.lowering.program import lower_system

        point = system.saddle_point
        if point:
            tolerance = self.precision.coarsened(float(point.rank_tolerance))
            if tolerance != float(point.rank_tolerance):
                system = replace(system, saddle_point=replace(point, rank_tolerance=repr(tolerance)))
        with keeping(self.digits + _GUARD):
            program = lower_system(system)
        target = Target(self.language, self.precision, lanes and self.compiler is not None)
        equations = equations_hash(program, target)
        return program, equations, emit(program, target, equations)

    def written(
        self, program: Program, sources: tuple[SourceFile, ...], folder: Path, lanes: bool = False
    ) -> Compilation | None:
        """Write the sources and start the compiler on those in C."""
        try:
            for source in sources:
                (folder / source.name).write_text(source.text, encoding="utf-8")
        except OSError as error:
            raise Cache(folder.parent).error(error) from None
        if self.compiler is None:
            return None
        in_c = [folder / s.name for s in sources if s.name.endswith(".c")]
        instead = OF_LANES if lanes else OF_FUNCTIONS if program.calls_functions else DEFAULT
        return self.compiler.start(in_c, folder / _LIBRARY, instead, self.precision.libraries)

    def opened(self, folder: Path, description: Described, compilation: Compilation | None = None) -> Library:
        """Open the kernels in a folder: the compiled library, else the source in Python."""
        from symgen.runtime.library import open_library, open_mpmath, open_numpy

        library = self._finished(compilation) if compilation else folder / _LIBRARY
        if library.is_file():
            return replace(open_library(library, description), provenance=self.provenance)
        source = (folder / f"{description.name}_{self.language}.py").read_text(encoding="utf-8")
        if self.digits:
            made = open_mpmath(source, description, self.digits)
        else:
            made = open_numpy(source, description, self.precision)
        return replace(made, provenance=self.provenance)

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
        """Return the core of runs for the precision, compiled once for all scenes.

        Raises
        ------
        BuildError
            When there is no C compiler, or it fails.
        """
        from symgen.runtime.library import open_core

        if self.compiler is None:
            raise BuildError(f"runs in {self.precision.name} need a C compiler, and there is none")
        here = Path(__file__).resolve().parent / "runtime" / "core"
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
    ) -> tuple[Any, Library]:
        """Take from the cache what ``make`` makes of a scene, or make it; ``kind`` is part of its name.

        ``read`` tells, when it is made, what it depends on besides the scene and symgen.
        """
        store = Cache()
        parts = (text.file, text.canonical, self.identity)
        name = "-".join(part for part in (text.name, kind, key(*parts)) if part)
        found = self._from_cache(graph.current(store, name))
        if found:
            return found
        with store.locked(name):
            found = self._from_cache(graph.current(store, name))
            if found:
                return found
            with store.building(name, lambda f: graph.keep(f, name, graph.needs(read()))) as folder:
                description, library = make(folder)
                try:
                    (folder / _DESCRIPTION).write_text(description.to_json(), encoding="utf-8")
                except OSError as error:
                    raise store.error(error) from None
            return description, library

    def _from_cache(self, entry: Entry | None) -> tuple[Described, Library] | None:
        if entry is None:
            return None
        from symgen.runtime.description import read_description

        try:
            description = read_description(entry.read_text(_DESCRIPTION))
            return description, self.opened(entry.folder, description)
        except (KeyError, TypeError, ValueError, OSError):
            return None


@contextmanager
def no_collection() -> Iterator[None]:
    """Pause the garbage collector: a derivation makes many objects that all live until its end."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def tools_for(backend: str, precision: str, digits: int | None, contraction: str, vector: str) -> Tools:
    """Return the tools that options ask for; raise ModelError where they do not go together."""
    if backend not in BACKENDS:
        raise ModelError(f"there is no backend {backend!r}. {nearest(backend, BACKENDS)}")
    wanted = precision_named(precision)
    compiler = None if backend == "numpy" else find_compiler()
    if compiler is None and backend == "c":
        raise ModelError(f"the backend 'c' needs a C compiler, and there is none. {GET_A_COMPILER}")
    if compiler is None and wanted.low:
        raise ModelError(f"{wanted.name} needs a C compiler: NumPy has no such type. {GET_A_COMPILER}")
    if backend != "mpmath" and digits is not None:
        raise ModelError(f"digits = {digits!r} goes with the backend 'mpmath', not {backend!r}")
    if backend == "mpmath":
        from symgen.runtime.arguments import count

        digits = count(DIGITS if digits is None else digits, "digits")
        if not 15 <= digits <= 10_000:
            raise ModelError(f"expected between 15 and 10000 digits, got {digits}")
        if wanted != FLOAT64:
            raise ModelError(f"the backend 'mpmath' has digits, not a precision, got {precision!r}")
    if compiler is None and (contraction, vector) != ("off", "none"):
        raise ModelError("contraction and vector are options of a C compiler, and none is used")
    if compiler:
        compiler = compiler.with_options(contraction, vector)
    return Tools(compiler, wanted, digits or 0, contraction, vector)
