"""Layout of the results of a sweep: the arrays, and how the dataset of some runs fills them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime.many.dataset import PARAMETER

if TYPE_CHECKING:
    import xarray

Array = NDArray[Any]
#: The dimension of histories: the coordinate has a row per run.
SAMPLE = "sample"


@dataclass(frozen=True, slots=True)
class StoredArray:
    """An array over runs: its dimensions and sizes after that of the runs, whether text, and attributes."""

    name: str
    dims: tuple[str, ...]
    sizes: tuple[int, ...]
    text: bool
    attributes: Mapping[str, str]
    coordinate: bool

    def empty(self, count: int) -> Array:
        """Return the values of runs without any: nan, or empty text."""
        shape = (count, *self.sizes)
        return np.full(shape, "", dtype=object) if self.text else np.full(shape, np.nan)


@dataclass(frozen=True, slots=True)
class SweepLayout:
    """Arrays of a sweep, the names of its parameters among them, and the components of vectors."""

    entries: tuple[StoredArray, ...]
    parameters: Mapping[str, str]
    axes: tuple[str, ...]

    @property
    def row(self) -> int:
        """Size of the results of one run [bytes]."""
        return sum(8 * int(np.prod(entry.sizes)) for entry in self.entries)

    def filled(self, rows: Mapping[str, Array], errors: Sequence[str]) -> dict[str, Array]:
        """Return the arrays of runs that all failed, with their parameters and errors."""
        arrays = {entry.name: entry.empty(len(errors)) for entry in self.entries}
        for name, label in self.parameters.items():
            arrays[label] = np.array(rows[name], dtype=float)
        arrays["error"] = np.array(errors, dtype=object)
        return arrays

    def taken(self, arrays: Mapping[str, Any], count: int) -> dict[str, Array]:
        """Return the arrays of some runs from dimensions and values by name.

        Raises
        ------
        ModelError
            When a run has more samples than the first one.
        """
        arrays_of_entries = {}
        for entry in self.entries:
            if entry.name not in arrays:
                arrays_of_entries[entry.name] = entry.empty(count)
                continue
            dims, values = arrays[entry.name][:2]
            if "run" not in dims:
                values = np.broadcast_to(values, (count, *values.shape))
            if values.shape[1:] != entry.sizes:
                values = self._padded(entry, values)
            arrays_of_entries[entry.name] = np.ascontiguousarray(values)
        return arrays_of_entries

    def _padded(self, entry: StoredArray, values: Array) -> Array:
        size = dict(zip(entry.dims, entry.sizes, strict=True)).get(SAMPLE, 0)
        if values.ndim != 1 + len(entry.sizes) or values.shape[1] > size:
            raise ModelError(
                f"a run has {values.shape[1]} samples of {entry.name}, and the first has {size}: histories "
                "have equal lengths\n  Keep reductions only, such as reduce='peak'."
            )
        padded = entry.empty(len(values))
        padded[:, : values.shape[1]] = values
        return padded


def layout_of(dataset: xarray.Dataset, parameters: Sequence[str]) -> SweepLayout:
    """Return the layout of a sweep from the dataset of some of its runs."""
    entries = []
    for name, variable in dataset.variables.items():
        if name in ("run", "axis"):
            continue
        dims = tuple(d if d == "axis" else SAMPLE for d in variable.dims if d != "run")
        sizes = tuple(dataset.sizes[d] for d in variable.dims if d != "run")
        text = variable.dtype == object
        entries.append(
            StoredArray(str(name), dims, sizes, text, dict(variable.attrs), name in dataset.coords)
        )
    labels = {p: p + PARAMETER if p + PARAMETER in dataset.coords else p for p in parameters}
    axes = tuple(str(a) for a in dataset["axis"].values) if "axis" in dataset.variables else ()
    return SweepLayout(tuple(entries), labels, axes)
