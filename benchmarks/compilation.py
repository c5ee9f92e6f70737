"""What power series cost where models are built: processor time of the compiler, and size of the C code.

All shipped scenes are compiled in turn with the kernels of power series and without them; the sums are
compared.
"""

from __future__ import annotations

import resource
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from harness import Required

import symgen
from symgen.codegen.emit import emit
from symgen.codegen.source import SourceFile
from symgen.codegen.target import Target
from symgen.lowering.kernel import Program
from symgen.lowering.program import lower_system
from symgen.pipeline.build import text_of
from symgen.pipeline.systems import derive
from symgen.toolchain.kernels import tools_for

#: Larger values would be noticed where a scene is built for the first time.
BOUND = 1.3


def required(rounds: int = 3) -> Iterator[Required]:
    """Yield the criteria on the sums over all shipped scenes."""
    spent, sizes = [0.0, 0.0], [0, 0]
    for name in symgen.shipped_scenes():
        program = lower_system(derive(text_of(name)))
        forms = [(form, emit(form, Target(), "x" * 64)) for form in (replace(program, series=()), program)]
        in_turn = [[_spent(*form) for form in forms] for _ in range(rounds)]
        for i, (_, files) in enumerate(forms):
            spent[i] += min(times[i] for times in in_turn)
            sizes[i] += sum(len(file.text) for file in files if file.name.endswith(".c"))
    about = "with power series over without, all shipped scenes"
    yield Required(f"compilation {about}", spent[1] / spent[0], BOUND, at_least=False, timed=True)
    yield Required(f"size of C code {about}", sizes[1] / sizes[0], BOUND, at_least=False)


def _spent(program: Program, files: tuple[SourceFile, ...]) -> float:
    """Return the processor time [s] of compiling and linking a program as builds do."""
    begun = _of_children()
    with TemporaryDirectory() as folder:
        compilation = tools_for("c", "float64", None, "off", "none").written(program, files, Path(folder))
        with compilation as running:
            assert running is not None
            running.finish()
    return _of_children() - begun


def _of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
