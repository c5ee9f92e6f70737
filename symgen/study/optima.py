"""Optimisations of a scene: bounds of outputs with units, and the scene of the optimum as a file."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

from symgen.errors import SceneError, SymgenError
from symgen.runtime.result.records import key_of
from symgen.runtime.sweeps.problem import ReducedOutput
from symgen.scene.loading import SceneText, override, read_scene, scene_path
from symgen.scene.units import OF_ANGLES, is_quantity, parse_quantity, shown_unit, unit_in
from symgen.study.sweeps import WrittenUnits

#: The line of a table, or of an entry of a list of tables.
_HEADER = re.compile(r"(?P<open>[ \t]*\[\[?[ \t]*)(?P<name>[A-Za-z_]\w*)[ \t]*(?P<end>[.\]])")
#: Units of outputs that the unit of a dimension stands for.
_ALSO = {"N*m": ("J",), "1/s": ("Hz",)}


def bounds_of(constraints: Mapping[str, Any]) -> tuple[dict[str, tuple[Any, Any]], dict[str, str]]:
    """Return by quantity the lower and upper bound in SI units, and the text of a bound with a unit.

    Raises
    ------
    SceneError
        For a bound that is no number and no quantity.
    """
    bounds, texts = {}, dict[str, str]()
    for name, table in constraints.items():
        ends = []
        for key in ("least", "greatest"):
            value = getattr(table, key)
            if isinstance(value, str):
                if not is_quantity(value):
                    raise SceneError(
                        f"expected a quantity such as '5 N*m', got {value!r}",
                        where=f"optimise.constraints.{name}.{key}",
                    )
                if unit_in(value):
                    texts[name] = value
                value = float(parse_quantity(value)[0])
            ends.append(value)
        bounds[name] = (ends[0], ends[1])
    return bounds, texts


def check_units(texts: Mapping[str, str], units: Mapping[str, str]) -> None:
    """Raise SceneError for a bound that has another unit than its quantity; ``units`` are those in SI."""
    for name, text in texts.items():
        unit = shown_unit(text)
        fits = {unit, *_ALSO.get(unit, ())}
        if unit in OF_ANGLES.values():
            fits |= {plain for plain, angles in OF_ANGLES.items() if angles == unit}
        if units[name] not in fits:
            raise SceneError(
                f"expected a quantity in {units[name]}, got {text!r}", where=f"optimise.constraints.{name}"
            )


def check_units_at_start(texts: Mapping[str, str], model: Any, arguments: Mapping[str, Any]) -> None:
    """Check units of bounds as :func:`check_units` by one run, before the optimisation with these arguments.

    Where this run fails, the optimisation says why, or starts elsewhere.
    """
    variables: Mapping[str, Any] = arguments["variables"]
    units = {p.name: p.unit for p in model.description.tunable if p.name in variables}
    check_units({name: text for name, text in texts.items() if name in units}, units)
    named = {name: ReducedOutput.named(name, units).output for name in texts if name not in units}
    if not named:
        return
    of_search = (
        "variables",
        "objective",
        "constraints",
        "method",
        "seed",
        "start",
        "tolerance",
        "iterations",
    )
    same = {name: x for name, x in arguments.items() if name not in (*of_search, "points")}
    first = next(iter(variables))
    begin = {first: [arguments.get("start", {}).get(first, model.parameters[first])]}
    try:
        runs = model.sweep(begin, outputs=[*dict.fromkeys(named.values())], reduce="final", **same)
    except SymgenError:
        return
    known = {str(name).removesuffix(".final"): x.attrs.get("units", "") for name, x in runs.data_vars.items()}
    units = {name: known[output] for name, output in named.items() if output in known}
    check_units({name: text for name, text in texts.items() if name in units}, units)


def with_values(
    text: SceneText, values: Mapping[str, float], units: WrittenUnits, description: Any
) -> SceneText:
    """Return a scene with values in SI units of parameters, or of the keys that these stand for."""
    changes = dict[str, Any]()
    for p in description.tunable:
        if p.name in values:
            unit, size = units.get(p.name, (p.unit, 1.0))
            number = values[p.name] / size
            changes[key_of(p.name, p.about)] = number if unit in ("", "1") else f"{number!r} {unit}"
    return override(text, changes)


def check_tables(source: str | os.PathLike[str], changed: SceneText, target: Path) -> None:
    """Refuse to write a scene whose files of points would not be found, or are others than in the source."""
    read, path = read_scene(source), scene_path(source)
    tables = tomllib.loads(path.read_text(encoding="utf-8-sig")).get("tables", {})
    files = [name for name, table in tables.items() if "file" in table]
    moved = path.absolute().parent != target.absolute().parent
    for name in files:
        if moved or changed.data.get("tables", {}).get(name) != read.data["tables"][name]:
            raise SceneError(
                f"expected --write in {path.parent}, with the file of tables.{name} as it is there",
                where=f"tables.{name}.file",
                hint="Write into the folder of the scene, without --set of this table.",
            )


def written(source: str | os.PathLike[str], changed: SceneText) -> str:
    """Return the text of a scene file with the values of a changed scene; all else, comments too, is kept."""
    import tomlkit

    text = scene_path(source).read_text(encoding="utf-8-sig")
    before, after, mark = dict(read_scene(source).data), dict(changed.data), "_"
    while mark in text + str(after):
        mark += "_"
    for name, entries in tuple(before.items()):
        if isinstance(entries, list) and len(entries) == len(after.get(name, ())):
            text = _apart(text, name, mark, before, after)
    document = tomlkit.parse(text)
    _update(document, before, after)
    return re.sub(rf"{mark}\d+{mark}", "", tomlkit.dumps(document))


def _apart(text: str, name: str, mark: str, *of_scene: dict[str, Any]) -> str:
    """Return the text of a scene in which groups of [[name]] behind other tables have names of their own.

    These are the name and a number between two marks that occur in no text. Their entries move there
    in both sets of tables. tomlkit would write all groups where the first one is.
    """
    parts, ends = list[str](), list[int]()  # number of entries up to the end of each group
    last = ""
    for line in text.splitlines(keepends=True):
        if header := _HEADER.match(line):
            if header["name"] == name:
                if last != name:
                    ends.append(ends[-1] if ends else 0)
                ends[-1] += header["open"].strip() == "[[" and header["end"] == "]"
            last = header["name"]
        at = header.end("name") if header and last == name and len(ends) > 1 else 0
        parts += [line[:at], f"{mark}{len(ends) - 1}{mark}" * bool(at), line[at:]]
    if len(ends) < 2 or ends[-1] != len(of_scene[0][name]):  # the second for such lines in a text
        return text
    for tables in of_scene:
        entries = tables[name]
        tables[name] = entries[: ends[0]]
        for k, (begin, end) in enumerate(pairwise(ends), 1):
            tables[f"{name}{mark}{k}{mark}"] = entries[begin:end]
    return "".join(parts)


def _update(document: Any, before: Any, after: Any) -> None:
    """Change a table or list of a document where the data differ."""
    if isinstance(after, dict):
        for key in before.keys() - after.keys():
            del document[key]
        for key, value in after.items():
            if key not in before:
                document[key] = value
            elif value != before[key]:
                _change(document, key, before[key], value)
        return
    for i, value in enumerate(after):
        if value != before[i]:
            _change(document, i, before[i], value)


def _change(document: Any, key: Any, before: Any, after: Any) -> None:
    alike = (isinstance(before, dict) and isinstance(after, dict)) or (
        isinstance(before, list) and isinstance(after, list) and len(before) == len(after)
    )
    if alike:
        _update(document[key], before, after)
    else:
        document[key] = after
