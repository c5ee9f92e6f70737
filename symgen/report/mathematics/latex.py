"""Changed matrix entries before and after, in LaTeX."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from symgen.report.mathematics.equations import aligned
from symgen.symbolic.difference import Change
from symgen.symbolic.notation import latex, latex_name, latex_text
from symgen.symbolic.reading import expression


def changes_in_latex(changes: Sequence[Change]) -> list[str]:
    """Return changes as one display, which requires the package amsmath."""
    return aligned([row for change in changes for row in _rows(change)])


def _rows(change: Change) -> Iterator[tuple[str, str]]:
    place = rf"\left({', '.join(map(latex_name, change.place.split(', ')))}\right)"
    if change.through_shared_terms:
        yield place, rf"{_mathematics(change.after)} \quad\text{{(through shared terms)}}"
        return
    for word, text in (("before", change.before), ("after", change.after)):
        if text:
            told = word if change.before and change.after else change.kind
            yield place, rf"{_mathematics(text)} \quad\text{{({told})}}"
            place = ""


def _mathematics(text: str) -> str:
    read = expression(text)
    return latex_text(text) if read is None else latex(read)
