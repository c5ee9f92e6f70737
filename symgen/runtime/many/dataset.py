"""Samples of many runs, and the dataset that holds them all."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from symgen.errors import ModelError
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.many.reductions import HISTORY, mean_weights, reduced, reductions
from symgen.runtime.result.records import Coordinate, Variable, by_owner, found, unknown

if TYPE_CHECKING:
    import xarray

    from symgen.runtime.kernels.description import Described

#: Name of the number of samples of each run, next to reductions.
RECORDED = "recorded"
#: Behind the name of a parameter that is also that of an output.
PARAMETER = " (parameter)"
#: Name of the reasons why runs ended early.
EARLY = "ended_early"
#: Most runs that a thread takes at a time: progress is reported in these parts.
BLOCK = 32


@dataclass(frozen=True, slots=True)
class KeptSamples:
    """Samples that are kept of one run, or of a block of runs, which share the record.

    Attributes
    ----------
    along, times
        The coordinate of its samples, and their times, (samples,) or (runs, samples), if these are not the
        coordinate; None without samples.
    samples, single
        Outputs with a value per sample, and quantities with one value per run: a row for each run.
    axes
        Names of the components of vectors.
    error
        Message of a failed run, which has nothing else.
    runs
        Increasing numbers of the runs of a block.
    """

    along: Coordinate | None = None
    times: Array | None = None
    samples: tuple[Variable, ...] = ()
    single: tuple[Variable, ...] = ()
    axes: tuple[str, ...] = ()
    error: str = ""
    runs: Indices | None = None


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

    def takes(self, variable: Variable) -> bool:
        """Return whether an output, or a component of it, is selected by its name."""
        return self.outputs is None or not {*variable.names}.isdisjoint(self.outputs)

    def within(self, variables: Iterable[Variable]) -> bool:
        """Return whether names are given, and all are those of outputs, or components, among some."""
        names = {*(self.outputs or ())}
        return bool(names) and len(found(variables, names)) == len(names)

    def __call__(
        self,
        variables: Sequence[Variable],
        along: Coordinate,
        times: Array | None,
        drift: Mapping[str, Array],
        axes: tuple[str, ...],
        runs: Indices | None = None,
        reduction: Callable[[Variable, str, Array], Variable] = reduced,
        early: Sequence[str] | None = None,
    ) -> KeptSamples:
        """Return the selected outputs of one or more runs, or their reductions, and their drift (runs,).

        Outputs are (runs, samples, ...). Where names of reductions are given, the coordinate may be (runs,
        samples), and ``reduction`` may be one of other values than all samples. ``early`` has the reason why
        each run ended before its range, or an empty text; None where none can.
        """
        samples, single = chosen(tuple(variables), self.outputs), _drifts(drift)
        if early is not None:
            about = "why the run ended before its range; empty where it did not"
            single = (*single, Variable(EARLY, "", about, (), np.array(early, dtype=object)))
        if self.reduce is None:
            return KeptSamples(along, times, samples, single, axes, runs=runs)
        if callable(self.reduce):
            per_run = tuple(v.of(_reduced(self.reduce, v)) for v in samples)
            return KeptSamples(single=(*per_run, *single), axes=axes, runs=runs)
        names, weights = reductions(self.reduce), mean_weights(along.values, times)
        per_run = tuple(reduction(v, name, weights) for name in names if name != HISTORY for v in samples)
        count = np.full(1 if runs is None else len(runs), float(along.values.shape[-1]))
        recorded = Variable(RECORDED, "1", "number of samples that the run recorded", (), count)
        single = (*per_run, *single, recorded)
        if HISTORY in names:
            return KeptSamples(along, times, samples, single, axes, runs=runs)
        return KeptSamples(single=single, axes=axes, runs=runs)


class CompiledRuns(Protocol):
    """Many runs of a model that compiled code carries out, some of them in a call."""

    @property
    def grain(self) -> int:
        """Number of runs that fill all lanes."""

    @property
    def reason(self) -> str:
        """Why runs are not in SIMD lanes; '' where they are."""

    def most(self, keep: Keep) -> int:
        """Return the number of runs of one call."""

    def __call__(self, first: int, last: int, keep: Keep) -> list[KeptSamples | None]:
        """Carry out some runs; None stands for those that are to be carried out singly."""


def of_one(variables: Iterable[Variable]) -> tuple[Variable, ...]:
    """Return variables of one run with the axis of runs."""
    return tuple(v.of(v.values[None]) for v in variables)


def _drifts(drift: Mapping[str, Array]) -> tuple[Variable, ...]:
    return tuple(
        Variable(f"{name}_drift", unit, f"largest drift of the {name}", (), drift[name])
        for name, unit in (("constraint", "m"), ("energy", "J"))
        if name in drift
    )


def chosen(variables: tuple[Variable, ...], outputs: Sequence[str] | None) -> tuple[Variable, ...]:
    """Return the variables of some names, components, or points and links; all for None."""
    if outputs is None:
        return variables
    named = by_owner(variables, outputs)
    for name, outputs_of in named.items():
        if not outputs_of:
            raise ModelError(
                f"the runs have no output {name!r}. {unknown(name, variables)}\n"
                "  Each analysis has its own: kinematics positions and angles, inverse_dynamics forces, "
                "simulate those under [analysis] outputs."
            )
    return tuple({v.name: v for outputs_of in named.values() for v in outputs_of.values()}.values())


def _reduced(reduce: Callable[..., Any], variable: Variable) -> Array:
    _, *shape = variable.values.shape
    results = np.empty((len(variable.values), *shape[1:]))
    for i, samples in enumerate(variable.values):
        values = np.asarray(reduce(samples, axis=0), dtype=float)
        if values.shape != samples.shape[1:]:
            raise ModelError(
                f"expected reduce to return the shape {samples.shape[1:]} for the samples of "
                f"{variable.name}, of shape {samples.shape}, got the shape {values.shape}"
            )
        results[i] = values
    return results


def dataset_of(
    description: Described,
    analysis: str,
    columns: Mapping[str, Array],
    records: Sequence[KeptSamples],
    reason: str = "",
) -> xarray.Dataset:
    """Return all runs in one dataset, with nan where a run has no value; ``columns`` are their parameters.

    ``reason`` is that for which runs are not in SIMD lanes.
    """
    import xarray

    data, coordinates = arrays_of(description, columns, records)
    title = f"{description.title}: {len(records)} runs of {analysis}"
    notes = {"notes": f"runs are not in SIMD lanes: {reason}"} if reason else {}
    return xarray.Dataset(data, coords=coordinates, attrs={"title": title, **notes})


def arrays_of(
    description: Described, columns: Mapping[str, Array], records: Sequence[KeptSamples]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the data and the coordinates of a dataset of all runs, as dimensions, values and attributes."""
    count, errors = len(records), np.full(len(records), "", dtype=object)
    blocks: list[_Block] = []
    for block in _shared(records):
        errors[block.runs] = block.one.error
        if not block.one.error:
            blocks.append(block)
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
        label = name if name not in data and name not in coordinates else f"{name}{PARAMETER}"
        coordinates[label] = ("run", np.array(values), {"units": unit, "long_name": about})
    return data, coordinates


class _Block(NamedTuple):
    """Neighbouring runs that share a record, and their rows in its values."""

    runs: slice
    rows: slice
    one: KeptSamples


def _shared(records: Sequence[KeptSamples]) -> Iterator[_Block]:
    """Yield neighbouring runs with the same record, together."""
    first = 0
    for _, same in groupby(records, id):
        count, one = sum(1 for _ in same), records[first]
        row = 0 if one.runs is None else int(np.searchsorted(one.runs, first))
        yield _Block(slice(first, first + count), slice(row, row + count), one)
        first += count


def _rows(
    count: int, size: int, blocks: Sequence[_Block], values: Sequence[Array | None], places: Sequence[Any]
) -> Array:
    """Return a row of samples per run, with nan where a run has none."""
    rows = np.full((count, size), np.nan)
    for block, of_runs, place in zip(blocks, values, places, strict=True):
        if of_runs is not None:
            rows[block.runs, place] = of_runs if of_runs.ndim == 1 else of_runs[block.rows]
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


def along_samples(runs: xarray.Dataset, output: str) -> Array:
    """Return the coordinate of the samples, (samples,) or (runs, samples)."""
    samples = runs[output].dims[1]
    names = [str(n) for n in runs.coords if samples in runs[n].dims]
    name = next((n for n in names if n != "time"), "time")
    return np.asarray(runs[name].values, dtype=float)


def times_of_samples(runs: xarray.Dataset) -> Array | None:
    """Return the times of the samples of a run, if they are the same for all."""
    if "time" not in runs.variables:
        return None
    times = np.asarray(runs["time"].values)
    rows = times if times.ndim == 2 else times[None]
    return rows[0] if np.array_equal(rows, np.broadcast_to(rows[0], rows.shape)) else None
