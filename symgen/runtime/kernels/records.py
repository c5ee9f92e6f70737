"""Records from JSON: every value has the type that the dataclass declares, or the text is refused."""

from __future__ import annotations

import types
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

Record = TypeVar("Record")


def record(kind: type[Record], data: Any) -> Record:
    """Return an instance of a dataclass from what ``asdict`` and JSON made of one.

    Raises
    ------
    ValueError
        When a field is missing, unknown, or of another type than declared; it names the field.
    """
    return _read(kind, data, kind.__name__)


def _read(kind: Any, data: Any, where: str) -> Any:
    if kind is Any:
        return data
    if is_dataclass(kind):
        return _of_class(kind, data, where)
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        return _of_union(inner, data, where)
    if origin is dict and isinstance(data, dict):
        return {key: _read(inner[1], value, f"{where}.{key}") for key, value in data.items()}
    if origin in (tuple, list) and isinstance(data, list):
        each = inner[:1] * len(data) if origin is list or inner[1:] == (...,) else inner
        if len(each) == len(data):
            pairs = zip(each, data, strict=True)
            return origin(_read(k, value, f"{where}[{i}]") for i, (k, value) in enumerate(pairs))
    if type(data) is kind or (kind is float and type(data) is int) or (data is None and kind is type(None)):
        return data
    raise ValueError(f"expected {kind} for {where}, got {data!r:.100}")


def _of_class(kind: Any, data: Any, where: str) -> Any:
    hints, required = _declared(kind)
    if not isinstance(data, dict) or not required <= data.keys() <= hints.keys():
        raise ValueError(f"expected the fields {sorted(hints)} for {where}, got {data!r:.100}")
    return kind(**{name: _read(hints[name], value, f"{where}.{name}") for name, value in data.items()})


def _of_union(kinds: tuple[Any, ...], data: Any, where: str) -> Any:
    if data is None and type(None) in kinds:
        return None
    (kind,) = (k for k in kinds if k is not type(None))
    return _read(kind, data, where)


@cache
def _declared(kind: Any) -> tuple[dict[str, Any], frozenset[str]]:
    """Return the types of a dataclass's fields by name, and the names of those without a default."""
    needed = (f.name for f in fields(kind) if f.default is MISSING and f.default_factory is MISSING)
    return get_type_hints(kind), frozenset(needed)
