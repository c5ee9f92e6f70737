"""C compiled to WebAssembly by Zig, which brings a C compiler and library as a Python package."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from symgen.codegen.emit import SourceFile
from symgen.errors import BuildError

_COMMAND = ("-m", "ziglang", "cc", "-target", "wasm32-wasi", "-mexec-model=reactor")
#: Contraction is off as in native code, so that results differ by the mathematical library alone.
_FLAGS = ("-std=c11", "-O2", "-ffp-contract=off", "-fno-sanitize=all", "-s")
#: Time limit [s]; the first call compiles the C library too.
_LIMIT = 900.0


def compile_wasm(files: Sequence[SourceFile]) -> bytes:
    """Return the WebAssembly module of C files, some of them in folders.

    Raises
    ------
    BuildError
        When Zig is not installed, or refuses the files.
    """
    if find_spec("ziglang") is None:
        raise BuildError(
            "WebAssembly is compiled by Zig, which is not installed\n"
            "  pip install 'symgen[live]' installs it."
        )
    with tempfile.TemporaryDirectory(prefix="symgen-live-") as name:
        folder = Path(name)
        for file in files:
            path = folder / file.name
            path.parent.mkdir(exist_ok=True)
            path.write_text(file.text, encoding="utf-8")
        sources = [file.name for file in files if file.name.endswith(".c")]
        command = [sys.executable, *_COMMAND, *_FLAGS, "-o", "live.wasm", *sources]
        local = {**os.environ, "ZIG_LOCAL_CACHE_DIR": str(folder / "zig")}
        try:
            done = subprocess.run(
                command, cwd=folder, env=local, capture_output=True, text=True, timeout=_LIMIT, check=False
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise BuildError(f"Zig could not compile to WebAssembly: {error}") from None
        if done.returncode:
            raise BuildError(f"Zig could not compile to WebAssembly:\n{done.stderr[-2000:]}")
        return (folder / "live.wasm").read_bytes()
