"""Executors of sweeps: chunks are carried out in processes of the sweep, or by any executor."""

from __future__ import annotations

import os
import pickle
import signal
import threading
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from multiprocessing import connection, get_context, parent_process
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from symgen.errors import CapabilityError, ModelError, SimulationError, SymgenError, shown
from symgen.runtime.arrays import Array
from symgen.runtime.sweeps.designs import Design, Listed
from symgen.version import __version__

if TYPE_CHECKING:
    from symgen.runtime.sweeps.layout import SweepLayout

#: A chunk, as its first run and the run after its last; and its first run with its results.
Span = tuple[int, int]
Chunk = tuple[int, dict[str, NDArray[Any]]]
#: Largest size of the results of all chunks that are submitted at a time [bytes].
_HELD = 2**28
#: Processes that end without a result, one after the other, until the sweep is given up.
_ENDED = 3


def submitted(
    sweep: Any, layout: SweepLayout, spans: Sequence[Span], executor: Any
) -> Generator[Chunk, None, None]:
    """Yield the results of chunks as they are completed, in any order.

    Parameters
    ----------
    executor
        A number of processes; a ``concurrent.futures.Executor``; or anything whose ``get_executor`` returns
        one, such as a ``distributed.Client``.

    Raises
    ------
    ModelError
        For another executor.
    CapabilityError
        Where a process has another version of symgen or other equations.
    SimulationError
        When processes end without a result, or the executor fails.
    """
    design, none = sweep.design, np.zeros((0, len(sweep.design.names)))
    work = packed(replace(sweep, design=Listed(design.names, none), threads=sweep.threads or 1), layout)
    most = max(2, _HELD // (layout.row * max(last - first for first, last in spans))) if spans else 2
    if isinstance(executor, int) and not isinstance(executor, bool) and executor >= 1:
        yield from _in_processes(executor, work, design, spans)
        return
    pool = executor.get_executor() if hasattr(executor, "get_executor") else executor
    if not isinstance(pool, Executor):
        raise ModelError(
            "expected an executor: a number of processes, a concurrent.futures.Executor or a "
            f"distributed.Client, got {shown(executor)}"
        )
    try:
        yield from _by(pool, work, design, spans, most)
    except SymgenError:
        raise
    except Exception as error:  # of the executor: chunks have errors of symgen only
        raise SimulationError(
            f"the executor of the sweep failed: {type(error).__name__}: {error}\n"
            "  Carry the sweep out again: with a file it continues with the missing chunks."
        ) from error


def _in_processes(count: int, work: bytes, design: Design, spans: Sequence[Span]) -> Iterator[Chunk]:
    """Yield the results of chunks from new processes, which are replaced where one ends.

    Each has a pipe of its own. Those of a pool share one with a lock, which stays locked for ever when a
    process is killed while it writes.
    """
    missing, ended = [*reversed(spans)], 0
    workers: dict[Connection, BaseProcess] = {}
    idle: list[Connection] = []
    busy: dict[Connection, Span] = {}
    try:
        while missing or busy:
            while len(workers) < min(count, len(missing) + len(busy)):
                there, process = _started(work)
                workers[there] = process
                idle.append(there)
            while missing and idle:
                there = idle.pop()
                busy[there] = missing.pop()
                with suppress(OSError):  # it has ended, which the wait finds
                    there.send(design.values(*busy[there]))
            for each in connection.wait(busy):
                there = cast("Connection", each)
                span = busy.pop(there)
                try:
                    error, arrays = there.recv()
                except (EOFError, OSError):
                    missing.append(span)
                    there.close()
                    workers.pop(there).join()
                    ended += 1
                    if ended == _ENDED:
                        raise SimulationError(
                            f"{_ENDED} times in a row, a process of the sweep ended without a result: it was "
                            "killed, or had too little memory\n  Take fewer processes or smaller chunks. A "
                            "script starts processes under: if __name__ == '__main__'."
                        ) from None
                    continue
                if error is not None:
                    raise error
                ended = 0
                idle.append(there)
                yield span[0], arrays
    finally:
        for there, process in workers.items():
            process.kill()
            process.join()
            there.close()


def _started(work: bytes) -> tuple[Connection, BaseProcess]:
    """Return a new process, and the end of its pipe here."""
    context = get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=serve, args=(there, work), daemon=True)
    process.start()
    there.close()  # the pipe then ends with the process
    return here, process


def serve(pipe: Connection, work: bytes) -> None:
    """Carry out chunks whose parameters come through a pipe, until it ends; send an error and the results."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process of the sweep ends this one
    _follow()
    while True:
        try:
            rows = pipe.recv()
        except EOFError:
            return
        try:
            pipe.send((None, _chunk(work, rows)))
        except Exception as error:
            pipe.send((error, {}))


def _follow() -> None:
    """End this process when its parent ends, however that does, and not only after its chunk."""
    parent = parent_process()

    def watch() -> None:
        if parent is not None:
            connection.wait([parent.sentinel])
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _by(pool: Executor, work: bytes, design: Design, spans: Sequence[Span], most: int) -> Iterator[Chunk]:
    """Yield the results of chunks from an executor, to which ``most`` of them are submitted at a time.

    A task has the parameter values of its own runs only.
    """
    waiting, running = iter(spans), dict[Future[Any], int]()
    try:
        while True:
            for first, last in waiting:
                running[pool.submit(_chunk, work, design.values(first, last))] = first
                if len(running) >= most:
                    break
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                yield running[future], future.result()
                del running[future]
    finally:
        for future in running:
            future.cancel()


def packed(sweep: Any, layout: SweepLayout) -> bytes:
    """Return a sweep for other processes: its model as a scene with the hash of its equations, no binary."""
    return pickle.dumps((__version__, sweep.model.description.equations, pickle.dumps((sweep, layout))))


@lru_cache(maxsize=4)
def _unpacked(work: bytes) -> tuple[Any, SweepLayout]:
    """Return a sweep whose kernels come from the cache of this machine, or are compiled for its processor."""
    version, equations, inner = pickle.loads(work)  # noqa: S301 - as any executor does
    unpacked: tuple[Any, SweepLayout] | None = None
    if version == __version__:
        unpacked = pickle.loads(inner)  # noqa: S301
    if unpacked is None or equations != unpacked[0].model.description.equations:
        raise CapabilityError(
            f"the equations of a sweep from symgen {version} differ in its worker, which has {__version__}\n"
            "  Install the same version for all workers."
        )
    return unpacked


def _chunk(work: bytes, rows: Array) -> dict[str, NDArray[Any]]:
    """Return the results of the runs of one chunk by their parameters: the task of an executor."""
    sweep, layout = _unpacked(work)
    return sweep.arrays(layout, rows)


def dask_client(address: str) -> Any:
    """Return a client of the Dask scheduler at an address; raise ModelError if there is none."""
    from symgen.runtime.sweeps.stores import needed

    needed("a Dask cluster", "distributed", extra="dask")
    from distributed import Client

    try:
        return Client(address)
    except (OSError, ValueError, TypeError) as error:
        raise ModelError(f"there is no Dask scheduler at {address!r}: {error}") from None
