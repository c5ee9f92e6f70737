"""Rooted trees, and the conditions that they set to Runge-Kutta methods (Hairer, Norsett, Wanner I, II.2)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from math import prod

from mpmath import fdot, mpf

#: A tree by its branches from the root, in order.
Tree = tuple["Tree", ...]


@cache
def trees(order: int) -> list[Tree]:
    """Return all rooted trees with this number of vertices."""
    return sorted(_forests(order - 1, order - 1))


@cache
def _forests(vertices: int, largest: int) -> list[Tree]:
    """Return the multisets of trees with this number of vertices together, each at most of the largest order."""
    if vertices == 0:
        return [()]
    found = {
        tuple(sorted((tree, *rest)))
        for size in range(1, min(vertices, largest) + 1)
        for tree in trees(size)
        for rest in _forests(vertices - size, size)
    }
    return sorted(found)


def order(tree: Tree) -> int:
    """Return the number of vertices."""
    return 1 + sum(map(order, tree))


def density(tree: Tree) -> int:
    """Return gamma of a tree: the product of the orders of all its subtrees."""
    return order(tree) * prod(map(density, tree))


def stage_weights(a: Sequence[Sequence[mpf]], tree: Tree, known: dict[Tree, list[mpf]]) -> list[mpf]:
    """Return for every stage the elementary weight of a tree, the products of A over its branches."""
    if tree not in known:
        weights = [mpf(1)] * len(a)
        for branch in tree:
            inner = stage_weights(a, branch, known)
            weights = [w * fdot(row, inner) for w, row in zip(weights, a, strict=True)]
        known[tree] = weights
    return known[tree]
