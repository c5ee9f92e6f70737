"""Sparse L D L^T of a symmetric matrix as straight-line code, with an elimination order fixed in advance.

For [M J^T; J 0] in spanning-tree order, or with all coordinates first, the pivots vanish only if J loses
rank, so no pivoting is needed. The factorisation reports, for every unknown, its pivot and the part of it
that cannot cancel: their ratio measures the distance from a loss of rank. A multiplier whose pivot has
cancelled is set to zero: its row depends on the earlier ones.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from symgen.errors import DerivationError
from symgen.lowering.expressions import ZERO, Node, add, guarded_reciprocal, less, multiply, reciprocal
from symgen.lowering.like_terms import fewest
from symgen.lowering.straight_line import StraightLine

_Taken = dict[tuple[int, int], list[tuple[int, Node]]]


@dataclass(frozen=True, slots=True)
class Factor:
    """Factors as atoms: ``inverse[k]`` is 1/D_k, ``lower[i, k]`` the nonzero L_ik below the diagonal.

    ``pivot[k]`` is D_k, ``sound[k]`` the sum of its terms with the sign of the pivot; ``watched`` is True if
    some pivot may vanish.
    """

    order: tuple[int, ...]
    inverse: Mapping[int, Node]
    lower: Mapping[tuple[int, int], Node]
    pivot: Mapping[int, Node]
    sound: Mapping[int, Node]
    watched: bool


def factor(
    line: StraightLine,
    entries: Mapping[tuple[int, int], Node],
    order: Sequence[int],
    primal: int,
    labels: Sequence[str],
    tolerance: Node | None,
) -> Factor:
    """Factorise, appending the assignments to ``line``.

    Parameters
    ----------
    entries
        Nonzero entries (i, j), either triangle or both, as atoms or small expressions.
    order
        Elimination order of all unknowns.
    primal
        Number of coordinates, which come first (positive pivots); multipliers follow (negative pivots).
    labels
        Names of the unknowns, for error messages.
    tolerance
        A multiplier is zero if the ratio of its pivot to the sound part does not exceed this. None if no
        multiplier's pivot can vanish.

    Raises
    ------
    DerivationError
        If a pivot is structurally zero: the unknown is undetermined.
    """
    place = {k: i for i, k in enumerate(order)}
    pending: dict[tuple[int, int], list[Node]] = {}
    taken: _Taken = {}
    below: dict[int, set[int]] = {k: set() for k in order}
    for (i, j), value in entries.items():
        if value != ZERO:
            late, early = (i, j) if place[i] >= place[j] else (j, i)
            pending[late, early] = [value]
            if late != early:
                below[early].add(late)
    inverse: dict[int, Node] = {}
    lower: dict[tuple[int, int], Node] = {}
    pivot: dict[int, Node] = {}
    sound: dict[int, Node] = {}
    watched = tolerance is not None

    def total(plus: Iterable[Node], minus: Iterable[Node] = ()) -> Node:
        # If pivots may nearly vanish, cancelling terms are not collected: see `solve`.
        return add(plus, minus) if watched else fewest(line, plus, minus)

    for k in order:
        # Terms from unknowns of the other kind have the sign of this pivot; those of the same kind cancel.
        of_sign = total(pending.get((k, k), ()), _of_kind(taken, k, primal, same=False))
        if of_sign == ZERO:
            raise DerivationError(f"nothing determines {labels[k]}: its pivot is zero whatever the state")
        cancelling = _of_kind(taken, k, primal, same=True)
        if k >= primal and not watched:
            of_sign, cancelling = add([of_sign], cancelling), []
        sound[k] = line.name(of_sign, f"s{k}")
        pivot[k] = line.name(add([sound[k]], cancelling), f"d{k}")
        if cancelling and k >= primal and tolerance is not None:
            one_over = guarded_reciprocal(pivot[k], sound[k], tolerance)
        else:
            one_over = reciprocal(pivot[k])
        inverse[k] = line.name(one_over, f"r{k}")
        rows = sorted(below[k], key=place.__getitem__)
        column = {
            i: line.name(total(pending.get((i, k), ()), (x for _, x in taken.get((i, k), ()))), f"a{i}_{k}")
            for i in rows
        }
        rows = [i for i in rows if column[i] != ZERO]
        for n, i in enumerate(rows):
            lower[i, k] = line.name(total([multiply(column[i], inverse[k])]), f"l{i}_{k}")
            for j in rows[: n + 1]:
                taken.setdefault((i, j), []).append((k, multiply(lower[i, k], column[j])))
                if i != j:
                    below[j].add(i)
    return Factor(tuple(order), inverse, lower, pivot, sound, watched)


def _of_kind(taken: _Taken, k: int, primal: int, *, same: bool) -> list[Node]:
    return [x for j, x in taken.get((k, k), ()) if ((j < primal) == (k < primal)) == same]


def solve(line: StraightLine, factors: Factor, rhs: Sequence[Node], mark: str = "") -> list[Node]:
    """Solve with the factors, appending the assignments to ``line``; return the solution as atoms.

    Terms that become available last are subtracted last, to shorten dependency chains. If pivots may nearly
    vanish, terms of one sign come first instead: with large cancelling terms, runs then get closer to a
    loss of rank. ``mark`` ends the names of this solution among others of the same line.
    """
    rows: dict[int, list[int]] = {k: [] for k in factors.order}
    columns: dict[int, list[int]] = {k: [] for k in factors.order}
    for i, k in factors.lower:
        rows[i].append(k)
        columns[k].append(i)
    y: dict[int, Node] = {}
    for i in factors.order:
        earlier = [multiply(factors.lower[i, k], y[k]) for k in rows[i]]
        y[i] = line.name(add([rhs[i]], earlier) if factors.watched else less(rhs[i], earlier), f"y{i}{mark}")
    x: dict[int, Node] = {}
    for k in reversed(factors.order):
        scaled = multiply(y[k], factors.inverse[k])
        later = [multiply(factors.lower[i, k], x[i]) for i in columns[k]]
        x[k] = line.name(
            add([scaled], later) if factors.watched else less(scaled, later[::-1]), f"x{k}{mark}"
        )
    return [x[i] for i in range(len(rhs))]
