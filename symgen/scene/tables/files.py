"""Points of tables from files of columns."""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from symgen.errors import SceneError, nearest

_LARGEST = 4_000_000
#: A title of a column with its unit, as "angle [deg]".
_TITLE = re.compile(r".*\[(?P<unit>[^\]]*)\]\s*")


def with_points(tables: Any, folder: Path | None = None) -> Any:
    """Return tables by name with lists as ``x`` and ``y``: of a ``file``, the columns of these titles.

    Names of files are relative to a folder, by default the working directory.

    Raises
    ------
    SceneError
        For a file that cannot be read, an unknown title, and a row without a number.
    """
    if not isinstance(tables, Mapping):
        return tables
    found = dict[Any, Any]()
    for name, table in tables.items():
        try:
            is_file = isinstance(table, Mapping) and "file" in table
            found[name] = _columns(table, folder or Path()) if is_file else table
        except SceneError as error:
            raise error.located(where=f"tables.{name}") from None
    return found


def of_files(tables: Any, folder: Path) -> dict[str, Any]:
    """Return the tables with the name of a ``file``, which becomes absolute."""
    found = tables.items() if isinstance(tables, Mapping) else ()
    return {
        name: {**table, "file": str((folder / table["file"]).absolute())}
        for name, table in found
        if isinstance(table, Mapping) and isinstance(table.get("file"), str)
    }


def _columns(table: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    rest: dict[str, Any] = {key: value for key, value in table.items() if key != "file"}
    rows = _rows(table["file"], folder)
    titles = [title.strip() for title in rows[0][1]]
    for key in ("x", "y"):
        title = table.get(key)
        if title not in titles:
            raise SceneError(
                f"expected the title of a column of {os.fspath(table['file'])!r}, got {title!r}",
                where=key,
                hint=nearest(title, titles) if isinstance(title, str) else f"Titles: {', '.join(titles)}.",
            )
        if titles.count(title) > 1:
            raise SceneError(f"expected different titles of columns, got {title!r} twice", where=key)
        rest[key] = [_cell(row, titles.index(title), title, key, line) for line, row in rows[1:]]
    return rest


def _rows(name: Any, folder: Path) -> list[tuple[int, list[str]]]:
    """Return the rows of a file that are not empty, each with the number of its line."""
    if not isinstance(name, str | os.PathLike):
        raise SceneError(f"expected the name of a file, got {name!r}", where="file")
    path = (folder / name).absolute()
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or str(error)
        raise SceneError(
            f"cannot read the points of {str(path)!r}: {reason}",
            where="file",
            hint="A name in a scene file is relative to its folder, one of --set, set or Python to the "
            "working directory.",
        ) from None
    if len(text) > _LARGEST:
        raise SceneError(f"expected a file of at most {_LARGEST} characters", where="file")
    separator = next((c for c in ";\t" if c in text.partition("\n")[0]), ",")
    read = csv.reader(text.splitlines(), delimiter=separator)
    rows = [(read.line_num, row) for row in read if any(c.strip() for c in row)]
    if len(rows) < 3:
        raise SceneError(
            f"expected a row of titles and at least two of points in {str(path)!r}", where="file"
        )
    return rows


def _cell(row: list[str], column: int, title: str, key: str, line: int) -> str | float:
    text = row[column].strip() if column < len(row) else ""
    try:
        number = float(text)
    except ValueError:
        raise SceneError(f"expected a number in line {line} of {title!r}, got {text!r}", where=key) from None
    unit = _TITLE.fullmatch(title)
    return f"{text} {unit['unit']}" if unit and unit["unit"].strip() not in ("", "1", "-") else number
