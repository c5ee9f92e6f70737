"""What ``symgen generate`` did, in words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from symgen.report.difference import difference_lines

if TYPE_CHECKING:
    from symgen.regeneration import Regenerated
    from symgen.sources import Generated

#: Files named as the reason of a derivation; more are counted.
_REASONS = 3


def regenerated_lines(found: Regenerated, shown: int | None) -> Iterator[str]:
    """Yield what was derived anew and why, what changed in the mathematics of each model, and the files."""
    for name, because in found.derived.items():
        yield f"derived {name}: {_reason(because)}"
    for name, change in found.changes.items():
        if change is None:
            yield f"{name}: no record of its mathematics before"
            continue
        yield f"{name}:"
        yield from (f"  {line}" for line in difference_lines(change, shown))
    yield from (f"generated/{name}" for name in found.written)
    if not found.written:
        yield "generated/ is current"


def generated_lines(found: Generated, shown: int | None) -> Iterator[str]:
    """Yield why the kernels of a scene or file were made, and what changed in the mathematics."""
    head = f"{found.name}: {found.title}"
    if found.change is None:
        yield f"{head}\n  made for the first time"
        return
    if not found.because:
        yield f"{head}\n  nothing changed"
        return
    yield f"{head}\n  made anew: {_reason(found.because)}"
    yield from (f"  {line}" for line in difference_lines(found.change, shown))


def _reason(because: tuple[str, ...]) -> str:
    """Return which files changed."""
    if not because:
        return "not in the cache"
    files = [name.partition(":")[2] if not name.startswith("version:") else name for name in because]
    more = f" and {len(files) - _REASONS} more" if len(files) > _REASONS else ""
    return f"{', '.join(files[:_REASONS])}{more} changed"
