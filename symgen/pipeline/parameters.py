"""User-defined values: those of tunable parameters, and those that change the equations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from symgen.errors import SceneError
from symgen.scene.loading import NAMED, SceneText, by_name, check_scene

if TYPE_CHECKING:
    from symgen.runtime.elastic.model import ElasticModel
    from symgen.runtime.model.compiled import Compiled


def split(text: SceneText, changes: Mapping[str, Any]) -> tuple[dict[str, str], dict[str, Any]]:
    """Divide the changes into those of tunable parameters and those that change the equations."""
    changes = by_name(text, changes)
    parameters, inputs = (text.data.get(table) or {} for table in NAMED)
    tunable = {}
    for name, value in changes.items():
        table = parameters.get(name) if isinstance(parameters, Mapping) else None
        is_input = isinstance(inputs, Mapping) and name in inputs
        if is_input or (isinstance(table, Mapping) and table.get("tunable") is True):
            from symgen.scene.units import is_quantity

            if is_quantity(str(value)):
                tunable[name] = str(value)
    return tunable, {k: v for k, v in changes.items() if k not in tunable}


def check_values(text: SceneText) -> None:
    """Check a scene with other values of its tunable parameters as if they were written in it."""
    from symgen.scene.resolve import resolve

    resolve(check_scene(text))


def in_si(model: Compiled | ElasticModel, values: Mapping[str, str], file: str) -> dict[str, float]:
    """Return values of tunable parameters in SI units; raise SceneError for one with another unit."""
    from symgen.scene.units import describe, describe_unit, parse_quantity, without_angles

    result = {}
    for info in model.description.tunable:
        if info.name in values:
            try:
                number, dimension = parse_quantity(values[info.name])
                if dimension.unit != without_angles(info.unit):
                    wanted, got = describe_unit(info.unit), describe(dimension)
                    raise SceneError(f"expected {wanted}, got {values[info.name]!r}, {got}")
            except SceneError as error:
                table = "inputs" if info.name in getattr(model.description, "inputs", ()) else "parameters"
                raise error.located(where=f"{table}.{info.name}", file=file) from None
            result[info.name] = float(number)
    return result


def of_user(model: Compiled, values: Mapping[str, Any], file: str) -> dict[str, Any]:
    """Return values of parameters of a user's System in SI units: numbers are in those already.

    Raises
    ------
    SceneError
        For a quantity of another unit than the parameter has.
    """
    from symgen.scene.units import parse_quantity

    units = {info.name: info.unit for info in model.description.tunable}
    result: dict[str, Any] = {}
    for name, value in values.items():
        try:
            result[name] = float(value)
        except (TypeError, ValueError):
            result[name] = value
        if not isinstance(result[name], str) or name not in units:
            continue
        try:
            number, dimension = parse_quantity(value)
            size, expected = parse_quantity(f"1 {units[name]}")
        except SceneError as error:
            raise error.located(where=name, file=file) from None
        if dimension != expected:
            raise SceneError(f"expected {units[name]}, got {value!r}", where=name, file=file)
        result[name] = float(number / size)
    return result
