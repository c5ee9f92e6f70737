"""Derived matrices in several formats: text, LaTeX, shared terms, C, and numeric values at a state."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import sympy as sp

from symgen.errors import ModelError, check_known
from symgen.report.mathematics.dimensions import in_own_units
from symgen.report.mathematics.layout import WIDTH, columns, defined, heading, in_lines, wrapped
from symgen.report.mathematics.lowered import in_c, in_shared_terms
from symgen.report.mathematics.numbers import in_numbers, value_of
from symgen.symbolic.notation import latex, latex_name, text_name
from symgen.symbolic.quantity import Quantity, symbols_of
from symgen.symbolic.system import Definition, NamedMatrix, System

FORMATS = ("unicode", "latex", "shared", "c", "numeric")
#: The beginning of a matrix, and the end of a row, in LaTeX.
_BEGIN = r"\begin{matrix}"
_ROW_END = re.compile(r"\\\\(?!\n)")
#: Name and meaning of a component of a vector, both with the name of what the vector belongs to.
_COMPONENT = re.compile(r"((?:[A-Za-z]+_)+?)(\w+?)((?:_[a-z]+)?)_([xyz]): \4 component of (.*\b)\2(\b.*)")
#: Most rows and columns of a matrix that LaTeX shows as a whole.
_WHOLE = 12
#: Most characters of such a matrix.
_LETTERS = 4000


def overview(matrices: Iterable[NamedMatrix]) -> list[tuple[str, str, str, str, str]]:
    """Return name, shape, unit, description and source of every matrix."""
    return [
        (
            m.name,
            "" if m.in_letters else f"{m.matrix.rows} x {m.matrix.cols}",
            m.unit,
            m.description,
            m.source,
        )
        for m in matrices
    ]


def show(
    system: System,
    matrices: Sequence[NamedMatrix],
    form: str,
    values: Mapping[str, float | sp.Expr] | None = None,
    label: str = "",
    width: int = WIDTH,
) -> str:
    """Return matrices of a system in one format, with the shared terms that they use.

    Parameters
    ----------
    system
        The system of the matrices.
    matrices
        Matrices to show.
    form
        One of ``FORMATS``.
    values, label
        For the numeric format: values of arguments by name [SI], and the label of the state.
    width
        Maximum width of lines.

    Raises
    ------
    ModelError
        If the format does not exist, or values are missing for the numeric format.
    """
    check_form(form)
    matrices = [in_own_units(m, system.quantities()) for m in matrices]
    if form == "unicode":
        return _as_text(system, matrices, width)
    if form == "latex":
        return as_latex(system, matrices, width)
    if form == "shared":
        legend = _legend(system, matrices, used_terms(system, matrices), width)
        return "\n".join([in_shared_terms(system, matrices, width), *(["", *legend] if legend else [])])
    if form == "c":
        return "\n\n".join(in_c(system, m, width) for m in matrices)
    return "\n\n".join(in_numbers(system, m, values or {}, label, width) for m in matrices)


def check_form(form: str) -> None:
    """Raise ModelError if the format does not exist."""
    check_known(form, FORMATS, "there is no format")


def check_letters(matrices: Iterable[NamedMatrix], form: str) -> None:
    """Raise ModelError for equations between vectors and matrices in a format of entries."""
    for m in matrices:
        if m.in_letters and form not in ("unicode", "latex"):
            raise ModelError(
                f"{m.name} is an equation between vectors and matrices: name one of these for {form}"
            )


def _as_text(system: System, matrices: Sequence[NamedMatrix], width: int) -> str:
    """Return matrices as text, followed by the shared terms they use and a legend of symbols."""
    matrices, shared = as_written(system, matrices)
    lines = []
    for m in matrices:
        lines += [*heading(m, width), "", *in_lines(m, width), ""]
    if shared:
        lines += ["with", *(line for s, e in shared.items() for line in defined(s, e, width)), ""]
    return "\n".join([*lines, *_legend(system, matrices, shared, width)]).rstrip()


def as_latex(system: System, matrices: Sequence[NamedMatrix], width: int = WIDTH) -> str:
    """Return matrices and the shared terms they use as LaTeX, which requires the package amsmath."""
    matrices, shared = as_written(system, matrices)
    lines: list[str] = []
    for m in matrices:
        lines += [*(f"% {line.strip()}" for line in heading(m, width - 2)), *displayed(m)]
    lines += terms_in_latex(shared)
    return "\n".join(latex_lines(lines, width))


def latex_lines(lines: Iterable[str], width: int) -> Iterator[str]:
    """Yield lines of LaTeX within a width, each row of a matrix on lines of its own."""
    for line in lines:
        for row in _ROW_END.sub(r"\\\\\n", line.replace(_BEGIN, f"{_BEGIN}\n")).splitlines():
            parts = wrapped(row, width, "  ", inside=False)
            if any(columns(part) > width for part in parts):  # blanks between arguments are ignored
                parts = wrapped(row.replace("}{", "} {"), width, "  ", inside=False)
            yield from parts


def terms_in_latex(shared: Mapping[sp.Symbol, sp.Expr]) -> list[str]:
    """Return shared terms as lines of LaTeX."""
    return ["% with", *aligned([(latex(s), latex(e)) for s, e in shared.items()])] if shared else []


def displayed(m: NamedMatrix) -> list[str]:
    """Return a matrix as displayed equations; for a large matrix its nonzero entries only."""
    if max(m.matrix.shape) <= _WHOLE and len(str(m.matrix)) <= _LETTERS:
        return [r"\[", latex(m.equation), r"\]"]
    entries = []
    for i in range(m.matrix.rows):
        for j in range(m.matrix.cols):
            if m.matrix[i, j] != 0:
                places = [latex_name(m.rows[i]) if m.rows else str(i + 1)]
                if m.matrix.cols > 1:
                    places.append(latex_name(m.columns[j]) if m.columns else str(j + 1))
                label = latex(m.lefts[i]) if m.lefts else rf"\left({', '.join(places)}\right)"
                entries.append((label, latex(m.matrix[i, j])))
    return aligned(entries)


def aligned(pairs: Sequence[tuple[str, str]]) -> list[str]:
    """Return pairs of left and right sides as lines of one aligned display."""
    if not pairs:
        return []
    rows = [f"{left} &= {right}" for left, right in pairs]
    return [r"\begin{align*}", " \\\\\n".join(rows), r"\end{align*}"]


def _legend(
    system: System, matrices: Sequence[NamedMatrix], used: Mapping[sp.Symbol, sp.Expr], width: int
) -> list[str]:
    """Return the undefined symbols that occur, with name, unit and description."""
    there = _there(matrices, used)
    known = [(x, "") for x in system.arguments() if x.symbol in there]
    known += [(c.quantity, f" = {value_of(c)}") for c in system.constants if c.quantity.symbol in there]
    rows = _letters_of_rows(system, matrices)
    stated = (d.quantity for d in system.definitions if d.quantity.symbol in there - used.keys())
    known += [(x, f", {rows[x.symbol]}" if x.symbol in rows else "") for x in stated]
    if not known:
        return []
    written = [text_name(x.name) for x, _ in known]
    meanings = {f" of {x.name}": f", {x.description}" for x in system.arguments() if x.symbol not in there}
    first, second = max(map(columns, written)), max(len(x.name) for x, _ in known)
    renamed = any(w != x.name for w, (x, _) in zip(written, known, strict=True))
    lines = ["where"]
    for w, (x, value) in zip(written, known, strict=True):
        name = f"  {w}{' ' * (first - columns(w))}"
        name += f"  {x.name:<{second}}" if renamed else ""
        indent = " " * (columns(name) + 2)
        if len(indent) > width // 2:
            indent = "      "
        about = x.description + meanings.get(x.description[x.description.find(" of ") :], "")
        parts = wrapped(f"{about} [{x.unit}]{value}", width - columns(name) - 2, "")
        lines += [f"{name}  {parts[0]}", *(f"{indent}{part}" for part in parts[1:])]
    terms = (d.quantity for d in system.definitions if d.quantity.symbol in used)
    for pattern, about in dict.fromkeys(_families(terms)):
        lines += wrapped(f"  {pattern}  {about}", width, " " * (len(pattern) + 4))
    return lines


def _families(terms: Iterable[Quantity]) -> Iterator[tuple[str, str]]:
    """Yield names and meanings of components of vectors that are called by what they belong to, as ``*``."""
    for x in terms:
        if found := _COMPONENT.fullmatch(f"{x.name}: {x.description}"):
            letter, _, more, _, before, behind = found.groups()
            yield f"{letter}*{more}", f"{before}*{behind} [{x.unit}]"


def _there(matrices: Iterable[NamedMatrix], used: Mapping[sp.Symbol, sp.Expr]) -> set[sp.Basic]:
    """Return the symbols of matrices and of the terms that they use."""
    there = symbols_of(e for m in matrices for e in (m.matrix, m.left) if e is not None)
    return there.union(*(e.free_symbols for e in used.values()))


def used_constants(system: System, matrices: Sequence[NamedMatrix]) -> list[Definition]:
    """Return the constants of the scene that occur in matrices, directly or in a shared term."""
    there = _there(matrices, used_terms(system, matrices))
    return [c for c in system.constants if c.quantity.symbol in there]


def as_written(
    system: System, matrices: Sequence[NamedMatrix]
) -> tuple[list[NamedMatrix], dict[sp.Symbol, sp.Expr]]:
    """Return matrices as a reader writes them, and the shared terms that they use.

    The sine or cosine of a symbol stands in place of its name.
    """
    shared = used_terms(system, matrices)
    own = {s: e for s, e in shared.items() if isinstance(e, (sp.sin, sp.cos)) and e.args[0].is_Symbol}
    shown = [replace(m, matrix=m.matrix.xreplace(own)) for m in matrices] if own else [*matrices]
    return shown, {s: e.xreplace(own) for s, e in shared.items() if s not in own}


def used_terms(system: System, matrices: Sequence[NamedMatrix]) -> dict[sp.Symbol, sp.Expr]:
    """Return the shared terms used by matrices, directly or indirectly, in order.

    Letters that are rows of other matrices (:func:`_letters_of_rows`) stay letters.
    """
    definitions = {d.quantity.symbol: d.expression for d in system.definitions}
    own = _letters_of_rows(system, matrices).keys()
    terms: set[sp.Symbol] = set()
    waiting = [s for m in matrices for s in m.matrix.free_symbols]
    while waiting:
        symbol = waiting.pop()
        if symbol in definitions and symbol not in terms and symbol not in own:
            terms.add(symbol)
            waiting.extend(definitions[symbol].free_symbols)
    return {s: e for s, e in definitions.items() if s in terms}


def _letters_of_rows(system: System, matrices: Sequence[NamedMatrix]) -> dict[sp.Basic, str]:
    """Return the letters whose definitions are rows of other matrices, with equation or matrix of each."""
    definitions = {d.quantity.name: d for d in system.definitions}
    shown = {m.name for m in matrices}
    return {
        definitions[row].quantity.symbol: number[1] if (number := _number_of(row, m)) else f"see {m.name}"
        for m in system.matrices
        if m.matrix.cols == 1 and m.name not in shown
        for row, e in zip(m.rows, m.matrix, strict=False)
        if row in definitions and definitions[row].expression == e
    }


def _number_of(row: str, m: NamedMatrix) -> re.Match[str] | None:
    """Return the match of the equation of a row in the source of its matrix, as (4.28) in theta3 (4.28)."""
    return re.search(rf"; {re.escape(row)} (\([^;)]*\))", m.source)
