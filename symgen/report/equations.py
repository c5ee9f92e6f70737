"""Derived matrices as text: for the terminal, LaTeX, C, or numbers at the start of the scene."""

from __future__ import annotations

import sympy as sp

from symgen.codegen.printers import Printer
from symgen.errors import ModelError, nearest
from symgen.lowering.program import lower_system
from symgen.runtime.model import Model
from symgen.symbolic.system import Export, NamedMatrix, System

FORMATS = ("unicode", "latex", "c", "numeric")


def overview(system: System) -> list[tuple[str, str, str, str]]:
    """Return name, shape, unit and meaning of every matrix."""
    return [(m.name, f"{m.matrix.rows} x {m.matrix.cols}", m.unit, m.description) for m in system.matrices]


def show(system: System, name: str, form: str, model: Model | None = None) -> str:
    """Return one matrix in one form, with the shared subexpressions that it uses.

    Raises
    ------
    DerivationError
        When there is no such matrix.
    ModelError
        When there is no such form, or numbers are asked for where there is no state.
    """
    if form not in FORMATS:
        raise ModelError(f"there is no format {form!r}. {nearest(form, FORMATS)}")
    matrix = system[name]
    if form == "c":
        return _as_c(system, matrix)
    if form == "numeric":
        return _as_numbers(system, matrix, model)
    definitions = [(d.quantity.symbol, d.expression) for d in system.definitions]
    used = _used(matrix.matrix, dict(definitions))
    write = (lambda e: sp.pretty(e, use_unicode=True, wrap_line=False)) if form == "unicode" else sp.latex
    lines = [write(matrix.matrix)]
    shared = [(s, e) for s, e in definitions if s in used]
    if form == "latex":
        lines += [rf"{sp.latex(s)} &= {sp.latex(e)} \\" for s, e in shared]
        return "\n".join([rf"% {matrix.description} [{matrix.unit}]", *lines])
    lines += ["", "with"] if shared else []
    lines += [f"  {s} = {e}" for s, e in shared]
    return "\n".join([f"{matrix.name}: {matrix.description} [{matrix.unit}]", "", *lines])


def _used(matrix: sp.ImmutableMatrix, definitions: dict[sp.Symbol, sp.Expr]) -> set[sp.Symbol]:
    found: set[sp.Symbol] = set()
    waiting = list(matrix.free_symbols)
    while waiting:
        symbol = waiting.pop()
        if symbol in definitions and symbol not in found:
            found.add(symbol)
            waiting.extend(definitions[symbol].free_symbols)
    return found


def _as_c(system: System, matrix: NamedMatrix) -> str:
    from dataclasses import replace

    export = Export(matrix.name, matrix.description, (matrix.name,))
    program = lower_system(replace(system, exports=(export,), saddle_point=None))
    kernel = program.kernels[0]
    printer = Printer({})
    lines = [f"/* {matrix.description} [{matrix.unit}]: {kernel.counts}"]
    for array, _ in kernel.inputs:
        lines.append(f" * {array}: {', '.join(x.name for x in system.group(array).quantities)}")
    lines.append(" */")
    lines += [f"const double {a.target} = {printer(a.value)};" for a in kernel.assignments]
    lines += [f"{s.array}[{s.index}] = {printer(s.value)};" for s in kernel.stores]
    return "\n".join(lines)


def _as_numbers(system: System, matrix: NamedMatrix, model: Model | None) -> str:
    if model is None:
        raise ModelError(f"{system.name} is a building block: it has no state to give numbers at")
    state = model.initial_state()
    found = model.accelerations(state)
    free = [found.points[p] for p in model.description.free]
    values: dict[str, list[float]] = {
        "t": [state.t],
        "q": state.q.tolist(),
        "u": state.u.tolist(),
        "p": list(model.parameters.values()),
        "work": [x for a in free for x in a.tolist()] + list(found.multipliers.values()),
    }
    known = {
        x.symbol: sp.Float(value, 17)
        for group in system.groups
        for x, value in zip(group.quantities, values[group.name], strict=True)
    }
    numbers = system.expanded(matrix.name).xreplace(known).evalf(12)
    head = f"{matrix.name} at the start [{matrix.unit}]"
    rows = matrix.rows or tuple(str(i) for i in range(numbers.rows))
    width = max(map(len, rows))
    lines = [
        f"{row:>{width}}  " + "  ".join(f"{float(x): .10e}" for x in numbers[i, :])
        for i, row in enumerate(rows)
    ]
    return "\n".join([head, *([f"columns: {', '.join(matrix.columns)}"] if matrix.columns else []), *lines])
