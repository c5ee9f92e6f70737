"""Finite elements of an elastic link, one file each; a new one is a file and its name in ``ELEMENTS``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from symgen.registry import Registry

if TYPE_CHECKING:
    from symgen.elements.element import Element

_FILES = ("beam8", "cubic", "timoshenko", "rayleigh", "beam9")
#: Each has its own kernels, the block ``element_NAME``, which depend on no other element. Those of an
#: element without a module in ``generated/`` are compiled into the cache when a model first needs them.
ELEMENTS: Registry[Element] = Registry({name: f"symgen.elements.{name}:ELEMENT" for name in _FILES})
