"""Changes in the mathematics as text."""

from __future__ import annotations

from collections.abc import Iterator

from symgen.symbolic.difference import Change, Difference, MatrixDifference

_ALL = "all kernels"
_KINDS = ("added", "removed", "changed", "rewritten")


def difference_lines(difference: Difference, shown: int | None = None) -> Iterator[str]:
    """Yield the changes: matrices with entries before and after, shared terms, operation counts, values.

    Parameters
    ----------
    difference
        The difference.
    shown
        Maximum number of printed entries per matrix, and of shared terms; None for all.
    """
    if not difference:
        yield "no change in the mathematics"
    for matrix in difference.matrices:
        yield f"{matrix.name}{_shape(matrix)}: {_summary(matrix)}"
        yield from _changes(matrix.changes, shown, "entries")
    if difference.definitions:
        yield "shared terms:"
        yield from _changes(difference.definitions, shown, "terms")
    yield from _operations(difference)
    if difference.values:
        yield "tunable parameters, which are arguments of the kernels:"
        yield from _changes(difference.values, shown, "parameters")


def _shape(matrix: MatrixDifference) -> str:
    old, new = (f"{rows} x {columns}" for rows, columns in matrix.shapes)
    if matrix.kind in ("added", "removed"):
        return f" ({new if matrix.kind == 'added' else old})"
    return f" ({new})" if old == new else f" ({old}, now {new})"


def _summary(matrix: MatrixDifference) -> str:
    if matrix.kind in ("added", "removed"):
        return matrix.kind
    counts = [(matrix.count(kind), kind) for kind in _KINDS]
    words = ", ".join(f"{n} {kind}" for n, kind in counts if n) or "other shape"
    return f"{words} (the same values, written otherwise)" if matrix.kind == "rewritten" else words


def _changes(changes: tuple[Change, ...], shown: int | None, noun: str) -> Iterator[str]:
    yield from (line for change in changes[:shown] for line in _in_text(change))
    if shown is not None and len(changes) > shown:
        yield f"  ... and {len(changes) - shown} {noun} more"


def _in_text(change: Change) -> Iterator[str]:
    yield f"  {change.kind} [{change.place}]"
    if change.through_shared_terms:
        yield f"    {change.after}  (through shared terms)"
        return
    if change.before:
        yield f"    - {change.before}"
    if change.after:
        yield f"    + {change.after}"


def _operations(difference: Difference) -> Iterator[str]:
    if not difference.operations:
        return
    width = max(map(len, (*difference.operations, _ALL)))
    yield "operations, before and after:"
    for kernel, (before, after) in difference.operations.items():
        yield f"  {kernel:{width}}  {_count(before)} {_count(after)}"
    yield f"  {_ALL:{width}}  {difference.totals[0]:>6} {difference.totals[1]:>6}"


def _count(flops: int | None) -> str:
    return f"{'-' if flops is None else flops:>6}"
