"""The steps of the recursion against exact elimination, in rational numbers."""

from __future__ import annotations

import random

import pytest
import sympy as sp

from symgen.mechanics.rods.particles import end_mass
from symgen.mechanics.rods.recursion import chain_recursion

DIMENSIONS = (2, 3)


def rational(rng):
    return sp.Rational(rng.randint(-40, 40), rng.randint(1, 9))


def positive_definite(rng, n):
    root = sp.Matrix(n, n, lambda i, j: rational(rng))
    return root * root.T + sp.eye(n)


def upper(matrix):
    return [matrix[i, j] for i in range(matrix.rows) for j in range(i, matrix.cols)]


def result(step, name, values):
    """Evaluate a result of a step, with the entries of every group given."""
    known = {x.symbol: v for g in step.groups for x, v in zip(g.quantities, values[g.name], strict=True)}
    return list(step.expanded(name).xreplace(known))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_a_step_is_exact_elimination(dimension, seed):
    """Schur complement and solution of the rod's own equations, by solving the bordered matrix directly."""
    rng = random.Random(seed)
    recursion = chain_recursion(dimension)
    s = positive_definite(rng, dimension)
    b, d, a_p = (sp.Matrix([rational(rng) for _ in range(dimension)]) for _ in range(3))
    d[0] += 50
    a12, gamma = rational(rng), rational(rng)
    bordered = sp.Matrix(sp.BlockMatrix([[s, d], [d.T, sp.zeros(1)]]))
    coupled = sp.Matrix(sp.BlockMatrix([[a12 * sp.eye(dimension)], [-d.T]]))
    rhs = sp.Matrix([*b, gamma])
    values = {"along": d, "coupling": [a12], "gamma": [gamma], "here": [*upper(s), *b]}
    gathered = -coupled.T * bordered.LUsolve(coupled)
    passed = -coupled.T * bordered.LUsolve(rhs)
    assert result(recursion.step("inward"), "add_inner", values) == [*upper(gathered), *passed]

    factors = result(recursion.step("inward"), "factors", values)
    loss = sp.Mul(*s.diagonal()) / s.det()
    assert factors[-1] == loss and loss >= 1
    solution = bordered.LUsolve(rhs - coupled * a_p)
    values |= {"factors": factors, "inner_motion": a_p}
    outward = recursion.step("outward")
    assert result(outward, "outer_motion", values) == list(solution[:dimension])
    assert result(outward, "multiplier", values) == [solution[dimension]]


@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_the_base_is_held_or_free(dimension):
    rng = random.Random(5)
    recursion = chain_recursion(dimension)
    s = positive_definite(rng, dimension)
    b, a = (sp.Matrix([rational(rng) for _ in range(dimension)]) for _ in range(2))
    here = [*upper(s), *b]
    assert result(recursion.step("free"), "motion", {"here": here}) == list(s.LUsolve(b))
    assert result(recursion.step("pinned"), "reaction", {"here": here, "motion": a}) == list(s * a - b)


@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_gamma_is_minus_the_squared_rate(dimension):
    step = chain_recursion(dimension).step("length")
    rate = [x.symbol for x in step.group("rate").quantities]
    assert sp.expand(step.expanded("gamma")[0] + sum(w**2 for w in rate)) == 0


@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_what_is_left_of_the_exact_solution_is_nothing(dimension):
    """One rod on a free base: its equations as a whole, solved exactly, leave zero in the 'rest' step."""
    rng = random.Random(7)
    recursion, n = chain_recursion(dimension), dimension
    ends = end_mass(*(sp.Rational(x) for x in ("3/2", "4/5", "1/3", "1/7")))
    d = sp.Matrix([rational(rng) + 50 for _ in range(n)])
    f, gamma = sp.Matrix([rational(rng) for _ in range(2 * n)]), rational(rng)
    mass = sp.kronecker_product(sp.Matrix([[ends.a11, ends.a12], [ends.a12, ends.a22]]), sp.eye(n))
    row = sp.Matrix([[*(-d), *d]])
    whole = sp.Matrix(sp.BlockMatrix([[mass, row.T], [row, sp.zeros(1)]]))
    solution = list(whole.LUsolve(sp.Matrix([*f, gamma])))
    inner, outer, lam = solution[:n], solution[n : 2 * n], solution[2 * n]
    values = {"along": d, "coupling": [ends.a12], "gamma": [gamma], "multiplier": [lam]}
    values |= {"inner_motion": inner, "outer_motion": outer}
    rest, unloaded = recursion.step("rest"), recursion.step("unloaded")
    for name, m, a, force in (("inner", ends.a11, inner, f[:n]), ("outer", ends.a22, outer, f[n:])):
        own = result(unloaded, "left", {"mass": [m], "force": force, "motion": a})
        assert [x + y for x, y in zip(own, result(rest, f"add_{name}", values), strict=True)] == [0] * n
    assert result(rest, "length_left", values) == [0]


@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_every_entry_has_unit_and_description(dimension):
    for step in chain_recursion(dimension).steps:
        assert all(x.unit and x.description for x in step.quantities())
        assert step.title and all(m.unit and m.description for m in step.matrices)
