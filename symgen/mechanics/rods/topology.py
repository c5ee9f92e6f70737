"""The spanning tree of a linkage and the order in which its unknowns are eliminated."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Tree:
    """A spanning tree from the ground.

    ``points`` lists the moving points from the ground outward, ``carrier`` the rod that carries each (None
    for the root of a part without rod to the ground), ``braces`` the further rods of the same body to the
    point, ``cuts`` the rods that close loops.
    """

    points: tuple[str, ...]
    carrier: Mapping[str, str | None]
    cuts: tuple[str, ...]
    braces: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


def spanning_tree(
    ground: Iterable[str],
    points: Sequence[str],
    rods: Mapping[str, tuple[str, str]],
    supports: Mapping[str, Sequence[str]] | None = None,
    bodies: Mapping[str, str] | None = None,
) -> Tree:
    """Traverse the rods breadth first from the ground points, in the order they are written.

    Parameters
    ----------
    ground
        Names of the fixed points.
    points
        Names of the moving points.
    rods
        The two ends of every rod that has at least one moving end.
    supports
        The points that place an end without coordinates of its own: it is reached when they are.
    bodies
        The body of every rod that is a distance between points of a body.
    """
    placed_by = supports or {}
    ends = {rod: tuple(tuple(placed_by.get(e, (e,))) for e in pair) for rod, pair in rods.items()}
    at: dict[str, list[str]] = {}
    for rod, (a, b) in ends.items():
        for end in dict.fromkeys((*a, *b)):
            at.setdefault(end, []).append(rod)
    reached = list(dict.fromkeys(ground))
    seen, order = set(reached), []
    carrier: dict[str, str | None] = {}
    waiting = iter(points)
    while True:
        for point in reached:
            for rod in at.get(point, ()):
                far = _carried(ends[rod], seen)
                if far:
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
    braces = _braces(order, carrier, ends, bodies or {})
    used = {*carrier.values(), *(rod for held in braces.values() for rod in held)}
    return Tree(tuple(order), carrier, tuple(rod for rod in rods if rod not in used), braces)


def _carried(ends: tuple[tuple[str, ...], ...], seen: set[str]) -> str:
    """Return the new point that a rod carries from an end that is already reached, if any."""
    for near, far in (ends, ends[::-1]):
        if len(far) == 1 and far[0] not in seen and all(p in seen for p in near):
            return far[0]
    return ""


def _braces(
    order: Sequence[str],
    carrier: Mapping[str, str | None],
    ends: Mapping[str, tuple[tuple[str, ...], ...]],
    bodies: Mapping[str, str],
) -> dict[str, tuple[str, ...]]:
    """Return, for each point that a body carries, the body's further rods to earlier points."""
    later = set(order)
    braces: dict[str, tuple[str, ...]] = {}
    for point in order:
        later.discard(point)
        main = carrier[point]
        if main and main in bodies:
            held = []
            for rod, body in bodies.items():
                a, b = ends[rod]
                rest = b if a == (point,) else a if b == (point,) else (point,)
                if rod != main and body == bodies[main] and point not in rest and not later & set(rest):
                    held.append(rod)
            braces[point] = tuple(held)
    return braces


def elimination_order(
    tree: Tree, coordinates: Mapping[str, Sequence[int]], multipliers: Mapping[str, int], count: int
) -> tuple[int, ...]:
    """Order the unknowns of [M J^T; J 0] so that no pivot vanishes unless J loses rank.

    Leaves first, each point followed by the multipliers of the rods that carry it; the multipliers that
    close loops last.

    Parameters
    ----------
    tree
        The spanning tree.
    coordinates
        Indices of the coordinates of each moving point.
    multipliers
        Index of the multiplier of each rod, counted from the first coordinate.
    count
        Number of all unknowns; those outside the tree come last in their own order.
    """
    order: list[int] = []
    for point in reversed(tree.points):
        order.extend(coordinates[point])
        rod = tree.carrier[point]
        if rod is not None:
            order.extend(multipliers[r] for r in (rod, *tree.braces.get(point, ())))
    rest = sorted(set(range(count)) - set(order))
    return tuple(order + rest)
