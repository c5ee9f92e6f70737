"""Many runs carried out: variants of a model, in threads."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.errors import InitialStateError, ModelError, SimulationError, nearest, shown
from symgen.runtime.many.dataset import Kept, at_one_pose, kept_of

if TYPE_CHECKING:
    from symgen.runtime.result.state import State

Array = NDArray[np.float64]
#: Errors of single runs, which become entries of the dataset; all others end the call.
FAILURES = (SimulationError, InitialStateError)
#: Most runs that a thread takes at a time: progress is reported in these parts.
_BLOCK = 32
#: Arguments of a single run that do not apply to many.
_SINGLE = ("checkpoint", "checkpoint_every", "resume", "through", "state")


def variants(
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

    def kept(self, i: int, outputs: Sequence[str] | None, reduce: Callable[..., Any] | None) -> Kept:
        """Carry out run i by itself and return its samples; errors are those of the analysis."""
        state = {} if self.states is None else {"state": self.states[i]}
        result = getattr(self.variant(i), self.analysis)(**state, **self.arguments)
        if self.analysis != "equilibrium":
            return kept_of(result, outputs, reduce)
        if reduce is not None:
            raise ModelError("equilibrium_many does not accept reduce: an equilibrium has no samples")
        return at_one_pose(result, self.model.description.shown_axes, outputs)


def carried_out(
    runs: Runs,
    outputs: Sequence[str] | None,
    reduce: Callable[..., Any] | None,
    threads: int | None,
    progress: Callable[[float], None] | None,
) -> list[Kept]:
    """Return the samples of all runs; the first one is alone, since it may compile kernels for all others."""
    wrong = [name for name in _SINGLE if name in runs.arguments]
    if wrong:
        raise ModelError(f"{runs.analysis}_many does not accept {', '.join(wrong)}: it is for single runs")
    if threads is not None and threads < 1:
        raise ModelError(f"expected one thread or more, got {threads}")
    count, workers = len(runs), threads or _processors()
    kept = [Kept()] * count

    def carry_out(first: int, last: int) -> int:
        for i in range(first, last):
            try:
                kept[i] = runs.kept(i, outputs, reduce)
            except FAILURES as error:
                kept[i] = Kept(error=str(error))
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
