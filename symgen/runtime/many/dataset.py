"""Samples of many runs, and the dataset that holds them all."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError, nearest
from symgen.runtime.many.reductions import HISTORY, mean_weights, reduced, reductions
from symgen.runtime.result.records import Coordinate, Variable

if TYPE_CHECKING:
    import xarray

    from symgen.runtime.kernels.description import Described

Array = NDArray[np.float64]
#: Name of the number of samples of each run, next to reductions.
RECORDED = "recorded"
#: Most runs that a thread takes at a time: progress is reported in these parts.
BLOCK = 32


@dataclass(frozen=True, slots=True)
class Kept:
    """Samples of one run that are kept, or of a block of runs, which share the record.

    Attributes
    ----------
    along, times
        The coordinate of its samples, and their times if these are not the coordinate; None without samples.
    samples, single
        Outputs with a value per sample, and quantities with one value per run.
    axes
        Names of the components of vectors.
    error
        Message of a failed run, which has nothing else.
    runs
        Increasing numbers of the runs of a block, whose ``samples`` and ``single`` have a row for each.
    """

    along: Coordinate | None = None
    times: Array | None = None
    samples: tuple[Variable, ...] = ()
    single: tuple[Variable, ...] = ()
    axes: tuple[str, ...] = ()
    error: str = ""
    runs: NDArray[np.intp] | None = None


@dataclass(frozen=True, slots=True)
class Keep:
    """Selection of outputs, and their reduction where requested: a function, or names of reductions."""

    outputs: Sequence[str] | None
    reduce: Callable[..., Any] | str | Sequence[str] | None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the reductions; none where samples are kept or a function reduces them."""
        if self.reduce is None or callable(self.reduce):
            return ()
        names = reductions(self.reduce)
        return () if HISTORY in names else names

    def __call__(
        self,
        variables: tuple[Variable, ...],
        along: Coordinate,
        times: Array | None,
        drift: Mapping[str, float | Array],
        axes: tuple[str, ...],
        row: int | None = None,
        runs: NDArray[np.intp] | None = None,
    ) -> Kept:
        """Return the selected outputs of one run, or their reductions, and its drift.

        With ``row``, variables and drift hold those of a block of ``runs``.
        """
        samples = chosen(variables, self.outputs)
        strayed = _drifts(drift)
        if self.reduce is None:
            return Kept(along, times, samples, strayed, axes, runs=runs)
        if row is not None:
            samples, strayed = (
                tuple(replace(v, values=v.values[row]) for v in block) for block in (samples, strayed)
            )
        if callable(self.reduce):
            single = tuple(replace(v, values=_reduced(self.reduce, v)) for v in samples)
            return Kept(single=(*single, *strayed), axes=axes)
        names = reductions(self.reduce)
        weights = mean_weights(along.values, times)
        single = tuple(reduced(v, name, weights) for name in names if name != HISTORY for v in samples)
        strayed = (*strayed, _recorded(np.array(float(along.values.size))))
        if HISTORY in names:
            return Kept(along, times, samples, (*single, *strayed), axes)
        return Kept(single=(*single, *strayed), axes=axes)

    def of_rows(
        self,
        variables: tuple[Variable, ...],
        along: Coordinate,
        times: Array | None,
        drift: Mapping[str, Array],
        axes: tuple[str, ...],
        is_done: Sequence[bool],
        runs: NDArray[np.intp],
    ) -> list[Kept | None]:
        """Return the stored outputs of each completed run of a block, None for the others."""
        if self.reduce is not None:
            return [
                self(variables, along, times, drift, axes, i) if own else None
                for i, own in enumerate(is_done)
            ]
        block = self(variables, along, times, drift, axes, runs=runs)
        return [block if own else None for own in is_done]

    def of_block(
        self,
        variables: Sequence[Variable],
        drift: Array,
        axes: tuple[str, ...],
        along: Array,
        reduction: Callable[[Variable, str, Array], Variable],
        runs: NDArray[np.intp],
        times: Array | None = None,
    ) -> list[Kept]:
        """Return the reductions of runs with samples along their coordinate, (runs, samples) or (samples,).

        ``drift`` is that of the constraints (runs,) [m].
        """
        samples = chosen(tuple(variables), self.outputs)
        size, weights = np.full(len(drift), float(along.shape[-1])), mean_weights(along, times)
        reduced = tuple(reduction(v, name, weights) for name in self.names for v in samples)
        single = (*reduced, *_drifts({"constraint": drift}), _recorded(size))
        return [Kept(single=single, axes=axes, runs=runs)] * len(runs)


def _drifts(drift: Mapping[str, float | Array]) -> tuple[Variable, ...]:
    return tuple(
        Variable(f"{name}_drift", unit, f"largest drift of the {name}", (), np.asarray(drift[name]))
        for name, unit in (("constraint", "m"), ("energy", "J"))
        if name in drift
    )


def _recorded(size: Array) -> Variable:
    """Return the number of samples, which is smaller for runs that end at a dead centre or an event."""
    return Variable(RECORDED, "1", "number of samples that the run recorded", (), size)


def chosen(variables: tuple[Variable, ...], outputs: Sequence[str] | None) -> tuple[Variable, ...]:
    """Return the variables of some names, all for None."""
    if outputs is None:
        return variables
    named = {v.name: v for v in variables}
    for name in outputs:
        if name not in named:
            raise ModelError(
                f"the runs have no output {name!r}. {nearest(name, named)}\n"
                "  Each analysis has its own: kinematics positions and angles, inverse_dynamics forces, "
                "simulate those under [analysis] outputs."
            )
    return tuple(named[name] for name in outputs)


def _reduced(reduce: Callable[..., Any], variable: Variable) -> Array:
    values = np.asarray(reduce(variable.values, axis=0), dtype=float)
    shape = variable.values.shape
    if values.shape != shape[1:]:
        raise ModelError(
            f"expected reduce to return the shape {shape[1:]} for the samples of {variable.name}, of shape "
            f"{shape}, got the shape {values.shape}"
        )
    return values


def dataset_of(
    description: Described, analysis: str, columns: Mapping[str, Array], kept: Sequence[Kept]
) -> xarray.Dataset:
    """Return all runs in one dataset, with nan where a run has no value; ``columns`` are their parameters."""
    import xarray

    data, coordinates = arrays_of(description, columns, kept)
    title = f"{description.title}: {len(kept)} runs of {analysis}"
    return xarray.Dataset(data, coords=coordinates, attrs={"title": title})


def arrays_of(
    description: Described, columns: Mapping[str, Array], kept: Sequence[Kept]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the data and the coordinates of a dataset of all runs, as dimensions, values and attributes."""
    count, errors = len(kept), np.full(len(kept), "", dtype=object)
    blocks: list[_Block] = []
    for runs, one in _shared(kept):
        errors[runs] = one.error
        if not one.error:
            blocks.append(_Block(runs, one))
    model_of = max((b.one for b in blocks), key=lambda k: k.along.values.size if k.along else 0)
    along, size = model_of.along, model_of.along.values.size if model_of.along else 0
    places = [_places(b.one.along, along) for b in blocks]
    whole = sum(b.runs.stop - b.runs.start for b in blocks) == count
    whole &= all(isinstance(p, slice) and p == slice(None) for p in places)
    data: dict[str, Any] = {"error": ("run", errors, {"long_name": "why the run failed"})}
    shared = all(_agree(b.one.along, along, p) for b, p in zip(blocks, places, strict=True))
    over = (along.name if shared else "sample",) if along else ()
    for sampled, variables in ((True, model_of.samples), (False, model_of.single)):
        for k, v in enumerate(variables):
            shape = (count, *((size,) if sampled else ()), *((len(v.components),) if v.components else ()))
            values = np.empty(shape, v.values.dtype)
            if not whole:
                values[:] = "" if v.values.dtype == object else np.nan
            for block, place in zip(blocks, places, strict=True):
                if sampled:
                    values[block.runs, place] = block.one.samples[k].values[block.rows]
                else:
                    values[block.runs] = block.one.single[k].values[block.rows]
            dims = ("run", *(over if sampled else ()), *(("axis",) if v.components else ()))
            data[v.name] = (dims, values, {"units": v.unit, "long_name": v.about})
    coordinates: dict[str, Any] = {"run": np.arange(count)}
    if along:
        labels = {"units": along.unit, "long_name": along.about}
        values_of = [b.one.along.values if b.one.along else None for b in blocks]
        apart = (("run", *over), _rows(count, size, blocks, values_of, places))
        coordinates[along.name] = (*((over, along.values) if shared else apart), labels)
    if model_of.times is not None:
        times = _rows(count, size, blocks, [b.one.times for b in blocks], places)
        coordinates["time"] = (("run", *over), times, {"units": "s", "long_name": "time"})
    if any("axis" in dims for dims, *_ in data.values()):
        coordinates["axis"] = list(model_of.axes)
    units = {p.name: (p.unit, p.about) for p in description.tunable}
    for name, values in columns.items():
        unit, about = units[name]
        label = name if name not in data and name not in coordinates else f"{name} (parameter)"
        coordinates[label] = ("run", np.array(values), {"units": unit, "long_name": about})
    return data, coordinates


class _Block(NamedTuple):
    """Neighbouring runs that did not fail and share a record."""

    runs: slice
    one: Kept

    @property
    def rows(self) -> slice | None:
        """Rows of the runs in the values of the record; None for a record of one run, without rows."""
        if self.one.runs is None:
            return None
        first = int(np.searchsorted(self.one.runs, self.runs.start))
        return slice(first, first + self.runs.stop - self.runs.start)


def _shared(kept: Sequence[Kept]) -> Iterator[tuple[slice, Kept]]:
    """Yield neighbouring runs with the same record, together, and the record."""
    first = 0
    for _, same in groupby(kept, id):
        count = sum(1 for _ in same)
        yield slice(first, first + count), kept[first]
        first += count


def _rows(
    count: int, size: int, blocks: Sequence[_Block], values: Sequence[Array | None], places: Sequence[Any]
) -> Array:
    """Return a row of samples per run, with nan where a run has none."""
    rows = np.full((count, size), np.nan)
    for block, of_runs, place in zip(blocks, values, places, strict=True):
        if of_runs is not None:
            rows[block.runs, place] = of_runs
    return rows


def _places(of_run: Coordinate | None, along: Coordinate | None) -> Any:
    """Return the places of the samples of a run in those of the longest run: equal values, or the first."""
    if of_run is None or along is None or of_run.values.size == along.values.size:
        return slice(None)
    order = np.argsort(along.values, kind="stable")
    at = np.searchsorted(along.values, of_run.values, sorter=order).clip(max=along.values.size - 1)
    places = order[at]
    return places if np.array_equal(along.values[places], of_run.values) else slice(of_run.values.size)


def _agree(of_run: Coordinate | None, along: Coordinate | None, places: Any) -> bool:
    """Return whether a run has the coordinate of the longest run; a loss of rank moves samples a little."""
    if of_run is None or along is None or of_run is along or np.array_equal(of_run.values, along.values):
        return True
    near = 1e-6 * np.ptp(along.values)
    return bool(np.allclose(of_run.values, along.values[places], rtol=0.0, atol=near))
