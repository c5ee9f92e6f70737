"""Finite elements of an elastic link, one file each; a new one is a file and its name in ``ELEMENTS``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from symgen.elements.element import Element


class _Files(Mapping[str, "Element"]):
    """Elements by the names of their files, loaded on first access."""

    def __init__(self, *names: str) -> None:
        self._names = names

    def __getitem__(self, name: str) -> Element:
        if name not in self._names:
            raise KeyError(name)
        element: Element = import_module(f"symgen.elements.{name}").ELEMENT
        return element

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


#: Each has its own kernels, the block ``element_NAME``, which depend on no other element.
ELEMENTS = _Files(
    "beam8",
    "cubic",
    "timoshenko",
    "rayleigh",
    "beam9",
)
