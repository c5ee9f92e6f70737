"""From a file, a shipped name or Python words to a checked :class:`~symgen.scene.schema.Scene`."""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symgen.calls import checked
from symgen.errors import SceneError, nearest
from symgen.scene.tables.files import of_files, with_points

if TYPE_CHECKING:
    from symgen.scene.schema import Scene

SHIPPED = Path(__file__).resolve().parent.parent / "scenes"
#: Those of the page "From your mechanism to a scene".
MACHINES = SHIPPED / "machines"
_LARGEST = 4_000_000
_DEEPEST = 20  # tables in tables: a scene has four
_LONGEST_NAME = 40
_WORD = re.compile(r"[A-Za-z]\w*", re.ASCII)
#: Hint on an unknown name that is near none.
_LISTS = "'symgen scenes' lists the shipped ones."


@dataclass(frozen=True, slots=True)
class SceneText:
    """A scene read but not yet checked: its name, where it came from, and its tables.

    ``of_files`` are tables of points as written, which files give. A ``shipped`` one comes with symgen.
    """

    name: str
    file: str
    data: Mapping[str, Any]
    of_files: Mapping[str, Any] = field(default_factory=dict)
    shipped: bool = False

    @property
    def canonical(self) -> str:
        """The tables as JSON in their written order: what identifies the scene in the cache."""
        return json.dumps([self.name, self.data], default=str)


@checked
def shipped_scenes() -> list[str]:
    """Return the names of the scenes that come with symgen, without the machines of the trades."""
    return sorted(path.stem for path in SHIPPED.glob("*.toml"))


def machines() -> list[str]:
    """Return the names of the shipped machines of the trades."""
    return sorted(path.stem for path in MACHINES.glob("*.toml"))


def shipped_scene(name: str) -> str:
    """Return the text of a shipped scene.

    Raises
    ------
    SceneError
        When no scene of this name comes with symgen.
    """
    path = scene_path(name)
    if path.parent not in (SHIPPED, MACHINES):
        known = shipped_scenes() + machines()
        raise SceneError(f"no scene called {name!r} comes with symgen", hint=nearest(name, known, _LISTS))
    return path.read_text(encoding="utf-8")


def scene_path(source: str | os.PathLike[str]) -> Path:
    """Return the file of a scene: that of a shipped name, else the path itself."""
    text = os.fspath(source)
    known = {SHIPPED: shipped_scenes(), MACHINES: machines()}
    return next((folder / f"{text}.toml" for folder in known if text in known[folder]), Path(text))


def read_scene(source: str | os.PathLike[str]) -> SceneText:
    """Read a shipped scene by name, or a TOML file by path.

    Raises
    ------
    SceneError
        When there is no such scene or file, or the file is not TOML; for a file of points that it names.
    """
    text, path = os.fspath(source), scene_path(source)
    if path.suffix == ".py":
        raise SceneError(
            f"expected a scene, got the Python file {text!r}",
            hint="'symgen generate', 'build', 'show', 'report', 'accuracy' and 'diff' take it, and "
            "symgen.build; the analyses take it where its System has values.",
        )
    try:
        with path.open("rb") as stream:
            content = stream.read(_LARGEST + 1)
    except (FileNotFoundError, NotADirectoryError):
        raise SceneError(f"there is no scene and no file called {text!r}", hint=_alike(text)) from None
    except (OSError, ValueError) as error:
        raise SceneError(f"cannot read the scene: {error}", file=text) from None
    if len(content) > _LARGEST:
        raise SceneError(f"expected a scene of at most {_LARGEST} bytes", file=path.name)
    try:
        data = tomllib.loads(content.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:  # of TOML, of UTF-8, and of numbers with too many digits
        from symgen.scene.faults import ONE_LOOP  # pydantic is not loaded by runs from the cache

        hint = ONE_LOOP if "'loop',) twice" in str(error) else ""
        if isinstance(error, UnicodeDecodeError):
            hint = "Save the file as text in UTF-8."
        raise SceneError(f"this is not valid TOML: {error}", file=path.name, hint=hint) from None
    if _depth(data) > _DEEPEST:
        raise SceneError(f"expected tables nested at most {_DEEPEST} deep", file=path.name)
    given = of_files(data.get("tables"), path.parent)
    shipped = path.parent in (SHIPPED, MACHINES)
    return _with_points(SceneText(_identifier(path.stem), path.name, data, given, shipped), path.parent)


def _with_points(text: SceneText, folder: Path | None = None) -> SceneText:
    """Return a scene with the points of its tables."""
    if "tables" not in text.data:
        return text
    try:
        return replace(text, data={**text.data, "tables": with_points(text.data["tables"], folder)})
    except SceneError as error:
        raise error.located(file=text.file) from None


def _alike(text: str) -> str:
    """Return a hint with the file of the same folder, or the shipped scene, whose name is nearest."""
    path, files = Path(text), list[str]()
    with suppress(OSError, ValueError):
        files = [str(file) for file in path.parent.glob("*.toml")]
    file = str(path) if path.suffix == ".toml" else f"{path}.toml"
    hints = [nearest(file, files), nearest(text, shipped_scenes() + machines())]
    close = [hint for hint in hints if hint.startswith("Did you mean")]
    return " ".join([*close[:1], _LISTS])


@checked
def load_scene(source: str | os.PathLike[str], set: Mapping[str, Any] | None = None) -> Scene:
    """Load and check a scene: a shipped name or the path of a TOML file.

    Parameters
    ----------
    source
        A name that ``symgen scenes`` lists, or a path.
    set
        Values to replace, by parameter name or by dotted key: ``{"rho": "2 kg/m"}``,
        ``{"links.OA.mass": "1 kg"}``. A table replaces that of the scene; ``parameters`` and ``inputs``
        replace or add the values that they name. None removes a key or a table. Names of files are relative
        to the working directory, those in a scene file to its folder.

    Raises
    ------
    SceneError
        For anything wrong in the scene, naming file, table and key.
    """
    return check_scene(override(read_scene(source), set or {}))


#: Tables that a scene may leave out.
_TABLES = ("analysis", "gravity", "start", "inputs", "states", "parameters", "tables", "units")
#: Tables of named values, which are set by the name alone.
NAMED = ("parameters", "inputs")
#: Stands for an entry that is removed, so that entries behind it keep their numbers until the end.
_REMOVED = object()


def override(text: SceneText, changes: Mapping[str, Any]) -> SceneText:
    """Return the scene with the values at these parameters or dotted keys replaced, or removed for None."""
    if not changes:
        return text
    from symgen.scene.schema import Scene

    changes = by_name(text, changes)
    data = _as_written(text, changes)
    for key, value in changes.items():
        named = [table for table in map(data.get, NAMED) if isinstance(table, dict)]
        parameters = next((table for table in named if key in table), None)
        if value is None:
            _remove(text, data if parameters is None else parameters, key)
            continue
        if parameters is not None:
            if isinstance(parameters[key], dict) and not isinstance(value, Mapping):
                parameters[key]["value"] = value
            else:
                parameters[key] = value
            continue
        *path, last = key.split(".")
        table: Any = data
        for depth, part in enumerate(path, 1):
            if isinstance(table, dict) and part not in table:
                table |= _absent(path[:depth])
            table = _inside(table, part)
        more = isinstance(value, Mapping)
        if isinstance(table, list) and last.isdecimal() and int(last) < len(table) + more:
            table[int(last) : int(last) + 1] = [value]
        elif isinstance(table, dict) and (path or key in data or key in Scene.model_fields):
            table[last] = value
        else:
            raise SceneError(
                f"there is no parameter and no key {key!r} to set",
                file=text.file,
                hint=_of_analysis(key)
                or _respelled(path, last, table)
                or nearest(key, [name for table in named for name in table]),
            )
    left = _left(data)
    _check_used(text, left)
    return _with_points(replace(text, data=left, of_files={}))


def _check_used(text: SceneText, data: Mapping[str, Any]) -> None:
    """Raise SceneError for an added parameter or input whose name occurs nowhere in the scene."""
    for table, use in (("parameters", "links.LINK.mass"), ("inputs", "torques.0.torque")):
        known, present = (of.get(table) or {} for of in (text.data, data))
        added = [name for name in present if name not in known] if isinstance(present, dict) else []
        words = {word for written in _texts(data) for word in _WORD.findall(written)} if added else set()
        for name in added:
            if name not in words:
                raise SceneError(
                    f"nothing uses the new {table[:-1]} {name!r}",
                    where=f"{table}.{name}",
                    file=text.file,
                    hint=nearest(name, known, f"Write it into another value as well: {use}={name}."),
                )


def _texts(data: Any) -> Iterator[str]:
    """Yield the texts in tables and lists, but titles and explanations."""
    if isinstance(data, dict):
        for key, value in data.items():
            yield from () if key in ("title", "about") else _texts(value)
    elif isinstance(data, list):
        for value in data:
            yield from _texts(value)
    elif isinstance(data, str):
        yield data


def _as_written(text: SceneText, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of a scene, in which those of points whose file or titles change are as written."""
    data: dict[str, Any] = json.loads(json.dumps(text.data, default=str))
    for name, table in text.of_files.items():
        x, y = (changes.get(f"tables.{name}.{key}") for key in "xy")
        if f"tables.{name}.file" in changes or isinstance(x, str) or isinstance(y, str):
            data["tables"][name] = dict(table)
    return data


def _remove(text: SceneText, table: Any, key: str) -> None:
    """Mark what is at a dotted key of a table as removed; raise SceneError if there is nothing."""
    *path, last = key.split(".")
    for depth, part in enumerate(path):
        if _inside(table, part) is None:
            path, last = path[:depth], part
            break
        table = _inside(table, part)
    if _inside(table, last) in (None, _REMOVED):
        numbers = range(len(table)) if isinstance(table, list) else ()
        known = table if isinstance(table, dict) else map(str, numbers)
        raise SceneError(
            f"there is no key {key!r} to remove",
            file=text.file,
            hint=nearest(".".join([*path, last]), [".".join([*path, name]) for name in known]),
        )
    table[int(last) if isinstance(table, list) else last] = _REMOVED


def _left(data: Any) -> Any:
    """Return tables and lists without what was removed."""
    if isinstance(data, dict):
        return {key: _left(value) for key, value in data.items() if value is not _REMOVED}
    return [_left(value) for value in data if value is not _REMOVED] if isinstance(data, list) else data


def by_name(text: SceneText, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return changes with an entry per named value: a table of them changes those that it names.

    The key is the name of a value that the scene has, TABLE.NAME of another.
    """
    result: dict[str, Any] = {}
    for key, value in changes.items():
        if key in NAMED and isinstance(value, Mapping):
            entries = {f"{key}.{name}": entry for name, entry in value.items()}
        else:
            entries = {key: value}
        for path, entry in entries.items():
            table, _, name = path.partition(".")
            known = text.data.get(table) if table in NAMED else None
            result[name if isinstance(known, Mapping) and name in known else path] = entry
    return result


def _of_analysis(key: str) -> str:
    """Return how to set a key of the table [analysis] that was given without it; empty for other keys."""
    from symgen.scene.schema import Analysis

    if key not in Analysis.model_fields:
        return ""
    option = ", or give --t-end to the analysis (in Python t_end)" if key == "t_end" else ""
    return f"Set analysis.{key}{option}."


def _respelled(path: list[str], last: str, table: Any) -> str:
    """Return a hint for a key of an entry without its number, or of a table with another name; else empty."""
    from symgen.scene.schema import Scene

    if isinstance(table, list) and last.isdecimal():
        return f"The next entry is {'.'.join([*path, str(len(table))])}={{...}}."
    if isinstance(table, list) and table:
        return f"Did you mean {'.'.join([*path, '0', last])!r}? Entries are numbered from 0."
    if not path or path[0] in Scene.model_fields:
        return ""
    hint = nearest(".".join([*path, last]), [".".join([x, *path[1:], last]) for x in Scene.model_fields])
    return hint if hint.startswith("Did") else ""


def _absent(path: list[str]) -> dict[str, Any]:
    """Return an empty table or list by its key where a scene may omit it, so that its keys can be set."""
    from symgen.loads import LOADS
    from symgen.scene.faults import table_at
    from symgen.scene.schema import Scene

    if len(path) == 1:
        is_list = (
            path[0] in LOADS or getattr(Scene.model_fields.get(path[0]), "default_factory", None) is list
        )
        return {path[0]: {}} if path[0] in _TABLES else {path[0]: []} if is_list else {}
    return {path[-1]: {}} if path[-1] in table_at(Scene, path).model_fields else {}


def _inside(table: Any, part: str) -> Any:
    """Return the value at a key of a table or an index of a list, counted from 0; None if absent."""
    if isinstance(table, dict):
        return table.get(part)
    if isinstance(table, list) and part.isdecimal() and int(part) < len(table):
        return table[int(part)]
    return None


def check_scene(text: SceneText) -> Scene:
    """Return the checked scene; raise SceneError naming file, table and key of the first fault."""
    from symgen.scene.schema import FORMAT_VERSION, Scene

    version = text.data.get("symgen")
    if version != FORMAT_VERSION or type(version) is not int:
        came = f"it says {version!r}" if version is not None else "there is no such key"
        raise SceneError(
            f"expected the format version 'symgen = {FORMAT_VERSION}', but {came}",
            where="symgen",
            file=text.file,
            hint=f"Write 'symgen = {FORMAT_VERSION}' as the first line of the scene.",
        )
    if "name" in text.data:
        raise SceneError(
            "the name of a scene is that of its file",
            where="name",
            file=text.file,
            hint="Remove this key, and rename the file; 'title' is a text for people.",
        )
    try:
        return Scene(**text.data).called(text.name, text.file)
    except SceneError as error:
        raise error.located(file=text.file) from None


def _depth(data: Any) -> int:
    """Return how deep tables and lists are nested, without recursion."""
    level, depth = [data], 0
    while level:
        level = [
            inner
            for outer in level
            for inner in (outer.values() if isinstance(outer, dict) else outer)
            if isinstance(inner, dict | list)
        ]
        depth += 1
    return depth


def _identifier(stem: str) -> str:
    word = "".join(c if c.isascii() and (c.isalnum() or c == "_") else "_" for c in stem[:_LONGEST_NAME])
    return word if word[:1].isalpha() else f"scene_{word}"


def text_of(scene: Any) -> SceneText:
    """Return the tables of a scene given as a name, a path, a Python object, or tables."""
    if isinstance(scene, SceneText):
        return scene
    if isinstance(scene, str | os.PathLike):
        return read_scene(scene)
    return SceneText(scene.name, scene.file, scene.model_dump(exclude_unset=True) | {"symgen": scene.symgen})
