"""Sweeps as CSV tables: a row per run, a column per parameter and per component of an output."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from symgen.atomic import writable, write_text
from symgen.errors import ModelError
from symgen.runtime.many.reductions import HISTORY

if TYPE_CHECKING:
    import xarray

    from symgen.runtime.many.dataset import Keep

#: Ending of a table of a sweep.
TABLE = ".csv"


def table_at(file: str | os.PathLike[str] | None, keep: Keep) -> Path | None:
    """Return the path of a table, None for another file; raise if it cannot be written."""
    if file is None or Path(file).suffix.lower() != TABLE:
        return None
    if not callable(keep.reduce) and HISTORY in (keep.reduce or ()):
        raise ModelError("a CSV table of a sweep has one row per run: give a .zarr store for 'history'")
    return writable(file, (TABLE,), "table")


def write_table(runs: xarray.Dataset, path: Path) -> None:
    """Write runs with all digits in columns ``NAME [UNIT]``: parameters, outputs, the error.

    Texts of several lines, such as notes, have "; " between these, so that each run is one line of the file.
    """
    text = io.StringIO()
    names, columns = zip(*_columns(runs), strict=True)
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    rows = zip(*(column.tolist() for column in columns), strict=True)
    writer.writerows([_in_one_line(x) if isinstance(x, str) else x for x in row] for row in rows)
    write_text(path, text.getvalue())


def _in_one_line(text: str) -> str:
    return "; ".join(line.strip() for line in text.splitlines())


def _columns(runs: xarray.Dataset) -> Iterator[tuple[str, Any]]:
    yield "run", runs["run"].values if "run" in runs.coords else np.arange(runs.sizes["run"])
    names = [n for n in (*runs.coords, *runs.data_vars) if n not in ("run", "axis", "error")]
    for name in (*names, "error"):
        variable = runs[name]
        unit = f" [{variable.attrs['units']}]" if variable.attrs.get("units") else ""
        if variable.dims == ("run",):
            yield f"{name}{unit}", variable.values
        elif variable.dims == ("run", "axis"):
            for axis in runs["axis"].values:
                yield f"{name}.{axis}{unit}", variable.sel(axis=axis).values
