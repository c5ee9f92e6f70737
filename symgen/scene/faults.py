"""Faults of a scene: one sentence that names table and key, also from pydantic's report."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, get_args, get_origin

from pydantic import ValidationError

from symgen.errors import SceneError, nearest, shown
from symgen.scene.table import Table

#: The alternatives of a value, which pydantic names behind and inside the place of a fault.
_ALTERNATIVES = {"string_type": "str", "int_type": "int", "float_type": "float"}
_LONGEST = 80
#: What expresses several loops.
ONE_LOOP = (
    "A link-joint table describes a single loop. Mechanisms with several loops are expressed by [points] and "
    "[links], with bodies (links with several points) where three or more joints meet."
)
#: How links are joined without ``[[joints]]``.
JOINED = (
    "Links that share a point are joined there without this table: by a pin in the plane; in space by a ball "
    "joint, or, at two common points, by a revolute joint. Sliders are [[guides]]. Of rigid links remove it."
)
#: Keys of scenes that were meant to have several loops.
_LOOPS = re.compile(r"loops|loop_?\d+")


@contextmanager
def at(where: str) -> Iterator[None]:
    """Add a place in front of that of any fault inside."""
    try:
        yield
    except SceneError as error:
        raise error.located(where=where) from None


def scene_error(scene: type[Table], error: ValidationError) -> SceneError:
    """Return the first fault of a scene; a misspelled key before the one that is then missing."""
    faults = error.errors()
    fault = next((f for f in faults if f["type"] == "extra_forbidden"), faults[0])
    place = [str(p) for p in fault["loc"] if p != "[key]" and not str(p).startswith(("union[", "list["))]
    alternative = bool(place) and place[-1] == _ALTERNATIVES.get(fault["type"])
    if alternative:
        place.pop()
    where = ".".join(place)
    value = shown(fault["input"], _LONGEST)
    hint = ""
    match fault["type"]:
        case _ if alternative:
            problem = f"expected a text with a unit, an expression or a number, got {value}"
        case "model_type" | "dict_type":
            problem = f"expected a table of keys, got {value}"
            hint = ONE_LOOP if where == "loop" and isinstance(fault["input"], list) else ""
        case "list_type":
            problem = f"expected a list in square brackets, got {value}"
            if isinstance(fault["input"], dict):
                hint = f"A list of tables has double brackets: [[{where}]]."
        case "too_short" | "too_long" as kind:
            limit, bound = ("least", "min_length") if kind == "too_short" else ("most", "max_length")
            problem = f"expected at {limit} {fault['ctx'][bound]} entries in the list, got {value}"
        case "bool_type":
            problem = f"expected true or false, got {value}"
        case "string_type":
            problem = f"expected a text in quotation marks, got {value}"
        case "int_type" | "int_from_float":
            problem = f"expected a whole number, got {value}"
        case "literal_error":
            problem = f"expected {fault['ctx']['expected']}, got {value}"
            hint = JOINED if place[0] == "joints" else ""
        case "extra_forbidden":
            problem, hint = (
                f"unknown key {place[-1]!r}",
                nearest(place[-1], table_at(scene, place).model_fields),
            )
            if where == "synthesis":
                hint = "'symgen synthesise' reads files with this table."
            if where == "loop.units":
                hint = "Units of results are a table of every scene: [units]."
            if _LOOPS.fullmatch(where) or (place[0] == "loop" and _is_a_loop(fault["input"])):
                hint = ONE_LOOP
        case "missing":
            problem = "this key is missing"
            hint = JOINED if place[0] == "joints" else ""
        case "string_pattern_mismatch":
            problem = f"expected a name of letters, digits and _ that starts with a letter, got {value}"
            if place[-1] in ("title", "about"):
                problem = f"expected a text without control characters, got {value}"
        case _:
            message = fault["msg"]
            problem = f"{message[:1].lower()}{message[1:]}, got {value}"
    return SceneError(problem, where=where, hint=hint)


def _is_a_loop(value: Any) -> bool:
    """Return whether a value looks like a link-joint table."""
    return isinstance(value, dict) and "rows" in value


def table_at(scene: type[Table], place: Sequence[str]) -> type[Table]:
    """Return the model of the table that the last part of a place is a key of."""
    table = scene
    parts = iter(place[:-1])
    for part in parts:
        if part in table.model_fields:
            annotation = table.model_fields[part].annotation
            table = next(tables_in(annotation), table)
            if get_origin(annotation) is dict:
                next(parts, None)  # a name that the user gave
    return table


def tables_in(annotation: Any) -> Iterator[type[Table]]:
    """Yield the tables in an annotation, in tables of tables and lists of them as well."""
    if isinstance(annotation, type) and issubclass(annotation, Table):
        yield annotation
    for inner in get_args(annotation):
        yield from tables_in(inner)
