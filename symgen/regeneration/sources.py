"""Sources of equations: scenes, user-defined derivations and building blocks, with their records."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symgen.errors import ModelError
from symgen.pipeline.user_system import is_user_file, load
from symgen.scene.loading import override, read_scene, scene_path
from symgen.symbolic.difference import Difference, difference, texts
from symgen.symbolic.record import Record, read_record
from symgen.toolchain import dependencies as graph
from symgen.toolchain.cache import Cache, key

if TYPE_CHECKING:
    from symgen.symbolic.system import System

_RECORD = "equations.json"


@dataclass(frozen=True, slots=True)
class Systems:
    """Systems derived from one source.

    Attributes
    ----------
    name, title
        Name and title of the model.
    all
        Systems by the prefix of their matrix names; the prefix of the equations of motion is empty.
    needs
        Files that the derivation depends on, other than those of symgen.
    values
        Values of the tunable parameters of a scene, in SI units.
    """

    name: str
    title: str
    all: Mapping[str, System]
    needs: graph.Needs
    values: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Generated:
    """Result of generating the kernels of one source.

    Attributes
    ----------
    name, title
        Name and title of the model.
    because
        Dependencies that changed since the last generation; empty if none did, or for the first generation.
    change
        Changes in the mathematics since then; None if the earlier mathematics was not recorded.
    """

    name: str
    title: str
    because: tuple[str, ...]
    change: Difference | None


def systems(source: str | os.PathLike[str], set: Mapping[str, Any] | None = None) -> Systems:
    """Derive all systems of a source.

    Parameters
    ----------
    source
        A shipped name, the path of a scene file or of a Python file, or the name of a building block.
    set
        Scene values to override, as in :func:`symgen.build`.

    Raises
    ------
    SceneError, DerivationError
        If the source is invalid.
    ModelError
        If values are set for a source other than a scene.
    """
    from symgen.models import BLOCKS

    if (is_user_file(source) or source in BLOCKS) and set:
        raise ModelError(f"'set' applies to scenes only; {source} is not a scene: its values are arguments")
    if is_user_file(source):
        user = load(Path(source))
        return Systems(user.system.name, user.system.title, {"": user.system}, user.needs)
    if source in BLOCKS:
        block = BLOCKS[str(source)]()
        return Systems(block.name, block.title, {"": block}, {})
    return _of_scene(source, set or {})


def _of_scene(source: str | os.PathLike[str], set_: Mapping[str, Any]) -> Systems:
    from symgen.methods import further_of
    from symgen.pipeline.systems import system_of
    from symgen.scene.loading import check_scene
    from symgen.scene.resolve import resolve
    from symgen.scene.rods.letters import derived_in_letters

    read = graph.of_file(scene_path(source))
    resolved = resolve(check_scene(override(read_scene(source), set_)))
    own = system_of(resolved)
    further = derived_in_letters(resolved, further_of)
    values = {p.quantity.name: f"{float(p.default):.12g} {p.quantity.unit}" for p in resolved.parameters}
    return Systems(own.name, own.title, {"": own, **{f"{k}.": s for k, s in further.items()}}, read, values)


def record_of(derived: Systems) -> Record:
    """Return the record of the derived systems, with the operation counts of every kernel."""
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
    """Return the records of two sources and their difference.

    Parameters
    ----------
    before, after
        Sources as accepted by :func:`systems`.
    set
        Scene values to override in the second source.
    """
    sources = systems(before), systems(after, set)
    old, new = map(record_of, sources)
    return old, new, replace(difference(old, new), values=texts(*(s.values for s in sources)))


def generate(source: str | os.PathLike[str]) -> Generated:
    """Generate the kernels of a source, and compare its mathematics with the previous generation.

    Raises
    ------
    SceneError, DerivationError
        If the source is invalid.
    BuildError, CacheError
        If compilation fails, or the cache cannot be written.
    """
    from symgen.pipeline.build import build

    model = build(source)
    store = Cache()
    place = Path(source) if is_user_file(source) else scene_path(source)
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
    """Return the record of a source in its present state, and store it in the cache."""
    entry = graph.current(store, name)
    if entry:
        with suppress(OSError):
            os.utime(entry.folder)
        return read_record(entry.read_text(_RECORD))
    derived = systems(source)
    mathematics = record_of(derived)
    needs = graph.needs(derived.needs)
    with store.locked(name), store.building(name, lambda f: graph.keep(f, name, needs)) as folder:
        (folder / _RECORD).write_text(mathematics.to_json(), encoding="utf-8")
    return mathematics
