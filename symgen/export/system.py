"""Exported kernels of a user-defined system, with their results at one set of arguments."""

from __future__ import annotations

import numpy as np

from symgen.codegen.emit import SourceFile
from symgen.export.program import exported
from symgen.export.view import Exported, doubles
from symgen.lowering.kernel import SETUP, Program
from symgen.runtime import _core
from symgen.runtime.kernels.evaluate import as_taken
from symgen.runtime.model.system import SystemModel

#: Least argument of kernels in the comparison.
_LEAST = 0.5
#: Spacing of these arguments, modulo one.
_GOLDEN = (5**0.5 - 1) / 2


def system(model: SystemModel, program: Program, sources: tuple[SourceFile, ...]) -> Exported:
    """Return the exported data of a user-defined system."""
    d = model.description
    kernels = [k for k in d.kernels if k.name != SETUP]
    work = max((k.work_size for k in d.kernels), default=0)
    sizes = {"T": d.size("t"), "Q": d.size("q"), "U": d.size("u"), "P": d.size("p")}
    sizes |= {"WORK": max(work, d.size("work")), "OUT": max(k.out_size for k in kernels)}
    arguments = {name: _numbers(size + 1, k) for k, (name, size) in enumerate(sizes.items())}
    p = as_taken(model.library, arguments["P"][:-1])
    rows = []
    for kernel in kernels:
        memory, out = arguments["WORK"].copy(), arguments["OUT"].copy()
        address = model.library.addresses[kernel.name]
        _core.call(
            address, d.sizes_of(kernel.name), arguments["T"], arguments["Q"], arguments["U"], p, memory, out
        )
        rows.append(doubles(f"OF_{kernel.name.upper()}", out[: kernel.out_size]))
    return exported(
        d,
        program,
        sources,
        (),
        family="system",
        templates=(
            ("system_check.c.j2", "check.c"),
            ("CMakeLists.txt.j2", "CMakeLists.txt"),
            ("system.md.j2", "README.md"),
        ),
        kernel_names=tuple(k.name for k in kernels),
        derived=d.derived,
        tables=tuple(doubles(name, values) for name, values in arguments.items()),
        expected=tuple(rows),
    )


def _numbers(count: int, first: int) -> np.ndarray:
    return _LEAST + (np.arange(first, first + count) * _GOLDEN) % 1.0
