"""Sweeps: runs of a design in chunks, from the first missing one on."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from symgen.atomic import writable
from symgen.errors import ArgumentError, CapabilityError, ModelError, ResultError, check_tunable, nearest
from symgen.runtime.many.dataset import Keep, arrays_of, chosen, dataset_of
from symgen.runtime.many.poses import FLOQUET
from symgen.runtime.many.reductions import reductions
from symgen.runtime.many.runs import FAILURES, Runs, carried_out, variants
from symgen.runtime.model.verbs import accepted
from symgen.runtime.result.records import attributes_of
from symgen.runtime.sweeps.designs import Design
from symgen.runtime.sweeps.executors import Chunk, submitted
from symgen.runtime.sweeps.layout import SweepLayout, layout_of
from symgen.runtime.sweeps.starts import notes_on_starts
from symgen.runtime.sweeps.stores import DONE, ENDING, MemoryStore, Zarr, needed
from symgen.runtime.sweeps.tables import TABLE, table_at, write_table
from symgen.version import __version__

if TYPE_CHECKING:
    import xarray

Array = NDArray[Any]
#: Analyses that a sweep carries out.
ANALYSES = (
    "simulate", "kinematics", "inverse_dynamics", "equilibrium", "modes", "periodic", "quasi_static"
)  # fmt: skip
#: Analyses of one pose, whose runs have no samples to reduce.
OF_A_POSE = ("equilibrium", "modes")
#: Most runs of a chunk.
_RUNS = 1024
#: Most bytes of the results of a chunk.
_BYTES = 2**23
#: Largest size of results in memory [bytes].
_HELD = 2**32
#: Chunks of a sweep of any size.
_CHUNKS = 64
#: Fewest runs of a chunk.
_LEAST = 64
#: Multiple of runs that fills SIMD lanes.
_LANES = 8
#: Runs that are tried for the layout of the results where the model's own parameters fail.
_TRIED = 64
#: Most runs of an estimate.
_TIMED = 1024
#: Time after which an estimate ends [s].
_PATIENCE = 0.5


@dataclass(frozen=True, slots=True)
class Sweep:
    """A design of runs of one analysis, with the outputs and reductions of each.

    Attributes
    ----------
    keep
        Selected outputs and their reductions.
    arguments
        Arguments of the analysis, common to all runs.
    threads
        Number of threads; all processors when absent.
    """

    model: Any
    analysis: str
    design: Design
    keep: Keep
    arguments: Mapping[str, Any]
    threads: int | None = None

    @property
    def attributes(self) -> dict[str, str]:
        """Attributes of the dataset."""
        title = f"sweep of {self.analysis.replace('_', ' ')}, {self.design.count} runs"
        return attributes_of(self.model.description, title)

    @property
    def identity(self) -> str:
        """Hash of everything that decides the results: equations, parameters, analysis, design."""
        parts = {
            "version": __version__,
            "equations": self.model.description.equations,
            "parameters": dict(self.model.parameters),
            "analysis": [self.analysis, {k: _plain(v) for k, v in sorted(self.arguments.items())}],
            "keep": [self.keep.outputs, self.keep.reduce],
            "design": self.design.identity,
        }
        return hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()

    def layout(self) -> SweepLayout:
        """Return the layout of the results: with the model's parameters, or of the first run that succeeds.

        Raises
        ------
        ModelError
            For parameters, outputs and arguments that the analysis refuses.
        SimulationError, InitialStateError
            When none of the first runs succeeds: the error of the first.
        """
        values = self.model.parameters
        for name in self.design.names:
            check_tunable(name, values, self.model.name)
        self.check_outputs()
        names = self.design.names
        rows = self.design.values(0, min(_TRIED, self.design.count))
        tried = np.vstack([[values[name] for name in names], rows])
        failure: Exception | None = None
        for row in tried:
            columns = {name: row[i : i + 1] for i, name in enumerate(names)}
            try:
                result, _ = carried_out(self._runs(columns), self.keep, 1, None)
            except FAILURES as error:
                failure = failure or error
                continue
            return layout_of(dataset_of(self.model.description, self.analysis, columns, result), names)
        assert failure is not None  # noqa: S101 - there is one run at least
        raise failure

    def check_outputs(self) -> None:
        """Raise ModelError for unknown outputs of elastic links: a static shape has those of a motion."""
        if not self.keep.outputs or self.analysis not in ("simulate", "periodic"):
            return  # other analyses refuse them after a pose, or after a run that takes no longer
        if "quasi_static" in self.model.capabilities:
            with suppress(*FAILURES):
                shape = self.model.quasi_static(samples=2)
                chosen(shape.variables, [name for name in self.keep.outputs if name != FLOQUET])

    def _runs(self, columns: Mapping[str, Array]) -> Runs:
        return Runs(self.model, self.analysis, *variants(self.model, columns, None), self.arguments)

    def arrays(
        self, layout: SweepLayout, rows: Array, progress: Callable[[float], None] | None = None
    ) -> dict[str, Array]:
        """Return the results of runs with values of the parameters, (runs, parameters)."""
        columns = {name: rows[:, i] for i, name in enumerate(self.design.names)}
        runs = self._runs(columns)  # the layout has accepted the arguments
        results, _ = carried_out(runs, self.keep, self.threads, progress, some=False, accepted=True)
        if all(k.error for k in results):
            return layout.filled(columns, [k.error for k in results])
        data, coordinates = arrays_of(self.model.description, columns, results)
        return layout.taken({**data, **coordinates}, len(results))

    def dataset(self) -> xarray.Dataset:
        """Return the results of all runs, of which one succeeds at least, with equal lengths of histories."""
        columns = dict(zip(self.design.names, self.design.values(0, self.design.count).T, strict=True))
        found = carried_out(self._runs(columns), self.keep, self.threads, None)
        return dataset_of(self.model.description, self.analysis, columns, *found)

    def chunk(self, layout: SweepLayout, least: int = _LEAST) -> int:
        """Return the number of runs of a chunk, ``least`` of them where results are small."""
        share = -(-self.design.count // _CHUNKS)
        size = min(_RUNS, max(1, _BYTES // layout.row), max(share, least))
        return size if size < _LANES else size // _LANES * _LANES


def _plain(value: Any) -> Any:
    return np.asarray(value).tolist() if isinstance(value, np.ndarray | np.generic | tuple) else value


def usual_analysis(model: Any) -> str:
    """Return the analysis of sweeps and widgets that name none."""
    elastic = "quasi_static" in model.capabilities  # as of symgen run: inverse dynamics is of rigid links
    in_space = len(getattr(model.description, "shown_axes", ())) == 3  # not in lanes
    preferred = ("simulate",) if elastic or in_space else ("inverse_dynamics", "simulate", "kinematics")
    return next((name for name in preferred if name in model.capabilities), "simulate")


def sweep_of(
    model: Any,
    analysis: str | None,
    design: Design,
    outputs: Sequence[str] | None,
    reduce: str | Sequence[str],
    arguments: Mapping[str, Any],
    threads: int | None,
) -> Sweep:
    """Return a sweep; raise CapabilityError or ModelError for an analysis that cannot be carried out."""
    verb = (analysis or usual_analysis(model)).replace("-", "_")  # as commands are named
    if verb not in ANALYSES:
        supported = [name for name in ANALYSES if name in model.capabilities]
        raise ModelError(f"there are no sweeps of {verb!r}. {nearest(verb, supported or ANALYSES)}")
    if "of" in arguments and verb != "kinematics":
        other = verb.replace("_", " ")
        after = (
            f" names points and links that kinematics records, got a sweep of {other}\n  Sweep kinematics."
        )
        raise ArgumentError("of", before="", after=after, call="Model.sweep")
    getattr(model, verb)  # raises the reason where the model does not support it
    if not hasattr(model.description, "equations"):
        raise CapabilityError(f"{model.name} does not support sweeps")
    if verb == "kinematics" and "of" not in arguments and "of" in accepted(model, verb):
        arguments = {**arguments, **_of_owners(model.description, outputs or ())}
    names = None if verb in OF_A_POSE else reductions(reduce)
    return Sweep(model, verb, design, Keep(outputs, names), dict(arguments), threads)


def _of_owners(d: Any, outputs: Sequence[str]) -> dict[str, list[str]]:
    """Return the argument ``of`` of kinematics for outputs, if it needs one: points, links and corners."""
    corners = {name: name.split(".")[:3] for name in outputs}
    of = {
        name: ".".join(corner) if len(corner) == 3 and {*corner} <= {*d.points} else corner[0]
        for name, corner in corners.items()
    }
    known = {*d.points, *d.links}
    owned = all(owner in known or "." in owner for owner in of.values())
    further = any("." in owner or owner == name for name, owner in of.items())
    return {"of": [*dict.fromkeys(of.values())]} if owned and further else {}


def carry_out(
    sweep: Sweep,
    file: str | os.PathLike[str] | None,
    chunk: int | None,
    part: tuple[int, int],
    progress: Callable[[float], None] | None,
    executor: Any = None,
) -> xarray.Dataset:
    """Carry out the missing chunks of a sweep, or of one part of them; see :meth:`symgen.Model.sweep`."""
    table = check(sweep, file, chunk, part)
    store, layout = _store(sweep, file, chunk, table)
    chunks = _chunks(sweep.design.count, store.chunk, part)
    missing = [span for span in chunks if not store.is_done(span[0])]
    finished = len(chunks) - len(missing)

    def within(part: float) -> None:
        if progress:
            progress((finished + part) / len(chunks))

    results: Generator[Chunk, None, None]
    if executor is None:
        results = (
            (first, sweep.arrays(layout, sweep.design.values(first, last), within)) for first, last in missing
        )
    else:
        results = submitted(sweep, layout, missing, executor)
    kept = list[int]()  # the first runs of chunks that are finished
    try:
        with closing(results):  # which ends the work of an executor when writing or progress fails
            for first, arrays in results:
                store.write(first, arrays)
                kept.append(first)
                finished += 1
                within(0.0)
    except KeyboardInterrupt:
        if not table or not kept:
            raise
        rows = np.concatenate([np.arange(*span) for span in chunks if span[0] in kept])
        write_table(store.dataset().isel(run=rows), table)
        raise KeyboardInterrupt(f"{len(rows)} of {sweep.design.count} runs are in {table}") from None
    if isinstance(store, Zarr) and store.group[DONE][:].all():  # the last part reads the others, once
        for first, _ in {*_chunks(sweep.design.count, store.chunk, (1, 1))} - {*chunks}:
            store.warn_of_damage(first)
    runs = store.dataset()
    if table:
        write_table(runs, table)
    with suppress(KeyboardInterrupt):  # the runs are finished: they are kept without the note
        if notes := "\n".join(notes_on_starts(sweep.model, sweep.analysis, sweep.design, sweep.arguments)):
            runs.attrs["notes"] = notes
    if progress:
        progress(1.0)
    return runs


def check(
    sweep: Sweep, file: str | os.PathLike[str] | None, chunk: int | None, part: tuple[int, int]
) -> Path | None:
    """Raise ModelError or ResultError where results cannot be written; return the path of a table."""
    number, parts = part
    table = table_at(file, sweep.keep)
    if not 1 <= number <= parts:
        raise ModelError(f"expected a part from 1 to {parts}, got {number}")
    if parts > 1 and (file is None or table):
        raise ModelError("parts of a sweep are written to one store: give its file, NAME.zarr")
    if chunk is not None and chunk < 1:
        raise ModelError(f"expected a chunk of one run or more, got {chunk}")
    if file is None or table:
        return table
    if sweep.arguments.get("controller") is not None:
        raise ModelError(
            "a store has the results of one sweep, and cannot know whether a controller is still the same\n"
            "  Sweep without a file, or to a table NAME.csv; or write the law into the scene, without a "
            "controller."
        )
    needed("a sweep in a file", "zarr")
    if Path(file).is_dir() and Path(file).suffix == ENDING:
        _part_of(sweep, Zarr(Path(file)))
    else:
        writable(file, (ENDING, TABLE), "results")
    return None


def _part_of(sweep: Sweep, store: Zarr) -> Zarr:
    """Return a store; raise ResultError if its results are those of another sweep."""
    if store.identity != sweep.identity:
        raise ResultError(
            f"{store.path} has the results of another sweep: other parameters, analysis, outputs or samples\n"
            "  Give another name, or remove it."
        )
    return store


def _chunks(count: int, size: int, part: tuple[int, int]) -> list[tuple[int, int]]:
    """Return the first run of each chunk of a part, and that after its last."""
    number, parts = part
    return [(first, min(first + size, count)) for first in range(0, count, size)][number - 1 :: parts]


def estimate(sweep: Sweep, chunk: int | None, part: tuple[int, int]) -> tuple[int, int, float]:
    """Return the numbers of runs and chunks of a part of a sweep, and its time [s] by that of first runs."""
    layout, count, spent, runs_done = sweep.layout(), sweep.design.count, 0.0, 0
    while runs_done < min(count, _TIMED) and spent < _PATIENCE:
        last = min(2 * runs_done + 1, count)
        begun = perf_counter()
        sweep.arrays(layout, sweep.design.values(runs_done, last))
        spent, runs_done = perf_counter() - begun + spent, last
    chunks = _chunks(count, chunk or sweep.chunk(layout), part)
    runs = sum(last - first for first, last in chunks)
    return runs, len(chunks), spent / runs_done * runs


def _store(
    sweep: Sweep, file: str | os.PathLike[str] | None, chunk: int | None, table: Path | None
) -> tuple[MemoryStore | Zarr, SweepLayout]:
    layout = sweep.layout()
    least = _LANES * (sweep.threads or os.cpu_count() or 1) if table else _LEAST  # an interrupt loses few
    size = chunk or sweep.chunk(layout, least)
    if file is None or table:
        if sweep.design.count * layout.row > _HELD:
            raise ModelError(
                f"the results of {sweep.design.count} runs are too large for memory: take fewer, or give a "
                "sweep a file"
            )
        return MemoryStore(layout, sweep.design.count, size, sweep.attributes), layout
    path = Path(file)
    store = _part_of(sweep, Zarr(path) if path.exists() else Zarr.created(path, layout, sweep, size))
    store.restored(layout, sweep)
    return store, layout
