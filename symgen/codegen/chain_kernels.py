"""Source files from loops over rods, through templates."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass

from symgen.codegen.emit import environment
from symgen.codegen.printers import Printer
from symgen.codegen.source import SourceFile
from symgen.codegen.views import TextAssignment
from symgen.lowering.expressions import references, rename
from symgen.lowering.recursion import Loops, RecursionStep, StepResult

#: Chains per group of SIMD lanes: they fill the widest vector register. With twice as many, ten rods
#: no longer fit into 32 KiB of cache.
LANES = 8

TEMPLATES = (
    ("c/chain_kernel.h.j2", "{}_kernel.h"),
    ("c/chain_kernel.c.j2", "{}_kernel.c"),
    ("cython/chain.pyx.j2", "{}.pyx"),
)

#: Kernels that a step loop calls.
RUN_KERNELS = ("accelerations", "factor", "solve", "constraints", "velocity_constraints", "energy")


@dataclass(frozen=True, slots=True)
class LoopStepView:
    """A step as used by the templates: loads by index, expressions as final text, stores by index."""

    name: str
    description: str
    counts: str
    arguments: tuple[str, ...]
    results: tuple[StepResult, ...]
    loads: tuple[tuple[str, str, int], ...]
    assignments: tuple[TextAssignment, ...]
    stores: tuple[tuple[str, int, str, str], ...]


@dataclass(frozen=True, slots=True)
class LoopsView:
    """A recursion as used by the templates; ``factors`` and ``gathered`` count doubles per rod and point."""

    name: str
    title: str
    guard: str
    equations: str
    references: tuple[str, ...]
    dimension: int
    lanes: int
    factors: int
    gathered: int
    flops: int
    per_rod: str
    steps: tuple[LoopStepView, ...]
    run_kernels: tuple[str, ...] = RUN_KERNELS


def loops_hash(loops: Loops) -> str:
    """Return the hash of everything that determines the generated code: steps, lanes and templates."""
    digest = hashlib.sha256(repr((loops, LANES)).encode())
    for template, _ in TEMPLATES:
        digest.update(environment().loader.get_source(environment(), template)[0].encode())
    return digest.hexdigest()


def emit_loops(loops: Loops, equations: str) -> tuple[SourceFile, ...]:
    """Return the header, the C source and the Cython module of a recursion.

    Parameters
    ----------
    loops
        The lowered recursion.
    equations
        Its :func:`loops_hash`, written into the code.
    """
    view = LoopsView(
        name=loops.name,
        title=loops.title,
        guard=f"SYMGEN_{loops.name.upper()}_KERNEL_H",
        equations=equations,
        references=loops.references,
        dimension=loops.dimension,
        lanes=LANES,
        factors=loops.size("inward", "factors"),
        gathered=loops.size("gather", "here"),
        flops=loops.per_rod.flops,
        per_rod=str(loops.per_rod),
        steps=tuple(map(_step, loops.steps)),
    )
    return tuple(
        SourceFile(file.format(loops.name), environment().get_template(template).render(unit=view))
        for template, file in TEMPLATES
    )


def _step(step: RecursionStep) -> LoopStepView:
    printer, kernel = Printer({}), step.kernel
    values = [a.value for a in kernel.assignments] + [s.value for s in kernel.stores]
    loads = [_load(r) for r in references(values) if "[" in r]
    names = {f"{array}[{i}]": name for name, array, i in loads}
    added = {r.name for r in step.results if r.added}
    return LoopStepView(
        name=kernel.name,
        description=kernel.description,
        counts=str(step.counts),
        arguments=tuple(name for name, _ in kernel.inputs),
        results=step.results,
        loads=tuple(sorted(loads, key=lambda load: load[1:])),
        assignments=tuple(
            TextAssignment(a.target, printer(rename(a.value, names))) for a in kernel.assignments
        ),
        stores=tuple(
            (s.array, s.index, "+=" if s.array in added else "=", printer(rename(s.value, names)))
            for s in kernel.stores
        ),
    )


def _load(reference: str) -> tuple[str, str, int]:
    array, index = re.fullmatch(r"(\w+)\[(\d+)\]", reference).groups()  # type: ignore[union-attr]
    return f"{array}_{index}", array, int(index)
