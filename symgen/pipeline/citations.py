"""Equations of the sources by number: the matrices, or their rows, that state that they correspond to one.

A source such as ``Rahman (62), corrected: -f1; fx (62a), (69i)-(69k); fy (62c)`` cites equations of the
whole matrix, and behind semicolons those of rows: names, also of their first words, ranges ``p12-p23`` and
patterns ``guide_*``, separated by commas; or of an entry ``w:theta1``. Words may stand before the equation,
as in ``A.4, A.8-A.12 add up to (A.1)``. A row called by a number, as ``A.8 E``, is that of this equation.
Where rows have numbers, ``corrected`` stands next to those that have an erratum.
"""

from __future__ import annotations

import json
import re
import shlex
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from symgen.symbolic.system import NamedMatrix

#: Models that between them print the equations of each paper, with their settings as --set takes them.
_ATTIA = "rod", "rod_spatial", "triple_pendulum", "vertical_rods", "elastic_slider_crank"
_THESIS = "element_beam8", "rigid_element", "four_bar_motion", "synthesis_limits", "thesis_four_bar"
_INEXTENSIBLE = tuple(f"links.{link}.elastic.axial=false" for link in ("crank", "coupler", "output"))
#: A piston with two guided points.
_PISTON = (
    'points.S={at=["2*r+l","0 mm"]}',
    'links.piston={points=["P","S"],mass="0.3 kg"}',
    'guides=[{points=["P","S"],along="rail"}]',
)
PAPERS: dict[str, tuple[tuple[str, tuple[str, ...]], ...]] = {
    "Attia": (*((name, ()) for name in _ATTIA), ("elastic_slider_crank", _PISTON)),
    "Rahman": (("slider_crank", ()),),
    "thesis": (*((name, ()) for name in _THESIS), ("thesis_four_bar", _INEXTENSIBLE)),
}
#: What other commands print, which read a scene.
COMMANDS: dict[str, tuple[tuple[str, str], ...]] = {
    "thesis": (
        ("symgen quasi-static thesis_four_bar --at 60", "thesis (8.9), (8.10)"),
        ("symgen modes elastic_four_bar_free --at 0, as many modes as (8.2) counts", "thesis (8.2)"),
        ("symgen synthesise TASK, a file as in docs/papers.md", "thesis (3.1), (3.2), not as printed"),
    )
}
#: Equations that symgen does not derive, with the reason.
NOT_DERIVED = {
    "thesis (2.1)-(2.17)": "equations of other authors, in a review of the literature",
    "thesis (7.1)-(7.6)": "Hamilton's principle itself, which holds for any system",
}
_NO_SUCH = "The papers have no equation of this number."
#: The last equation of each paper, of its chapters and appendices.
LAST: dict[str, dict[str, int]] = {
    "Attia": {"": 16},
    "Rahman": {"": 69},
    "thesis": {"2": 17, "3": 17, "4": 51, "5": 23, "6": 33, "7": 28, "8": 10}
    | {"A": 19, "B": 19, "C": 21, "D": 28, "E": 47, "F": 8},
}
#: The generated file of what these models cite, by paper and command: sources, with the rows that they name.
STORED = Path(__file__).with_name("citations.json")

_NUMBER = r"\(((?:[A-Z]|\d+)\.)?(\d+)([a-z]?)\)"
_ASKED = re.compile(rf"(?:(\w+) )?{_NUMBER}")
_WRITTEN = re.compile(r"(\w+ )?(\()?((?:[A-Za-z]|\d+)\.)?(\d+[a-z]?)(?(2)\))")
_COLUMN = re.compile(r":(.+?) \(")
_CITED = re.compile(rf"{_NUMBER}(?:-{_NUMBER})?")
#: How precisely an equation is cited: by a range of lettered ones, of groups, by one of its letters, by a
#: range of letters, by its own number. One with a letter is cited by its letter alone.
_NEAR, _RANGE, _GROUP, _LETTERS, _ITSELF = range(1, 6)


def settings(options: Iterable[str]) -> dict[str, Any]:
    """Return settings by key."""
    pairs = (option.split("=", 1) for option in options)
    return {key: tomllib.loads(f"value = {value}")["value"] for key, value in pairs}


def command_of(model: str, options: Iterable[str]) -> str:
    """Return the command that shows an equation, with {} in the place of its number."""
    return f'symgen show {model} "{{}}"' + "".join(f" --set {shlex.quote(x)}" for x in options)


def as_equation(name: str) -> str:
    """Return a number such as ``(47)``, ``f.1``, ``Attia 5b`` as sources write it; empty for other names."""
    if written := _WRITTEN.fullmatch(name):
        author, _, chapter, number = written.groups(default="")
        return f"{author}({chapter.upper()}{number})"
    return ""


def citation(m: NamedMatrix) -> tuple[str, ...]:
    """Return the source of a matrix and, where these matter, its rows; empty where it cites no equation."""
    numbered = any(as_equation(row.partition(" ")[0]) for row in m.rows)
    if not numbered and not _CITED.search(m.source):
        return ()
    return m.source, *(m.rows if numbered or ";" in m.source else ())


def citing(name: str, matrices: Iterable[NamedMatrix]) -> tuple[int, tuple[NamedMatrix, ...]]:
    """Return how precisely an equation is cited, zero if not at all, and the matrices or rows that do so."""
    asked = _ASKED.fullmatch(name)
    if asked is None:
        return 0, ()
    author, *number = asked.groups(default="")
    ranked = [
        (_cited(number, m.source, m.rows), m) for m in matrices if author.casefold() in m.source.casefold()
    ]
    best = max((cited.rank for cited, _ in ranked), default=0)
    return best, tuple(_part(m, cited) for cited, m in ranked if cited.rank == best > 0)


@dataclass(frozen=True, slots=True)
class _Cited:
    """How precisely a source cites an equation, and for which rows and columns; none stands for all."""

    rank: int
    source: str
    rows: Sequence[str] = ()
    columns: Sequence[str] = ()


def _cited(number: Sequence[str], source: str, rows: Sequence[str]) -> _Cited:
    """Return how the source of a matrix with these rows cites an equation."""
    own = "".join(number)
    whole, *others = (text.strip() for text in source.split(";"))
    if named := [row for row in rows if row.partition(" ")[0] == own]:
        of_rows = [x for x in others if (at := _place(x, rows)) is None or {*at[0]} & {*named}]
        return _Cited(_ITSELF, "; ".join([whole, *of_rows]), named)
    best, found, columns = (of_whole := _precision(number, whole)), list[str](), list[str]()
    general, cited, remarks = [whole], list[str](), list[str]()
    for text in others:
        at = _place(text, rows)
        if at is None:
            precision = _precision(number, text)
            of_whole = max(of_whole, precision)
            best = max(best, precision)
            if precision or not _CITED.search(text):
                general.append(text)
        elif (precision := _precision(number, at[2])) in (_RANGE, _LETTERS, _ITSELF):
            found += at[0]
            columns += at[1]
            cited.append(text)
        elif not _CITED.search(at[2]):
            remarks.append(text)
        elif not number[-1]:  # a group, of which these are equations
            best = max(best, precision)
    if found:
        return _Cited(_ITSELF, "; ".join([*general, *cited]), found, columns)
    return _Cited(best, "; ".join([*general, *remarks]) if of_whole == best else source)


def elsewhere(equation: str) -> str:
    """Return the command that prints the equation, or those of its letters, of each paper, as stored.

    Where there is none, say whether a paper has such an equation.
    """
    asked = _ASKED.fullmatch(equation)
    author, *number = asked.groups(default="") if asked else ("",)
    found, chapter, own = list[tuple[int, str]](), number[0].rstrip("."), int(number[1])
    papers = [paper for paper in LAST if author.casefold() in paper.casefold()]
    if not any(0 < own <= LAST[paper].get(chapter, 0) for paper in papers):
        return _NO_SUCH
    for paper, commands in json.loads(STORED.read_text(encoding="utf-8")).items():
        if paper in papers:
            ranked = [
                (max(_cited(number, source, rows).rank for source, *rows in cited), command)
                for command, cited in commands.items()
            ]
            best, command = max(ranked, key=lambda of: of[0])
            shown = equation.removeprefix(author).strip()
            continued = command.replace("{}", shown).replace(" --set ", " \\\n      --set ")
            found.append((best, f"{paper}: {continued}"))
    best = max((rank for rank, _ in found), default=0)
    commands = "\n  ".join(command for rank, command in found if rank == best > 0 or rank >= _GROUP)
    reasons = (text for source, text in NOT_DERIVED.items() if _precision(number, source))
    none = next((f"symgen does not derive it: {text}." for text in reasons), _NO_SUCH)
    return commands or none


def _place(text: str, rows: Sequence[str]) -> tuple[list[str], list[str], str] | None:
    """Return the rows and columns named at the beginning of a citation, and its rest; None without rows."""
    at = {row.partition(" ")[0]: i for i, row in reversed([*enumerate(rows)])}
    at |= {row: i for i, row in enumerate(rows)}
    name = "|".join(re.escape(x) for x in sorted(at, key=len, reverse=True))
    place = re.compile(rf"(?:, )?(?:({name})(?:-({name}))?|(\w*\*\w*))(?=[,: ]|$)")
    found, end = list[int](), 0
    while named := place.match(text, end):
        end = named.end()
        first, last, pattern = named.groups()
        if pattern:
            found += [i for i, row in enumerate(rows) if fnmatchcase(row.partition(" ")[0], pattern)]
        else:
            found += range(at[first], at[last or first] + 1)
    if not end:
        return None
    column = _COLUMN.match(text, end)
    return [rows[i] for i in found], [column[1]] if column else [], text[end:]


def _part(m: NamedMatrix, cited: _Cited) -> NamedMatrix:
    """Return rows, in the order of the matrix, or an entry, with the place in the description; else all."""
    if not cited.rows:
        return replace(m, source=cited.source)
    rows = sorted({*cited.rows}, key=m.rows.index)
    place = _rows(rows)
    if cited.columns:
        place += f", column{'s' * (len(cited.columns) > 1)} {', '.join(cited.columns)}"
    part = m.part(rows, cited.columns)
    return replace(part, description=f"{place}: {m.description}", source=cited.source)


def narrowed(m: NamedMatrix, rows: Sequence[str], columns: Sequence[str]) -> NamedMatrix:
    """Return some rows and columns; a description that begins with the rows names those that remain."""
    part = m.part(rows, columns)
    if m.rows and (before := _rows(m.rows)) and m.description.startswith(before):
        return replace(part, description=_rows(part.rows) + m.description.removeprefix(before))
    return part


def _rows(names: Sequence[str]) -> str:
    return f"row{'s' * (len(names) > 1)} {', '.join(names)}"


def _precision(number: Sequence[str], source: str) -> int:
    """Return how precisely a source cites an equation."""
    chapter, own, letter = number
    best = 0
    for cited in _CITED.finditer(source):
        chapters, first, letters, _, last, last_letters = cited.groups(default="")
        if chapters != chapter or not int(first) <= int(own) <= int(last or first):
            continue
        if not last:
            best = max(best, _ITSELF if letters == letter else 0 if letter else _GROUP)
        elif letter and first == last and last_letters:
            best = max(best, _LETTERS if letters <= letter <= last_letters else 0)
        elif letter and letter == letters == last_letters:
            best = max(best, _LETTERS)
        else:
            best = max(best, 0 if letter else _NEAR if letters or last_letters else _RANGE)
    return best
