"""Finite elements of an elastic link, one file each; a new one is a file and its name in ``ELEMENTS``."""

from __future__ import annotations

from collections.abc import Iterator, MutableMapping
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from symgen.elements.element import Element


class _Files(MutableMapping[str, "Element"]):
    """Elements by the names of their files, loaded on first access; others can be added."""

    def __init__(self, *names: str) -> None:
        self._names: dict[str, Element | None] = dict.fromkeys(names)

    def __getitem__(self, name: str) -> Element:
        found = self._names[name]
        if found is None:
            found = self._names[name] = import_module(f"symgen.elements.{name}").ELEMENT
        return found

    def __setitem__(self, name: str, element: Element) -> None:
        self._names[name] = element

    def __delitem__(self, name: str) -> None:
        del self._names[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


#: Each has its own kernels, the block ``element_NAME``, which depend on no other element. Those of an
#: element without a module in ``generated/`` are compiled into the cache when a model first needs them.
ELEMENTS = _Files(
    "beam8",
    "cubic",
    "timoshenko",
    "rayleigh",
    "beam9",
)
