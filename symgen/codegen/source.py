"""Generated files as values, for writing, caching and checking."""

from __future__ import annotations

from dataclasses import dataclass

#: Ending of the name of a C file with kernels as loops.
LOOPS = "_rolled.c"


@dataclass(frozen=True, slots=True)
class SourceFile:
    """A file to write: its name and its text."""

    name: str
    text: str
