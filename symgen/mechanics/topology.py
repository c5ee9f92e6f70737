"""The spanning tree of a linkage and the order in which its unknowns are eliminated."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Tree:
    """A spanning tree from the ground.

    ``points`` lists the moving points from the ground outward, ``carrier`` the rod that carries each (None
    for the root of a part that no rod ties to the ground), ``cuts`` the rods that close loops.
    """

    points: tuple[str, ...]
    carrier: Mapping[str, str | None]
    cuts: tuple[str, ...]


def spanning_tree(ground: Iterable[str], points: Sequence[str], rods: Mapping[str, tuple[str, str]]) -> Tree:
    """Walk the rods breadth first from the ground points, in the order they are written.

    Parameters
    ----------
    ground
        Names of the fixed points.
    points
        Names of the moving points.
    rods
        The two ends of every rod that has at least one moving end.
    """
    at: dict[str, list[str]] = {}
    for rod, ends in rods.items():
        for end in ends:
            at.setdefault(end, []).append(rod)
    reached = list(dict.fromkeys(ground))
    seen, order = set(reached), []
    carrier: dict[str, str | None] = {}
    waiting = iter(points)
    while True:
        for point in reached:
            for rod in at.get(point, ()):
                far = rods[rod][1] if rods[rod][0] == point else rods[rod][0]
                if far not in seen:
                    seen.add(far)
                    reached.append(far)
                    order.append(far)
                    carrier[far] = rod
        root = next((p for p in waiting if p not in seen), None)
        if root is None:
            break
        seen.add(root)
        reached = [root]
        order.append(root)
        carrier[root] = None
    used = set(carrier.values())
    return Tree(tuple(order), carrier, tuple(rod for rod in rods if rod not in used))


def elimination_order(
    tree: Tree, coordinates: Mapping[str, Sequence[int]], multipliers: Mapping[str, int], count: int
) -> tuple[int, ...]:
    """Order the unknowns of [M J^T; J 0] so that no pivot vanishes unless J loses rank.

    Leaves first, each point followed by the multiplier of the rod that carries it; the multipliers that
    close loops last.

    Parameters
    ----------
    tree
        The spanning tree.
    coordinates
        Indices of the coordinates of each moving point.
    multipliers
        Index of the multiplier of each rod, counted behind the coordinates.
    count
        Number of all unknowns; those of no point and no rod of the tree come last in their own order.
    """
    order: list[int] = []
    for point in reversed(tree.points):
        order.extend(coordinates[point])
        rod = tree.carrier[point]
        if rod is not None:
            order.append(multipliers[rod])
    rest = sorted(set(range(count)) - set(order))
    return tuple(order + rest)
