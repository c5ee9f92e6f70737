"""Spanning tree, cuts and elimination order."""

from __future__ import annotations

from symgen.mechanics.rods.topology import elimination_order, spanning_tree

PEAUCELLIER = {
    "OA": ("O", "A"), "AB": ("A", "B"), "BC": ("B", "C"), "CD": ("C", "D"),
    "DE": ("D", "E"), "BE": ("B", "E"), "AD": ("A", "D"),
}  # fmt: skip


def test_peaucellier_has_three_cuts():
    tree = spanning_tree(["O", "E"], ["A", "B", "C", "D"], PEAUCELLIER)
    assert set(tree.points) == {"A", "B", "C", "D"}
    assert len(tree.cuts) == 3
    assert {r for r in tree.carrier.values()} | set(tree.cuts) == set(PEAUCELLIER)


def test_a_tree_needs_no_cut():
    rods = {"a": ("O", "P"), "b": ("P", "Q"), "c": ("P", "R"), "d": ("R", "S")}
    tree = spanning_tree(["O"], ["P", "Q", "R", "S"], rods)
    assert tree.cuts == ()
    assert tree.carrier == {"P": "a", "Q": "b", "R": "c", "S": "d"}


def test_a_free_chain_has_a_root_of_its_own():
    tree = spanning_tree([], ["P", "Q"], {"a": ("P", "Q")})
    assert tree.carrier == {"P": None, "Q": "a"}


def test_each_point_is_followed_by_its_carrier_and_cuts_come_last():
    tree = spanning_tree(["O", "E"], ["A", "B", "C", "D"], PEAUCELLIER)
    coordinates = {p: range(2 * i, 2 * i + 2) for i, p in enumerate("ABCD")}
    multipliers = {r: 8 + i for i, r in enumerate(PEAUCELLIER)}
    order = elimination_order(tree, coordinates, multipliers, 15)
    assert sorted(order) == list(range(15))
    assert set(order[-3:]) == {multipliers[r] for r in tree.cuts}
    for point, rod in tree.carrier.items():
        last = max(order.index(k) for k in coordinates[point])
        assert order[last + 1] == multipliers[rod]
    parents = {
        p: PEAUCELLIER[r][0] if PEAUCELLIER[r][1] == p else PEAUCELLIER[r][1] for p, r in tree.carrier.items()
    }
    for child, parent in parents.items():
        if parent in coordinates:
            assert order.index(coordinates[child][0]) < order.index(coordinates[parent][0])
