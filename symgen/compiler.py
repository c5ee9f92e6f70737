"""The C compiler: found, named exactly, and run."""

from __future__ import annotations

import hashlib
import os
import shlex
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from symgen.errors import BuildError, ModelError, nearest

#: Default flags. ``-Og`` compiles straight-line code in four fifths of the time of ``-O1`` and runs it as
#: fast. Contraction is off so that results repeat bit for bit.
FLAGS = ("-std=c11", "-Og", "-ffp-contract=off")
DEFAULT = ("-Og",)
#: Instead of ``-Og`` where sines and cosines weigh: it finds both of an angle in one call.
OF_FUNCTIONS = ("-O1",)
#: Instead of ``-Og`` for many states at once: functions go through lanes in loops, which need inlining, and
#: a square root is one instruction only where it need not set errno.
OF_LANES = ("-O3", "-fno-math-errno")
#: Instead of ``-Og`` for the core of runs: its loops.
OF_CORE = ("-O2",)
#: Options that may change the last bits of results, or where a binary runs: what each value of them adds.
CONTRACTIONS = {"off": "-ffp-contract=off", "fast": "-ffp-contract=fast"}
VECTORS = {"none": (), "native": ("-march=native",)}
#: Instead of ``-Og`` for one processor: what is meant to run fast there is worth compiling longer.
_OF_NATIVE = ("-O2", "-fno-semantic-interposition", "-finline-functions", "-finline-limit=10000")
_TIMEOUT = 600


@dataclass(frozen=True, slots=True)
class Compiler:
    """A C compiler with its flags: ``command`` is how it is called, ``version`` its own first line."""

    command: tuple[str, ...]
    version: str
    flags: tuple[str, ...]

    def with_options(self, contraction: str, vector: str) -> Compiler:
        """Return the same compiler contracting products and sums, or for the vectors of this processor.

        Raises
        ------
        ModelError
            When there is no such value of an option.
        """
        for value, known in ((contraction, CONTRACTIONS), (vector, VECTORS)):
            if value not in known:
                option = "contraction" if known is CONTRACTIONS else "vector"
                raise ModelError(f"there is no {option} {value!r}. {nearest(str(value), known)}")
        flags = self.flags
        if contraction != "off":
            kept = (f for f in flags if not f.startswith("-ffp-contract"))
            flags = (*kept, CONTRACTIONS[contraction])
        return replace(self, flags=(*flags, *VECTORS[vector]))

    @property
    def identity(self) -> str:
        """Everything about it that may change the binary, the CPU too when the flags tune to it."""
        tuned = any(flag.startswith(("-march", "-mtune", "-mcpu")) for flag in self.flags)
        return "\n".join((*self.command, self.version, *self.flags, _cpu() if tuned else ""))

    def start(
        self,
        sources: Sequence[Path],
        library: Path,
        instead: Sequence[str] = DEFAULT,
        libraries: Sequence[str] = ("m",),
    ) -> Compilation:
        """Start compiling C sources, all side by side, to a shared library.

        Parameters
        ----------
        sources
            The files; objects are made beside them.
        library
            What to make.
        instead
            Flags for them in place of ``-Og``, unless the user chose others.
        libraries
            What it is linked with.
        """
        if tuple(instead) == DEFAULT and set(VECTORS["native"]) <= set(self.flags):
            instead = _OF_NATIVE
        flags = [flag for f in self.flags for flag in (instead if f == "-Og" else (f,))]
        running = []
        for source in sources:
            made = source.with_suffix(".o")
            command = [*self.command, *flags, "-fPIC", "-c", str(source), "-o", str(made)]
            running.append((command, made, _start(command)))
        return Compilation(self, tuple(running), library, tuple(f"-l{name}" for name in libraries))


@dataclass(frozen=True, slots=True)
class Compilation:
    """Compilers at work."""

    compiler: Compiler
    running: tuple[tuple[list[str], Path, subprocess.Popen[bytes]], ...]
    library: Path
    linked: tuple[str, ...]

    def finish(self) -> Path:
        """Wait for the objects, link them, and return the path of the library.

        Raises
        ------
        BuildError
            With the command and the compiler's own text.
        """
        failures = [
            failure for command, _, process in self.running if (failure := _failure(command, process))
        ]
        if failures:
            raise BuildError(failures[0])
        objects = [made for _, made, _ in self.running]
        command = [*self.compiler.command, *self.compiler.flags, "-shared", "-o", str(self.library)]
        command += [*map(str, objects), *self.linked]
        failure = _failure(command, _start(command))
        if failure:
            raise BuildError(failure)
        for made in objects:
            made.unlink()
        return self.library


def _start(command: list[str]) -> subprocess.Popen[bytes]:
    try:
        return subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
    except OSError as error:
        raise BuildError(f"cannot run the C compiler: {error}") from None


def _failure(command: list[str], process: subprocess.Popen[bytes]) -> str:
    """Wait for a compiler; return what it said when it failed, nothing otherwise."""
    try:
        said, _ = process.communicate(timeout=_TIMEOUT)
    except subprocess.TimeoutExpired:
        process.kill()
        said, _ = process.communicate()
    if not process.returncode:
        return ""
    return (
        f"the C compiler failed (exit code {process.returncode}): {shlex.join(command)}\n"
        f"{said.decode('utf-8', 'replace').strip()}\n"
        "  Flags come from SYMGEN_CFLAGS, the compiler from CC."
    )


def find_compiler() -> Compiler | None:
    """Return the compiler that ``CC`` names, or the first of cc, gcc and clang; None when there is none.

    Raises
    ------
    BuildError
        When ``CC`` names one that is not there.
    """
    chosen = os.environ.get("CC")
    candidates = [shlex.split(chosen)] if chosen else [["cc"], ["gcc"], ["clang"]]
    flags = os.environ.get("SYMGEN_CFLAGS")
    for command in candidates:
        path = shutil.which(command[0]) if command else None
        if path:
            full = (path, *command[1:])
            return Compiler(full, _version(full), FLAGS if flags is None else tuple(shlex.split(flags)))
    if chosen:
        raise BuildError(f"CC names the compiler {chosen!r}, which is not there; unset CC or mend it")
    return None


def _version(command: tuple[str, ...]) -> str:
    try:
        done = subprocess.run(
            [*command, "--version"], capture_output=True, timeout=30, check=False, stdin=subprocess.DEVNULL
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise BuildError(f"cannot run the C compiler {command[0]}: {error}") from None
    return done.stdout.decode("utf-8", "replace").partition("\n")[0].strip()


def _cpu() -> str:
    """Return the CPU's name and features, as far as the platform tells them."""
    import platform

    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        text = ""
    wanted = [line for line in text.splitlines() if line.startswith(("model name", "flags", "Features"))]
    features = hashlib.sha256("\n".join(sorted(set(wanted))).encode()).hexdigest()
    return f"{platform.machine()} {platform.processor()} {features}"
