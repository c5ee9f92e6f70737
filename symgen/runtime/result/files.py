"""Results read back from files."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
from numpy.lib.npyio import NpzFile

from symgen.calls import checked
from symgen.errors import ResultError
from symgen.runtime.arrays import Array
from symgen.runtime.digest import digest
from symgen.runtime.result.elastic import ElasticResult
from symgen.runtime.result.forces import Forces
from symgen.runtime.result.motion import Motion
from symgen.runtime.result.records import Coordinate, Drift, Event, Variable
from symgen.runtime.result.result import DIGEST, FORMAT, Result
from symgen.runtime.result.speed_response import SpeedResponse
from symgen.runtime.result.stored import check_arrays, fields
from symgen.runtime.result.turn import Turn

#: Classes of results by their kind in files.
_KINDS = {kind.KIND: kind for kind in (Result, Motion, SpeedResponse, ElasticResult, Turn, Forces)}
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
        data = fields(meta)
        check_arrays(data, arrays)
        arrays = {n: array.astype(float, copy=False) for n, array in arrays.items()}
        name, unit, about = data["coordinate"]
        return _KINDS[data["kind"]](
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
            events=tuple(Event(**e) for e in data["events"]),
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
