"""Mathematical changes between two records of a model."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction

from symgen.symbolic.record import EntryValues, Record, RecordedMatrix, terms_of

#: Values with a smaller relative difference are the same mathematics in another form.
_SAME = Fraction(1, 10**15)
#: Largest denominator of a factor that entries have in common, or of its inverse.
_DENOMINATOR = 1000
#: Place of a changed unit, which is that of all entries.
UNIT = "unit"
_NAME = re.compile(r"[^\W\d]\w*")


@dataclass(frozen=True, slots=True)
class Change:
    """Change of an entry, a shared subexpression or a unit.

    ``kind`` is ``added`` (previously zero or absent), ``removed``, ``changed``, or ``rewritten``: another
    text of the same value. An absent text is empty. ``through`` names the shared subexpressions with another
    text that an entry of the same text uses, directly or by others: the nearest first.
    """

    kind: str
    place: str
    before: str = ""
    after: str = ""
    through: tuple[str, ...] = ()

    @property
    def through_shared_terms(self) -> bool:
        """Whether the text is the same but the value of its symbols changed."""
        return self.kind == "changed" and self.before == self.after


@dataclass(frozen=True, slots=True)
class MatrixDifference:
    """Change of a matrix: ``kind`` as in :class:`Change`, and its changed entries.

    ``factor`` is the rational number that every changed entry is multiplied by; empty if there is none.
    ``entries`` counts the entries that are not zero in either record.
    """

    kind: str
    name: str
    shapes: tuple[tuple[int, int], tuple[int, int]]
    changes: tuple[Change, ...]
    factor: str = ""
    entries: int = 0

    @property
    def whole(self) -> bool:
        """Whether all entries are multiplied by the factor, and no other entry changed."""
        return bool(self.factor) and len(self._of_entries) == self.count("changed") == self.entries

    @property
    def has_other_unit(self) -> bool:
        """Whether the unit changed."""
        return len(self._of_entries) < len(self.changes)

    def count(self, kind: str) -> int:
        """Return the number of entries with this kind of change."""
        return sum(c.kind == kind for c in self._of_entries)

    @property
    def _of_entries(self) -> tuple[Change, ...]:
        return tuple(c for c in self.changes if c.place != UNIT)


@dataclass(frozen=True, slots=True)
class Difference:
    """Changes from one record to another.

    Attributes
    ----------
    matrices
        Changed matrices.
    constants
        Constants of the scene that changed.
    definitions
        Shared subexpressions that changed as text.
    operations
        Kernels with changed operation counts: before and after, None for an absent kernel.
    totals
        Operations of all kernels together, before and after.
    values
        Values of arguments that differ, where both sources give them: not part of the mathematics.
    """

    matrices: tuple[MatrixDifference, ...]
    constants: tuple[Change, ...]
    definitions: tuple[Change, ...]
    operations: Mapping[str, tuple[int | None, int | None]]
    totals: tuple[int, int]
    values: tuple[Change, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.matrices or self.constants or self.definitions or self.operations)


def difference(before: Record, after: Record) -> Difference:
    """Return the changes between two records, in the order of the later one."""
    costs = before.operations, after.operations
    values = EntryValues(before), EntryValues(after)
    return Difference(
        tuple(
            d
            for name in _names(before.matrices, after.matrices)
            if (d := _matrix(name, before, after, values))
        ),
        texts(before.constants, after.constants),
        texts(before.definitions, after.definitions),
        {k: c for k in _names(*costs) if len(set(c := (costs[0].get(k), costs[1].get(k)))) > 1},
        (sum(costs[0].values()), sum(costs[1].values())),
    )


def _names(before: Mapping[str, object], after: Mapping[str, object]) -> list[str]:
    """Return the names of both, removed ones last."""
    return list(dict.fromkeys([*after, *before]))


_NOTHING = RecordedMatrix("", 0, 0, {})


def _matrix(
    name: str, before: Record, after: Record, values: tuple[EntryValues, EntryValues]
) -> MatrixDifference | None:
    old, new = before.matrices.get(name, _NOTHING), after.matrices.get(name, _NOTHING)
    there = _names(old.entries, new.entries)
    terms = [terms_of(record, name) for record in (before, after)]
    differences, factor = [], ""
    if old.entries != new.entries or terms[0] != terms[1]:
        found = [v.of(name) for v in values]
        differences = [c for place in there if (c := _entry(place, old, new, found))]
        factor = _factor([c.place for c in differences if c.kind == "changed"], found)
    if any(c.through_shared_terms for c in differences):
        differences = [
            replace(c, through=_through(c.after, terms)) if c.through_shared_terms else c for c in differences
        ]
    if old is not _NOTHING and new is not _NOTHING and old.unit != new.unit:
        differences.insert(0, Change("changed", UNIT, old.unit, new.unit))
    shapes = (old.rows, old.columns), (new.rows, new.columns)
    if not differences and shapes[0] == shapes[1]:
        return None
    kind = "added" if old is _NOTHING else "removed" if new is _NOTHING else "changed"
    if kind == "changed" and shapes[0] == shapes[1] and all(c.kind == "rewritten" for c in differences):
        kind = "rewritten"
    return MatrixDifference(kind, name, shapes, tuple(differences), factor, len(there))


def _entry(
    place: str, old: RecordedMatrix, new: RecordedMatrix, found: list[dict[str, str]]
) -> Change | None:
    before, after = old.entries.get(place, ""), new.entries.get(place, "")
    if not before or not after:
        return Change("removed" if before else "added", place, before, after)
    pair = found[0].get(place), found[1].get(place)
    if pair == (None, None):
        return None if before == after else Change("changed", place, before, after)
    if not _equal(*pair):
        return Change("changed", place, before, after)
    return None if before == after else Change("rewritten", place, before, after)


def _factor(places: list[str], found: list[dict[str, str]]) -> str:
    """Return the rational number that the values at these places are multiplied by; empty if none is."""
    try:
        pairs = [(Fraction(found[0][p]), Fraction(found[1][p])) for p in places]
        factors = {_rational(after / before) for before, after in pairs}
    except (KeyError, ValueError, ZeroDivisionError):  # no value, or none whose ratio is defined
        return ""
    return str(factors.pop() or "") if len(factors) == 1 else ""


def _rational(ratio: Fraction) -> Fraction | None:
    """Return the simple fraction that a ratio of values is within their digits."""
    if abs(ratio) < 1:
        inverse = _rational(1 / ratio)
        return 1 / inverse if inverse else None
    near = ratio.limit_denominator(_DENOMINATOR)
    return near if abs(near - ratio) <= _SAME * abs(ratio) else None


def _through(text: str, terms: list[dict[str, str]]) -> tuple[str, ...]:
    """Return the shared subexpressions with other texts that a text uses, the nearest first."""
    used: dict[str, None] = {}
    front = [text]
    while front:
        names = dict.fromkeys(n for t in front for n in _NAME.findall(t) if n not in used)
        found = [n for n in names if any(n in t for t in terms)]
        used |= dict.fromkeys(found)
        front = [t[n] for n in found for t in terms if n in t]
    return tuple(n for n in used if terms[0].get(n) != terms[1].get(n))


def _equal(before: str | None, after: str | None) -> bool:
    """Return whether two values are equal within their digits."""
    if before == after or before is None or after is None:
        return before == after
    try:
        a, b = Fraction(before), Fraction(after)
    except ValueError:  # complex, or not finite
        return False
    return abs(a - b) <= _SAME * max(abs(a), abs(b))


def texts(before: Mapping[str, str], after: Mapping[str, str]) -> tuple[Change, ...]:
    """Return the added, removed and changed named texts, in the order of the later ones."""
    changes = []
    for name in _names(before, after):
        old, new = before.get(name, ""), after.get(name, "")
        if old != new:
            kind = "changed" if old and new else "added" if new else "removed"
            changes.append(Change(kind, name, old, new))
    return tuple(changes)
