"""Checkpoints: the whole state of a run in a file; the continued run gives the same bits.

A checkpoint is the memory of the run and of its equations, byte for byte, with the run's records in Python.
It belongs to one run: equations, parameters, start and options, machine and version must be the same. Counts
and indices are checked, so that an altered file cannot make the core read or write elsewhere.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.lib.npyio import NpzFile

from symgen.atomic import replacing
from symgen.errors import ModelError, ResultError
from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.digest import digest
from symgen.runtime.integrate.options import Options
from symgen.runtime.kernels.arguments import is_real
from symgen.runtime.kernels.library import Library

if TYPE_CHECKING:
    from symgen.runtime.kernels.evaluate import Kernels

FORMAT = 2
#: Default wall time [s] between two checkpoints.
EVERY = 10.0


#: Options that the numbers of a run do not depend on.
_OF_NO_RUN = ("method", "max_steps", "otherwise")


def mark_of(
    kernels: Kernels,
    library: Library,
    equations: _core.Integrable,
    chosen: Options,
    t0: float,
    y0: Array,
    *more: object,
) -> str:
    """Return a hash that distinguishes one run of the step loop from another; see :func:`mark_of_kernels`.

    ``more`` are further values that the results depend on.
    """
    method = chosen.method
    options = [getattr(chosen, name) for name in chosen.__slots__ if name not in _OF_NO_RUN]
    counts, numbers = _core.scheme_of(method)
    content = (method.name, method.kind, counts, numbers.tobytes().hex(), options, t0, y0.tobytes().hex())
    return mark_of_kernels(kernels, library, equations, *content, *more)


def mark_of_kernels(kernels: Kernels, library: Library, equations: _core.Integrable, *more: object) -> str:
    """Return a hash of all that a run's numbers depend on: symgen, machine, kernels, parameters, and more.

    ``library`` are the kernels that it goes through.
    """
    from symgen.version import __version__

    content = (
        __version__,
        platform.machine(),
        platform.system(),
        kernels.description.equations,
        library.backend,
        sorted(library.provenance.items()),
        equations.core_type.name,
        kernels.parameter_values.tobytes().hex(),
        *more,
    )
    return hashlib.sha256(repr(content).encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class CheckpointOptions:
    """File of a run's checkpoints, wall time between them [s], and the checkpoint to resume from."""

    file: Path | None
    every: float
    resume: Path | None


class Checkpoints:
    """Where a run, or runs that share a file, leave their state, and how often.

    Parameters
    ----------
    mark
        The hash of the runs by :func:`mark_of_kernels`.
    keeping
        File of the checkpoints, and the one to resume from.

    Attributes
    ----------
    left
        Arrays of the checkpoint to resume from; empty without one.
    spent
        Wall time taken before the runs were resumed [s].

    Raises
    ------
    ResultError
        If the checkpoint to resume from is missing, broken, or of another run.
    """

    def __init__(self, mark: str, keeping: CheckpointOptions) -> None:
        self._mark, self._file, self._every, self._from = mark, keeping.file, keeping.every, keeping.resume
        self.left, self.spent = ({}, 0.0) if keeping.resume is None else stored(keeping.resume, mark)
        self._started = self._written = time.perf_counter()

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Report arrays that are missing, or of other sizes than the run, as a fault of the checkpoint."""
        try:
            yield
        except (KeyError, IndexError, TypeError, ValueError, OverflowError) as error:
            raise ResultError(f"{self._from} is an incomplete checkpoint: {error}") from error

    def due(self, last: bool = False) -> bool:
        """Return whether it is time to write, or the last time to; count from now if it is."""
        now = time.perf_counter()
        if self._file is None or not (last or now - self._written >= self._every):
            return False
        self._written = now
        return True

    def write(self, t: float, arrays: Mapping[str, Any]) -> None:
        """Write a checkpoint at a time [s] of the motion, if there is a file."""
        if self._file is not None:
            store(self._file, self._mark, t, self.spent + time.perf_counter() - self._started, arrays)

    def look(self, run: _core.Run, last: bool = False) -> None:
        """Write a checkpoint of a run of the step loop if it is time, or the last."""
        if self.due(last):
            self.write(run.t, self.content(run))

    def leave(self, run: _core.Run) -> str:
        """Write a checkpoint of a run that is interrupted; return how it continues, '' without a file."""
        self.look(run, last=True)
        return f"the run is in {self._file}: --resume {self._file} continues it" if self._file else ""

    def content(self, run: _core.Run) -> dict[str, Any]:
        """Return the arrays of a checkpoint of such a run."""
        return memory_of(run)


class RunCheckpoints(Checkpoints):
    """Checkpoints of a run of the step loop that has not begun; it is restored if it is to be resumed."""

    def __init__(self, run: _core.Run, mark: str, keeping: CheckpointOptions) -> None:
        super().__init__(mark, keeping)
        if keeping.resume is not None:
            with self.reading():
                restore(run, self.left)


def keeping(
    file: str | os.PathLike[str] | None, every: float, resumed: str | os.PathLike[str] | None
) -> CheckpointOptions | None:
    """Return the checked options of checkpoints; None if none are requested.

    Raises
    ------
    ModelError, ResultError
        When the time is none, or the file cannot be written.
    """
    if file is None and resumed is None:
        return None
    for path_of in (file, resumed):
        if path_of is not None and not isinstance(path_of, str | os.PathLike):
            raise ModelError(f"expected the path of a checkpoint, got {path_of!r}")
    if not (is_real(every) and every >= 0):
        raise ModelError(f"expected checkpoint_every to be a number of seconds, got {every!r}")
    path = None if file is None else Path(file)
    if path is not None and not path.parent.is_dir():
        raise ResultError(f"cannot write the checkpoint {path}: there is no folder {path.parent}")
    if path is not None and (path.is_dir() or not os.access(path.parent, os.W_OK)):
        problem = "it is a folder" if path.is_dir() else f"nothing can be written into {path.parent}"
        raise ResultError(f"cannot write the checkpoint {path}: {problem}")
    return CheckpointOptions(path, every, None if resumed is None else Path(resumed))


def memory_of(run: _core.Run) -> dict[str, Array]:
    """Return the state of a run between two steps, as the arrays of a checkpoint."""
    equations, memory = run.save()
    return {
        "equations": np.frombuffer(equations, np.uint8),
        "run": np.frombuffer(memory, np.uint8),
        "passages": np.array(run.passages, dtype=float).reshape(-1, 3),
        "events": np.array([event[:3] for event in run.events], dtype=float).reshape(-1, 3),
        "event_states": np.array([event[3] for event in run.events], dtype=float).reshape(-1, run.dim),
    }


def restore(run: _core.Run, content: Mapping[str, Any]) -> None:
    """Bring a run that has not begun to where a checkpoint left it; KeyError or ValueError if incomplete."""
    run.restore(content["equations"].tobytes(), content["run"].tobytes())
    run.take(content["passages"], content["events"], content["event_states"])


def store(file: Path, mark: str, t: float, wall: float, arrays: Mapping[str, Any]) -> None:
    """Write a checkpoint at a time [s] of the motion, after so much wall time [s], whole or not at all.

    Raises
    ------
    OutputError
        When the file cannot be written.
    """
    header = {
        "symgen_checkpoint": FORMAT,
        "mark": mark,
        "t": t,
        "wall_s": wall,
        "digest": digest(arrays),
    }
    with replacing(file, "checkpoint") as temporary, temporary.open("wb") as stream:
        np.savez(stream, header=np.array(json.dumps(header)), **arrays)


def stored(file: str | os.PathLike[str], mark: str) -> tuple[dict[str, Any], float]:
    """Return the arrays of a checkpoint, and the wall time spent till then [s].

    Raises
    ------
    ResultError
        When the file is missing, broken, or of another run.
    """
    path = Path(file)
    try:
        with path.open("rb") as stream, NpzFile(stream, allow_pickle=False) as archive:
            header: dict[str, Any] = json.loads(str(archive["header"]))
            arrays = {name: archive[name] for name in archive.files if name != "header"}
        known, theirs = header["symgen_checkpoint"], header["mark"]
        stopped, spent = float(header["t"]), float(header["wall_s"])
        if known == FORMAT and header["digest"] != digest(arrays):
            raise ValueError("its content differs from the content written")
    except FileNotFoundError:
        raise ResultError(f"there is no checkpoint {path}") from None
    except Exception as error:  # any fault inside a foreign or broken file
        raise ResultError(f"{path} is not a checkpoint of symgen, or is broken: {error}") from error
    if known != FORMAT:
        raise ResultError(f"{path} has checkpoint format {known}, this symgen reads {FORMAT}")
    if theirs != mark:
        raise ResultError(
            f"{path} is the checkpoint of another run, stopped at t = {stopped:g} s\n"
            "  Resume with the scene, parameters, options, machine and version of symgen it was begun with."
        )
    return arrays, spent
