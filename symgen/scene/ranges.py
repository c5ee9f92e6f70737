"""Repeated entries of a scene: ``"B{k=0 to 40}"`` stands for the entries B0, B1, ..., B40."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from symgen.errors import SceneError

_RANGE = re.compile(r"\{([a-z])=(\d{1,9}) to (\d{1,9})\}")
#: Largest number of entries of one name.
_MOST = 10_000


def written_out(tables: dict[str, Any], where: str = "") -> dict[str, Any]:
    """Return tables with one entry per number for every name that has a range of numbers.

    ``{k=0 to 40}`` in a name stands for the numbers 0 to 40. In the entry, ``{k}``, ``{k+1}`` and ``{k-1}``
    stand for the number, and for the number plus or minus any whole number.

    Raises
    ------
    SceneError
        For a range without numbers or with too many, a second one in a name, and a name that occurs twice.
    """
    entries: dict[str, Any] = {}
    for key, value in tables.items():
        place = f"{where}.{key}" if where else str(key)
        for name, entry in _entries(key, value, place):
            if name in entries:
                raise SceneError(f"{name!r} occurs twice, once in a range of numbers", where=place)
            entries[name] = written_out(entry, place) if isinstance(entry, dict) else entry
    return entries


def _entries(key: Any, value: Any, where: str) -> Iterator[tuple[Any, Any]]:
    match = _RANGE.search(key) if isinstance(key, str) else None
    if match is None:
        yield key, value
        return
    if "{" in key[: match.start()] + key[match.end() :]:
        raise SceneError(
            f"expected one range of numbers in a name and no other braces, got {key!r}",
            where=where,
            hint="The number replaces the range: B{k=0 to 2}_end is B0_end, B1_end, B2_end.",
        )
    letter, first, last = match[1], int(match[2]), int(match[3])
    if not first <= last < first + _MOST:
        raise SceneError(
            f"expected a range of 1 to {_MOST} numbers, got {match[0]!r}",
            where=where,
            hint="The first number comes first, and both are part of the range: {k=0 to 3} has four.",
        )
    counter = re.compile(rf"\{{{letter}([+-]\d{{1,9}})?\}}")
    for number in range(first, last + 1):
        name = key[: match.start()] + str(number) + key[match.end() :]
        yield name, _numbered(value, counter, number)


def _numbered(value: Any, counter: re.Pattern[str], number: int) -> Any:
    """Return a value with the number in place of its letter, in all texts of lists and tables."""
    if isinstance(value, str):
        return counter.sub(lambda match: str(number + int(match[1] or 0)), value)
    if isinstance(value, list):
        return [_numbered(item, counter, number) for item in value]
    if isinstance(value, dict):
        return {key: _numbered(item, counter, number) for key, item in value.items()}
    return value
