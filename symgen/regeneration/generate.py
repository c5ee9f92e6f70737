"""``symgen generate``: derive outdated models again, each in its own process; keep all others.

A separate process loads only the modules that its derivation needs, so these are exactly the dependencies
of its kernels.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from symgen.codegen.manifest import Shipped, differences, write
from symgen.codegen.source import SourceFile
from symgen.errors import GenerationError
from symgen.regeneration.shipped import (
    TABLES,
    Derived,
    generated_folder,
    make,
    names,
    record_name,
    sources,
)
from symgen.toolchain import dependencies as graph
from symgen.toolchain.cache import Cache, CacheEntry

if TYPE_CHECKING:
    from symgen.symbolic.difference import Difference
    from symgen.symbolic.record import Record

Progress = Callable[[float], None]

_DERIVED = "made.json"
#: Suffix of the file with the error output of a derivation.
_SAID = ".said"


@dataclass(frozen=True, slots=True)
class Regenerated:
    """Result of regenerating everything under ``generated/``.

    Attributes
    ----------
    derived
        Models that were derived again, each with the dependencies that changed; empty if the cache held no
        earlier version.
    written
        Names of the files that were written or removed.
    changes
        Changes in the mathematics of every model with a written file; None if the earlier mathematics was
        not recorded.
    """

    derived: Mapping[str, tuple[str, ...]]
    written: tuple[str, ...]
    changes: Mapping[str, Difference | None]


def regenerate(progress: Progress | None = None) -> Regenerated:
    """Bring ``generated/`` of a checkout up to date; derive only models that the cache does not hold.

    Parameters
    ----------
    progress
        Callback that receives the completed fraction of the derivations.

    Raises
    ------
    GenerationError
        Outside a checkout, or if a derivation fails; then nothing is written.
    """
    folder = generated_folder()
    if not (folder.parent / "pyproject.toml").is_file():
        raise GenerationError(
            f"{folder} is not part of a checkout of symgen; only 'symgen generate --check' works"
        )
    models, derived = up_to_date(Cache(), progress)
    return _written(folder, {name: model.shipped for name, model in models.items()}, derived)


def compile_again() -> None:
    """Compile the modules of a checkout whose sources have changed, as its installation does.

    Raises
    ------
    GenerationError
        When the compilation fails.
    """
    command = [sys.executable, "setup.py", "-q", "build_ext", "--inplace"]
    done = subprocess.run(command, cwd=generated_folder().parent, capture_output=True, text=True, check=False)
    if done.returncode:
        last = (done.stderr or done.stdout).strip().splitlines()[-3:]
        raise GenerationError("the generated kernels cannot be compiled:\n  " + "\n  ".join(last))


def up_to_date(
    store: Cache, progress: Progress | None = None
) -> tuple[dict[str, Derived], dict[str, tuple[str, ...]]]:
    """Return all current models, and for each one that was derived again the dependencies that changed."""
    entries = {name: graph.current(store, _entry(name)) for name in (*names(), *TABLES)}
    missing = [name for name, entry in entries.items() if entry is None]
    derived = {name: _because(store, name) for name in missing}
    models = derive_all(missing, progress)
    for name, model in models.items():
        _keep(store, name, model)
    return models | {name: _read(entry) for name, entry in entries.items() if entry}, derived


def not_current(progress: Progress | None = None) -> list[str]:
    """Derive all models, ignoring the cache; return a difference for every outdated committed file."""
    models = derive_all([*names(), *TABLES], progress)
    return differences(generated_folder(), _files({name: m.shipped for name, m in models.items()}))


def derive_all(models: Iterable[str], progress: Progress | None = None) -> dict[str, Derived]:
    """Derive models in parallel, one per processor at a time, each in its own process.

    Raises
    ------
    GenerationError
        If a derivation fails, with its error output.
    """
    requested = list(models)
    derived: dict[str, Derived] = {}
    with TemporaryDirectory(ignore_cleanup_errors=True) as place:
        for name in _as_derived(requested, Path(place)) if requested else ():
            derived[name] = _of_json(json.loads((Path(place) / name).read_bytes()))
            if progress:
                progress(len(derived) / len(requested))
    return {name: derived[name] for name in requested}


PARENT = "import sys; from symgen.regeneration.generate import answer_all; answer_all(*sys.argv[1:])"


def _as_derived(requested: Sequence[str], folder: Path) -> Iterator[str]:
    """Yield the names of models as they are completed; child processes import this symgen."""
    home = str(Path(__file__).resolve().parent.parent.parent)
    path = os.pathsep.join(p for p in (home, os.environ.get("PYTHONPATH", "")) if p)
    with (
        (folder / _SAID).open("wb") as said,
        subprocess.Popen(
            [sys.executable, "-P", "-c", PARENT, str(folder), *requested],
            env={**os.environ, "PYTHONPATH": path},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=said,
            text=True,
            start_new_session=True,
        ) as process,
        _interrupting(process),
    ):
        failed = []
        for line in process.stdout or ():
            name, status = line.split()
            if status == "0":
                yield name
            else:
                failed.append(name)
    if failed:
        first = min(failed, key=requested.index)
        raise _failed(first, folder / f"{first}{_SAID}")
    if process.returncode:
        raise _failed("the remaining models", folder / _SAID)


@contextmanager
def _interrupting(process: subprocess.Popen[str]) -> Iterator[None]:
    """Interrupt the group of a process where the block is left before the process has ended."""
    try:
        yield
    except BaseException:
        with suppress(ProcessLookupError):
            if os.name == "nt":
                process.kill()
            else:
                os.killpg(process.pid, signal.SIGINT)
        raise


def _failed(subject: str, output: Path) -> GenerationError:
    words = output.read_text(encoding="utf-8", errors="replace").strip()
    return GenerationError(f"{subject} cannot be derived, and nothing was written:\n{words}")


def answer_all(folder: str, *names: str) -> None:
    """Derive models, each in a new process; print the name and exit status of each as it ends."""
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from multiprocessing import get_all_start_methods, get_context

    # Loading SymPy takes half of the time of most derivations: processes are forked from one that has it
    # loaded, but no module of symgen.
    forks = "forkserver" in get_all_start_methods()
    context = get_context("forkserver" if forks else "spawn")
    if forks:
        context.set_forkserver_preload(["sympy"])
    workers = min(os.cpu_count() or 1, len(names))
    with ProcessPoolExecutor(workers, mp_context=context, max_tasks_per_child=1) as pool:
        running = {pool.submit(answer_in, Path(folder), name): name for name in names}
        for done in as_completed(running):
            if done.cancelled():
                continue
            name, error = running[done], done.exception()
            if error:  # the process ended without writing an error
                (Path(folder) / f"{name}{_SAID}").write_text(str(error), encoding="utf-8")
            status = 1 if error else done.result()
            if status:
                for other in running:  # to shut the pool down here would break its replacement of processes
                    other.cancel()
            print(name, status, flush=True)


def answer_in(folder: Path, name: str) -> int:
    """Write a model, or the error of its failed derivation, into a folder; return the exit status."""
    import gc

    gc.disable()  # the objects of a derivation live until its end
    with (folder / f"{name}{_SAID}").open("wb") as said:
        os.dup2(said.fileno(), 2)
    try:
        (folder / name).write_bytes(answer(name))
    except BaseException:
        traceback.print_exc()
        return 1
    return 0


def answer(name: str) -> bytes:
    """Derive one model and return it as JSON."""
    return json.dumps(asdict(make(name))).encode()


def _of_json(data: dict[str, Any]) -> Derived:
    shipped = data["shipped"]
    files = tuple(SourceFile(**f) for f in shipped["files"])
    return Derived(Shipped(shipped["equations"], files, shipped["optimisation"]), data["needs"])


def _entry(name: str) -> str:
    return f"generated-{name}"


def _read(entry: CacheEntry) -> Derived:
    return _of_json(json.loads(entry.read_text(_DERIVED)))


def _keep(store: Cache, name: str, model: Derived) -> None:
    entry = _entry(name)
    with (
        store.locked(entry),
        store.building(entry, lambda folder: graph.keep(folder, entry, model.needs)) as folder,
    ):
        (folder / _DERIVED).write_text(json.dumps(asdict(model)), encoding="utf-8")


def _because(store: Cache, name: str) -> tuple[str, ...]:
    """Return the dependencies that changed since the model was last derived."""
    earlier = graph.latest(store, _entry(name))
    return tuple(graph.changed(earlier[1])) if earlier else ()


def _files(shipped: Mapping[str, Shipped]) -> list[SourceFile]:
    models = {name: shipped[name] for name in names()}
    tables = [
        replace(file, name=Path(os.path.relpath(path, generated_folder())).as_posix())
        for name, path in TABLES.items()
        for file in shipped[name].files
    ]
    return [*sources(models), *tables]


def _written(
    folder: Path, shipped: Mapping[str, Shipped], derived: Mapping[str, tuple[str, ...]]
) -> Regenerated:
    before = {name: _recorded(folder, name) for name in names() if record_name(name)}
    written = write(folder, _files(shipped))
    changes: dict[str, Difference | None] = {}
    for name in sorted(before):
        if any(file.name in written for file in shipped[name].files):
            changes[name] = _difference(before[name], _recorded(folder, name))
    return Regenerated(derived, tuple(written), changes)


def _recorded(folder: Path, name: str) -> str:
    with suppress(OSError):
        return (folder / record_name(name)).read_text(encoding="utf-8")
    return ""


def _difference(before: str, after: str) -> Difference | None:
    from symgen.symbolic.difference import difference
    from symgen.symbolic.record import read_record

    def read(text: str) -> Record | None:
        with suppress(KeyError, TypeError, ValueError):
            return read_record(text)
        return None

    old, new = read(before), read(after)
    return difference(old, new) if old and new else None
