"""The order of elimination, its cost, and sums of like terms."""

from __future__ import annotations

import numpy as np
import pytest
from shared.shipped import derived

import symgen
from symgen.lowering.expressions import Constant, Negative, Product, Quotient, Reference, Sum, count
from symgen.lowering.like_terms import fewest
from symgen.lowering.straight_line import StraightLine
from symgen.mechanics.rods.elimination import cost, minimum_degree


def chain(masses, more=()):
    """Return a chain of rods of 1 m, each at its own angle."""
    places = np.cumsum([[np.cos(0.4 * k), -np.sin(0.4 * k)] for k in range(len(masses))], axis=0)
    points = {"P0": {"at": ["0 m", "0 m"], "ground": True}}
    points |= {f"P{k + 1}": {"at": [f"{x!r} m" for x in p]} for k, p in enumerate(places.tolist())}
    links = {f"L{k}": {"points": [f"P{k}", f"P{k + 1}"], "mass": f"{m} kg"} for k, m in enumerate(masses)}
    for a, b in more:
        links[f"{a}{b}"] = {"points": [a, b], "mass": "1 kg"}
    return symgen.Scene(title="chain", points=points, links=links)


def coordinates_first(scene):
    system = symgen.derive(scene)
    n = system[system.saddle_point.mass].matrix.rows
    order = system.saddle_point.order
    assert sorted(order) == list(range(len(order)))
    return set(order[:n]) == set(range(n))


@pytest.mark.parametrize(
    ("masses", "more", "first"),
    [
        ([1] * 3, (), True),
        ([1] * 12, (), False),  # the factor of the multipliers' part is full
        ([1, 1, 1000], (), False),  # as many digits would be lost as the masses differ by
        ([1] * 3, (("P0", "P3"),), False),  # a closed loop may lose rank: its pivots are watched
    ],
)
def test_coordinates_come_first_in_short_open_chains_of_like_masses(masses, more, first):
    assert coordinates_first(chain(masses, more)) == first


def test_in_a_tree_no_pivot_is_guarded_and_none_is_said_to_cancel():
    scene = chain([1] * 3)
    assert symgen.derive(scene).saddle_point.independent
    model = symgen.build(scene)
    equations, start = model.evaluator.equations(), model.initial_state()
    assert equations.check(0.0, np.concatenate([start.q, start.u])) == 0
    assert equations.soundness == 1.0


def test_a_pivot_that_is_constant_costs_nothing():
    """Two coordinates with constant masses and one multiplier whose row varies."""
    varies = {(0, 0): False, (1, 1): False, (1, 0): False, (2, 0): True, (2, 1): True}
    assert cost((0, 1, 2), varies) < cost((0, 2, 1), varies)
    assert cost((0, 1), {(0, 0): False, (1, 0): False, (1, 1): False}) == 4


def four_bars(n):
    """Return the variable (True) and constant entries of [M J^T; J 0] of n four-bars in a row, by hand.

    Point k of the n + 1 moving points has the coordinates 2 k and 2 k + 1; n + 1 uprights, then n couplers.
    """
    entries = {}
    for k in range(n + 1):
        x, y = 2 * k, 2 * k + 1
        entries |= {(x, x): False, (y, y): False, (2 * (n + 1) + k, x): True, (2 * (n + 1) + k, y): True}
        if k:
            entries |= {(x, x - 2): False, (y, y - 2): False}
            entries |= {(3 * (n + 1) + k - 1, c): True for c in (x - 2, y - 2, x, y)}
    return entries


def test_minimum_degree_of_four_bars_in_a_row_is_linear():
    orders = {n: minimum_degree(four_bars(n), 2 * n + 2, 4 * n + 3) for n in (10, 20, 40, 80)}
    assert [cost(order, four_bars(n)) for n, order in orders.items()] == [3411, 6981, 14121, 28401]


@pytest.mark.parametrize("seed", range(8))
def test_leading_blocks_of_minimum_degree_have_as_many_negative_values_as_multipliers(seed):
    """Random masses and rows, some on the same coordinates: no leading block is singular."""
    rng = np.random.default_rng(seed)
    n, m = 12, 9
    rows = [rng.choice(n, size=rng.integers(1, 5), replace=False) for _ in range(m)]
    jacobian = np.zeros((m, n))
    for row, columns in zip(jacobian, rows, strict=True):
        row[columns] = rng.uniform(0.5, 1.5, len(columns))
    half = np.where(rng.random((n, n)) < 0.2, rng.standard_normal((n, n)), 0.0)
    matrix = np.block([[half @ half.T + np.eye(n), jacobian.T], [jacobian, np.zeros((m, m))]])
    order = minimum_degree(np.argwhere(matrix).tolist(), n, n + m)
    assert sorted(order) == list(range(n + m))
    for size in range(1, n + m + 1):
        leading = order[:size]
        multipliers = [k for k in leading if k >= n]
        for k in multipliers:
            assert set(np.flatnonzero(jacobian[k - n])) <= set(leading[: leading.index(k)])
        values = np.linalg.eigvalsh(matrix[np.ix_(leading, leading)])
        if np.linalg.matrix_rank(jacobian[[k - n for k in multipliers]]) == len(multipliers):
            assert np.min(np.abs(values)) > 1e-9
            assert np.sum(values < 0) == len(multipliers)


def test_linkages_with_loops_are_eliminated_by_minimum_degree_where_that_is_cheaper():
    linked = chain([1] * 8, [("P0", "P2"), ("P2", "P4"), ("P4", "P6"), ("P6", "P8")])
    system = symgen.derive(linked)
    point = system.saddle_point
    masses, jacobian = system[point.mass].matrix, system[point.jacobian].matrix
    n = masses.rows
    entries = [(i, j) for i in range(n) for j in range(n) if masses[i, j] != 0]
    entries += [(n + i, j) for i in range(jacobian.rows) for j in range(n) if jacobian[i, j] != 0]
    assert point.order == minimum_degree(entries, n, n + jacobian.rows)
    along_the_tree = (2, 3, 6, 0, 1, 4, 5)  # B, rocker, A, crank, coupler
    assert derived("four_bar").saddle_point.order == along_the_tree


def line_of(**values):
    line = StraightLine()
    return line, [line.name(value, name) for name, value in values.items()]


def test_like_terms_are_one_where_that_is_less():
    x, y = Reference("x"), Reference("y")
    line, (twice, same) = line_of(twice=Product((Constant("2"), x)), same=Quotient(x, y))
    assert fewest(line, [Product((twice, y))], [Product((Constant("3"), Product((y, x))))]) == Negative(
        Product((x, y))
    )
    assert fewest(line, [Product((twice, x)), Product((twice, y))]) == Sum(
        (Product((twice, x)), Product((twice, y)))
    )
    assert fewest(line, [twice], [x, x]) == Constant("0")
    assert fewest(line, [same, Constant("1")], [Constant("3")]) == Sum((same, Negative(Constant("2"))))


def test_common_factors_are_drawn_out():
    x, y = Reference("x"), Reference("y")
    line, (a, b) = line_of(a=Product((Constant("3"), x)), b=Product((Constant("3"), y)))
    terms = [
        Product((a, x)),
        Product((a, Product((Constant("2"), x)))),
        Product((b, Product((Constant("3"), y)))),
    ]
    found = fewest(line, terms)
    assert found == Product((Constant("9"), Sum((Product((x, x)), Product((y, y))))))
    assert count([found]).flops == 4
