"""Samples of many runs, and the dataset that holds them all."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError, check_known
from symgen.runtime.many.reductions import HISTORY, mean_weights, reduced, reductions
from symgen.runtime.result.records import Coordinate, Variable

if TYPE_CHECKING:
    import xarray

    from symgen.runtime.kernels.description import Described
    from symgen.runtime.rods.equilibrium import Equilibrium

Array = NDArray[np.float64]
#: Name of the number of samples of each run, next to reductions.
RECORDED = "recorded"
#: Most runs that a thread takes at a time: progress is reported in these parts.
BLOCK = 32


@dataclass(frozen=True, slots=True)
class Kept:
    """Samples of one run that are kept.

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
    row
        Number of the run, where ``samples`` and ``single`` hold those of a block of runs.
    """

    along: Coordinate | None = None
    times: Array | None = None
    samples: tuple[Variable, ...] = ()
    single: tuple[Variable, ...] = ()
    axes: tuple[str, ...] = ()
    error: str = ""
    row: int | None = None


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
    ) -> Kept:
        """Return the selected outputs of one run, or their reductions, and its drift.

        With ``row``, variables and drift hold those of a block of runs.
        """
        samples = chosen(variables, self.outputs)
        strayed = _drifts(drift)
        if self.reduce is None:
            return Kept(along, times, samples, strayed, axes, row=row)
        if row is not None:
            samples, strayed = (
                tuple(replace(v, values=v.values[row]) for v in block) for block in (samples, strayed)
            )
        if callable(self.reduce):
            single = tuple(replace(v, values=_reduced(self.reduce, v)) for v in samples)
            return Kept(single=(*single, *strayed), axes=axes)
        names = reductions(self.reduce)
        weights = mean_weights(along.values)
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
        done: Sequence[bool],
    ) -> list[Kept | None]:
        """Return what is kept of each run of a block that is done, None for the others."""
        if self.reduce is not None:
            return [
                self(variables, along, times, drift, axes, i) if own else None for i, own in enumerate(done)
            ]
        block = self(variables, along, times, drift, axes)
        return [replace(block, row=i) if own else None for i, own in enumerate(done)]

    def of_block(
        self,
        variables: Sequence[Variable],
        drift: Array,
        axes: tuple[str, ...],
        along: Array,
        reduction: Callable[[Variable, str, Array], Variable],
    ) -> list[Kept]:
        """Return the reductions of runs with samples along their coordinate, (runs, samples) or (samples,).

        ``drift`` is that of the constraints (runs,) [m].
        """
        samples = chosen(tuple(variables), self.outputs)
        size, weights = np.full(len(drift), float(along.shape[-1])), mean_weights(along)
        made = tuple(reduction(v, name, weights) for name in self.names for v in samples)
        single = (*made, *_drifts({"constraint": drift}), _recorded(size))
        return [Kept(single=single, axes=axes, row=i) for i in range(len(drift))]


def _drifts(drift: Mapping[str, float | Array]) -> tuple[Variable, ...]:
    return tuple(
        Variable(f"{name}_drift", unit, f"largest drift of the {name}", (), np.asarray(drift[name]))
        for name, unit in (("constraint", "m"), ("energy", "J"))
        if name in drift
    )


def _recorded(size: Array) -> Variable:
    """Return the number of samples, which is smaller for runs that end at a dead centre or an event."""
    return Variable(RECORDED, "1", "number of samples that the run recorded", (), size)


def at_one_pose(found: Equilibrium, axes: tuple[str, ...], outputs: Sequence[str] | None) -> Kept:
    """Return outputs, positions, ground reactions and stability of an equilibrium."""
    named = {name: (found.units[name], "output", values) for name, values in found.outputs.items()}
    for name, place in found.state.positions.items():
        named.setdefault(f"{name}.position", ("m", "position", place))
    for name, force in found.reactions.items():
        named.setdefault(f"{name}.reaction", ("N", "force of the ground on the linkage", force))
    single = tuple(
        Variable(
            name,
            unit,
            about,
            axes if np.size(v) > 1 else (),
            np.asarray(v).reshape(np.shape(v)[: np.size(v) > 1]),
        )
        for name, (unit, about, v) in named.items()
    )
    stability = Variable(
        "stability", "1", "stable, neutral or unstable", (), np.array(found.stability, dtype=object)
    )
    return Kept(single=(*chosen(single, outputs), stability), axes=axes)


def chosen(variables: tuple[Variable, ...], outputs: Sequence[str] | None) -> tuple[Variable, ...]:
    """Return the variables of some names, all for None."""
    if outputs is None:
        return variables
    named = {v.name: v for v in variables}
    for name in outputs:
        check_known(name, named, "the runs have no output")
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

    count = len(kept)
    model_of = max((k for k in kept if not k.error), key=lambda k: k.along.values.size if k.along else 0)
    along, size = model_of.along, model_of.along.values.size if model_of.along else 0
    places = [None if k.error else _places(k.along, along) for k in kept]
    blocks, whole = list(_blocks(kept)), all(isinstance(p, slice) and p == slice(None) for p in places)
    errors = np.array([k.error for k in kept], dtype=object)
    data: dict[str, Any] = {"error": ("run", errors, {"long_name": "why the run failed"})}
    own = {id(k.along): (k.along, p) for k, p in zip(kept, places, strict=True) if p is not None}
    shared = all(_agree(of_run, along, p) for of_run, p in own.values())
    over = (along.name if shared else "sample",) if along else ()
    for sampled, variables in ((True, model_of.samples), (False, model_of.single)):
        for k, v in enumerate(variables):
            shape = (count, *((size,) if sampled else ()), *((len(v.components),) if v.components else ()))
            values = np.empty(shape, v.values.dtype)
            if not whole:
                values[:] = "" if v.values.dtype == object else np.nan
            for runs, rows, one in blocks:
                if sampled:
                    values[runs, places[runs.start]] = one.samples[k].values[rows]
                else:
                    values[runs] = one.single[k].values[rows]
            dims = ("run", *(over if sampled else ()), *(("axis",) if v.components else ()))
            data[v.name] = (dims, values, {"units": v.unit, "long_name": v.about})
    coordinates: dict[str, Any] = {"run": np.arange(count)}
    if along:
        labels = {"units": along.unit, "long_name": along.about}
        of_runs = [k.along.values if k.along else None for k in kept]
        apart = (("run", *over), _rows(of_runs, places, size))
        coordinates[along.name] = (*((over, along.values) if shared else apart), labels)
    if model_of.times is not None:
        times = _rows([k.times for k in kept], places, size)
        coordinates["time"] = (("run", *over), times, {"units": "s", "long_name": "time"})
    if any("axis" in dims for dims, *_ in data.values()):
        coordinates["axis"] = list(model_of.axes)
    units = {p.name: (p.unit, p.about) for p in description.tunable}
    for name, values in columns.items():
        unit, about = units[name]
        label = name if name not in data and name not in coordinates else f"{name} (parameter)"
        coordinates[label] = ("run", np.array(values), {"units": unit, "long_name": about})
    title = f"{description.title}: {count} runs of {analysis}"
    return xarray.Dataset(data, coords=coordinates, attrs={"title": title})


def _blocks(kept: Sequence[Kept]) -> Iterator[tuple[slice, Any, Kept]]:
    """Yield runs that did not fail, those of a block together, their rows in its samples, and one of them."""
    first = 0
    while first < len(kept):
        one, last = kept[first], first + 1
        if one.row is not None:
            while last < len(kept) and _continues(one, kept[last], last - first):
                last += 1
        if not one.error:
            rows = None if one.row is None else slice(one.row, one.row + last - first)
            yield slice(first, last), rows, one
        first = last


def _continues(one: Kept, other: Kept, runs: int) -> bool:
    """Return whether another run stands behind a run in the same block, by so many rows."""
    same = other.row is not None and other.row == (one.row or 0) + runs
    return same and (other.samples or other.single)[0].values is (one.samples or one.single)[0].values


def _rows(of_runs: Sequence[Array | None], places: Sequence[Any], size: int) -> Array:
    """Return a row of samples per run, with nan where a run has none."""
    rows = np.full((len(of_runs), size), np.nan)
    for i, (values, place) in enumerate(zip(of_runs, places, strict=True)):
        if place is not None:
            rows[i, place] = values
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
