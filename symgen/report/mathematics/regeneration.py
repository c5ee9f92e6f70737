"""Summary of ``symgen generate`` as text."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from symgen.report.mathematics.difference import (
    difference_lines,
    grouped,
    mathematics_lines,
    operation_lines,
    series,
)

if TYPE_CHECKING:
    from symgen.regeneration.generate import Regenerated
    from symgen.regeneration.sources import Generated

#: Maximum number of files named as the reason for a derivation; further ones are counted.
_REASONS = 3


def regenerated_lines(regenerated: Regenerated, shown: int | None) -> Iterator[str]:
    """Yield derived models with reasons, changes in the mathematics, and written files.

    Models with the same changes are listed once; the operation counts of each follow.
    """
    for name, because in regenerated.derived.items():
        yield f"derived {name}: {_reason(because)}"
    changes = {name: change for name, change in regenerated.changes.items() if change is not None}
    for name in regenerated.changes:
        if name not in changes:
            yield f"{name}: no record of its mathematics before"
    alike = grouped((tuple(mathematics_lines(change, shown)), name) for name, change in changes.items())
    for lines, names in alike.items():
        yield f"{series(names)}:"
        yield from (f"  {line}" for line in lines)
        for name in names:
            counts = operation_lines(changes[name], name if len(names) > 1 else "")
            yield from (f"  {line}" for line in counts)
    yield from (f"generated/{name}" for name in regenerated.written)
    if not regenerated.written:
        yield "generated/ is current"


def generated_lines(generated: Generated, shown: int | None) -> Iterator[str]:
    """Yield the reason for generating the kernels of a scene or file, and the changes in the mathematics."""
    yield f"{generated.name}: {generated.title}"
    if generated.change is None:
        yield "  generated for the first time"
    elif not generated.because:
        yield "  nothing changed"
    else:
        yield f"  regenerated: {_reason(generated.because)}"
        yield from (f"  {line}" for line in difference_lines(generated.change, shown))


def _reason(because: tuple[str, ...]) -> str:
    """Return the names of the changed files."""
    if not because:
        return "not in the cache"
    files = [name.partition(":")[2] if not name.startswith("version:") else name for name in because]
    more = f" and {len(files) - _REASONS} more" if len(files) > _REASONS else ""
    return f"{', '.join(files[:_REASONS])}{more} changed"
