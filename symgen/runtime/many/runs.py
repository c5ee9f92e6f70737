"""Many runs carried out: variants of a model, in threads."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from copy import deepcopy
from dataclasses import dataclass, replace
from threading import Event
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.errors import InitialStateError, ModelError, RangeError, SimulationError, check_tunable, shown
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.evaluate import Kernels
from symgen.runtime.kernels.limits import refusals
from symgen.runtime.many.dataset import BLOCK, CompiledRuns, Keep, KeptSamples, of_one
from symgen.runtime.many.poses import FLOQUET, at_one_pose, ended_early, of_modes, with_notes, with_stability
from symgen.runtime.model.verbs import with_common_axis

if TYPE_CHECKING:
    from symgen.runtime.result.state import State

#: Errors of single runs, which become entries of the dataset; all others end the call.
FAILURES = (SimulationError, InitialStateError, RangeError)
#: Arguments of a single run that do not apply to many.
_SINGLE = ("checkpoint", "checkpoint_every", "resume", "through", "state")


def variants(
    model: Any, parameters: Mapping[str, ArrayLike], states: Any
) -> tuple[dict[str, Array], Sequence[State] | None]:
    """Return the values of each parameter for all runs, and their states; raise ModelError for others."""
    columns = {name: _values(model, name, column) for name, column in parameters.items()}
    counts = {name: len(values) for name, values in columns.items() if values.ndim}
    if states is not None:
        counts["states"] = len(_states(model, states))
    if not counts:
        raise ModelError("expected a list of values for a parameter, or of states, with one entry per run")
    first, count = next(iter(counts.items()))
    for name, length in counts.items():
        if length != count:
            raise ModelError(f"expected {count} values of {name}, as of {first}, got the shape ({length},)")
    if not count:
        raise ModelError(f"expected at least one run, got the shape (0,) of {first}")
    return {name: np.broadcast_to(values, count) for name, values in columns.items()}, states


def _values(model: Any, name: str, sequence: ArrayLike) -> Array:
    known = getattr(model, "parameters", {})
    check_tunable(name, known, model.name)
    values = np.asarray(sequence, dtype=float)
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
    from symgen.runtime.result.state import State, finite

    if not isinstance(states, list | tuple):
        raise ModelError(f"expected a list of states, one per run, got {shown(states)}")
    start = getattr(model, "initial_state", None)
    begin = start() if start is not None and not hasattr(model, "in_space") and states else None
    for i, state in enumerate(states):
        if not isinstance(state, State):
            raise ModelError(f"expected a state of {model.name} for run {i}, got {shown(state)}")
        finite(state)
        if begin is None:
            continue
        for noun, rows, size in (("coordinates", state.q, len(begin.q)), ("rates", state.u, len(begin.u))):
            if len(rows) != size:
                raise ModelError(f"expected {size} {noun} of {model.name} for run {i}, got {len(rows)}")
    return states


def parameters_of_runs(
    kernels: Kernels, columns: Mapping[str, Array], states: Sequence[State] | None
) -> Array:
    """Return the parameters of each run, (runs, parameters)."""
    count = len(next(iter(columns.values()))) if states is None else len(states)
    rows = np.tile(kernels.parameter_values, (count, 1))
    names = [p.name for p in kernels.description.tunable]
    for name, values in columns.items():
        rows[:, names.index(name)] = values
    return rows


def is_stored(kernels: Kernels, rows: Array, states: object) -> NDArray[np.bool_]:
    """Return a flag for each run: true with the parameters of the scene, whose start is stored."""
    stored: NDArray[np.bool_] = np.all(rows == [p.default for p in kernels.description.tunable], axis=1)
    return stored & (states is None)


@dataclass(frozen=True, slots=True)
class Runs:
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

    def refused(self) -> dict[int, str]:
        """Return the reasons why parameters of runs are refused, by the number of the run."""
        if not self.columns:
            return {}
        model, count = self.model, len(self)
        rows = [self.columns.get(name, np.full(count, value)) for name, value in model.parameters.items()]
        return refusals(model.description, model.library, np.column_stack(rows))

    def driven(self) -> CompiledRuns | None:
        """Return the runs in lanes, if they are of a driven linkage."""
        driven = self.analysis in ("kinematics", "inverse_dynamics")
        return self.model._driven_runs(self) if driven else None

    def result(self, i: int) -> Any:
        """Carry out run i by itself; errors are those of the analysis."""
        model, state = self.variant(i), {} if self.states is None else {"state": self.states[i]}
        analysis = getattr(model, self.analysis)
        if self.analysis in ("kinematics", "inverse_dynamics"):
            analysis = with_common_axis(model, self.analysis)
        return analysis(**state, **with_own_controller(self.arguments))

    def record_of(self, result: Any, keep: Keep) -> KeptSamples:
        """Return the samples of a result that are kept."""
        if self.analysis in ("equilibrium", "modes"):
            if keep.reduce is not None:
                raise ModelError(f"{self.analysis}_many does not accept reduce: a pose has no samples")
            if self.analysis == "modes":
                return of_modes(result, keep.outputs)
            return at_one_pose(result, self.model.description.shown_axes, keep.outputs)
        periodic = self.analysis == "periodic"
        if periodic and keep.outputs is not None:  # which has it in any case, and no samples of it
            keep = replace(keep, outputs=[name for name in keep.outputs if name != FLOQUET])
        measured = {name: np.array([value]) for name, value in result.drift.measured.items()}
        early = self._early(result)
        variables = of_one(result.variables)
        record = keep(variables, result.coordinate, result.times, measured, result.axes, early=early)
        if periodic:
            record = with_stability(record, result.statistics)
        return with_notes(record, result.notes) if result.NOTED_IN_MANY else record

    def _early(self, result: Any) -> list[str] | None:
        """Return why a run ended early, None where runs of this kind cannot: see :class:`Keep`."""
        ending = [e.name for e in getattr(self.model.description, "events", ()) if e.ends_run]
        if result.KIND not in ("kinematics", "forces"):
            return [ended_early(result, ending)] if ending else None
        all_values = self.arguments.get("at") is not None or self.arguments.get("over") == "input"
        return ["" if all_values else ended_early(result, ())]


def with_own_controller(arguments: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return arguments of a run with a copy of their controller, whose memory other runs do not change.

    Plain functions are not copied. Raise ModelError for an object that cannot be.
    """
    controller = arguments.get("controller")
    if controller is None:
        return arguments
    try:
        return {**arguments, "controller": deepcopy(controller)}
    except Exception as error:
        raise ModelError(
            "each of many runs takes a copy of the controller as it is before the first, and "
            f"copy.deepcopy of {shown(controller)} fails: {error}\n"
            "  Give its class a method __deepcopy__, or carry out single runs."
        ) from error


def carried_out(
    runs: Runs,
    keep: Keep,
    threads: int | None,
    progress: Callable[[float], None] | None,
    *,
    some: bool = True,
    accepted: bool = False,
) -> tuple[list[KeptSamples], str]:
    """Return the samples of all runs; where ``some`` must succeed and none does, raise the first error.

    Also return why runs are not in SIMD lanes, '' where they are or no runs of this kind could be.

    The runs up to the first that succeeds are carried out one after the other: it may compile kernels for all
    others, and wrong arguments are refused there. Those of driven linkages need it only for arguments that
    were not ``accepted`` by another call.
    """
    wrong = [name for name in _SINGLE if name in runs.arguments]
    if wrong:
        raise ModelError(f"{runs.analysis}_many does not accept {', '.join(wrong)}: it is for single runs")
    if threads is not None and threads < 1:
        raise ModelError(f"expected one thread or more, got {threads}")
    results: list[KeptSamples] = []
    result, failed, driven = None, None, runs.driven() if accepted else None
    while not driven and result is None and len(results) < len(runs):
        try:
            result = runs.result(len(results))
            results.append(runs.record_of(result, keep))
        except FAILURES as error:
            failed = failed or error
            results.append(KeptSamples(error=str(error)))
        if progress:
            progress(len(results) / len(runs))
    if failed and result is None:
        if some:
            raise failed
        return results, ""
    finished_runs, count, workers = len(results), len(runs), threads or _processors()
    results += [KeptSamples()] * (count - finished_runs)
    found = driven or runs.model._compiled_runs(runs, result)
    compiled, reason = (None, found) if isinstance(found, str) else (found, found.reason)
    ended = Event()
    refused = runs.refused()

    def carry_out(first: int, last: int) -> int:
        blocks = compiled(first, last, keep) if compiled else [None] * (last - first)
        for i, one in enumerate(blocks, first):
            if i in refused:
                results[i] = KeptSamples(error=f"{runs.model.name}: {refused[i]}")
                continue
            if one is not None:
                results[i] = one
                continue
            if ended.is_set():
                break
            try:
                results[i] = runs.record_of(runs.result(i), keep)
            except FAILURES as error:
                results[i] = KeptSamples(error=str(error))
        return last - first

    grain = compiled.grain if compiled else 1
    most = compiled.most(keep) if compiled else BLOCK
    share = count if workers == 1 else max(1, count // (4 * workers))
    block = grain * -(-min(most, share) // grain)
    blocks = [(first, min(first + block, count)) for first in range(finished_runs, count, block)]
    for finished in _in_threads(carry_out, blocks, workers, ended):
        finished_runs += finished
        if progress:
            progress(finished_runs / count)
    return results, reason


def _in_threads(
    task: Callable[[int, int], int], blocks: Sequence[tuple[int, int]], workers: int, ended: Event
) -> Iterator[int]:
    """Yield the results of a task for blocks of runs, as they end; an exception in one of them ends all.

    ``ended`` is set before the blocks in hand are waited for.
    """
    if workers == 1:
        yield from (task(*block) for block in blocks)
        return
    with ThreadPoolExecutor(workers) as pool:
        pending = [pool.submit(task, *block) for block in blocks]
        try:
            for future in as_completed(pending):
                yield future.result()
        finally:
            ended.set()
            for future in pending:
                future.cancel()


def _processors() -> int:
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1
