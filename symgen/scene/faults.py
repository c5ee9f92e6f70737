"""From pydantic's report to one sentence that names table and key."""

from __future__ import annotations

from pydantic import ValidationError

from symgen.errors import SceneError, nearest
from symgen.scene.schema import TABLES, Scene

_NOT_PLACES = ("[key]", "str", "int", "float")
_LONGEST = 80


def scene_error(error: ValidationError) -> SceneError:
    """Return the first fault of a scene; a misspelled key before the one that is then missing."""
    faults = error.errors()
    fault = next((f for f in faults if f["type"] == "extra_forbidden"), faults[0])
    place = [str(part) for part in fault["loc"] if part not in _NOT_PLACES]
    where = ".".join(place)
    got = repr(fault["input"])
    got = got if len(got) <= _LONGEST else got[: _LONGEST - 3] + "..."
    hint = ""
    match fault["type"]:
        case "extra_forbidden":
            table = TABLES.get(place[0], Scene) if len(place) > 1 else Scene
            problem, hint = f"unknown key {place[-1]!r}", nearest(place[-1], table.model_fields)
        case "missing":
            problem = "this key is missing"
        case "string_pattern_mismatch":
            problem = f"expected a name of letters, digits and _ that starts with a letter, got {got}"
        case _:
            message = fault["msg"]
            problem = f"{message[:1].lower()}{message[1:]}, got {got}"
    return SceneError(problem, where=where, hint=hint)
