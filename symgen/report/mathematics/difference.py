"""Changes in the mathematics as text."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Iterator
from dataclasses import replace
from typing import TypeVar

from symgen.symbolic.difference import Change, Difference, MatrixDifference

_ALL = "all kernels"
#: Maximum number of shared terms named as the cause of a change; further ones are counted.
_TERMS = 3
_KINDS = ("added", "removed", "changed", "rewritten")


def difference_lines(difference: Difference, shown: int | None = None) -> Iterator[str]:
    """Yield the changes: matrices with entries before and after, shared terms, operation counts, values.

    Equal changes of several entries or matrices are listed once; matrices of which all entries are multiplied
    by the same factor are named together in a line above.

    Parameters
    ----------
    difference
        The difference.
    shown
        Maximum number of printed entries per matrix, and of shared terms; None for all.
    """
    yield from mathematics_lines(difference, shown)
    yield from operation_lines(difference)
    if difference.values:
        yield "tunable parameters, which are arguments of the kernels:"
        yield from _changes(difference.values, shown, "parameters")


def mathematics_lines(difference: Difference, shown: int | None) -> Iterator[str]:
    """Yield the changes of matrices and shared terms."""
    if not difference:
        yield "no change in the mathematics"
    for factor, scaled in grouped((m.factor, m) for m in difference.matrices if m.whole).items():
        if len(scaled) > 1:
            yield f"{series([m.name for m in scaled])}: all entries times {factor}"
    for same in grouped((replace(m, name=""), m) for m in difference.matrices).values():
        matrix = same[0]
        yield f"{series([m.name for m in same])}{_shape(matrix)}: {_summary(matrix)}"
        yield from _changes(matrix.changes, shown, "entries")
    if difference.constants:
        yield "constants:"
        yield from _changes(difference.constants, shown, "constants")
    if difference.definitions:
        yield "shared terms:"
        yield from _changes(difference.definitions, shown, "terms")


_Key = TypeVar("_Key", bound=Hashable)
_Value = TypeVar("_Value")


def grouped(pairs: Iterable[tuple[_Key, _Value]]) -> dict[_Key, list[_Value]]:
    """Return the values of each key, in the order of the first one."""
    groups: dict[_Key, list[_Value]] = {}
    for group, value in pairs:
        groups.setdefault(group, []).append(value)
    return groups


def series(names: list[str]) -> str:
    """Return names as a list; three or more with consecutive numbers at their ends as first to last."""
    ends = [re.fullmatch(r"(.*?)(\d+)", name) for name in names]
    numbers = [(end[1], int(end[2])) for end in ends if end] if all(ends) else []
    if len(numbers) > 2 and all(n == (numbers[0][0], numbers[0][1] + k) for k, n in enumerate(numbers)):
        return f"{names[0]} to {names[-1]}"
    return " and ".join((", ".join(names[:-1]), names[-1])) if len(names) > 1 else names[0]


def _shape(matrix: MatrixDifference) -> str:
    old, new = (f"{rows} x {columns}" for rows, columns in matrix.shapes)
    if matrix.kind in ("added", "removed"):
        return f" ({new if matrix.kind == 'added' else old})"
    return f" ({new})" if old == new else f" ({old}, now {new})"


def _summary(matrix: MatrixDifference) -> str:
    if matrix.kind in ("added", "removed"):
        return matrix.kind
    unit = ["other unit"] if matrix.has_other_unit else []
    if matrix.whole and matrix.entries > 1:
        return ", ".join([f"all entries times {matrix.factor}", *unit])
    counts = [(matrix.count(kind), kind) for kind in _KINDS]
    words = (
        ", ".join([*(f"{n} {kind}{_times(matrix, kind)}" for n, kind in counts if n), *unit]) or "other shape"
    )
    return f"{words} (the same values, written otherwise)" if matrix.kind == "rewritten" else words


def _times(matrix: MatrixDifference, kind: str) -> str:
    return f" (times {matrix.factor})" if kind == "changed" and matrix.factor else ""


def _changes(changes: tuple[Change, ...], shown: int | None, noun: str) -> Iterator[str]:
    alike = list(grouped((replace(change, place=""), change.place) for change in changes).items())
    yield from (line for change, places in alike[:shown] for line in _in_text(change, places))
    if more := sum(len(places) for _, places in alike[shown:] if shown is not None):
        yield f"  ... and {more} {noun} more"


def _in_text(change: Change, places: list[str]) -> Iterator[str]:
    yield f"  {change.kind} {series([f'[{place}]' for place in places])}"
    if change.through_shared_terms:
        yield f"    {change.after}  (through {_terms(change.through)})"
        return
    if change.before:
        yield f"    - {change.before}"
    if change.after:
        yield f"    + {change.after}"


def _terms(names: tuple[str, ...]) -> str:
    if not names:
        return "shared terms"
    more = len(names) - _TERMS
    return ", ".join(names[:_TERMS]) + (f" and {more} more" if more > 0 else "")


def operation_lines(difference: Difference, model: str = "") -> Iterator[str]:
    """Yield the operation counts that changed; the model is named if there are several."""
    if not difference.operations:
        return
    width = max(map(len, (*difference.operations, _ALL)))
    yield f"operations{f' of {model}' if model else ''}, before and after:"
    for kernel, (before, after) in difference.operations.items():
        yield f"  {kernel:{width}}  {_count(before)} {_count(after)}"
    yield f"  {_ALL:{width}}  {difference.totals[0]:>6} {difference.totals[1]:>6}"


def _count(flops: int | None) -> str:
    return f"{'-' if flops is None else flops:>6}"
