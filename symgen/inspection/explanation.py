"""Plain-text explanation of a scene, by simplifications and solution, and of the keys of scene files."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from symgen.errors import SceneError, nearest
from symgen.inspection.view import view_of
from symgen.models import BLOCKS
from symgen.pipeline.build import build_selected
from symgen.pipeline.systems import system_of
from symgen.report.page.structure import matrix_lines, memory_lines, solver_lines
from symgen.scene.loading import load_scene
from symgen.scene.resolve import resolve

#: In a path, any name that the scene chooses.
NAME = "NAME"
#: JSON types in words.
_TYPES = {"string": "text", "integer": "whole number", "number": "number", "boolean": "true or false"}


def explanation(scene: str, changes: Mapping[str, Any]) -> Iterator[str]:
    """Yield the explanation line by line; lines that need the compiled model come last.

    Raises
    ------
    SceneError
        If the scene is invalid.
    """
    if scene in BLOCKS:
        raise SceneError(
            f"{scene} is a building block, which has no solution to explain",
            hint=f"symgen show {scene} prints its equations, symgen report {scene} a page of them.",
        )
    resolved = resolve(load_scene(scene, set=changes))
    system = system_of(resolved)
    view = view_of(resolved)
    yield from view.structure(resolved, system)
    yield from matrix_lines(system)
    yield from solver_lines(system)
    model = build_selected(scene, set=changes)
    yield from model.mobility
    yield from view.solution(model)
    yield from memory_lines(model.description)


class Key(NamedTuple):
    """A key: its path with ``NAME`` for names of the scene, its values in words, and what it means.

    ``default`` is "required", or the value of a key that is absent; empty if that is described.
    """

    path: str
    form: str
    default: str
    about: str


def keys_of(schema: Mapping[str, Any]) -> list[Key]:
    """Return all keys of a JSON Schema of scenes, tables before their keys."""
    return list(_keys(schema, schema, ""))


def explained(keys: list[Key], text: str) -> list[Key]:
    """Return a key and those of its table, or all keys that end so, such as those of one name.

    Raises
    ------
    SceneError
        For a key that scenes do not have.
    """
    path = ".".join(part for part in re.split(r"[\s.\[\]\"']+", text) if part and not part.isdecimal())
    parts = path.split(".")
    found = [k for k in keys if _is(parts, k.path.split("."))]
    if found:
        return [*found, *(k for k in keys if _is(parts, k.path.split(".")[:-1]))]
    ending = [k for k in keys if k.path.split(".")[-1] == parts[-1]]
    found = [k for k in ending if _is(parts, k.path.split(".")[-len(parts) :])]
    if not found:
        names = {k.path.split(".")[-1] for k in keys} - {NAME}
        raise SceneError(f"scenes have no key {text!r}", hint=nearest(parts[-1], sorted(names)))
    return found


def _is(parts: list[str], path: list[str]) -> bool:
    """Return whether a key that was written is that of a path."""
    return len(parts) == len(path) and all(q in (p, NAME) for p, q in zip(parts, path, strict=True))


def _keys(whole: Mapping[str, Any], table: Mapping[str, Any], path: str) -> Iterator[Key]:
    required = table.get("required", ())
    for name, value in table.get("properties", {}).items():
        yield from _key(whole, value, f"{path}.{name}".strip("."), name in required)
    of_names = table.get("additionalProperties") or next(
        iter(table.get("patternProperties", {}).values()), None
    )
    if isinstance(of_names, dict):
        yield from _key(whole, of_names, f"{path}.{NAME}".strip("."), required=False)


def _key(whole: Mapping[str, Any], value: Mapping[str, Any], path: str, required: bool) -> Iterator[Key]:
    tables = list(_tables(whole, value))
    default = value.get("default")
    shown = str(default).lower() if isinstance(default, bool) else str(default)
    shown = "required" if required else "" if default in (None, [], {}) else shown
    about = value.get("description") or " ".join(t["description"] for t in tables if "description" in t)
    yield Key(path, _form(whole, value), shown, about.replace("``", ""))
    for one in tables:
        yield from _keys(whole, one, path)


def _tables(whole: Mapping[str, Any], value: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Yield the tables that a value may be, or that its list may hold."""
    if "$ref" in value:
        yield from _tables(whole, whole["$defs"][value["$ref"].rpartition("/")[2]])
    elif value.get("type") == "object" or "properties" in value:
        yield value
    elif value.get("type") == "array":
        yield from _tables(whole, value.get("items", {}))
    for one in value.get("anyOf", ()) if "properties" not in value else ():
        yield from _tables(whole, one)


def _form(whole: Mapping[str, Any], value: Mapping[str, Any]) -> str:
    """Return in words what a value may be."""
    if "$ref" in value:
        return _form(whole, whole["$defs"][value["$ref"].rpartition("/")[2]])
    if "enum" in value or "const" in value:
        return ", ".join(str(x) for x in value.get("enum", [value.get("const")]))
    kinds = [_form(whole, x) for x in value.get("anyOf", ()) if x.get("type") != "null"]
    if {*kinds} >= {"text", "whole number", "number"}:
        kinds = ["quantity or expression", *(k for k in kinds if k not in _TYPES.values())]
    if kinds and "properties" not in value:
        return " or ".join(dict.fromkeys(kinds))
    if value.get("type") == "array":
        return f"list: {_form(whole, value.get('items', {}))}"
    return _TYPES.get(value.get("type", ""), "table")
