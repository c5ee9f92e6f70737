"""The derivation of a model step by step, as text or as a LaTeX document."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

import sympy as sp

from symgen.report.equations import displayed, terms_in_latex, used_terms
from symgen.symbolic.system import NamedMatrix, System

#: Letters of a matrix beyond which its structure is shown in its place.
_LETTERS = 2500


class Step(Protocol):
    """What a step of a derivation has: see :class:`symgen.models.record.Step`."""

    @property
    def title(self) -> str:
        """What is done."""

    @property
    def about(self) -> str:
        """The same in a sentence or two."""

    @property
    def source(self) -> str:
        """Where the source has it."""

    @property
    def system(self) -> System:
        """What the matrices belong to."""

    @property
    def matrices(self) -> tuple[NamedMatrix, ...]:
        """What it gives."""


def record_in_text(steps: Sequence[Step]) -> str:
    """Return the steps for the terminal; of matrices that are too large the structure."""
    return "\n".join(line for k, step in enumerate(steps, 1) for line in _in_text(k, step)).rstrip()


def _in_text(number: int, step: Step) -> Iterator[str]:
    head = f"{number}. {step.title}  ({step.source})"
    yield from (head, "-" * len(head), step.about, "")
    for m in step.matrices:
        yield f"{m.name}: {m.description} [{m.unit}]"
        large = len(str(m.matrix)) > _LETTERS
        yield from _structure(m) if large else [sp.pretty(m.matrix, use_unicode=True, wrap_line=False)]
        yield ""
    short = [m for m in step.matrices if len(str(m.matrix)) <= _LETTERS]
    shared = used_terms(step.system, short)
    if shared:
        yield from ("with", *(f"  {s} = {e}" for s, e in shared.items()), "")


def _structure(m: NamedMatrix) -> list[str]:
    """Return a dot a zero and a star an entry, or for a column how many there are."""
    filled = sum(1 for e in m.matrix if e != 0)
    told = f"  {m.matrix.rows} x {m.matrix.cols}, {filled} entries that are not zero"
    if m.matrix.cols == 1:
        return [told]
    rows = ("  " + " ".join("*" if e != 0 else "." for e in m.matrix.row(i)) for i in range(m.matrix.rows))
    return [told, *rows]


def record_in_latex(title: str, steps: Sequence[Step]) -> str:
    """Return the steps as a document that LaTeX compiles."""
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
        lines += [
            rf"\section{{{_plain(step.title)}}}",
            rf"{_plain(step.about)} \emph{{{_plain(step.source)}}}.",
        ]
        for m in step.matrices:
            words = rf"\paragraph{{{_plain(m.name)}}} {_plain(m.description)} [{_plain(m.unit)}]"
            large = len(str(m.matrix)) > _LETTERS
            lines += [words, *([rf"({_plain(_structure(m)[0].strip())})."] if large else displayed(m))]
        short = [m for m in step.matrices if len(str(m.matrix)) <= _LETTERS]
        lines += terms_in_latex(step.system, short)
    return "\n".join([*lines, r"\end{document}"])


#: What LaTeX does not know among the signs of the records, by code point.
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
    """Return words as LaTeX sets them; what it has no sign for becomes a question mark."""
    known = {chr(int(code, 16)) for code, _ in _SIGNS}
    kept = (c if ord(c) < 256 or c in known else "?" for c in text)
    return "".join(_ESCAPED.get(c, c) for c in kept)
