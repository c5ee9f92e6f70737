"""Description of results in files: fields with their types, and arrays with their shapes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    StringConstraints,
    ValidationError,
    create_model,
    model_validator,
)

from symgen.errors import CONTROL, shown
from symgen.runtime.arrays import Array

Text = Annotated[str, StringConstraints(pattern=f"^[^{CONTROL}]*$")]
Interval = tuple[float, float]
Size = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Motion = dict[str, dict[str, float | str | list[float]]]


class _Part(BaseModel):
    """Part of a result: unknown fields are errors."""

    model_config = ConfigDict(strict=True, extra="forbid")


class _Drift(_Part):
    constraint: float = 0.0
    velocity: float = 0.0
    energy: float = 0.0
    energy_exchanged: float = 0.0

    @model_validator(mode="after")
    def _of_energy(self) -> _Drift:
        if len(self.model_fields_set & {"energy", "energy_exchanged"}) == 1:
            raise ValueError("expected both energy and energy_exchanged")
        return self


class _Event(_Part):
    name: Text
    time: float
    rising: bool
    motion: Motion


class _Provenance(_Part, extra="allow"):
    method: Text
    backend: Text = ""
    parameters: dict[str, float] = {}


class _Pose(_Part):
    kind: Text
    t: float
    drives: dict[str, float]
    positions: dict[str, list[float]]
    collinear: list[tuple[str, str]]
    units: dict[str, Text]


class _Pole(_Part):
    at: float
    residues: dict[str, float]


class _Statistics(_Part, extra="allow"):
    """Statistics of every kind of result; those of one kind are required there."""

    t: float = 0.0
    steps: int = 0
    rejected: int = 0
    evaluations: int = 0
    factorisations: int = 0
    wall_s: float = 0.0
    singular_poses: list[_Pose] = []


class _OfMotion(_Statistics):
    unassemblable: list[Interval]
    out_of_reach: list[Interval]


class _OfForces(_OfMotion):
    elements: int
    condition: float
    worst_at: Text
    residual: float


class _OfLoop(_Statistics):
    input: Text
    closure: float
    least_singular: float
    wall_s: float
    poles: list[_Pole]
    undetermined: dict[str, list[tuple[int, int]]]


class _OfElastic(_Statistics):
    steps: int
    wall_s: float
    error: float | None
    mesh_error: float | None
    floquet: list[tuple[float, float]]
    floquet_error: float | None


class _OfSpeeds(_Statistics):
    first_critical: float
    floquet_errors: list[float | None]
    error: float


class _Fields(_Part):
    """Fields of every kind of result."""

    symgen_result: int
    symgen_version: str
    kind: str
    name: Text
    title: Text
    axes: Annotated[list[Literal["x", "y", "z"]], Field(min_length=2, max_length=3)]
    coordinate: tuple[Text, Text, Text]
    drift: _Drift
    final: Motion
    statistics: _Statistics
    notes: list[Text]
    provenance: _Provenance
    events: list[_Event]
    variables: list[tuple[Text, Text, Text, list[str]]]
    units: dict[str, tuple[Text, Size]]


#: Fields by the kind of result.
_OF_KIND = {
    kind: create_model(f"_Fields_{kind}", __base__=_Fields, statistics=(statistics, ...))
    for kind, statistics in {
        "run": _Statistics,
        "kinematics": _OfMotion,
        "forces": _OfForces,
        "loop": _OfLoop,
        "elastic": _OfElastic,
        "speed_response": _OfSpeeds,
    }.items()
}


def fields(text: str) -> dict[str, Any]:
    """Return the fields of a result in JSON, checked.

    Raises
    ------
    ValueError
        With the first field that is missing or wrong.
    """
    data: dict[str, Any] = json.loads(text)
    kind = data.get("kind")
    if kind not in _OF_KIND:
        raise ValueError(f"kind: expected one of {', '.join(_OF_KIND)}, got {shown(kind)}")
    try:
        _OF_KIND[kind].model_validate_json(text)
    except ValidationError as error:
        fault = error.errors()[0]
        field = ".".join(map(str, fault["loc"]))
        raise ValueError(f"{field}: {fault['msg'].lower()}, got {shown(fault['input'])}") from None
    return data


def check_arrays(data: Mapping[str, Any], arrays: Mapping[str, Array]) -> None:
    """Check the arrays of a result against its fields.

    Raises
    ------
    ValueError
        With the first array that is missing, superfluous or of another type or shape.
    """
    along, axes = data["coordinate"][0], data["axes"]
    outputs = {name: components for name, _, _, components in data["variables"]}
    if len(outputs) < len(data["variables"]) or along in outputs:
        raise ValueError("variables: two outputs have the same name")
    for name in (along,) if data["kind"] == "speed_response" else (along, "time"):
        if name not in arrays:
            raise ValueError(f"coordinate: there is no array {name!r}")
    count = len(arrays[along]) if arrays[along].ndim else 0
    shapes = {along: (count,), "time": (count,)} | {
        name: (count, len(axes)) if components else (count,) for name, components in outputs.items()
    }
    for name, array in arrays.items():
        if name not in shapes:
            raise ValueError(f"there is an array {name!r} without a description")
        if array.dtype.kind != "f" or array.dtype.itemsize != 8:
            raise ValueError(f"{name}: expected numbers of type float64, got {array.dtype}")
        if array.shape != shapes[name]:
            raise ValueError(f"{name}: expected the shape {shapes[name]}, got {array.shape}")
    for name, components in outputs.items():
        if name not in arrays:
            raise ValueError(f"variables: there is no array {name!r}")
        if components and components != axes:
            raise ValueError(f"variables: expected components {axes} of {name}, got {components}")
    _check_statistics(data, count, outputs)


def _check_statistics(data: Mapping[str, Any], count: int, outputs: Mapping[str, Any]) -> None:
    """Check statistics with a value per sample."""
    statistics = data["statistics"]
    for name, ranges in statistics.get("undetermined", {}).items():
        if not all(0 <= first <= last < count for first, last in ranges):
            raise ValueError(f"statistics.undetermined.{name}: expected ranges of {count} samples")
    if data["kind"] == "speed_response":
        if len(statistics["floquet_errors"]) != count:
            raise ValueError(f"statistics.floquet_errors: expected {count} values")
        if "floquet" not in outputs or not any(name.endswith(".stress") for name in outputs):
            raise ValueError("variables: expected the outputs floquet and LINK.stress")
