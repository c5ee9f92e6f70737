"""The order in which the unknowns of [M J^T; J 0] of a linkage are eliminated."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import sympy as sp

from symgen.mechanics.rods.elimination import cost, minimum_degree
from symgen.mechanics.rods.topology import elimination_order
from symgen.models.rods.linkage import RodsModel

#: All coordinates first loses as many digits as the condition of the mass matrix has.
_MOST_CONDITION = 100
#: Part of the cost along the tree that minimum degree may have: below that, results keep their last digits.
_WORTH = 0.75


def is_open(model: RodsModel) -> bool:
    """Return whether the constraints are the lengths of the rods of an open tree, each of a point of its own.

    Their rows are independent in every configuration: each has a point that no earlier row has.
    """
    tree = model.tree
    carriers = {tree.carrier[p] for p in tree.points} - {None}
    braced = any(tree.braces.values())
    return not tree.cuts and not braced and {c.link for c in model.constraints} == carriers


def order_of(
    model: RodsModel, masses: sp.MatrixBase, jacobian: sp.MatrixBase
) -> tuple[tuple[int, ...], tuple[tuple[str, int], ...]]:
    """Return the order along the tree, from its leaves to the root, or another one that is cheaper.

    Behind it are the orders that were compared and their costs in additions and multiplications, the chosen
    one first; the cost of an order along the tree that is dearer is counted up to the point where this shows.

    Along the tree of an open linkage, the number of operations is proportional to the number of rods, and
    masses may differ widely. A numeric mass matrix with all coordinates first has a numeric factor, and only
    the pivots of the multipliers remain as divisors, which is cheaper for short chains. With closed loops or
    bodies, rods that are not in the tree come last and the factor of their part is full, unless the order is
    of minimum degree.
    """
    n = masses.rows
    numbers = {ij: x.xreplace(model.linkage.constants) for ij, x in masses.todok().items()}
    slopes = {ij: x.xreplace(model.linkage.constants) for ij, x in jacobian.todok().items()}
    at = {p: range(i * len(model.axes), (i + 1) * len(model.axes)) for i, p in enumerate(model.moving)}
    lengths = {c.link: n + i for i, c in enumerate(model.constraints) if c.link}
    outward = elimination_order(model.tree, at, lengths, n + jacobian.rows)
    varies = {ij: not x.is_number for ij, x in numbers.items()}
    varies |= {(n + i, j): not x.is_number for (i, j), x in slopes.items()}
    if not is_open(model):
        name, other, worth = "minimum degree", minimum_degree(varies, n, n + jacobian.rows), _WORTH
    elif _is_even(numbers, n):
        name, worth = "all coordinates first", 1.0
        other = (*(k for k in outward if k < n), *(k for k in outward if k >= n))
    else:
        return outward, (("along the tree", cost(outward, varies)),)
    best = name, cost(other, varies)
    tree = "along the tree", cost(outward, varies, enough=best[1] / worth)
    return (other, (best, tree)) if best[1] / worth < tree[1] else (outward, (tree, best))


def _is_even(masses: Mapping[tuple[int, int], sp.Expr], size: int) -> bool:
    if not masses or not all(x.is_number for x in masses.values()):
        return False
    numbers = np.zeros((size, size))
    for ij, x in masses.items():
        numbers[ij] = x
    return bool(np.linalg.cond(numbers) <= _MOST_CONDITION)
