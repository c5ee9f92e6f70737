"""Points of a table from a file of columns."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from symgen.errors import SceneError, nearest

_LARGEST = 4_000_000
#: A title of a column with its unit, as "angle [deg]".
_TITLE = re.compile(r".*\[(?P<unit>[^\]]*)\]\s*")


def with_points(table: Any, folder: Path) -> Any:
    """Return a table with lists as ``x`` and ``y``: of a ``file`` in a folder, the columns of these titles.

    Raises
    ------
    SceneError
        For a file that cannot be read, an unknown title, and a row without a number.
    """
    if not isinstance(table, Mapping) or "file" not in table:
        return table
    rest: dict[str, Any] = {key: value for key, value in table.items() if key != "file"}
    rows = _rows(table["file"], folder)
    titles = [title.strip() for title in rows[0][1]]
    for key in ("x", "y"):
        title = table.get(key)
        if title not in titles:
            raise SceneError(
                f"expected the title of a column of {table['file']!r}, got {title!r}",
                where=key,
                hint=nearest(title, titles) if isinstance(title, str) else f"Titles: {', '.join(titles)}.",
            )
        if titles.count(title) > 1:
            raise SceneError(f"expected different titles of columns, got {title!r} twice", where=key)
        rest[key] = [_cell(row, titles.index(title), title, key, line) for line, row in rows[1:]]
    return rest


def _rows(name: Any, folder: Path) -> list[tuple[int, list[str]]]:
    """Return the rows of a file that are not empty, each with the number of its line."""
    if not isinstance(name, str):
        raise SceneError(f"expected the name of a file, got {name!r}", where="file")
    try:
        text = (folder / name).read_text(encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        raise SceneError(f"cannot read the points: {error}", where="file") from None
    if len(text) > _LARGEST:
        raise SceneError(f"expected a file of at most {_LARGEST} characters", where="file")
    separator = next((c for c in ";\t" if c in text.partition("\n")[0]), ",")
    read = csv.reader(text.splitlines(), delimiter=separator)
    rows = [(read.line_num, row) for row in read if any(c.strip() for c in row)]
    if len(rows) < 3:
        raise SceneError(f"expected a row of titles and at least two of points in {name!r}", where="file")
    return rows


def _cell(row: list[str], column: int, title: str, key: str, line: int) -> str | float:
    text = row[column].strip() if column < len(row) else ""
    try:
        number = float(text)
    except ValueError:
        raise SceneError(f"expected a number in line {line} of {title!r}, got {text!r}", where=key) from None
    unit = _TITLE.fullmatch(title)
    return f"{text} {unit['unit']}" if unit and unit["unit"].strip() not in ("", "1", "-") else number
