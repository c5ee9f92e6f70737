"""Coefficients of the integrators in 40 digits, as runs in wider types than float64 use them."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from mpmath import fdot, mp, mpf
from shared.full import full
from shared.rooted_trees import density, order, stage_weights, trees
from shared.two_rods import END, POSITIONS, positions, scene

import symgen
from symgen.runtime.integrate.integrators import INTEGRATORS

EXPLICIT = [name for name, m in INTEGRATORS.items() if m.kind == "explicit"]
COMPOSED = ["rattle4", "rattle6", "rattle8"]
DIGITS = 60


def exact(values):
    """Return coefficients with all their digits."""
    return [mpf(int(x.numerator)) / int(x.denominator) for x in map(Fraction, values)]


def explicit(name):
    """Return the number of stages, A, b, c, and for each power of theta the weights of the interpolant."""
    k = INTEGRATORS[name].coefficients
    return (
        k["stages"],
        [exact(row) for row in k["a"]],
        exact(k["b"]),
        exact(k["c"]),
        [exact(column) for column in k["dense"].T],
    )


@pytest.mark.parametrize("name", EXPLICIT)
def test_explicit_methods_satisfy_their_order_conditions(name):
    with mp.workdps(DIGITS):
        stages, a, b, c, _ = explicit(name)
        assert max(abs(sum(row) - at) for row, at in zip(a, c, strict=True)) < mpf("1e-37")
        known = {}
        for tree in [t for n in range(1, INTEGRATORS[name].order + 1) for t in trees(n)]:
            weight = fdot(b, stage_weights(a, tree, known)[:stages])
            assert abs(weight - mpf(1) / density(tree)) < mpf("1e-37"), tree


@pytest.mark.parametrize("name", EXPLICIT)
def test_interpolants_satisfy_the_order_conditions_at_every_theta(name):
    """A cubic through both ends of a step has order 3 for each solution of order 3 or more."""
    with mp.workdps(DIGITS):
        _, a, _, _, dense = explicit(name)
        known = {}
        for tree in [t for n in range(1, INTEGRATORS[name].dense_order) for t in trees(n)]:
            weights = stage_weights(a, tree, known)
            for power, column in enumerate(dense, start=1):
                expected = mpf(1) / density(tree) if power == order(tree) else 0
                assert abs(fdot(column, weights) - expected) < mpf("1e-34"), (tree, power)


@pytest.mark.parametrize(("name", "row", "below"), [("dop853", 0, 5), ("dopri5", 0, 4)])
def test_error_estimates_vanish_up_to_their_order(name, row, below):
    """The estimate of order 3 of dop853 is in doubles."""
    with mp.workdps(DIGITS):
        _, a, _, _, _ = explicit(name)
        weights = exact(INTEGRATORS[name].coefficients["error"][row])
        known = {}
        for tree in [t for n in range(1, below + 1) for t in trees(n)]:
            assert abs(fdot(weights, stage_weights(a, tree, known)[: len(weights)])) < mpf("1e-37"), tree


@pytest.mark.parametrize("name", COMPOSED)
def test_compositions_satisfy_their_order_conditions(name):
    """A symmetric method is exp(h X1 + h^3 X3 + h^5 X5 + ...): in the product of its parts, all words of the
    X up to the order vanish, except powers of X1 (Hairer, Lubich, Wanner, Geometric Numerical Integration,
    III.3)."""
    method = INTEGRATORS[name]
    letters = range(1, method.order, 2)
    with mp.workdps(DIGITS):
        side = exact(method.coefficients["side"])
        parts = [*side, 1 - 2 * sum(side), *reversed(side)]
        for length in range(1, method.order + 1):
            for word in product(letters, repeat=length):
                if sum(word) <= method.order and set(word) != {1}:
                    assert abs(_coefficient(word, parts)) < mpf("1e-38"), word


def _coefficient(word, parts):
    """Return the coefficient of a word in the product of exp(sum of part^k X_k): part by part, the word is
    read from the left, and a part that reads n letters contributes 1 / n! times their powers."""
    read = [mpf(1)] + [mpf(0)] * len(word)
    for part in parts:
        after = list(read)
        for begin in range(len(word)):
            factor = read[begin]
            for end in range(begin + 1, len(word) + 1):
                factor = factor * part ** word[end - 1] / (end - begin)
                after[end] += factor
        read = after
    return read[-1]


@pytest.mark.parametrize(
    ("name", "options", "error"),
    [
        ("dop853", {"rtol": 1e-19}, 1e-15),
        full("dop853", {"rtol": 1e-20}, 2e-16),
        full("dopri5", {"rtol": 1e-18}, 1e-14),
        full("rattle8", {"step": 1 / 2048}, 3e-16),
    ],
)
def test_runs_in_float128_are_correct_to_the_digits_of_doubles(name, options, error):
    """Coefficients in doubles would leave 8e-13, at every tolerance."""
    run = symgen.build(symgen.Scene(**scene()), precision="float128").simulate(END, method=name, **options)
    found = np.concatenate([run.final[p]["position"] for p in "AB"])
    assert np.max(np.abs(found - np.array([float(x) for x in POSITIONS]))) < error


@pytest.mark.full
def test_the_reference_of_two_rods():
    with mp.workdps(40):
        assert max(abs(x - mpf(y)) for x, y in zip(positions(), POSITIONS, strict=True)) < mpf("1e-20")
