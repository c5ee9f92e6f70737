"""What equations come from: a scene, a user's own derivation, a building block; and their record."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symgen import graph
from symgen.cache import Cache, key
from symgen.errors import ModelError
from symgen.own import is_own, load
from symgen.scene.loading import override, read_scene, scene_path
from symgen.symbolic.difference import Difference, difference, texts
from symgen.symbolic.record import Record, read_record

if TYPE_CHECKING:
    from symgen.symbolic.system import System

_RECORD = "equations.json"


@dataclass(frozen=True, slots=True)
class Systems:
    """What was derived from one source.

    Attributes
    ----------
    name, title
        Of the model.
    all
        Its Systems, by what comes before the names of their matrices: none for those of its motion.
    needs
        The files it came from, besides those of symgen.
    values
        Those of the tunable parameters of a scene, in SI units.
    """

    name: str
    title: str
    all: Mapping[str, System]
    needs: graph.Needs
    values: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Generated:
    """What became of the kernels of one source.

    Attributes
    ----------
    name, title
        Of the model.
    because
        What changed since they were last made; nothing where nothing did, or where this is the first time.
    change
        What changed in the mathematics since; None where there was no record of it.
    """

    name: str
    title: str
    because: tuple[str, ...]
    change: Difference | None


def systems(source: str | os.PathLike[str], set: Mapping[str, Any] | None = None) -> Systems:
    """Derive everything that a source gives.

    Parameters
    ----------
    source
        A shipped name, the path of a scene file or of a Python file, or the name of a building block.
    set
        Values of a scene to replace, as in :func:`symgen.build`.

    Raises
    ------
    SceneError, DerivationError
        For anything wrong in the source.
    ModelError
        When values are given for what is no scene.
    """
    from symgen.models import BLOCKS

    if (is_own(source) or source in BLOCKS) and set:
        raise ModelError(f"values are set of scenes, and {source} is none: its values are its arguments")
    if is_own(source):
        own = load(Path(source))
        return Systems(own.system.name, own.system.title, {"": own.system}, own.needs)
    if source in BLOCKS:
        block = BLOCKS[str(source)]()
        return Systems(block.name, block.title, {"": block}, {})
    return _of_scene(source, set or {})


def _of_scene(source: str | os.PathLike[str], set_: Mapping[str, Any]) -> Systems:
    from symgen.models.analyses import elastic_systems
    from symgen.pipeline import system_of
    from symgen.scene.linkage import Linkage
    from symgen.scene.loading import check_scene
    from symgen.scene.resolve import resolve

    read = graph.of_file(scene_path(source))
    resolved = resolve(check_scene(override(read_scene(source), set_)))
    own = system_of(resolved)
    further = elastic_systems(resolved) if isinstance(resolved, Linkage) else {}
    values = {p.quantity.name: f"{float(p.default):.12g} {p.quantity.unit}" for p in resolved.parameters}
    return Systems(own.name, own.title, {"": own, **{f"{k}.": s for k, s in further.items()}}, read, values)


def record_of(derived: Systems) -> Record:
    """Return the record of what was derived, with the operations of every kernel."""
    from symgen.lowering.program import lower_system
    from symgen.symbolic.record import record

    costs = {
        prefix + k.name: k.counts.flops
        for prefix, system in derived.all.items()
        for k in lower_system(system).kernels
    }
    return record(derived.name, derived.title, derived.all, costs)


def compare(
    before: str | os.PathLike[str],
    after: str | os.PathLike[str],
    set: Mapping[str, Any] | None = None,
) -> tuple[Record, Record, Difference]:
    """Return the mathematics of two sources, and what is different in the second.

    Parameters
    ----------
    before, after
        As of :func:`systems`.
    set
        Values to replace in the second.
    """
    sources = systems(before), systems(after, set)
    old, new = map(record_of, sources)
    return old, new, replace(difference(old, new), values=texts(*(s.values for s in sources)))


def generate(source: str | os.PathLike[str]) -> Generated:
    """Make the kernels of a source, and say what changed in its mathematics since the last time.

    Raises
    ------
    SceneError, DerivationError
        For anything wrong in the source.
    BuildError, CacheError
        When the compiler fails, or the cache cannot be written.
    """
    from symgen.pipeline import build

    model = build(source)
    store = Cache()
    place = Path(source) if is_own(source) else scene_path(source)
    name = f"{model.name}-equations-{key(str(place.resolve()))}"
    earlier = graph.latest(store, name)
    because = tuple(graph.changed(earlier[1])) if earlier else ()
    before = _earlier(earlier[0]) if earlier else None
    if before and not because:
        return Generated(before.name, before.title, (), difference(before, before))
    after = _recorded(store, name, source)
    return Generated(after.name, after.title, because, difference(before, after) if before else None)


def _earlier(folder: Path) -> Record | None:
    with suppress(OSError, KeyError, TypeError, ValueError):
        return read_record((folder / _RECORD).read_text(encoding="utf-8"))
    return None


def _recorded(store: Cache, name: str, source: str | os.PathLike[str]) -> Record:
    """Return the record of a source as it is now, and make it the latest in the cache."""
    entry = graph.current(store, name)
    if entry:
        with suppress(OSError):
            os.utime(entry.folder)
        return read_record(entry.read_text(_RECORD))
    derived = systems(source)
    found = record_of(derived)
    needs = graph.needs(derived.needs)
    with store.locked(name), store.building(name, lambda f: graph.keep(f, name, needs)) as folder:
        (folder / _RECORD).write_text(found.to_json(), encoding="utf-8")
    return found
