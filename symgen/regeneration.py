"""``symgen generate``: what changed is derived anew, each model in a process of its own; all else is kept.

A process of its own loads what one derivation needs and nothing else of symgen, so that what it had loaded is
exactly what its kernels depend on. All of them part from one that has loaded SymPy.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NoReturn

from symgen import graph
from symgen.cache import Cache, Entry
from symgen.codegen.manifest import Shipped, differences, write
from symgen.codegen.source import SourceFile
from symgen.errors import GenerationError
from symgen.shipped import UNITS, UNITS_FILE, Made, generated_folder, make, names, record_name, sources

if TYPE_CHECKING:
    from symgen.symbolic.difference import Difference
    from symgen.symbolic.record import Record

Progress = Callable[[float], None]

_MADE = "made.json"
#: How the name of a file ends that holds what a derivation said.
_SAID = ".said"


@dataclass(frozen=True, slots=True)
class Regenerated:
    """What became of everything under ``generated/``.

    Attributes
    ----------
    derived
        Models that were derived anew, each with what changed and so called for it; with nothing where there
        was no earlier one in the cache.
    written
        Names of the files that were written or removed.
    changes
        What changed in the mathematics of every model of which a file was written; None where there is no
        record of what it was.
    """

    derived: Mapping[str, tuple[str, ...]]
    written: tuple[str, ...]
    changes: Mapping[str, Difference | None]


def regenerate(progress: Progress | None = None) -> Regenerated:
    """Bring ``generated/`` of a checkout up to date; derive only what the cache does not hold.

    Parameters
    ----------
    progress
        Takes the part of the derivations that is done.

    Raises
    ------
    GenerationError
        Outside a checkout, or when a derivation fails; then nothing is written.
    """
    folder = generated_folder()
    if not (folder.parent / "pyproject.toml").is_file():
        raise GenerationError(
            f"{folder} is not part of a checkout of symgen; only 'symgen generate --check' works"
        )
    made, derived = up_to_date(Cache(), progress)
    return _written(folder, {name: model.shipped for name, model in made.items()}, derived)


def up_to_date(
    store: Cache, progress: Progress | None = None
) -> tuple[dict[str, Made], dict[str, tuple[str, ...]]]:
    """Return everything as it is now, and what of it was derived anew, each with what called for it."""
    entries = {name: graph.current(store, _entry(name)) for name in (*names(), UNITS)}
    missing = [name for name, entry in entries.items() if entry is None]
    derived = {name: _because(store, name) for name in missing}
    made = derive_all(missing, progress)
    for name, model in made.items():
        _keep(store, name, model)
    return made | {name: _read(entry) for name, entry in entries.items() if entry}, derived


def not_current(progress: Progress | None = None) -> list[str]:
    """Derive everything anew, whatever the cache holds; return a difference for every file that is not so."""
    made = derive_all([*names(), UNITS], progress)
    return differences(generated_folder(), _files({name: m.shipped for name, m in made.items()}))


def derive_all(models: Iterable[str], progress: Progress | None = None) -> dict[str, Made]:
    """Derive models side by side, as many at once as there are processors, each in a process of its own.

    Raises
    ------
    GenerationError
        When a derivation fails, with its own words.
    """
    asked = list(models)
    made: dict[str, Made] = {}
    with TemporaryDirectory(ignore_cleanup_errors=True) as place:
        for name in _as_derived(asked, Path(place)) if asked else ():
            made[name] = _made(json.loads((Path(place) / name).read_bytes()))
            if progress:
                progress(len(made) / len(asked))
    return {name: made[name] for name in asked}


_PARENT = "import sys; from symgen.regeneration import answer_all; answer_all(*sys.argv[1:])"


def _as_derived(names: Iterable[str], folder: Path) -> Iterator[str]:
    """Yield models when their files are in a folder; symgen is imported from where this process does."""
    home = str(Path(__file__).resolve().parent.parent)
    path = os.pathsep.join(p for p in (home, os.environ.get("PYTHONPATH", "")) if p)
    with (
        (folder / _SAID).open("wb") as said,
        subprocess.Popen(
            [sys.executable, "-P", "-c", _PARENT, str(folder), *names],
            env={**os.environ, "PYTHONPATH": path},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=said,
            text=True,
        ) as process,
    ):
        failed = []
        for line in process.stdout or ():
            name, status = line.split()
            if status == "0":
                yield name
            else:
                failed.append(name)
    if failed:
        raise _failed(failed[0], folder / f"{failed[0]}{_SAID}")
    if process.returncode:
        raise _failed("what is left", folder / _SAID)


def _failed(what: str, said: Path) -> GenerationError:
    words = said.read_text(encoding="utf-8", errors="replace").strip()
    return GenerationError(f"{what} cannot be derived, and nothing was written:\n{words}")


def answer_all(folder: str, *names: str) -> None:
    """Derive models, each in a process that parts from this one, and print which is done, with its status.

    What is loaded before they part is no part of symgen: all derivations use it, and it takes long.
    """
    import gc

    import jinja2  # noqa: F401
    import sympy.tensor.tensor  # noqa: F401 - loaded at the first sum

    gc.disable()  # all that a derivation makes lives until its end
    waiting, running = [*reversed(names)], dict[int, str]()
    while waiting or running:
        while waiting and len(running) < (os.cpu_count() or 1):
            name = waiting.pop()
            child = os.fork()
            if not child:
                _answer_in(Path(folder), name)
            running[child] = name
        child, status = os.wait()
        if status:
            waiting.clear()
        print(running.pop(child), status, flush=True)


def _answer_in(folder: Path, name: str) -> NoReturn:
    """Write a model into a folder, or what is said where it cannot be derived, and end this process."""
    with (folder / f"{name}{_SAID}").open("wb") as said:
        os.dup2(said.fileno(), 2)
    try:
        (folder / name).write_bytes(answer(name))
    except BaseException:
        traceback.print_exc()
        os._exit(1)
    os._exit(0)  # what a derivation made need not be taken apart


def answer(name: str) -> bytes:
    """Derive one model and return it as JSON."""
    return json.dumps(asdict(make(name))).encode()


def _made(data: dict[str, Any]) -> Made:
    shipped = data["shipped"]
    files = tuple(SourceFile(**f) for f in shipped["files"])
    return Made(Shipped(shipped["equations"], files, shipped["optimisation"]), data["needs"])


def _entry(name: str) -> str:
    return f"generated-{name}"


def _read(entry: Entry) -> Made:
    return _made(json.loads(entry.read_text(_MADE)))


def _keep(store: Cache, name: str, model: Made) -> None:
    entry = _entry(name)
    with (
        store.locked(entry),
        store.building(entry, lambda folder: graph.keep(folder, entry, model.needs)) as folder,
    ):
        (folder / _MADE).write_text(json.dumps(asdict(model)), encoding="utf-8")


def _because(store: Cache, name: str) -> tuple[str, ...]:
    """Return what changed since the model was last derived."""
    earlier = graph.latest(store, _entry(name))
    return tuple(graph.changed(earlier[1])) if earlier else ()


def _files(shipped: Mapping[str, Shipped]) -> list[SourceFile]:
    models = {name: shipped[name] for name in names()}
    place = Path(os.path.relpath(UNITS_FILE, generated_folder())).as_posix()
    return [*sources(models), *(replace(file, name=place) for file in shipped[UNITS].files)]


def _written(
    folder: Path, shipped: Mapping[str, Shipped], derived: Mapping[str, tuple[str, ...]]
) -> Regenerated:
    before = {name: _recorded(folder, name) for name in names()}
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
