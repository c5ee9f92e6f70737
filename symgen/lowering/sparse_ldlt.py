"""Sparse L D L^T of a symmetric matrix as straight-line code, in an order fixed when it is generated.

For [M J^T; J 0] in spanning-tree order, or all coordinates first, the pivots vanish only where J loses rank,
so no pivoting is needed. The factorisation reports, for every unknown, its pivot and the part of it that
cannot cancel: their ratio tells how near to losing rank the configuration is. A multiplier whose pivot
cancelled is set to zero: its row follows from those before it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from symgen.errors import DerivationError
from symgen.lowering.like_terms import fewest
from symgen.lowering.nodes import ZERO, Node, add, guarded_reciprocal, less, multiply, reciprocal
from symgen.lowering.straight_line import StraightLine

_Taken = dict[tuple[int, int], list[tuple[int, Node]]]


@dataclass(frozen=True, slots=True)
class Factor:
    """The factors, as atoms: ``inverse[k]`` is 1/D_k, ``lower[i, k]`` the nonzero L_ik below the diagonal.

    ``pivot[k]`` is D_k, ``sound[k]`` the sum of its terms that have its own sign; ``watched`` tells whether
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
    """Factorise, adding the assignments to ``line``.

    Parameters
    ----------
    entries
        Nonzero entries (i, j), either triangle or both, as atoms or small expressions.
    order
        The elimination order of all unknowns.
    primal
        Unknowns below this number are coordinates (positive pivots), the others multipliers (negative).
    labels
        Names of the unknowns, for the error.
    tolerance
        A multiplier whose pivot keeps no more of its sound part is zero. None where no multiplier's pivot can
        vanish: all of it is sound.

    Raises
    ------
    DerivationError
        When a pivot is zero by structure: nothing determines that unknown.
    """
    place = {k: i for i, k in enumerate(order)}
    kept: dict[tuple[int, int], list[Node]] = {}
    taken: _Taken = {}
    below: dict[int, set[int]] = {k: set() for k in order}
    for (i, j), value in entries.items():
        if value != ZERO:
            late, early = (i, j) if place[i] >= place[j] else (j, i)
            kept[late, early] = [value]
            if late != early:
                below[early].add(late)
    inverse: dict[int, Node] = {}
    lower: dict[tuple[int, int], Node] = {}
    pivot: dict[int, Node] = {}
    sound: dict[int, Node] = {}
    watched = tolerance is not None

    def total(plus: Iterable[Node], minus: Iterable[Node] = ()) -> Node:
        # Where pivots may nearly vanish what cancels is left as it stands: see `solve`.
        return add(plus, minus) if watched else fewest(line, plus, minus)

    for k in order:
        # Terms from unknowns of the other kind have the sign of this pivot; those of its own kind cancel.
        of_sign = total(kept.get((k, k), ()), _of_kind(taken, k, primal, same=False))
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
            i: line.name(total(kept.get((i, k), ()), (x for _, x in taken.get((i, k), ()))), f"a{i}_{k}")
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


def solve(line: StraightLine, factors: Factor, rhs: Sequence[Node]) -> list[Node]:
    """Solve with the factors, adding the assignments to ``line``; return the solution as atoms.

    What is ready last is taken last, so that nothing waits. Not so where pivots may nearly vanish: large
    terms cancel there, and with those of one sign first runs come nearer to a loss of rank.
    """
    rows: dict[int, list[int]] = {k: [] for k in factors.order}
    columns: dict[int, list[int]] = {k: [] for k in factors.order}
    for i, k in factors.lower:
        rows[i].append(k)
        columns[k].append(i)
    y: dict[int, Node] = {}
    for i in factors.order:
        earlier = [multiply(factors.lower[i, k], y[k]) for k in rows[i]]
        y[i] = line.name(add([rhs[i]], earlier) if factors.watched else less(rhs[i], earlier), f"y{i}")
    x: dict[int, Node] = {}
    for k in reversed(factors.order):
        scaled = multiply(y[k], factors.inverse[k])
        later = [multiply(factors.lower[i, k], x[i]) for i in columns[k]]
        x[k] = line.name(add([scaled], later) if factors.watched else less(scaled, later[::-1]), f"x{k}")
    return [x[i] for i in range(len(rhs))]
