"""Equations of the sources by number: the matrices, or their rows, that state that they correspond to one.

A source such as ``Rahman (62), signs corrected; fx (62a), (69i)-(69k); fy (62c)`` cites equations of the
whole matrix, and behind semicolons those of rows: a name, a range ``p12-p23`` or a pattern ``guide_*``; or of
an entry ``w:theta1``. A row called by a number, as ``A.8 E``, is that of this equation.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from fnmatch import fnmatchcase

from symgen.symbolic.system import NamedMatrix

_NUMBER = r"\(((?:[A-Z]|\d+)\.)?(\d+)([a-z]?)\)"
_ASKED = re.compile(rf"(?:(\w+) )?{_NUMBER}")
_BARE = re.compile(r"(?:\w+ )?((?:(?:[A-Z]|\d+)\.)?\d+[a-z]?)")
_CITED = re.compile(rf"{_NUMBER}(?:-{_NUMBER})?")
#: How precisely an equation is cited: by a range of other groups, or of groups, by its group, by a range of
#: letters, by its own number.
_NEAR, _RANGE, _GROUP, _LETTERS, _ITSELF = range(1, 6)


def as_equation(name: str) -> str:
    """Return a number such as ``(47)``, ``F.1`` or ``Attia (5b)`` in brackets; empty for other names."""
    if bare := _BARE.fullmatch(name):
        return f"{name[: bare.start(1)]}({bare[1]})"
    return name if _ASKED.fullmatch(name) else ""


def citing(name: str, matrices: Iterable[NamedMatrix]) -> tuple[int, tuple[NamedMatrix, ...]]:
    """Return how precisely an equation is cited, zero if not at all, and the matrices or rows that do so."""
    asked = _ASKED.fullmatch(name)
    if asked is None:
        return 0, ()
    author, *number = asked.groups(default="")
    ranked = [
        found for m in matrices if author.casefold() in m.source.casefold() for found in _places(number, m)
    ]
    best = max((rank for rank, _ in ranked), default=0)
    return best, tuple(m for rank, m in ranked if rank == best > 0)


def _places(number: list[str], m: NamedMatrix) -> Iterator[tuple[int, NamedMatrix]]:
    """Yield how precisely a matrix, or rows of it, cite an equation."""
    own = "".join(number)
    if named := [row for row in m.rows if row.partition(" ")[0] == own]:
        yield _ITSELF, _part(m, named, (), m.source)
        return
    whole, *others = (text.strip() for text in m.source.split(";"))
    best, rows, entries = _precision(number, whole), list[str](), list[str]()
    general, cited = [whole], list[str]()
    for text in others:
        at = _place(text, m)
        if at is None:
            general.append(text)
            best = max(best, _precision(number, text))
        elif (precision := _precision(number, text)) in (_RANGE, _LETTERS, _ITSELF):
            rows += at[0]
            entries += at[1]
            cited.append(text)
        elif not number[-1]:  # a group, of which these are equations
            best = max(best, precision)
    if rows:
        yield _ITSELF, _part(m, rows, entries, "; ".join([*general, *cited]))
    elif best:
        yield best, m


def _place(text: str, m: NamedMatrix) -> tuple[list[str], list[str]] | None:
    """Return the rows and columns named before the first number of a citation; None where there are none."""
    named, _, column = text.partition("(")[0].strip().partition(":")
    names = [row.partition(" ")[0] for row in m.rows]
    first, _, last = named.partition("-")
    if first in names and (last or first) in names:
        at = [*range(names.index(first), names.index(last or first) + 1)]
    elif "*" in named:
        at = [i for i, name in enumerate(names) if fnmatchcase(name, named)]
    else:
        return None
    return [m.rows[i] for i in at], [column] if column else []


def _part(m: NamedMatrix, rows: Iterable[str], columns: Iterable[str], source: str) -> NamedMatrix:
    """Return rows, in the order of the matrix, or an entry, with the place in the description."""
    rows = sorted({*rows}, key=m.rows.index)
    place = f"row{'s' * (len(rows) > 1)} {', '.join(rows)}"
    columns = [*columns]
    if columns:
        place += f", column {', '.join(columns)}"
    return replace(m.part(rows, columns), description=f"{place}: {m.description}", source=source)


def _precision(number: list[str], source: str) -> int:
    """Return how precisely a source cites an equation."""
    chapter, own, letter = number
    best = 0
    for cited in _CITED.finditer(source):
        chapters, first, letters, _, last, last_letters = cited.groups(default="")
        if chapters != chapter or not int(first) <= int(own) <= int(last or first):
            continue
        if not last:
            best = max(best, _ITSELF if letters == letter else _GROUP)
        elif letter and first == last and last_letters:
            best = max(best, _LETTERS if letters <= letter <= last_letters else 0)
        elif letter and letter == letters == last_letters:
            best = max(best, _LETTERS)
        else:
            lettered = bool(letters or last_letters)
            best = max(best, _RANGE if lettered == bool(letter) else _NEAR)
    return best
