"""The C compiler: detection, identification and execution."""

from __future__ import annotations

import hashlib
import os
import platform
import re
import select
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from symgen.errors import BuildError, SlowBackendWarning, check_known

#: Default flags. Straight-line code compiles in four fifths of the time of ``-O1`` and runs as fast.
#: Contraction is off so that results are reproducible bit for bit.
FLAGS = ("-std=c11", "-Og", "-ffp-contract=off")
DEFAULT = ("-Og",)
#: Instead of ``-Og`` where sines and cosines dominate, as sine and cosine of an angle share one call, and for
#: kernels as loops, which take a sixth less time.
OF_OPTIMISED = ("-O1",)
#: Instead of ``-Og`` for batches of states: SIMD lanes call functions in loops, which need inlining, and
#: a square root is a single instruction only if it need not set errno.
OF_LANES = ("-O3", "-fno-math-errno")
#: Instead of ``-Og`` for the core of runs, which consists of loops. ``-O2`` compiles in one and a half times
#: the time, and saves at most 7 % of a run.
OF_CORE = ("-O1",)
#: Options that affect the last bits of results or the portability of a binary, with the flags of each value.
CONTRACTIONS = {"off": "-ffp-contract=off", "fast": "-ffp-contract=fast"}
VECTORS = {"none": (), "native": ("-march=native",)}
#: Instead of ``-Og`` for a specific processor: there a longer compilation pays off.
_OF_NATIVE = ("-O2", "-fno-semantic-interposition", "-finline-functions", "-finline-limit=10000")
#: What flags that choose a processor begin with.
_TUNED = ("-march", "-mtune", "-mcpu")
#: Time limit [s] for compiling or linking one file.
LIMIT = 600.0
#: Time limit [s] for printing the compiler's version.
VERSION_LIMIT = 30.0
_ORIGIN = "  Flags come from SYMGEN_CFLAGS, the compiler from CC"


@dataclass(frozen=True, slots=True)
class Compiler:
    """A C compiler with its flags: ``command`` invokes it, ``version`` is the first line it prints."""

    command: tuple[str, ...]
    version: str
    flags: tuple[str, ...]

    def with_options(self, contraction: str, vector: str) -> Compiler:
        """Return the same compiler with another contraction mode or vector instruction set.

        Raises
        ------
        ModelError
            If an option does not have this value.
        """
        check_known(contraction, CONTRACTIONS, "there is no contraction")
        check_known(vector, VECTORS, "there is no vector")
        flags = self.flags
        if contraction != "off":
            others = (f for f in flags if not f.startswith("-ffp-contract"))
            flags = (*others, CONTRACTIONS[contraction])
        return replace(self, flags=(*flags, *VECTORS[vector]))

    @property
    def of_lanes(self) -> Compiler:
        """The same compiler, with all instructions of this processor where these have wider vectors.

        Kernels in lanes then get wider lanes. Without contraction that changes no bit.
        """
        ours = any(flag.startswith(_TUNED) for flag in self.flags)
        if ours or CONTRACTIONS["off"] not in self.flags or not has_wide_vectors():
            return self
        return replace(self, flags=(*self.flags, *VECTORS["native"]))

    @property
    def identity(self) -> str:
        """All settings that may change the binary, including the CPU if the flags tune to it."""
        tuned = any(flag.startswith(_TUNED) for flag in self.flags)
        return "\n".join((*self.command, self.version, *self.flags, _cpu() if tuned else ""))

    def start(
        self,
        sources: Sequence[Path],
        library: Path,
        instead: Sequence[str] = DEFAULT,
        libraries: Sequence[str] = ("m",),
    ) -> Compilation:
        """Start compiling C sources in parallel to a shared library.

        Parameters
        ----------
        sources
            The C files; object files are placed next to them.
        library
            Path of the library.
        instead
            Flags that replace ``-Og``, unless the user has set flags.
        libraries
            Libraries to link with.
        """
        if tuple(instead) == DEFAULT and set(VECTORS["native"]) <= set(self.flags):
            instead = _OF_NATIVE
        with ExitStack() as opened:
            running = []
            for source in sources:
                flags = [flag for f in self.flags for flag in (instead if f == "-Og" else (f,))]
                object_file = source.with_suffix(".o")
                command = [*self.command, *flags, "-fPIC", "-c", str(source), "-o", str(object_file)]
                running.append((started(command, opened), object_file))
            linked = tuple(f"-l{name}" for name in libraries)
            return Compilation(self, tuple(running), library, linked, opened.pop_all())


@dataclass(frozen=True, slots=True)
class Compilation:
    """Running compiler processes; a context manager that kills the remaining ones on exit."""

    compiler: Compiler
    running: tuple[tuple[Process, Path], ...]
    library: Path
    linked: tuple[str, ...]
    opened: ExitStack

    def __enter__(self) -> Compilation:
        return self

    def __exit__(self, *_: object) -> None:
        self.opened.close()

    def finish(self) -> Path:
        """Wait for the objects, link them, and return the path of the library.

        Files that exceed the time limit are compiled again at ``-O0``, with a warning.

        Raises
        ------
        BuildError
            With the command and the compiler's own output, or with the exceeded time limit.
        """
        with self:
            slow = [process for process, _ in self.running if not process.ended(LIMIT)]
            for process in slow:
                process.kill()
            again = [started(_unoptimised(process), self.opened) for process in slow]
            for process in (*again, *(p for p, _ in self.running if p not in slow)):
                process.check(LIMIT)
            objects = [object_file for _, object_file in self.running]
            command = [*self.compiler.command, *self.compiler.flags, "-shared", "-o", str(self.library)]
            link = started([*command, *map(str, objects), *self.linked], self.opened)
            link.check(LIMIT)
        if not self.library.is_file():
            raise BuildError(
                f"the C compiler reported success but wrote no library: {shlex.join(link.command)}\n"
                f"{_ORIGIN}; they must let it compile and link (no -E, -S, -fsyntax-only)."
            )
        for object_file in objects:
            object_file.unlink(missing_ok=True)
        return self.library


def started(command: list[str], opened: ExitStack) -> Process:
    """Start a compiler that ends with ``opened``, also if a signal arrives in between."""
    with _signals_later():
        return opened.enter_context(Process(command))


@contextmanager
def _signals_later() -> Iterator[None]:
    """Let signals act at the end: their handlers, which Python calls in the main thread, raise exceptions."""
    met: list[int] = []
    handlers: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)):
            if number not in handlers and callable(signal.getsignal(number)):
                handlers[number] = signal.signal(number, lambda number, _: met.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for number in met:
            handlers[number](number, None)


def _unoptimised(process: Process) -> list[str]:
    """Return the command of a compilation that exceeded the limit, at ``-O0``; BuildError if it was that."""
    plain = [word for word in process.command if not re.fullmatch(r"-O\w*", word)]
    if plain == process.command or "-O0" in process.command:
        raise BuildError(process.over_limit(LIMIT))
    warnings.warn(
        f"the C compiler exceeded the limit of {LIMIT:g} s with {Path(plain[-3]).name} and was killed; that "
        "file is compiled again at -O0, so runs take longer",
        SlowBackendWarning,
        stacklevel=2,
    )
    return [*plain, "-O0"]


class Process:
    """A compiler that runs in ``folder``, in a process group of its own, which ends with it."""

    def __init__(self, command: list[str], folder: Path | None = None) -> None:
        self.command = command
        try:
            # A file, not a pipe: a pipe stays open as long as any process of the group lives.
            self._output = tempfile.TemporaryFile()  # noqa: SIM115 - closed by __exit__
            self._process = subprocess.Popen(
                command,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=self._output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        except OSError as error:
            raise BuildError(f"cannot run the C compiler {command[0]}: {error}") from None
        self._begun = time.monotonic()

    def __enter__(self) -> Process:
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()
        self._output.close()

    def ended(self, limit: float) -> bool:
        """Wait until the compiler has ended; return False if it has run for longer than the limit [s]."""
        deadline = self._begun + limit
        if sys.platform == "linux" and self._process.poll() is None:
            # Popen.wait with a limit looks every 50 ms only.
            with suppress(OSError), os.fdopen(os.pidfd_open(self._process.pid)) as handle:
                poll = select.poll()
                poll.register(handle, select.POLLIN)
                poll.poll(1e3 * max(0.0, deadline - time.monotonic()))
        try:
            self._process.wait(max(0.0, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            return False
        return True

    def kill(self) -> None:
        """Kill the compiler and all processes of its group."""
        if self._process.poll() is None:
            if os.name == "nt":
                self._process.kill()
            else:
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()

    @property
    def output(self) -> str:
        """Return the compiler's output so far."""
        self._output.seek(0)
        return self._output.read().decode("utf-8", "replace").strip()

    def check(self, limit: float) -> None:
        """Wait for the compiler; raise BuildError unless it succeeds within the limit [s]."""
        if not self.ended(limit):
            raise BuildError(self.over_limit(limit))
        code = self._process.returncode
        if code:
            end = f"killed by signal {-code}" if code < 0 else f"exit code {code}"
            said = f"{self.output}\n" if self.output else ""
            raise BuildError(f"the C compiler failed ({end}): {shlex.join(self.command)}\n{said}{_ORIGIN}.")

    def over_limit(self, limit: float) -> str:
        """Kill the compiler, and return the message for one that exceeded the limit [s]."""
        self.kill()
        lines = (
            f"the C compiler exceeded the limit of {limit:g} s and was killed: {shlex.join(self.command)}",
            self.output,
            "  The backend numpy (--backend numpy) needs no compiler; a smaller model compiles faster.",
        )
        return "\n".join(filter(None, lines))


def find_compiler() -> Compiler | None:
    """Return the compiler named by ``CC``, or the first of cc, gcc, clang and Zig; None if there is none.

    Raises
    ------
    BuildError
        If the compiler in ``CC`` does not exist, or ``CC`` or ``SYMGEN_CFLAGS`` cannot be parsed.
    """
    chosen = os.environ.get("CC")
    candidates = [_words("CC", chosen)] if chosen else [["cc"], ["gcc"], ["clang"], zig("-mcpu=baseline")]
    flags = os.environ.get("SYMGEN_CFLAGS")
    for command in candidates:
        path = shutil.which(command[0]) if command else None
        if path:
            full = (path, *command[1:])
            of_user = FLAGS if flags is None else tuple(_words("SYMGEN_CFLAGS", flags))
            return Compiler(full, version_of(full, Path(path).stat().st_mtime_ns), of_user)
    if chosen:
        raise BuildError(f"CC names the compiler {chosen!r}, which does not exist\n  Unset CC or correct it.")
    return None


def zig(*flags: str) -> list[str]:
    """Return the command of the C compiler in the Python package of Zig; empty if it is not installed."""
    # By default Zig checks for overflow.
    command = [sys.executable, "-m", "ziglang", "cc", "-fno-sanitize=all", *flags]
    return command if find_spec("ziglang") else []


def _words(variable: str, value: str) -> list[str]:
    try:
        return shlex.split(value)
    except ValueError as error:  # an unclosed quote or a trailing backslash
        raise BuildError(
            f"the environment variable {variable} cannot be split into words: {error}, got {value!r}"
        ) from None


@cache
def version_of(command: tuple[str, ...], changed: int) -> str:
    """Return the first line in which a compiler, whose file last changed then, states its version."""
    with Process([*command, "--version"]) as process:
        if not process.ended(VERSION_LIMIT):
            raise BuildError(process.over_limit(VERSION_LIMIT))
        return process.output.partition("\n")[0].strip()


def _cpu() -> str:
    """Return the CPU's name and features, as far as the platform provides them."""
    wanted = [line for line in _cpuinfo() if line.startswith(("model name", "flags", "Features"))]
    features = hashlib.sha256("\n".join(sorted(set(wanted))).encode()).hexdigest()
    return f"{platform.machine()} {platform.processor()} {features}"


def has_wide_vectors() -> bool:
    """Return whether this is an x86 processor with AVX; False where the platform does not say."""
    return any(line.startswith("flags") and "avx" in line.split() for line in _cpuinfo())


@cache
def _cpuinfo() -> list[str]:
    try:
        return Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return []
