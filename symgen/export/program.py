"""Exported data common to all families, from the description and the program."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from symgen.codegen.emit import SourceFile, plain
from symgen.export.view import Exported, braces, with_headers
from symgen.lowering.kernel import Kernel, Program, Slot
from symgen.runtime.integrate.integrators import INTEGRATORS
from symgen.runtime.integrate.integrators.method import Integrator
from symgen.runtime.kernels.description import Described


def exported(
    d: Described,
    program: Program,
    sources: tuple[SourceFile, ...],
    core: Sequence[str],
    method: Integrator = INTEGRATORS["dop853"],
    **fields: Any,
) -> Exported:
    """Return the exported data of a model.

    Parameters
    ----------
    d, program, sources
        The description, the lowered equations of motion, and all kernels in C.
    core
        Source files of the core that the model needs, besides that of the method; none without runs.
    method
        The method of its runs.
    fields
        Data of the model's family.
    """
    return Exported(
        name=d.name,
        title=_title_of(sources),
        equations=d.equations,
        references=program.references,
        core=with_headers([*core, *(f"{m.kind}.c" for m in (method, method.near) if m)] if core else ()),
        method=method,
        kernels=sources,
        **fields,
    )


def arguments(d: Described, program: Program) -> dict[str, Any]:
    """Return the parameters with their values in the scene, and the outputs."""
    return {
        "parameters": group(program, "p"),
        "defaults": braces(p.default for p in d.parameters),
        "outputs": _outputs_of(program),
    }


def _title_of(sources: Sequence[SourceFile]) -> str:
    """Return the title from the header of the kernels, safe in a comment."""
    header = next(f for f in sources if f.name.endswith(".h"))
    return header.text.splitlines()[0].removeprefix("/* ")


def group(program: Program, name: str) -> tuple[Slot, ...]:
    """Return the descriptions of the entries of one argument array."""
    return plain(next((slots for owner, _, slots in program.groups if owner == name), ()))


def state_of(program: Program, extra: int) -> tuple[Slot, ...]:
    """Return the descriptions of the entries of a state."""
    work = (Slot("work", "J", "work of loads without potential since the start"),) if extra else ()
    return (*group(program, "q"), *group(program, "u"), *work)


def _outputs_of(program: Program) -> tuple[Slot, ...]:
    """Return the recorded outputs, one slot per number."""
    kernel: Kernel | None = next((k for k in program.kernels if k.name == "outputs"), None)
    if kernel is None:
        return ()
    slots = []
    for block in kernel.blocks:
        count = block.shape[0] * block.shape[1]
        names = [f" {r} {c}".rstrip() for r in block.rows or ("",) for c in block.columns or ("",)]
        if len(names) != count:
            names = [f"[{i}]" for i in range(count)] if count > 1 else [""]
        slots += [Slot(f"{block.name}{name}", block.unit, block.description) for name in names]
    return plain(tuple(slots))
