"""Summary of ``symgen generate`` as text."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from symgen.report.mathematics.difference import difference_lines

if TYPE_CHECKING:
    from symgen.regeneration.generate import Regenerated
    from symgen.regeneration.sources import Generated

#: Maximum number of files named as the reason for a derivation; further ones are counted.
_REASONS = 3
#: Prefixes of text lines and of mathematics, by format.
_WORDS = {"text": ("", "  "), "latex": ("% ", "")}


def regenerated_lines(found: Regenerated, shown: int | None, form: str = "text") -> Iterator[str]:
    """Yield derived models with reasons, changes in the mathematics of each model, and written files.

    ``form`` is the format of the mathematics, as in ``difference_lines``; in LaTeX other text is a comment.
    """
    words, indent = _WORDS[form]
    for name, because in found.derived.items():
        yield f"{words}derived {name}: {_reason(because)}"
    for name, change in found.changes.items():
        if change is None:
            yield f"{words}{name}: no record of its mathematics before"
            continue
        yield f"{words}{name}:"
        yield from (f"{indent}{line}" for line in difference_lines(change, shown, form))
    yield from (f"{words}generated/{name}" for name in found.written)
    if not found.written:
        yield f"{words}generated/ is current"


def generated_lines(found: Generated, shown: int | None, form: str = "text") -> Iterator[str]:
    """Yield the reason for generating the kernels of a scene or file, and the changes in the mathematics."""
    words, indent = _WORDS[form]
    yield f"{words}{found.name}: {found.title}"
    if found.change is None:
        yield f"{words}  generated for the first time"
    elif not found.because:
        yield f"{words}  nothing changed"
    else:
        yield f"{words}  regenerated: {_reason(found.because)}"
        yield from (f"{indent}{line}" for line in difference_lines(found.change, shown, form))


def _reason(because: tuple[str, ...]) -> str:
    """Return the names of the changed files."""
    if not because:
        return "not in the cache"
    files = [name.partition(":")[2] if not name.startswith("version:") else name for name in because]
    more = f" and {len(files) - _REASONS} more" if len(files) > _REASONS else ""
    return f"{', '.join(files[:_REASONS])}{more} changed"
