"""Equations of the sources by number: which matrices state that they correspond to one."""

from __future__ import annotations

import re
from collections.abc import Iterable

from symgen.symbolic.system import NamedMatrix

_NUMBER = r"\(((?:[A-Z]|\d+)\.)?(\d+)([a-z]?)\)"
_ASKED = re.compile(rf"(?:(\w+) )?{_NUMBER}")
_CITED = re.compile(rf"{_NUMBER}(?:-{_NUMBER})?")
#: How precisely an equation is cited: by a range of other groups, or of groups, by its group, by a range of
#: letters, by its own number.
_NEAR, _RANGE, _GROUP, _LETTERS, _ITSELF = range(1, 6)


def is_equation(name: str) -> bool:
    """Return whether a name is a number such as ``(47)``, ``(F.1)`` or ``Attia (5b)``."""
    return _ASKED.fullmatch(name) is not None


def citing(name: str, matrices: Iterable[NamedMatrix]) -> tuple[int, tuple[NamedMatrix, ...]]:
    """Return the matrices whose source cites an equation most precisely, and how precisely; zero for none."""
    asked = _ASKED.fullmatch(name)
    if asked is None:
        return 0, ()
    author, *number = asked.groups(default="")
    ranked = [(_precision(number, m.source), m) for m in matrices if author in m.source]
    best = max((rank for rank, _ in ranked), default=0)
    return best, tuple(m for rank, m in ranked if rank == best > 0)


def _precision(number: list[str], source: str) -> int:
    """Return how precisely a source cites an equation."""
    chapter, own, letter = number
    best = 0
    for cited in _CITED.finditer(source):
        chapters, first, letters, _, last, last_letters = cited.groups(default="")
        if chapters != chapter or not int(first) <= int(own) <= int(last or first):
            continue
        if last:
            lettered = bool(letters or last_letters)
            within = (_LETTERS if letter else _RANGE) if lettered == bool(letter) else _NEAR
            best = max(best, within)
        else:
            best = max(best, _ITSELF if letters == letter else _GROUP)
    return best
