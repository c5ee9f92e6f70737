"""Lowered matrices: entries in terms of named shared terms, as text or C."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import sympy as sp

from symgen.codegen.printers import Printer
from symgen.errors import ModelError
from symgen.lowering.expressions import Node, rename
from symgen.lowering.kernel import Block, Kernel
from symgen.lowering.program import lower_system
from symgen.precision import Precision
from symgen.report.mathematics.layout import WIDTH, wrapped
from symgen.report.mathematics.numbers import value_of
from symgen.symbolic.system import Export, Group, NamedMatrix, System

#: Digits of constants in readable text.
_DIGITS = 12


def in_shared_terms(system: System, matrices: Sequence[NamedMatrix], width: int = WIDTH) -> str:
    """Return matrices after common-subexpression elimination, with one nonzero entry per line.

    Terms named in the derivation keep their names; further common subexpressions are called c0, c1, ...
    """
    kernel = _kernel(system, matrices)
    names = {f"{group.name}[{i}]": x.name for group in system.groups for i, x in enumerate(group.quantities)}
    names |= {f"c[{i}]": c.quantity.name for i, c in enumerate(system.constants)}
    prints = Printer({}, literal=_short)

    def text(node: Node) -> str:
        return prints(rename(node, names))

    lines = [f"{kernel.description}: {kernel.counts}", ""]
    lines += [f"  {a.target} = {text(a.value)}" for a in kernel.assignments]
    values = {s.index: text(s.value) for s in kernel.stores}
    for block in kernel.blocks:
        lines += ["", f"{block.name}: {block.description} [{block.unit}]"]
        lines += [
            f"  [{place}] = {values[index]}" for index, place in _places(block) if values[index] != "0"
        ] or ["  zero"]
    return "\n".join(part for line in lines for part in wrapped(line, width, "      "))


def in_c(system: System, matrix: NamedMatrix, width: int = WIDTH) -> str:
    """Return a matrix as lines of C that write it to ``out`` in row-major order."""
    kernel = _kernel(system, [matrix])
    printer = Printer({})
    comment = [f"/* {matrix.description} [{matrix.unit}]: {kernel.counts}"]
    for array, _ in kernel.inputs:
        constants = [f"{c.quantity.name} = {value_of(c)}" for c in system.constants] if array == "c" else []
        names = constants or [x.name for x in system.group(array).quantities]
        comment.append(f" * {array}: {', '.join(names)}")
    lines = [part for line in comment for part in wrapped(line, width, " *     ")]
    code = [f"const double {a.target} = {printer(a.value)};" for a in kernel.assignments]
    code += [f"{s.array}[{s.index}] = {printer(s.value)};" for s in kernel.stores]
    return "\n".join([*lines, " */", *(part for line in code for part in wrapped(line, width))])


def _kernel(system: System, matrices: Sequence[NamedMatrix]) -> Kernel:
    if any(d.expression.has(sp.Piecewise) for d in system.definitions):
        raise ModelError(
            f"{matrices[0].name}: its directions are chosen by cases, which straight-line C cannot express\n"
            "  Use --format unicode, latex or numeric."
        )
    names = tuple(m.name for m in matrices)
    about = matrices[0].description if len(matrices) == 1 else ", ".join(names)
    # A single kernel, including the terms that are otherwise precomputed once per run.
    groups = [replace(group, per_run=False) for group in system.groups]
    if system.constants:
        groups.append(Group("c", "constants of the scene", tuple(c.quantity for c in system.constants)))
    exports = (Export("shown", about, names),)
    alone = replace(
        system,
        groups=tuple(groups),
        constants=(),
        matrices=tuple(matrices),
        exports=exports,
        saddle_point=None,
        residual="",
    )
    return lower_system(alone).kernels[0]


def _places(block: Block) -> list[tuple[int, str]]:
    """Return the index in ``out`` of every entry, with its row and column by name or number."""
    rows, columns = block.shape
    places = []
    for i in range(rows):
        for j in range(columns):
            names = [block.rows[i] if block.rows else str(i + 1)]
            if columns > 1:
                names.append(block.columns[j] if block.columns else str(j + 1))
            places.append((block.offset + i * columns + j, ", ".join(names)))
    return places


def _short(text: str, _: Precision) -> str:
    return f"{float(text):.{_DIGITS}g}"
