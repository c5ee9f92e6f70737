"""Description of a compiled rotor: its points, links and welds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from symgen.runtime.kernels.description import Described


@dataclass(frozen=True, slots=True)
class RotorLinkInfo:
    """An elastic link between two points, and those of them at which it is welded."""

    link: str
    start: str
    end: str
    elements: int
    welds: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class RotorDescription(Described):
    """Runtime data of a rotor: free points, links, and the points with masses in the order of the kernel."""

    method: ClassVar[str] = "rotor"
    free: tuple[str, ...]
    links: tuple[RotorLinkInfo, ...]
    masses: tuple[str, ...]

    @property
    def coordinates(self) -> int:
        """Zero: the kernels read parameters alone."""
        return 0

    @property
    def extent(self) -> str:
        """Number of links, in words."""
        links = "1 elastic link" if len(self.links) == 1 else f"{len(self.links)} elastic links"
        return f"{links} in space"
