"""Results read back from files, and the description of these: fields with their types, arrays with shapes."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.lib.npyio import NpzFile
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    StringConstraints,
    ValidationError,
    create_model,
    model_validator,
)

from symgen.calls import checked
from symgen.errors import CONTROL, ResultError, shown
from symgen.runtime.arrays import Array
from symgen.runtime.digest import digest
from symgen.runtime.result.elastic import ElasticResult
from symgen.runtime.result.forces import Forces
from symgen.runtime.result.motion import Motion
from symgen.runtime.result.records import Coordinate, Drift, LocatedEvent, Variable
from symgen.runtime.result.result import DIGEST, FORMAT, Result
from symgen.runtime.result.speed_response import SpeedResponse
from symgen.runtime.result.turn import Turn

Text = Annotated[str, StringConstraints(pattern=f"^[^{CONTROL}]*$")]
Interval = tuple[float, float]
Size = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Moved = dict[str, dict[str, float | str | list[float]]]


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
    motion: Moved


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
    final: Moved
    statistics: _Statistics
    notes: list[Text]
    provenance: _Provenance
    events: list[_Event]
    variables: list[tuple[Text, Text, Text, list[str]]]
    units: dict[str, tuple[Text, Size]]


#: Classes of results and their fields, by their kind in files.
_KINDS = {
    kind.KIND: (
        kind,
        create_model(f"_FieldsOf{kind.__name__}", __base__=_Fields, statistics=(statistics, ...)),
    )
    for kind, statistics in {
        Result: _Statistics,
        Motion: _OfMotion,
        Forces: _OfForces,
        Turn: _OfLoop,
        ElasticResult: _OfElastic,
        SpeedResponse: _OfSpeeds,
    }.items()
}
#: Endings of files that are read back.
_READ = (".nc", ".npz")


@checked
def load_result(file: str | os.PathLike[str]) -> Result:
    """Read a result that :meth:`Result.save` wrote.

    Raises
    ------
    ResultError
        When the file is missing, altered or inconsistent, or not a result; the message names the field.
    """
    path = Path(file)
    if path.suffix.lower() not in _READ:
        raise ResultError(f"expected a file ending in {' or '.join(_READ)}, got {path.name!r}")
    try:
        arrays, meta, written = (_read_netcdf if path.suffix.lower() == ".nc" else _read_npz)(path)
        known = json.loads(meta)["symgen_result"]
        if known != FORMAT:
            raise ResultError(f"{path} has result format {known}, this symgen reads {FORMAT}")
        if written not in ("", digest(arrays, meta)):  # files of earlier versions have none
            raise ValueError("its content differs from the content written")
        data = _fields(meta)
        _check_arrays(data, arrays)
        arrays = {n: array.astype(float, copy=False) for n, array in arrays.items()}
        name, unit, about = data["coordinate"]
        return _KINDS[data["kind"]][0](
            name=data["name"],
            title=data["title"],
            axes=tuple(data["axes"]),
            coordinate=Coordinate(name, unit, about, arrays[name]),
            variables=tuple(Variable(n, u, a, tuple(c), arrays[n]) for n, u, a, c in data["variables"]),
            drift=Drift(**data["drift"]),
            final=data["final"],
            statistics=data["statistics"],
            provenance=data["provenance"],
            notes=tuple(data["notes"]),
            events=tuple(LocatedEvent(**e) for e in data["events"]),
            times=arrays.get("time") if name != "time" else None,
            units={of: (shown, size) for of, (shown, size) in data["units"].items()},
        )
    except ResultError:
        raise
    except OSError as error:
        raise ResultError(f"cannot read {path}: {error.strerror or error}") from None
    except Exception as error:  # any fault inside a foreign or broken file
        raise ResultError(f"{path} is not a result of symgen, or is broken: {error}") from error


def _read_netcdf(path: Path) -> tuple[dict[str, Array], str, str]:
    """Return the arrays of a file, its fields in JSON, and its digest."""
    import xarray

    with xarray.open_dataset(path, engine="scipy", decode_cf=False) as dataset:
        arrays = {str(n): np.array(dataset[n].values) for n in dataset.variables if n != "axis"}
        return arrays, dataset.attrs["symgen"], dataset.attrs.get(DIGEST, "")


def _read_npz(path: Path) -> tuple[dict[str, Array], str, str]:
    """Return the same."""
    with path.open("rb") as stream, NpzFile(stream, allow_pickle=False) as stored:
        arrays = {n: stored[n] for n in stored.files}
        return arrays, str(arrays.pop("symgen")), str(arrays.pop(DIGEST, ""))


def _fields(text: str) -> dict[str, Any]:
    """Return the fields of a result in JSON, checked.

    Raises
    ------
    ValueError
        With the first field that is missing or wrong.
    """
    data: dict[str, Any] = json.loads(text)
    kind = data.get("kind")
    if kind not in _KINDS:
        raise ValueError(f"kind: expected one of {', '.join(_KINDS)}, got {shown(kind)}")
    try:
        _KINDS[kind][1].model_validate_json(text)
    except ValidationError as error:
        fault = error.errors()[0]
        field = ".".join(map(str, fault["loc"]))
        raise ValueError(f"{field}: {fault['msg'].lower()}, got {shown(fault['input'])}") from None
    return data


def _check_arrays(data: Mapping[str, Any], arrays: Mapping[str, Array]) -> None:
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
