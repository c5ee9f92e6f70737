"""What exports of all families have alike: what follows from description and program."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from symgen.codegen.emit import SourceFile, plain
from symgen.export.view import Exported, braces, with_headers
from symgen.lowering.kernel import Kernel, Program, Slot
from symgen.runtime.description import Described


def exported(
    d: Described, program: Program, sources: tuple[SourceFile, ...], core: Sequence[str], **own: Any
) -> Exported:
    """Return what is exported of a model.

    Parameters
    ----------
    d, program, sources
        Its description, its equations of motion after the lowering, and all its kernels in C.
    core
        Files of the core that it needs, without their headers.
    own
        What its family says of it.
    """
    return Exported(
        name=d.name,
        title=_title_of(sources),
        equations=d.equations,
        references=program.references,
        core=with_headers(core),
        kernels=sources,
        **own,
    )


def arguments(d: Described, program: Program) -> dict[str, Any]:
    """Return parameters with their values in the scene, and outputs, of what takes and gives them."""
    return {
        "parameters": group(program, "p"),
        "defaults": braces(p.default for p in d.parameters),
        "outputs": _outputs_of(program),
    }


def _title_of(sources: Sequence[SourceFile]) -> str:
    """Return the title as the kernels' header has it, safe in a comment."""
    header = next(f for f in sources if f.name.endswith(".h"))
    return header.text.splitlines()[0].removeprefix("/* ")


def group(program: Program, name: str) -> tuple[Slot, ...]:
    """Return what the entries of one argument array mean."""
    return plain(next((slots for own, _, slots in program.groups if own == name), ()))


def state_of(program: Program, extra: int) -> tuple[Slot, ...]:
    """Return what the numbers of a state mean."""
    work = (Slot("work", "J", "work of loads without potential since the start"),) if extra else ()
    return (*group(program, "q"), *group(program, "u"), *work)


def _outputs_of(program: Program) -> tuple[Slot, ...]:
    """Return what the scene records, a slot for each number."""
    kernel: Kernel | None = next((k for k in program.kernels if k.name == "outputs"), None)
    if kernel is None:
        return ()
    found = []
    for block in kernel.blocks:
        count = block.shape[0] * block.shape[1]
        names = [f" {r} {c}".rstrip() for r in block.rows or ("",) for c in block.columns or ("",)]
        if len(names) != count:
            names = [f"[{i}]" for i in range(count)] if count > 1 else [""]
        found += [Slot(f"{block.name}{name}", block.unit, block.description) for name in names]
    return plain(tuple(found))
