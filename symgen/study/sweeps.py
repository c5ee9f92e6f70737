"""Sweeps of a scene: the parameters that vary, as text with units, made tunable where they are not."""

from __future__ import annotations

import csv
import math
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError, SceneError
from symgen.pipeline.build import build_selected
from symgen.runtime.result.records import parameter_of
from symgen.runtime.sweeps.designs import Normal, Uniform
from symgen.scene.expressions import is_frequency, parse_any
from symgen.scene.loading import SceneText, check_scene, override, read_scene
from symgen.scene.reading import Values
from symgen.scene.units import is_quantity, shown_unit, unit_in

#: Name and size in SI of the units in which parameters are written, by parameter.
WrittenUnits = dict[str, tuple[str, float]]
_NORMAL = re.compile(r"normal\((.*),(.*)\)$")
_FORMS = '"START:STOP:COUNT", a list "V1,V2", a range "LOW:HIGH" to sample, or "normal(MEAN, DEVIATION)"'


class Column(NamedTuple):
    """Values of a parameter, and their unit; empty for numbers."""

    values: NDArray[np.float64]
    unit: str


def varied(
    source: str | os.PathLike[str],
    vary: Mapping[str, Any],
    *,
    set: Mapping[str, Any] | None = None,
    backend: str = "auto",
    table: str = "sweep.vary",
) -> tuple[Any, dict[str, Any], WrittenUnits]:
    """Return the model of a scene, its varied parameters in SI units, and the units they are written in.

    The second are values or distributions by parameter; the last are name and size in SI of a unit.

    Parameters
    ----------
    source
        A shipped name, or the path of a scene file.
    vary
        By parameter, or by dotted key such as ``links.crank.mass``: ``START:STOP:COUNT``, values ``V1,V2`` or
        a list of them, ``LOW:HIGH``, or ``normal(MEAN, DEVIATION)``, with units. The parameter of a key is
        called like the key, with ``_`` for every dot.
    set, backend
        As of :func:`symgen.build`.
    table
        Of the scene with ``vary``, for messages.

    Raises
    ------
    SceneError, ModelError
        For keys that have no single value, and values of wrong units or form.
    """
    text, names = tunable(override(read_scene(source), set or {}), vary)
    values = values_of(text, names, vary, table)
    return build_selected(text, backend=backend), values, _units_of(text, names, vary)


def tunable(text: SceneText, keys: Iterable[str]) -> tuple[SceneText, dict[str, str]]:
    """Return a scene in which the keys are tunable parameters, and the names of these by key."""
    names = {}
    for key in keys:
        text, names[key] = _tunable(text, key)
    return text, names


def values_of(
    text: SceneText, names: Mapping[str, str], vary: Mapping[str, Any], table: str = "sweep.vary"
) -> dict[str, Any]:
    """Return the values of varied parameters by name; see :func:`varied`."""
    read = Values(check_scene(text))
    try:
        return {names[key]: _values(read, names[key], value, table) for key, value in vary.items()}
    except SceneError as error:
        raise error.located(file=text.file) from None


def _units_of(text: SceneText, names: Mapping[str, str], vary: Mapping[str, Any]) -> WrittenUnits:
    """Return by parameter the unit of its first value that has one, else that of its value in the scene."""
    read, units = Values(check_scene(text)), dict[str, tuple[str, float]]()
    for key, value in vary.items():
        name = names[key]
        of_scene = read.scene.parameters[name].value
        texts = [f"1 {value.unit}"] if isinstance(value, Column) else _texts(value)
        unit = next(filter(None, map(unit_in, [*texts, *_texts(of_scene)])), "")
        if unit:
            units[name] = unit, float(_values(read, name, f"1 {unit}", "")[0])
    return units


def _texts(value: Any) -> list[str]:
    """Return the quantities in the text of values; none for numbers."""
    each = value if isinstance(value, list) else [value]
    return [part for text in each if isinstance(text, str) for part in re.split(r"[:,]|normal\(|\)", text)]


def _tunable(text: SceneText, key: str) -> tuple[SceneText, str]:
    """Return the scene with a tunable parameter for a key, and its name."""
    parameters = text.data.get("parameters", {})
    if key in parameters:
        entry = parameters[key]
        if isinstance(entry, dict) and entry.get("tunable"):
            return text, key
        entry = {**entry, "tunable": True} if isinstance(entry, dict) else {"value": entry, "tunable": True}
        return _with(text, {**parameters, key: entry}), key
    value: Any = text.data
    for part in key.split("."):
        value = value.get(part) if isinstance(value, dict) else _at(value, part)
    if value is None:
        value = _drawn_length(text, key)
    if not isinstance(value, str | int | float) or isinstance(value, bool):
        raise SceneError(
            f"there is no parameter {key!r}, and no key of that path with one value",
            where=key,
            file=text.file,
            hint="Write the value in the scene, or name a parameter of [parameters].",
        )
    name = parameter_of(key)
    with_parameter = _with(text, {**parameters, name: {"value": value, "tunable": True, "about": key}})
    return override(with_parameter, {key: name}), name


def _drawn_length(text: SceneText, key: str) -> str | None:
    """Return the drawn length of a link, for the key ``links.NAME.length``; None for other keys."""
    from symgen.scene.resolve import resolve

    table, _, name = key.removesuffix(".length").partition(".")
    if table != "links" or not key.endswith(".length") or name not in text.data.get("links", {}):
        return None
    linkage: Any = resolve(check_scene(text))
    places = {p.name: [linkage.number(x) for x in p.at] for p in linkage.points}
    link = next((k for k in linkage.links if k.name == name), None)
    return f"{math.dist(places[link.start], places[link.end])!r} m" if link else None


def _at(value: Any, part: str) -> Any:
    inside = isinstance(value, list) and part.isdecimal() and int(part) < len(value)
    return value[int(part)] if inside else None


def _with(text: SceneText, parameters: Mapping[str, Any]) -> SceneText:
    return SceneText(text.name, text.file, {**text.data, "parameters": dict(parameters)})


def _values(read: Values, name: str, value: Any, table: str) -> Any:
    """Return values or a distribution of a parameter in SI units."""

    def number(text: Any) -> float:
        given = text.strip() if isinstance(text, str) else text
        if in_hertz and is_frequency(given):
            return read.number(parse_any(given, {})[0])
        if in_hertz and isinstance(given, str) and is_quantity(given) and shown_unit(given) != size.unit:
            raise SceneError(
                f"expected a frequency such as '5 Hz', as the scene has, got {given!r}",
                where=f"{table}.{name}",
                hint="In an expression the angular velocity of f is 2*pi*f.",
            )
        return read.number(read.value(given, size, f"{table}.{name}"))

    size = read.names[name][1]
    in_hertz = is_frequency(read.scene.parameters[name].value)
    if isinstance(value, Column):
        return value.values * number(f"1 {value.unit}" if value.unit else 1)
    if not isinstance(value, str):
        return np.array([number(one) for one in (value if isinstance(value, list) else [value])])
    normal = _NORMAL.fullmatch(value.strip())
    if normal:
        return Normal(number(normal[1]), number(normal[2]))
    parts = value.split(":")
    if len(parts) == 2:
        return Uniform(*map(number, parts))
    if len(parts) == 3:
        if not parts[2].strip().isdecimal() or not 1 <= int(parts[2]) <= 10**9:
            raise ModelError(f"expected a whole number of values after {name}=START:STOP:, got {parts[2]!r}")
        return np.linspace(number(parts[0]), number(parts[1]), int(parts[2]))
    if len(parts) > 3:
        raise ModelError(f"expected {_FORMS} after {name}=, got {value!r}")
    return np.array([number(one) for one in value.split(",")])


def of_options(options: Sequence[str]) -> dict[str, str]:
    """Return the texts of ``--vary KEY=VALUES`` by key."""
    texts = {}
    for option in options:
        key, equals, values = option.partition("=")
        if not equals or not key.strip() or not values.strip():
            raise ModelError(f"expected --vary KEY={_FORMS}, got {option!r}")
        texts[key.strip()] = values.strip()
    return texts


def of_file(file: str | os.PathLike[str]) -> dict[str, Column]:
    """Return the columns of a CSV file: one parameter each, named in the first row, as KEY or KEY [UNIT]."""
    try:
        with Path(file).open(newline="", encoding="utf-8-sig") as stream:
            head, *rows = [row for row in csv.reader(stream) if row]
    except (OSError, UnicodeDecodeError, csv.Error, ValueError) as error:
        raise ModelError(f"cannot read the list of parameters {os.fspath(file)!r}: {error}") from None
    wrong = next((i for i, row in enumerate(rows, 2) if len(row) != len(head)), None)
    if wrong is not None or not rows:
        place = f"row {wrong}" if wrong else "no row"
        raise ModelError(f"expected {len(head)} values in every row of {os.fspath(file)!r}, got {place}")
    columns = {}
    for i, column in enumerate(head):
        key, _, unit = column.strip().removesuffix("]").partition("[")
        try:
            columns[key.strip()] = Column(np.array([float(row[i]) for row in rows]), unit.strip())
        except ValueError as error:
            raise ModelError(f"expected numbers of {key.strip()} in {os.fspath(file)!r}: {error}") from None
    return columns
