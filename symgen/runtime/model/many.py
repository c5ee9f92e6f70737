"""Many runs of one model in a call: variants of its parameters and starts, in threads, as one dataset."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from types import MethodType
from typing import TYPE_CHECKING, Any, Protocol, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.calls import checked
from symgen.errors import CapabilityError, InitialStateError, ModelError, SimulationError, nearest, shown
from symgen.runtime.result.records import Coordinate, Variable

if TYPE_CHECKING:
    import xarray

    from symgen.runtime.result.state import State
    from symgen.runtime.rods.equilibrium import Equilibrium

Array = NDArray[np.float64]
#: Errors of single runs, which become entries of the dataset; all others end the call.
FAILURES = (SimulationError, InitialStateError)
#: Most runs that a thread takes at a time: progress is reported in these parts.
_BLOCK = 32
#: Arguments of a single run that do not apply to many.
_SINGLE = ("checkpoint", "checkpoint_every", "resume", "through", "state")


class ManyCall(Protocol):
    """Signature of ``model.simulate_many`` and its like."""

    def __call__(
        self,
        parameters: Mapping[str, ArrayLike] | None = None,
        *,
        states: Sequence[State] | None = None,
        outputs: Sequence[str] | None = None,
        reduce: Callable[..., Any] | None = None,
        threads: int | None = None,
        progress: Callable[[float], None] | None = None,
        **arguments: Any,
    ) -> xarray.Dataset:
        """See :class:`ManyRuns`."""


class Many:
    """The analysis NAME of many variants: ``model.NAME_many``, where the model supports NAME."""

    def __init__(self, analysis: str) -> None:
        self.analysis = analysis

        def call(
            model: Any,
            parameters: Mapping[str, ArrayLike] | None = None,
            *,
            states: Any = None,
            outputs: Sequence[str] | None = None,
            reduce: Callable[..., Any] | None = None,
            threads: int | None = None,
            progress: Callable[[float], None] | None = None,
            **arguments: Any,
        ) -> xarray.Dataset:
            runs = _Runs(model, analysis, *_variants(model, parameters or {}, states), arguments)
            return _dataset(runs, _carried_out(runs, outputs, reduce, threads, progress))

        call.__name__ = f"{analysis}_many"
        call.__qualname__ = f"Model.{analysis}_many"
        call.__doc__ = f"Carry out {analysis} for many variants: see :class:`ManyRuns`."
        self.call = checked(call)

    def __get__(self, model: Any, owner: type | None = None) -> ManyCall:
        """Return the bound call; raise CapabilityError where the model does not support the analysis."""
        if model is None:
            return cast("ManyCall", self.call)
        reason = model._refused(self.analysis)
        if reason is not None:
            raise CapabilityError(f"{model.name} does not support {self.analysis}_many: {reason}")
        return MethodType(self.call, model)


class ManyRuns:
    """Analyses of many variants of a model in one call, in several threads.

    Every call takes the arguments of its analysis, which are common to all runs, and those below.

    Parameters
    ----------
    parameters
        Values of tunable parameters by name, in SI units: one number for all runs, or one per run.
    states
        The state in which each run starts, one per run; those of the variants when absent.
    outputs
        Names of the outputs to keep; all when absent.
    reduce
        Called as ``reduce(values, axis=0)`` with the samples of each output, such as ``np.max`` or
        ``np.ptp``; its results are kept in place of the samples.
    threads
        Number of threads; as many as processors when absent. It changes no bit of the results.
    progress
        Called now and then with the completed part of all runs.

    Returns
    -------
    xarray.Dataset
        Outputs over the dimension ``run`` and the coordinate of the analysis, with the parameters as
        coordinates of the runs and the largest drift of each run where it is measured. ``error`` is the
        message of a run that failed, and empty for all others. Outputs of a failed run are nan, as are
        samples that a run did not reach. Every run has the bits of ``model.with_parameters(...)`` and the
        analysis alone.

    Raises
    ------
    ModelError
        For parameters, states and outputs of wrong names or shapes, and arguments that the analysis refuses.
    SimulationError, InitialStateError
        When no run succeeds: the error of the first.
    """

    simulate_many = Many("simulate")
    kinematics_many = Many("kinematics")
    inverse_dynamics_many = Many("inverse_dynamics")
    equilibrium_many = Many("equilibrium")
    periodic_many = Many("periodic")
    quasi_static_many = Many("quasi_static")


def _variants(
    model: Any, parameters: Mapping[str, ArrayLike], states: Any
) -> tuple[dict[str, Array], Sequence[State] | None]:
    """Return the values of each parameter for all runs, and their states; raise ModelError for wrong ones."""
    columns = {name: _values(model, name, given) for name, given in parameters.items()}
    counts = {name: len(values) for name, values in columns.items() if values.ndim}
    if states is not None:
        counts["states"] = len(_states(model, states))
    if not counts:
        raise ModelError("expected a list of values for a parameter, or of states, with one entry per run")
    first, count = next(iter(counts.items()))
    for name, found in counts.items():
        if found != count:
            raise ModelError(f"expected {count} values of {name}, as of {first}, got the shape ({found},)")
    if not count:
        raise ModelError(f"expected at least one run, got the shape (0,) of {first}")
    return {name: np.broadcast_to(values, count) for name, values in columns.items()}, states


def _values(model: Any, name: str, given: ArrayLike) -> Array:
    known = getattr(model, "parameters", {})
    if name not in known:
        raise ModelError(f"{model.name} has no tunable parameter {name!r}. {nearest(name, known)}")
    values = np.asarray(given, dtype=float)
    if values.ndim > 1:
        raise ModelError(
            f"expected one value of {name} per run, or one for all, got the shape {values.shape}"
        )
    wrong = np.flatnonzero(~np.isfinite(values))
    if len(wrong):
        raise ModelError(
            f"expected finite values of {name}, got {values.flat[wrong[0]]:g} for run {wrong[0]}"
        )
    return values


def _states(model: Any, states: Any) -> Sequence[State]:
    from symgen.runtime.result.state import State

    if not isinstance(states, list | tuple):
        raise ModelError(f"expected a list of states, one per run, got {shown(states)}")
    for i, state in enumerate(states):
        if not isinstance(state, State):
            raise ModelError(f"expected a state of {model.name} for run {i}, got {shown(state)}")
    return states


@dataclass(frozen=True, slots=True)
class _Kept:
    """Samples of one run that are kept.

    Attributes
    ----------
    along, times
        The coordinate of its samples, and their times where that is another; None without samples.
    samples, single
        Outputs with a value per sample, and quantities with one value per run.
    axes
        Names of the components of vectors.
    error
        Message of a failed run, which has nothing else.
    """

    along: Coordinate | None = None
    times: Array | None = None
    samples: tuple[Variable, ...] = ()
    single: tuple[Variable, ...] = ()
    axes: tuple[str, ...] = ()
    error: str = ""


@dataclass(frozen=True, slots=True)
class _Runs:
    """An analysis of a model, with the parameters and states of each run and the arguments of all."""

    model: Any
    analysis: str
    columns: Mapping[str, Array]
    states: Sequence[State] | None
    arguments: Mapping[str, Any]

    def __len__(self) -> int:
        return len(self.states) if self.states is not None else len(next(iter(self.columns.values())))

    def variant(self, i: int) -> Any:
        """Return the model of run i."""
        if not self.columns:
            return self.model
        return self.model.with_parameters(**{name: values[i] for name, values in self.columns.items()})

    def kept(self, i: int, outputs: Sequence[str] | None, reduce: Callable[..., Any] | None) -> _Kept:
        """Carry out run i by itself and return its samples; errors are those of the analysis."""
        state = {} if self.states is None else {"state": self.states[i]}
        result = getattr(self.variant(i), self.analysis)(**state, **self.arguments)
        if self.analysis != "equilibrium":
            return _kept(result, outputs, reduce)
        if reduce is not None:
            raise ModelError("equilibrium_many does not accept reduce: an equilibrium has no samples")
        return _at_one_pose(result, self.model.description.shown_axes, outputs)


def _carried_out(
    runs: _Runs,
    outputs: Sequence[str] | None,
    reduce: Callable[..., Any] | None,
    threads: int | None,
    progress: Callable[[float], None] | None,
) -> list[_Kept]:
    """Return the samples of all runs; the first one is alone, since it may compile kernels for all others."""
    wrong = [name for name in _SINGLE if name in runs.arguments]
    if wrong:
        raise ModelError(f"{runs.analysis}_many does not accept {', '.join(wrong)}: it is for single runs")
    if threads is not None and threads < 1:
        raise ModelError(f"expected one thread or more, got {threads}")
    count, workers = len(runs), threads or _processors()
    kept = [_Kept()] * count

    def carry_out(first: int, last: int) -> int:
        for i in range(first, last):
            try:
                kept[i] = runs.kept(i, outputs, reduce)
            except FAILURES as error:
                kept[i] = _Kept(error=str(error))
        return last - first

    done = carry_out(0, 1)
    block = min(_BLOCK, -(-count // (4 * workers)))
    blocks = [(first, min(first + block, count)) for first in range(1, count, block)]
    for finished in _in_threads(carry_out, blocks, workers):
        done += finished
        if progress:
            progress(done / count)
    if all(k.error for k in kept):
        runs.kept(0, outputs, reduce)  # raises the error of the first run
    return kept


def _in_threads(
    task: Callable[[int, int], int], blocks: Sequence[tuple[int, int]], workers: int
) -> Iterator[int]:
    """Yield the results of a task for blocks of runs, as they end; an exception in one of them ends all."""
    if workers == 1:
        yield from (task(*block) for block in blocks)
        return
    with ThreadPoolExecutor(workers) as pool:
        pending = [pool.submit(task, *block) for block in blocks]
        try:
            for future in as_completed(pending):
                yield future.result()
        finally:
            for future in pending:
                future.cancel()


def _processors() -> int:
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def _kept(result: Any, outputs: Sequence[str] | None, reduce: Callable[..., Any] | None) -> _Kept:
    """Return the selected outputs of one result, or their reductions, and its drift."""
    samples = _chosen(result.variables, outputs)
    drift = tuple(
        Variable(
            f"{name}_drift", unit, f"largest drift of the {name}", (), np.array(result.drift.measured[name])
        )
        for name, unit in (("constraint", "m"), ("energy", "J"))
        if name in result.drift.measured
    )
    if reduce is None:
        return _Kept(result.coordinate, result.times, samples, drift, result.axes)
    reduced = tuple(replace(v, values=_reduced(reduce, v)) for v in samples)
    return _Kept(single=(*reduced, *drift), axes=result.axes)


def _at_one_pose(found: Equilibrium, axes: tuple[str, ...], outputs: Sequence[str] | None) -> _Kept:
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
    return _Kept(single=(*_chosen(single, outputs), stability), axes=axes)


def _chosen(variables: tuple[Variable, ...], outputs: Sequence[str] | None) -> tuple[Variable, ...]:
    if outputs is None:
        return variables
    named = {v.name: v for v in variables}
    for name in outputs:
        if name not in named:
            raise ModelError(f"the runs have no output {name!r}. {nearest(name, named)}")
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


def _dataset(runs: _Runs, kept: Sequence[_Kept]) -> xarray.Dataset:
    """Return all runs in one dataset, with nan where a run has no value."""
    import xarray

    count = len(runs)
    model_of = max((k for k in kept if not k.error), key=lambda k: k.along.values.size if k.along else 0)
    along, size = model_of.along, model_of.along.values.size if model_of.along else 0
    places = [None if k.error else _places(k.along, along) for k in kept]
    errors = np.array([k.error for k in kept], dtype=object)
    for i, place in enumerate(places):
        if place is None and not errors[i]:
            errors[i] = "its samples are at other values of the coordinate than those of the other runs"
    data: dict[str, Any] = {"error": ("run", errors, {"long_name": "why the run failed"})}
    over = (along.name,) if along else ()
    for sampled, variables in ((True, model_of.samples), (False, model_of.single)):
        for k, v in enumerate(variables):
            shape = (count, *((size,) if sampled else ()), *((len(v.components),) if v.components else ()))
            values = np.full(shape, "" if v.values.dtype == object else np.nan, v.values.dtype)
            for i, place in enumerate(places):
                if place is not None:
                    values[(i, place) if sampled else i] = (kept[i].samples if sampled else kept[i].single)[
                        k
                    ].values
            dims = ("run", *(over if sampled else ()), *(("axis",) if v.components else ()))
            data[v.name] = (dims, values, {"units": v.unit, "long_name": v.about})
    coordinates: dict[str, Any] = {"run": np.arange(count)}
    if along:
        labels = {"units": along.unit, "long_name": along.about}
        coordinates[along.name] = (along.name, along.values, labels)
    if model_of.times is not None:
        times = np.full((count, size), np.nan)
        for i, place in enumerate(places):
            if place is not None:
                times[i, place] = kept[i].times
        coordinates["time"] = (("run", *over), times, {"units": "s", "long_name": "time"})
    if any("axis" in dims for dims, *_ in data.values()):
        coordinates["axis"] = list(model_of.axes)
    units = {p.name: (p.unit, p.about) for p in runs.model.description.tunable}
    for name, values in runs.columns.items():
        unit, about = units[name]
        label = name if name not in data and name not in coordinates else f"{name} (parameter)"
        coordinates[label] = ("run", np.array(values), {"units": unit, "long_name": about})
    title = f"{runs.model.description.title}: {count} runs of {runs.analysis}"
    return xarray.Dataset(data, coords=coordinates, attrs={"title": title})


def _places(of_run: Coordinate | None, along: Coordinate | None) -> Any:
    """Return the places of the samples of a run among those of the longest run; None where they have none."""
    if of_run is None or along is None:
        return slice(None)
    near = 1e-6 * np.ptp(along.values)  # a sample next to a loss of rank is moved by less
    if of_run.values.size == along.values.size and np.allclose(
        of_run.values, along.values, rtol=0.0, atol=near
    ):
        return slice(None)
    order = np.argsort(along.values, kind="stable")
    at = np.searchsorted(along.values, of_run.values, sorter=order).clip(max=along.values.size - 1)
    places = order[at]
    return places if np.array_equal(along.values[places], of_run.values) else None
