"""Description of the kernels of a user-defined system; stored as JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from symgen.runtime.kernels.description import Described


@dataclass(frozen=True, slots=True)
class ArrayInfo:
    """An argument array: its purpose, and name and unit of each entry."""

    about: str
    names: tuple[str, ...]
    units: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class SystemDescription(Described):
    """Runtime data of a user-defined system: its argument arrays by name."""

    method: ClassVar[str] = "system"
    arrays: dict[str, ArrayInfo]

    def size(self, array: str) -> int:
        """Return the number of entries of an argument array; 0 if there is no such array."""
        return len(self.arrays[array].names) if array in self.arrays else 0

    @property
    def coordinates(self) -> int:
        """Number of entries of q."""
        return self.size("q")

    @property
    def extent(self) -> str:
        """Sizes of the arrays of arguments, in words."""
        return ", ".join(f"{name}[{len(array.names)}]" for name, array in self.arrays.items())

    @property
    def sizes(self) -> tuple[int, int, int, int]:
        """Number of doubles in the arrays t, q, u and p of every kernel."""
        return 1, self.size("q"), self.size("u"), self.size("p") + self.derived + 1
