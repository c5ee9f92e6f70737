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
    _check(form)
    matrix = system[name]
    if form == "c":
        return _as_c(system, matrix)
    if form == "numeric":
        return _as_numbers(system, matrix, model)
    return _as_text(system, [matrix], form)


def show_rows(system: System, form: str, model: Model | None = None) -> str:
    """Return the momentum rows in one form: each by itself, and as numbers the square system they make."""
    _check(form)
    whole = ("matrix", "rhs")
    rows = [m for m in system.matrices if m.name not in whole]
    if form in ("c", "numeric"):
        names = whole if form == "numeric" else tuple(m.name for m in rows)
        return "\n\n".join(show(system, name, form, model) for name in names)
    return _as_text(system, rows, form)


def _check(form: str) -> None:
    if form not in FORMATS:
        raise ModelError(f"there is no format {form!r}. {nearest(form, FORMATS)}")


def _as_text(system: System, matrices: list[NamedMatrix], form: str) -> str:
    """Return matrices for reading, then the shared subexpressions that any of them uses."""
    definitions = [(d.quantity.symbol, d.expression) for d in system.definitions]
    used = _used(matrices, dict(definitions))
    shared = [(s, e) for s, e in definitions if s in used]
    if form == "latex":
        lines = [f"% {m.description} [{m.unit}]\n{sp.latex(m.matrix)}" for m in matrices]
        return "\n".join([*lines, *(rf"{sp.latex(s)} &= {sp.latex(e)} \\" for s, e in shared)])
    lines = []
    for m in matrices:
        written = sp.pretty(m.matrix, use_unicode=True, wrap_line=False)
        lines += [f"{m.name}: {m.description} [{m.unit}]", "", written, *_labels(m), ""]
    lines += ["with", *(f"  {s} = {e}" for s, e in shared), ""] if shared else []
    return "\n".join([*lines, *_legend(system, matrices, used)]).rstrip()


def _labels(matrix: NamedMatrix) -> list[str]:
    """Return what rows and columns are called, where they are more than one."""
    return [
        f"{what}: {', '.join(names)}"
        for what, names in (("rows", matrix.rows), ("columns", matrix.columns))
        if len(names) > 1
    ]


def _legend(system: System, matrices: list[NamedMatrix], used: set[sp.Symbol]) -> list[str]:
    """Return the symbols that stand there and are not defined, with unit and meaning."""
    there = set[sp.Basic]().union(*(m.matrix.free_symbols for m in matrices))
    there = there.union(*(d.expression.free_symbols for d in system.definitions if d.quantity.symbol in used))
    known = [x for group in system.groups for x in group.quantities if x.symbol in there]
    width = max((len(x.name) for x in known), default=0)
    return ["where", *(f"  {x.name:<{width}}  {x.description} [{x.unit}]" for x in known)] if known else []


def _used(matrices: list[NamedMatrix], definitions: dict[sp.Symbol, sp.Expr]) -> set[sp.Symbol]:
    found: set[sp.Symbol] = set()
    waiting = [s for m in matrices for s in m.matrix.free_symbols]
    while waiting:
        symbol = waiting.pop()
        if symbol in definitions and symbol not in found:
            found.add(symbol)
            waiting.extend(definitions[symbol].free_symbols)
    return found


def _as_c(system: System, matrix: NamedMatrix) -> str:
    from dataclasses import replace

    if any(d.expression.has(sp.Piecewise) for d in system.definitions):
        raise ModelError(
            f"{matrix.name}: its directions are chosen by cases, which straight-line C does not have\n"
            "  Use --format unicode, latex or numeric."
        )
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
        if group.name in values
        for x, value in zip(group.quantities, values[group.name], strict=True)
    }
    for definition in system.definitions:
        known[definition.quantity.symbol] = definition.expression.xreplace(known).evalf(17)
    numbers = matrix.matrix.xreplace(known).evalf(12)
    if numbers.free_symbols:
        raise ModelError(
            f"{matrix.name} holds unknowns; 'momentum_rows' as numbers is the system that gives them"
        )
    head = f"{matrix.name} at the start [{matrix.unit}]"
    rows = matrix.rows or tuple(str(i) for i in range(numbers.rows))
    width = max(map(len, rows))
    lines = [
        f"{row:>{width}}  " + "  ".join(f"{float(x): .10e}" for x in numbers[i, :])
        for i, row in enumerate(rows)
    ]
    return "\n".join([head, *([f"columns: {', '.join(matrix.columns)}"] if matrix.columns else []), *lines])
