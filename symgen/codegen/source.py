"""Generated files as values, for writing, caching and checking."""

from __future__ import annotations

from dataclasses import dataclass

#: What the name of a file in C with kernels as loops ends with.
LOOPS = "_rolled.c"


@dataclass(frozen=True, slots=True)
class SourceFile:
    """A file to write: its name and its text."""

    name: str
    text: str
