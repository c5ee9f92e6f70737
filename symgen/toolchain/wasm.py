"""C compiled to WebAssembly by Zig, which brings a C compiler and library as a Python package."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from symgen.codegen.source import SourceFile
from symgen.errors import BuildError
from symgen.toolchain.compiler import Process, zig

_TARGET = ("-target", "wasm32-wasi", "-mexec-model=reactor")
#: Contraction is off as in native code, so that results differ by the mathematical library alone.
_FLAGS = ("-std=c11", "-O2", "-ffp-contract=off", "-s")
#: Time limit [s]; the first call compiles the C library too.
_LIMIT = 900.0


def compile_wasm(files: Sequence[SourceFile]) -> bytes:
    """Return the WebAssembly module of C files, some of them in folders.

    Raises
    ------
    BuildError
        When Zig is not installed, refuses the files, or exceeds its time limit.
    """
    compiler = zig(*_TARGET)
    if not compiler:
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
        with Process([*compiler, *_FLAGS, "-o", "live.wasm", *sources], folder) as process:
            process.check(_LIMIT)
        return (folder / "live.wasm").read_bytes()
