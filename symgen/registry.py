"""Kinds that symgen knows by name, of loads, joints, elements and methods, with those that a program adds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, MutableMapping
from importlib import import_module
from typing import Any, ClassVar, TypeVar

T = TypeVar("T")


def load(entry: str) -> Any:
    """Import what ``module:name`` names."""
    module, _, name = entry.partition(":")
    return getattr(import_module(module), name)


class Registry(MutableMapping[str, T]):
    """Kinds by name, in order.

    Parameters
    ----------
    kinds
        The kinds of symgen; a text ``module:name`` is imported when the kind is first used.
    parts
        Returns the objects that decide a kind besides its own fields, for the key of the cache.
    """

    #: Every registry of this process. One that is not loaded has nothing added.
    loaded: ClassVar[list[Registry[Any]]] = []

    def __init__(self, kinds: Mapping[str, T | str], parts: Callable[[T], Any] = lambda kind: None) -> None:
        self._kinds: dict[str, Any] = dict(kinds)
        self._of_symgen = dict(self._kinds)
        self._parts = parts
        Registry.loaded.append(self)

    def __getitem__(self, name: str) -> T:
        kind: Any = self._kinds[name]
        if isinstance(kind, str):
            kind = self._kinds[name] = self._of_symgen[name] = load(kind)
        return kind

    def __setitem__(self, name: str, kind: T) -> None:
        self._kinds[name] = kind

    def __delitem__(self, name: str) -> None:
        del self._kinds[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._kinds)

    def __len__(self) -> int:
        return len(self._kinds)

    def added(self) -> dict[str, tuple[T, Any]]:
        """Return the kinds that are not symgen's, or replace one of its own, with their parts."""
        changed = {n: k for n, k in self._kinds.items() if k is not self._of_symgen.get(n)}
        return {name: (kind, self._parts(kind)) for name, kind in changed.items()}
