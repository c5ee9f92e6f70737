"""The C compiler: found, named exactly, and run."""

from __future__ import annotations

import hashlib
import os
import platform
import shlex
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from symgen.errors import BuildError

#: Default flags. ``-O1`` compiles straight-line code fast and runs it as fast as higher levels; contraction
#: is off so that results repeat bit for bit whatever the machine.
FLAGS = ("-std=c11", "-O1", "-ffp-contract=off")
_SHARED = ("-shared", "-fPIC")
_TIMEOUT = 600


@dataclass(frozen=True, slots=True)
class Compiler:
    """A C compiler with its flags: ``command`` is how it is called, ``version`` its own first line."""

    command: tuple[str, ...]
    version: str
    flags: tuple[str, ...]

    @property
    def identity(self) -> str:
        """Everything about it that may change the binary, the CPU too when the flags tune to it."""
        tuned = any(flag.startswith(("-march", "-mtune", "-mcpu")) for flag in self.flags)
        return "\n".join((*self.command, self.version, *self.flags, _cpu() if tuned else ""))

    def compile(self, sources: Sequence[Path], library: Path) -> None:
        """Compile C sources to a shared library.

        Raises
        ------
        BuildError
            With the command and the compiler's own text.
        """
        command = [*self.command, *self.flags, *_SHARED, "-o", str(library), *map(str, sources), "-lm"]
        try:
            done = subprocess.run(
                command, capture_output=True, timeout=_TIMEOUT, check=False, stdin=subprocess.DEVNULL
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise BuildError(f"cannot run the C compiler: {error}") from None
        if done.returncode:
            said = (done.stderr + done.stdout).decode("utf-8", "replace").strip()
            raise BuildError(
                f"the C compiler failed (exit code {done.returncode}): {shlex.join(command)}\n{said}\n"
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
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        text = ""
    wanted = [line for line in text.splitlines() if line.startswith(("model name", "flags", "Features"))]
    features = hashlib.sha256("\n".join(sorted(set(wanted))).encode()).hexdigest()
    return f"{platform.machine()} {platform.processor()} {features}"
