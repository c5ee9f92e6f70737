"""The step-by-step derivation of a model, as text or as a LaTeX document."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from symgen.report.mathematics.equations import as_written, displayed, latex_lines, terms_in_latex
from symgen.report.mathematics.layout import WIDTH, defined, heading, in_lines, wrapped
from symgen.symbolic.system import NamedMatrix, Step

#: Number of characters above which a matrix is replaced by its sparsity pattern.
_LETTERS = 2500


def record_in_text(steps: Sequence[Step], width: int = WIDTH) -> str:
    """Return the steps as text; large matrices are replaced by their sparsity patterns."""
    return "\n".join(line for k, step in enumerate(steps, 1) for line in _in_text(k, step, width)).rstrip()


def _in_text(number: int, step: Step, width: int) -> Iterator[str]:
    head = wrapped(f"{number}. {step.title}  ({step.source})", width)
    yield from (*head, "-" * max(map(len, head)), *wrapped(step.about, width, ""), "")
    short, shared = as_written(step.system, [m for m in step.matrices if len(str(m.matrix)) <= _LETTERS])
    whole = {m.name: m for m in short}
    for m in step.matrices:
        yield from heading(m, width)
        yield from in_lines(whole[m.name], width) if m.name in whole else _structure(m, width)
        yield ""
    if shared:
        yield from ("with", *(line for s, e in shared.items() for line in defined(s, e, width)), "")


def _structure(m: NamedMatrix, width: int = WIDTH) -> list[str]:
    """Return the pattern with a dot per zero and a star per entry; for a column the number of entries.

    There is no pattern of a matrix with more columns than the width.
    """
    filled = sum(1 for e in m.matrix if e != 0)
    line = f"  {m.matrix.rows} x {m.matrix.cols}, {filled} entries that are not zero"
    if m.matrix.cols == 1 or m.matrix.cols + 2 > width:
        return [line]
    gap = " " if 2 * m.matrix.cols + 1 <= width else ""
    rows = ("  " + gap.join("*" if e != 0 else "." for e in m.matrix.row(i)) for i in range(m.matrix.rows))
    return [line, *rows]


def record_in_latex(title: str, steps: Sequence[Step], width: int = WIDTH) -> str:
    """Return the steps as a complete LaTeX document."""
    lines = [
        r"\documentclass{article}",
        r"\usepackage[utf8]{inputenc}",
        r"\usepackage[T1]{fontenc}",
        r"\usepackage[a3paper,landscape,margin=15mm]{geometry}",
        r"\usepackage{amsmath}",
        r"\setcounter{MaxMatrixCols}{20}",
        r"\allowdisplaybreaks",
        *(rf"\DeclareUnicodeCharacter{{{code}}}{{{text}}}" for code, text in _SIGNS),
        rf"\title{{{_plain(title)}}}",
        r"\date{}",
        r"\begin{document}",
        r"\maketitle",
    ]
    for step in steps:
        short, shared = as_written(step.system, [m for m in step.matrices if len(str(m.matrix)) <= _LETTERS])
        whole = {m.name: m for m in short}
        lines += [
            rf"\section{{{_plain(step.title)}}}",
            rf"{_plain(step.about)} \emph{{{_plain(step.source)}}}.",
        ]
        for m in step.matrices:
            words = rf"\paragraph{{{_plain(m.name)}}} {_plain(m.description)} [{_plain(m.unit)}]"
            words += rf" \emph{{{_plain(m.source)}}}." if m.source else ""
            large = rf"({_plain(_structure(m)[0].strip())})."
            lines += [words, *(displayed(whole[m.name]) if m.name in whole else [large])]
        lines += terms_in_latex(shared)
    return "\n".join([*latex_lines(lines, width), r"\end{document}"])


#: Characters in the records that LaTeX does not support, by code point.
_SIGNS = (
    ("2202", r"\ensuremath{\partial}"),
    ("2212", r"\ensuremath{-}"),
    ("22EF", r"\ensuremath{\cdots}"),
    ("2081", r"\ensuremath{_1}"),
    ("2082", r"\ensuremath{_2}"),
    ("2099", r"\ensuremath{_n}"),
    ("03B5", r"\ensuremath{\varepsilon}"),
    ("03B8", r"\ensuremath{\theta}"),
    ("03B7", r"\ensuremath{\eta}"),
    ("03B1", r"\ensuremath{\alpha}"),
)
_ESCAPED = {c: rf"\{c}" for c in "#$%&_{}"} | {
    "\\": r"\textbackslash{}",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
}


def _plain(text: str) -> str:
    """Return text with special characters escaped for LaTeX; unsupported ones become question marks."""
    known = {chr(int(code, 16)) for code, _ in _SIGNS}
    characters = (c if ord(c) < 256 or c in known else "?" for c in text)
    return "".join(_ESCAPED.get(c, c) for c in characters)
