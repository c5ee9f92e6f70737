"""Derived matrices as text: for the terminal, in LaTeX, after the lowering, in C, as numbers at a state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from symgen.errors import ModelError, nearest
from symgen.report.lowered import in_c, in_shared_terms
from symgen.report.numbers import in_numbers
from symgen.symbolic.notation import latex, latex_name
from symgen.symbolic.system import NamedMatrix, System

FORMATS = ("unicode", "latex", "shared", "c", "numeric")
#: Rows and columns of a matrix that LaTeX writes whole, and letters of it; else entry by entry.
_WHOLE, _LETTERS = 12, 4000


def overview(system: System) -> list[tuple[str, str, str, str]]:
    """Return name, shape, unit and meaning of every matrix."""
    return [(m.name, f"{m.matrix.rows} x {m.matrix.cols}", m.unit, m.description) for m in system.matrices]


def show(
    system: System,
    matrices: Sequence[NamedMatrix],
    form: str,
    values: Mapping[str, float] | None = None,
    label: str = "",
) -> str:
    """Return matrices of a system in one form, with the shared terms that they use.

    Parameters
    ----------
    system
        What they belong to.
    matrices
        What to show.
    form
        One of ``FORMATS``.
    values, label
        For numbers: values of arguments by name [SI], and what the state is called.

    Raises
    ------
    ModelError
        When there is no such form, or numbers are asked for where values are missing.
    """
    check_form(form)
    if form == "unicode":
        return _as_text(system, matrices)
    if form == "latex":
        return as_latex(system, matrices)
    if form == "shared":
        return in_shared_terms(system, matrices)
    if form == "c":
        return "\n\n".join(in_c(system, m) for m in matrices)
    return "\n\n".join(in_numbers(system, m, values or {}, label) for m in matrices)


def check_form(form: str) -> None:
    """Raise ModelError where there is no such form."""
    if form not in FORMATS:
        raise ModelError(f"there is no format {form!r}. {nearest(form, FORMATS)}")


def _as_text(system: System, matrices: Sequence[NamedMatrix]) -> str:
    """Return matrices for reading, then the shared terms that any of them uses, then what symbols mean."""
    shared = used_terms(system, matrices)
    lines = []
    for m in matrices:
        written = sp.pretty(m.matrix, use_unicode=True, wrap_line=False)
        lines += [f"{m.name}: {m.description} [{m.unit}]", "", written, *_labels(m), ""]
    lines += ["with", *(f"  {s} = {e}" for s, e in shared.items()), ""] if shared else []
    return "\n".join([*lines, *_legend(system, matrices, shared)]).rstrip()


def as_latex(system: System, matrices: Sequence[NamedMatrix]) -> str:
    """Return matrices and the shared terms they use as LaTeX, which needs the package amsmath."""
    lines = []
    for m in matrices:
        lines += [f"% {m.name}: {m.description} [{m.unit}]", *displayed(m)]
    return "\n".join([*lines, *terms_in_latex(system, matrices)])


def terms_in_latex(system: System, matrices: Sequence[NamedMatrix]) -> list[str]:
    """Return the shared terms that matrices use as lines of LaTeX."""
    shared = used_terms(system, matrices)
    return ["% with", *aligned([(latex(s), latex(e)) for s, e in shared.items()])] if shared else []


def displayed(m: NamedMatrix) -> list[str]:
    """Return a matrix on display; of a large one its entries that are not zero."""
    if max(m.matrix.shape) <= _WHOLE and len(str(m.matrix)) <= _LETTERS:
        alone = m.matrix[0, 0] if m.matrix.shape == (1, 1) else m.matrix
        return [r"\[", latex(alone), r"\]"]
    entries = []
    for i in range(m.matrix.rows):
        for j in range(m.matrix.cols):
            if m.matrix[i, j] != 0:
                places = [latex_name(m.rows[i]) if m.rows else str(i + 1)]
                if m.matrix.cols > 1:
                    places.append(latex_name(m.columns[j]) if m.columns else str(j + 1))
                entries.append((rf"\left({', '.join(places)}\right)", latex(m.matrix[i, j])))
    return aligned(entries)


def aligned(pairs: Sequence[tuple[str, str]]) -> list[str]:
    """Return pairs of a left and a right side as lines of one display."""
    if not pairs:
        return []
    rows = [f"{left} &= {right}" for left, right in pairs]
    return [r"\begin{align*}", " \\\\\n".join(rows), r"\end{align*}"]


def _labels(matrix: NamedMatrix) -> list[str]:
    """Return what rows and columns are called, where they are more than one."""
    return [
        f"{what}: {', '.join(names)}"
        for what, names in (("rows", matrix.rows), ("columns", matrix.columns))
        if len(names) > 1
    ]


def _legend(system: System, matrices: Sequence[NamedMatrix], used: Mapping[sp.Symbol, sp.Expr]) -> list[str]:
    """Return the symbols that stand there and are not defined, with unit and meaning."""
    there = set[sp.Basic]().union(*(m.matrix.free_symbols for m in matrices))
    there = there.union(*(e.free_symbols for e in used.values()))
    known = [x for group in system.groups for x in group.quantities if x.symbol in there]
    width = max((len(x.name) for x in known), default=0)
    return ["where", *(f"  {x.name:<{width}}  {x.description} [{x.unit}]" for x in known)] if known else []


def used_terms(system: System, matrices: Sequence[NamedMatrix]) -> dict[sp.Symbol, sp.Expr]:
    """Return the shared terms that matrices use, directly or through others, in their order."""
    definitions = {d.quantity.symbol: d.expression for d in system.definitions}
    found: set[sp.Symbol] = set()
    waiting = [s for m in matrices for s in m.matrix.free_symbols]
    while waiting:
        symbol = waiting.pop()
        if symbol in definitions and symbol not in found:
            found.add(symbol)
            waiting.extend(definitions[symbol].free_symbols)
    return {s: e for s, e in definitions.items() if s in found}
