"""The constraint Jacobian of a driven linkage in block triangular form: driven cranks and Assur groups.

An Assur group is a part of a linkage that closes by itself if the previous groups are placed, such as a dyad
or a triad. The groups are the strongly connected components of the graph in which an unknown points to the
unknowns of the row matched to it (Dulmage and Mendelsohn).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from graphlib import TopologicalSorter

import numpy as np

from symgen.runtime.arrays import Indices

Numbers = Indices


@dataclass(frozen=True, slots=True)
class Groups:
    """Groups of unknowns in an order in which each depends on groups before it only.

    Attributes
    ----------
    starts
        Where each group starts among rows and columns, and where the last ends.
    rows, columns
        Constraints and coordinates, group by group.
    entries
        Place among the values, place in the kernel's output, constraint and coordinate of each entry. Values
        are the dense matrices of the groups, then the couplings.
    coupling_starts, coupling_columns
        Where the couplings of each row start, and where the last end; the place of each in ``columns``.
    """

    starts: Sequence[int]
    rows: Sequence[int]
    columns: Sequence[int]
    entries: Sequence[tuple[int, int, int, int]]
    coupling_starts: Sequence[int]
    coupling_columns: Sequence[int]

    @property
    def squares(self) -> int:
        """Number of values of the matrices of the groups."""
        return sum(width**2 for width in self.widths)

    @property
    def widths(self) -> list[int]:
        """Number of unknowns of each group."""
        return np.diff(self.starts).tolist()


def groups_of(places: Numbers, rows: Sequence[int], n: int) -> Groups:
    """Return the groups of n unknowns.

    Parameters
    ----------
    places
        Constraint, coordinate and place in the kernel's output of each entry that does not vanish everywhere,
        shape (entries, 3).
    rows
        n constraints whose rows are independent in some pose.

    Raises
    ------
    ValueError
        If the rows cannot be matched to the unknowns, so that they are dependent in every pose.
    """
    return _groups_of(np.ascontiguousarray(places, dtype=np.intp).tobytes(), tuple(rows), n)


@lru_cache(maxsize=64)
def _groups_of(pattern_of: bytes, rows: tuple[int, ...], n: int) -> Groups:
    """Return the groups of a pattern, which variants of a linkage share."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components, maximum_bipartite_matching

    places = np.frombuffer(pattern_of, dtype=np.intp).reshape(-1, 3)
    number = {row: i for i, row in enumerate(rows)}
    used = [(number[row], column, place) for row, column, place in places.tolist() if row in number]
    i, j, _ = np.array(used, dtype=np.intp).reshape(-1, 3).T
    pattern = csr_array((np.ones(len(used)), (i, j)), shape=(n, n))
    matched = maximum_bipartite_matching(pattern, perm_type="column")
    if np.any(matched < 0):
        raise ValueError("constraints are dependent in every pose")
    solves = np.empty(n, dtype=np.intp)  # the row matched to each column
    solves[matched] = np.arange(n)
    depends = pattern[solves]  # unknown on unknown
    count, label = connected_components(depends, connection="strong")
    before: dict[int, set[int]] = {c: set() for c in range(count)}
    for a, b in zip(*depends.nonzero(), strict=True):
        if label[a] != label[b]:
            before[int(label[a])].add(int(label[b]))
    ordered = TopologicalSorter({c: sorted(b) for c, b in before.items()}).static_order()
    parts = [np.flatnonzero(label == c) for c in ordered]
    columns = np.concatenate(parts) if parts else np.zeros(0, dtype=np.intp)
    at = np.empty(n, dtype=np.intp)
    at[columns] = np.arange(n)
    starts = [0, *np.cumsum([len(p) for p in parts], dtype=np.intp).tolist()]
    groups = Groups(starts, [rows[r] for r in solves[columns]], columns.tolist(), [], [0], [])
    return _filled(groups, {(row, int(at[column])): place for row, column, place in used}, solves[columns])


def _filled(groups: Groups, places: dict[tuple[int, int], int], order: Numbers) -> Groups:
    """Return groups with their entries, given the place in the output of each by its row and column."""
    by_row: dict[int, list[tuple[int, int]]] = {}
    for (row, column), place in sorted(places.items()):
        by_row.setdefault(row, []).append((column, place))
    entries, coupling_starts, first = [], [0], 0
    coupled: list[int] = []
    for start, width in zip(groups.starts, groups.widths, strict=False):
        for i in range(start, start + width):
            for column, place in by_row[int(order[i])]:
                value = first + (i - start) * width + column - start
                if column < start:
                    value = groups.squares + len(coupled)
                    coupled.append(column)
                entries.append((value, place, groups.rows[i], groups.columns[column]))
            coupling_starts.append(len(coupled))
        first += width**2
    return replace(groups, entries=entries, coupling_starts=coupling_starts, coupling_columns=coupled)
