"""The finite elements of an elastic link, one file each; a new one is a file and a line in ``ELEMENTS``."""

from __future__ import annotations

from symgen.elements import beam8, beam9, cubic, rayleigh, timoshenko
from symgen.elements.element import Element

ELEMENTS: dict[str, Element] = {
    "beam8": beam8.ELEMENT,
    "cubic": cubic.ELEMENT,
    "timoshenko": timoshenko.ELEMENT,
    "rayleigh": rayleigh.ELEMENT,
    "beam9": beam9.ELEMENT,
}
