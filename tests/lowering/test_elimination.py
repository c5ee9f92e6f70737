"""The order of elimination, its cost, and sums of like terms."""

from __future__ import annotations

import numpy as np
import pytest

import symgen
from symgen.lowering.like_terms import fewest
from symgen.lowering.nodes import Constant, Negative, Product, Quotient, Reference, Sum, count
from symgen.lowering.straight_line import StraightLine
from symgen.mechanics.rods.elimination import cost


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
